# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig run` as a user starts it, and the remains after the end of it or of one of its processes."""

import json
import os
import signal

import pytest
from running_graph import SHORT, RigRun, Traces

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate

REAL_TIME = pytest.mark.against_the_clock

STARTED = "starting the nodes"
CONNECTED = "all nodes are connected"
IN_GEAR = "motor speed 600 rpm"
SHIFTING = "shift to II"


def report_of(run) -> dict:
    return json.loads((run.folder / "report.json").read_text())


@REAL_TIME
def test_a_run_ends_well(tmp_path):
    run = RigRun(tmp_path / "run")
    code, output = run.end()
    assert code == 0, output
    assert output.splitlines()[0] == "controller alfa46 sends shares of the supply: level duty, as the controller declares"
    part = report_of(run)["run"]
    assert part["lost"] == 0 and part["behind"]["times"] == 0
    bag = Bag(run.folder)
    assert bag.gaps() == {}
    assert part["end"] == {"state": "ended", "reason": "the sequence ended"}
    assert 3.0 < part["duration_s"] < 10.0
    assert part["ticks"] == pytest.approx(part["duration_s"] / 0.005) and part["overruns"] < 0.1 * part["ticks"]
    assert 0.0 <= part["lateness_ms"]["p50"] <= part["lateness_ms"]["p99"] <= part["lateness_ms"]["max"]
    assert [row["to_gear"] for row in report_of(run)["shifts"]] == [2]
    steps = [text for _, topic, name, text, _ in bag.events() if topic == "/sequencer/events" and name == "step"]
    assert len(steps) == 8 and all(text in output for text in steps)
    assert bag.run_info()["sequence"] == "short"
    assert {path.name for path in run.folder.iterdir()} == {"short_0.mcap", "metadata.yaml", "report.json", "run.json", "logs"}
    recorder = json.loads((run.folder / "logs" / "recorder.json").read_text())
    assert recorder["publishers_at_end"] == 0, "it has seen all of them leave and waited for none"


@REAL_TIME
def test_a_killed_controller_brings_the_safe_state_within_100_ms(tmp_path):
    run = RigRun(tmp_path / "run")
    run.until(SHIFTING)
    traces = Traces(run)
    os.kill(traces.children["alfa46"], signal.SIGKILL)
    code, output = run.end()
    assert code == 1
    reason = report_of(run)["run"]["end"]["reason"]
    assert "alfa46 killed by signal 9" in reason
    assert reason in output.splitlines()[-1]
    bag = Bag(run.folder)
    last_command = [message.sample for _, message in bag.messages("/controller/command")][-1] * 1e-3
    tripped = [t for t, _, name, *_ in bag.events() if name == "rig_tripped"]
    assert len(tripped) == 1 and tripped[0] - last_command < 0.105
    _, state = list(bag.messages("/rig/state"))[-1]
    assert state.state == 3 and "alfa46 killed by signal 9" in state.reason
    t, current = bag.series("I_zr_p2")
    assert current[t > tripped[0] + 0.15].max() < 0.02, "the coils are without current"
    traces.wait_gone()


@REAL_TIME
@pytest.mark.parametrize(
    "name",
    [
        "container",
        pytest.param("recorder", marks=pytest.mark.campaign),  # test_restart.py kills a recorder too
    ],
)
def test_another_killed_process_ends_the_run_with_its_name(tmp_path, name):
    run = RigRun(tmp_path / "run")
    run.until(IN_GEAR)
    traces = Traces(run)
    os.kill(traces.children[name], signal.SIGKILL)
    code, output = run.end()
    assert code == 1 and f"{name} killed by signal 9" in output.splitlines()[-1]
    assert f"{name} killed" in report_of(run)["run"]["end"]["reason"]
    bag = Bag(run.folder, recover=True)
    assert bag.counts["/instruments/controller"] > 500
    traces.wait_gone()


@pytest.mark.parametrize("moment", [STARTED, pytest.param(SHIFTING, marks=(REAL_TIME, pytest.mark.campaign))])
def test_ctrl_c_at_any_time_leaves_a_readable_bag_and_no_process(tmp_path, moment):
    """The run uses a ROS domain that the user chooses. SIGTERM is tested at a moment between these two."""
    with allocate() as domain:
        run = RigRun(tmp_path / "run", env={"ROS_DOMAIN_ID": str(domain.number)})
        run.until(moment)
        traces = Traces(run)
        run.ctrl_c()
        code, output = run.end()
    assert f"ROS_DOMAIN_ID={domain.number}" in output
    assert code == 130 and "Traceback" not in output
    assert output.splitlines()[-1] == "rig: interrupted by Ctrl-C"
    assert report_of(run)["run"]["end"] == {"state": "interrupted", "reason": "interrupted by Ctrl-C"}
    bag = Bag(run.folder)
    assert bag.check() == [] and (run.folder / "metadata.yaml").exists()
    if moment == SHIFTING:
        assert report_of(run)["run"]["lost"] == 0
        assert "rig_tripped" in [name for _, topic, name, *_ in bag.events() if topic == "/rig/events"]
    traces.wait_gone()


@REAL_TIME
def test_sigterm_ends_in_order_too(tmp_path):
    run = RigRun(tmp_path / "run")
    run.until(CONNECTED)
    traces = Traces(run)
    run.process.terminate()
    code, output = run.end()
    assert code == 143 and Bag(run.folder).check() == []
    assert output.splitlines()[-1] == "rig: ended by SIGTERM" and "Traceback" not in output
    traces.wait_gone()


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["--out-there"], "there is no option '--out-there'"),
        (["--set", "alfa46.t12=1 bar"], "t12"),
        (["--drop", "/motor/m_wej"], "expected a topic"),
    ],
)
def test_wrong_arguments_start_nothing(tmp_path, arguments, sentence, capsys):
    assert main(["run", str(SHORT), "--out", str(tmp_path / "run"), *arguments]) == 2
    error = capsys.readouterr().err
    assert sentence in error and len(error.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_folder_with_something_in_it_is_not_touched(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["run", str(SHORT), "--out", str(tmp_path)]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_an_unknown_sequence_is_refused(tmp_path, capsys):
    assert main(["run", "dmeo", "--out", str(tmp_path / "run")]) == 2
    assert "demo" in capsys.readouterr().err and not (tmp_path / "run").exists()
