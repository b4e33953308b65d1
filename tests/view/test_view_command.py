# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig view` as a user starts it: its output, its refusals, its window."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rerun

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.view import picture, viewer


@pytest.fixture
def no_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)


@pytest.fixture
def no_driver(monkeypatch):
    monkeypatch.setattr(picture, "DRIVER_FOLDERS", ())


def test_without_display_and_driver_the_view_is_still_written(run, no_display, no_driver, capsys):
    assert main(["view", str(run)]) == 0
    captured = capsys.readouterr()
    assert f"{run / 'view.rrd'} written" in captured.out and "rerun view.rrd" in captured.out
    assert f"rerun-sdk=={rerun.__version__}" in captured.out, "another version may not read it"
    assert "mesa-vulkan-drivers" in captured.err
    assert (run / "view.rrd").exists() and not (run / "view.png").exists()


def test_a_picture_asked_for_needs_the_driver(run, no_driver, capsys):
    assert main(["view", str(run), "--picture", str(run / "x.png")]) == 2
    assert "mesa-vulkan-drivers" in capsys.readouterr().err


def test_no_open_only_writes(run, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":77")
    monkeypatch.setattr(viewer, "program", lambda: pytest.fail("a viewer was started"))
    assert main(["view", str(run), "--no-open"]) == 0
    assert main(["view", str(run), "--no-open"]) == 0
    assert capsys.readouterr().out.splitlines() == [f"{run / 'view.rrd'} written", f"{run / 'view.rrd'} is up to date"]


READS = "numba", "llvmlite", "scipy", "importlib.metadata", "matplotlib"
DRAWS = "numba", "llvmlite", "rig_nodes.runs.rig"
WAITS = """
import json, sys
from rig_nodes.cli.main import main
for words, heavy in json.loads(sys.argv[1]):
    code = main(words)
    print("then", code, words, sorted({*heavy} & {*sys.modules}), file=sys.stderr)
"""


def test_who_reads_draws_or_exports_a_run_does_not_wait_for_the_compiler(run, tmp_path):
    """One process for all, those that may load more behind the others."""
    reading = [["view", "--no-open"], ["view", "--no-open", "--shift", "1"], ["report"], ["bag", "check"]]
    drawing = [["report", "--picture", "shift.png"], ["export", "csv", "-o", "run.csv"]]
    calls = [([*words, str(run)], heavy) for verbs, heavy in ((reading, READS), (drawing, DRAWS)) for words in verbs]
    done = subprocess.run(
        [sys.executable, "-c", WAITS, json.dumps(calls)], cwd=tmp_path, capture_output=True, text=True, timeout=100
    )
    said = [line for line in done.stderr.splitlines() if line.startswith("then ")]
    assert said == [f"then 0 {words} []" for words, _ in calls], done.stderr


REFUSED = {
    "nothing": (["--no-open"], "give one of these: the folder of a run, --live, or --layout"),
    "two things": (["{run}", "--live"], "give one of these"),
    "picture of a live view": (["--live", "--picture", "{run}/x.png"], "--picture goes with a run only"),
    "domain of a run": (["{run}", "--domain", "0"], "--domain goes with --live only"),
    "tab without picture": (["{run}", "--tab", "run"], "--tab goes with --picture only"),
    "shift of a live view": (["--live", "--shift", "1"], "--shift goes with a run only"),
    "theme of a layout": (["--layout", "foxglove", "--theme", "light"], "--theme goes with a run or --live only"),
    "no shift": (["{run}", "--shift", "0"], "0 is no shift; give a number from 1, several as 2,5, or all"),
    "no such shift": (["{run}", "--shift", "7", "--no-open"], "--shift 7: the run has the shifts 1 to 1"),
    "no valve response": (
        ["{run}", "--tab", "valve", "--picture", "{run}/x.png"],
        "the run has no tab 'valve'; --tab can be shifts",
    ),
    "out without layout": (["{run}", "--out", "x.xml"], "--out goes with --layout only"),
    "no domain": (["--live", "--domain", "x"], "x is no ROS domain; give a number from 0 to 232"),
    "no port": (["--live", "--domain", "9", "--port", "0"], "0 is no port"),
    "no span": (["--live", "--domain", "9", "--seconds", "0"], "0 is no span of a plot"),
    "no tool": (["--layout", "excel"], "choice 'excel'; "),
    "layout into nowhere": (["--layout", "foxglove", "--out", "{run}/no/x.json"], "there is no folder"),
    "no such run": (["nowhere"], "nowhere: there is no such file or folder"),
    "one number": (["{run}", "--window", "3"], "3 is no window; write its start and end in s"),
    "backwards": (["{run}", "--window", "5,3"], "5,3 is no window"),
    "not finite": (["{run}", "--window", "0,inf"], "0,inf is no window"),
    "outside": (["{run}", "--window", "50,60"], "lies outside the run, which goes from 0.00 s"),
    "not a png": (["{run}", "--picture", "{run}/x.jpg"], "a file that ends in .png"),
    "no folder": (["{run}", "--picture", "{run}/not/x.png"], "there is no folder"),
}


@pytest.mark.parametrize("arguments, sentence", REFUSED.values(), ids=REFUSED)
def test_refusals_are_one_sentence(run, arguments, sentence, capsys):
    assert main(["view", *(a.format(run=run) for a in arguments)]) == 2
    error = capsys.readouterr().err
    assert sentence in error and len(error.splitlines()) == 1


@pytest.mark.parametrize("options", [[], ["--picture", "{run}/x.png"], ["--picture", "{run}/x.png", "--tab", "run"]])
def test_without_rerun_one_sentence(run, monkeypatch, capsys, options):
    monkeypatch.setitem(sys.modules, "rerun", None)
    for module in ("rerun.blueprint", "rerun.chunk"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    assert main(["view", str(run), *(a.format(run=run) for a in options)]) == 2
    error = capsys.readouterr().err
    assert (
        error.startswith("rig: the Python package rerun is not installed; pip install 'rig_nodes[view]'")
        and len(error.splitlines()) == 1
    )


def test_a_folder_that_cannot_be_written_is_named(run, monkeypatch, capsys):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    assert main(["view", str(run), "--no-open"]) == 2
    assert "view.rrd: cannot be written (Permission denied)" in capsys.readouterr().err


def test_a_viewer_that_cannot_open_a_window_is_quoted(run, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("DISPLAY", ":77")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(viewer, "START", 20.0)
    assert main(["view", str(run)]) == 2
    error = capsys.readouterr().err
    assert "the viewer ended at once" in error and "--picture" in error and len(error.splitlines()) == 1


def test_the_window_outlives_the_command_and_listens_on_loopback_only(tmp_path, monkeypatch):
    notes = tmp_path / "notes"
    program = tmp_path / "viewer"
    program.write_text(f'#!/bin/sh\n{{ echo "$@"; cat "$XDG_CONFIG_HOME/rerun/analytics.json"; }} > {notes}\nexec sleep 60\n')
    program.chmod(0o755)
    monkeypatch.setattr(viewer, "program", lambda: str(program))
    monkeypatch.setattr(viewer, "START", 1.0)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    process = viewer.open_window(Path("view.rrd"))
    try:
        assert os.getsid(process) == process, "it would end with the terminal"
        arguments, settings = notes.read_text().splitlines()
        assert arguments == "--bind 127.0.0.1 --port auto view.rrd"
        assert '"analytics_enabled": false' in settings
    finally:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)


def test_a_window_opens_in_the_theme_that_was_asked_for(tmp_path, monkeypatch):
    program = tmp_path / "viewer"
    program.write_text(f'#!/bin/sh\ncat "$XDG_DATA_HOME/rerun/app.ron" > {tmp_path / "notes"}\nexit 3\n')
    program.chmod(0o755)
    monkeypatch.setattr(viewer, "program", lambda: str(program))
    monkeypatch.setattr(viewer, "START", 20.0)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(RigError, match="ended at once"):
        viewer.open_window(Path("view.rrd"), "light")
    assert "theme_preference:Light" in (tmp_path / "notes").read_text()


def test_the_viewers_program_is_not_the_script_that_leaves_it_behind():
    assert Path(viewer.program()).read_bytes()[:4] == b"\x7fELF"


def test_a_viewer_that_does_not_answer_is_ended_in_time(run, monkeypatch, tmp_path):
    mute = tmp_path / "viewer"
    mute.write_text(f"#!/bin/sh\necho $$ > {tmp_path / 'pid'}\nexec sleep 60\n")
    mute.chmod(0o755)
    (tmp_path / "lvp_icd.json").write_text("{}")
    monkeypatch.setattr(picture, "DRIVER_FOLDERS", (str(tmp_path),))
    monkeypatch.setattr(viewer, "program", lambda: str(mute))
    with pytest.raises(RigError, match="did not finish within 1 s"):
        picture.take_picture(run / "view.rrd", tmp_path / "x.png", longest=1.0)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
