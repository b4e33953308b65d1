# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page on Python: each of its tasks runs as it stands there, in at most 15 lines."""

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "python.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the page's code has made when all of it has run, one block after the other in an empty folder."""
    mpl.use("Agg")
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("page"))
        for block in BLOCKS:
            exec(compile(block, str(PAGE), "exec"), found)
        found["files"] = {path.name: path.stat().st_size for path in Path.cwd().iterdir() if path.is_file()}
    return found


def test_no_task_takes_more_than_15_lines():
    assert len(BLOCKS) == 6 and max(len(block.splitlines()) for block in BLOCKS) <= 15


def test_torque_over_slip_is_a_picture(names):
    assert names["files"]["torque_over_slip.png"] > 5000 and names["files"]["shift.png"] > 20_000
    assert names["axes"].get_xlabel() == "s2_slip" and 350 < names["frame"]["s2_slip"].max() < 450


def test_twenty_loads_are_one_table(names):
    up = names["table"]["shift"] == 1
    assert np.allclose(names["table"]["load_up"][up], np.linspace(20, 115, 20)) and names["table"]["valid"].all()
    assert np.all(np.diff(names["table"]["input_torque_max_nm"][up]) > 0.0)
    assert names["files"]["loads.csv"] > 1000


def test_loops_are_columns(names):
    assert list(names["loops"]["load"]) == [40.0, 40.0, 80.0, 80.0]


def test_own_code_drives_the_motor(names):
    assert 100.0 <= names["session"].read("n_wej") < 130.0


def test_a_hundred_branches_begin_in_the_same_state(names):
    assert np.allclose(names["torques"], np.arange(100.0), atol=3.0), names["torques"]
