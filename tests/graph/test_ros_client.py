# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The example of a ROS 2 node of one's own: it works the rig by hand up to a shift under load."""

import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from running_graph import Graph

from rig_nodes.api import Run

EXAMPLE = Path(__file__).parents[2] / "docs/examples/ros/first_shift.py"


@pytest.mark.against_the_clock
def test_the_example_shifts_under_load(tmp_path):
    with closing(Graph(tmp_path / "graph")) as graph:
        done = subprocess.run(
            [sys.executable, str(EXAMPLE)],
            env=os.environ | {"ROS_DOMAIN_ID": str(graph.domain.number)},
            capture_output=True,
            text=True,
            timeout=120,
        )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("gear II after 1.4") and "fill, slip" in done.stderr
    (shift,) = Run(tmp_path / "graph").shifts
    assert 50.0 < shift["output_torque_nm"] < 120.0 and shift["valid"]
