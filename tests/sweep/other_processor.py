# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small sweep for test_other_processor.py, in a process whose compiler and libraries are set to a simpler processor.

Argument: folder. The settings stand in the environment.
"""

import sys
from pathlib import Path

from rig_nodes.runs.workers import Workers
from rig_nodes.studies.sweep.plan import Plan, make_plan
from rig_nodes.studies.sweep.run import manifest_of, run_sweep
from rig_nodes.studies.sweep.store import Store


def main() -> None:
    plan = make_plan(
        Plan("demo", "hydmag", method="list"),
        {"alfa46.t12": "-300 ms, -220 ms, 0 ms", "oil_supply.temperature": "40 degC, 20 degC, 60 degC"},
    )
    with Store(Path(sys.argv[1]), manifest_of(plan, False)) as store, Workers(1) as workers:
        run_sweep(plan, store, workers.stream)
        store.write_results(plan)


if __name__ == "__main__":
    main()
