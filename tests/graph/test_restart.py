# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig that is operated by hand survives the end of its processes: safe state, the reason, a new process, a complete bag."""

import signal
import time
from pathlib import Path

import pytest
from rclpy.action import ActionClient
from rig_msgs.action import RunSequence, Shift
from running_graph import PATIENCE, SHORT, Client, Graph
from std_srvs.srv import Trigger

import rig_nodes.controllers
from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import join_pieces, run_part
from rig_nodes.rig.transmission import NEUTRAL

C_BOX = Path(rig_nodes.controllers.__file__).parent / "examples" / "alfa46.c"
TRIPPED = 3


def seconds(stamp) -> float:
    return stamp.sec + stamp.nanosec * 1e-9


def shifting(user, commands) -> None:
    """Runs the short sequence up to its shift.

    The killed sequencer is still listed for 20 s, and a sequence that has just failed may not have ended yet. Therefore the
    order is repeated until it is executed.
    """
    client = ActionClient(user.node, RunSequence, "/sequencer/run")
    user.until(client.server_is_ready, "a sequencer")
    asked = []

    def obeyed():
        if not asked or time.monotonic() - asked[-1][1] > 0.5:
            asked.append((client.send_goal_async(RunSequence.Goal(name=str(SHORT))), time.monotonic()))
        return commands and commands[-1].shifting

    user.until(obeyed, "a shift that runs")


@pytest.mark.against_the_clock
@pytest.mark.parametrize(
    "victims, controller",
    [(("alfa46", "sequencer"), f"c:{C_BOX}"), (("recorder",), None)],
    ids=["alfa46 with its library and sequencer", "recorder"],
)
def test_a_killed_process_is_started_again(tmp_path, victims, controller):
    graph = Graph(tmp_path / "run", controller=controller)
    user = Client(graph.domain)
    trips = []
    try:
        states, commands = user.listen("/rig/state"), user.listen("/controller/command", depth=1)
        newest = user.listen("/rig/state", depth=1)  # depth 1, because with a queue a slow client would receive an old state first
        for victim in victims:
            shifting(user, commands)
            others = {name: child.pid for name, child in graph.supervisor.children.items() if name != victim}
            seen, fresh = len(states), len(newest)
            user.until(lambda: len(newest) > fresh + 1, "the newest state")
            before = seconds(newest[-1].header.stamp)
            graph.supervisor.children[victim].signal(signal.SIGKILL)
            tripped = user.until(lambda: next((s for s in states[seen:] if s.state == TRIPPED), None), "the safe state")
            assert seconds(tripped.header.stamp) - before < 0.1 + 0.05, "50 ms to see a state and send the signal"
            assert tripped.reason == f"{victim} killed by signal 9 (SIGKILL)"
            trips.append(tripped)

            user.until(lambda: graph.supervisor.children[victim].life == 2, "its second life")
            del commands[:]
            works_again(user, states, commands)
            assert {name: child.pid for name, child in graph.supervisor.children.items() if name != victim} == others
            assert not any(child.ended() for child in graph.supervisor.children.values())
            user.until(lambda: not commands[-1].shifting, "the end of the shift")
        if "recorder" in victims:
            second = graph.folder / "run_1.mcap"
            user.until(lambda: second.exists() and second.stat().st_size > 50_000, "a second piece of the bag")
    finally:
        user.close()
        end = graph.close()
    assert end.state == "interrupted", "stopped by the test and by nothing else"
    join_pieces(graph.folder)
    bag = Bag(graph.folder)
    part = run_part(bag, graph.folder, {}, end, graph.supervisor.restarts)
    assert [(r["process"], r["how"]) for r in part["restarts"]] == [(victim, "killed by signal 9 (SIGKILL)") for victim in victims]
    if "recorder" in victims:
        at, times = seconds(trips[0].header.stamp), bag.series("n_wej")[0]
        assert at - times[times < at].max() < 0.2, "what a killed recorder had not written"
        assert part["lost"] > 0 and bag.gaps(), "what nobody recorded is counted"
    else:
        assert part["lost"] == 0 and bag.check() == []
        events = [(name, text) for _, _, name, text, _ in bag.events()]
        for tripped in trips:
            assert ("rig_tripped", tripped.reason) in events
            assert ("process_restarted", f"{tripped.reason} and was started again") in events


def works_again(user, states, commands) -> None:
    """Resets the rig; a gear is engaged as before."""
    user.until(lambda: commands, "commands")
    assert user.call(Trigger, "/rig/reset").success
    user.until(lambda: states[-1].state != TRIPPED, "the reset")
    user.until(lambda: not commands[-1].shifting, "the end of the shift that was running")
    if commands[-1].gear != NEUTRAL:
        assert user.order(Shift, "/controller/shift", Shift.Goal(gear=NEUTRAL)).result().success
    shifting(user, commands)


def test_a_process_that_keeps_dying_ends_the_run(tmp_path):
    graph = Graph(tmp_path / "run")
    try:
        for life in (1, 2, 3, 4):
            assert graph.supervisor.children["sequencer"].life == life
            killed = graph.supervisor.children["sequencer"]
            killed.signal(signal.SIGKILL)
            deadline = time.monotonic() + 20.0
            while graph.supervisor.children["sequencer"] is killed and not graph.supervisor.ended.wait(0.02):
                assert time.monotonic() < deadline
    finally:
        end = graph.close()
    assert end.state == "failed" and "sequencer killed by signal 9" in end.reason
    assert (graph.folder / "logs" / "sequencer-4.log").exists()


def test_a_process_that_cannot_be_started_again_ends_the_rig_with_both_reasons(tmp_path):
    graph = Graph(tmp_path / "run")
    (graph.folder / "logs").rename(tmp_path / "others")
    graph.supervisor.children["sequencer"].signal(signal.SIGKILL)
    assert graph.supervisor.ended.wait(PATIENCE)
    end = graph.close()
    assert end.state == "failed"
    assert end.reason.startswith("sequencer killed by signal 9 (SIGKILL) and cannot be started again: ")
    assert "logs/sequencer-2.log cannot be written (No such file or directory)" in end.reason
    assert Bag(graph.folder).end["reason"].startswith("sequencer killed by signal 9")
