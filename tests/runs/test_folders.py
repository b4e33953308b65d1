# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders of runs: each run has its own, also of several that are started at the same time."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from rig_nodes.base import RUN_FILE, RigError
from rig_nodes.runs import run_folder, unless_empty


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_runs_that_are_started_at_the_same_time_have_a_folder_each():
    with ThreadPoolExecutor(8) as together:
        folders = list(together.map(lambda _: run_folder(None, "demo"), range(64)))
    assert sorted(folders) == sorted(Path("runs") / f"demo-{number}" for number in range(1, 65))


def test_a_name_that_is_a_link_to_nothing_is_taken():
    Path("runs").mkdir()
    Path("runs/demo-1").symlink_to("gone")
    assert run_folder(None, "demo") == Path("runs/demo-2")
    for out in ("runs/demo-1", "runs"):
        with pytest.raises(RigError, match="it exists and is not an empty folder"):
            run_folder(out, "demo")


@pytest.mark.parametrize("make", [lambda: Path("runs").write_text(""), lambda: Path("runs").symlink_to("gone")])
def test_where_no_folder_can_be_made_it_is_said(make):
    make()
    with pytest.raises(RigError, match=r"^runs/demo-1: "):
        run_folder(None, "demo")


@pytest.mark.parametrize("left, stays", [((), False), ((RUN_FILE,), False), ((RUN_FILE, "demo_0.mcap"), True)])
def test_what_failed_before_anything_was_recorded_leaves_no_folder(left, stays):
    folder = run_folder("mine", "demo")
    for name in left:
        (folder / name).write_text("x")
    with pytest.raises(RigError), unless_empty(folder):
        raise RigError("it failed")
    assert folder.exists() == stays
