# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A killed `rig run`: its processes end in order, and the recording says that it was that, not the controller or the sequencer."""

import os
import signal

import pytest
from rig_msgs.msg import RigState
from running_graph import RigRun, Traces

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main

WHY = "the process of rig run, which watches the run, has ended"


@pytest.mark.parametrize(
    "speed",
    [("--speed", "2"), pytest.param((), marks=(pytest.mark.against_the_clock, pytest.mark.campaign))],
    ids=["lockstep", "real time"],
)
def test_no_process_is_left_and_the_last_state_and_the_report_name_the_supervisor(tmp_path, speed, capfd):
    run = RigRun(tmp_path / "run", *speed)
    run.until("shift to II")
    traces = Traces(run)
    assert set(traces.children) == {"container", "alfa46", "sequencer", "recorder"}
    assert traces.shared_memory() == [], "killed processes would leave segments behind"
    os.kill(run.process.pid, signal.SIGKILL)
    traces.wait_gone()
    run.end()
    bag = Bag(run.folder)
    assert bag.check() == []
    *_, (_, last) = bag.messages("/rig/state")
    assert (last.state, last.reason) == (RigState.TRIPPED, WHY)
    assert [text for *_, name, text, _ in bag.events() if name == "rig_tripped"] == [WHY]
    assert main(["bag", "check", str(run.folder)]) == main(["report", str(run.folder)]) == 3
    out, err = capfd.readouterr()
    assert WHY in out + err and "the sequence ended" not in out and "shift controller's process" not in out + err
    assert err.count("the run was cut off at") == 2 and "end: the run was cut off at" in out and "whole" not in out
