# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign of hundreds of runs for test_procedures.py to interrupt: interrupted_campaign.py PROCEDURE."""

import sys

from rig_nodes.runs.campaign import run_campaign
from rig_nodes.runs.procedure import load_procedure
from rig_nodes.runs.workers import Workers

SHOWN = []


def rows(_series, run):
    """Returns the measured value of a run."""
    return run.recording.rows


def show(_done, _of):
    """Prints once that runs come back."""
    if not SHOWN:
        SHOWN.append(True)
        print("running", flush=True)


if __name__ == "__main__":
    from interrupted_campaign import rows  # the processes find functions of modules

    try:
        with Workers(2) as workers:
            run_campaign(load_procedure(sys.argv[1], "hydmag").series() * 500, rows, workers=workers, progress=show)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
        sys.exit(130)
