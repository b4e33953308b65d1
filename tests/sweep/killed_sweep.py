# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sweep in a process of its own for test_resume.py: it prints its progress line by line, so that the test can wait for it.

Arguments: folder, number of processes, and "many" for two thousand members. Lines: "processes PID ...", then
"finished N" for each member.
"""

import sys
from pathlib import Path

from rig_nodes.runs.workers import Workers
from rig_nodes.studies.sweep.plan import Plan, make_plan
from rig_nodes.studies.sweep.run import manifest_of, run_sweep
from rig_nodes.studies.sweep.store import Store

HERE = Path(__file__).resolve().parent


def plan():
    """Twenty-two short members: eleven rests, each twice."""
    return make_plan(Plan(str(HERE / "short.yaml"), "hydmag", repeats=2), {"rest": "20 ms .. 130 ms in 11"})


def many():
    """Two thousand members, all different."""
    return make_plan(
        Plan(str(HERE / "short.yaml"), "hydmag", samples=2000),
        {"alfa46.t12": "-300 ms .. 100 ms", "oil_supply.temperature": "20 degC .. 70 degC", "rest": "20 ms .. 130 ms"},
    )


def main() -> None:
    folder, jobs = Path(sys.argv[1]), int(sys.argv[2])
    chosen = many() if "many" in sys.argv[3:] else plan()
    with Store(folder, manifest_of(chosen, False)) as store, Workers(jobs) as workers:
        print("processes", *workers.pids(), flush=True)
        run_sweep(chosen, store, workers.stream, lambda done, entry: print("finished", entry["member"], flush=True))
        store.write_results(chosen)
    print("whole", flush=True)


if __name__ == "__main__":
    main()
