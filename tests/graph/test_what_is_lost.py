# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run that lost messages or time reports it in its last line and ends with exit code 3; a full disk is reported in a sentence."""

import contextlib
import gc
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Clock as ClockMessage
from running_graph import BRIEF, PATIENCE, SHORT, Client, Graph, RigRun, Traces, rig_run

from rig_nodes.analysis.lost import what_was_lost
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.run_arguments import exit_code
from rig_nodes.nodes import realtime
from rig_nodes.nodes.processes.result import facts_of, run_part


def part_of(folder) -> dict:
    return json.loads((folder / "report.json").read_text())["run"]


def stop_for(pid: int, seconds: float) -> None:
    """Stops a process by SIGSTOP, as a debugger or a paused container does."""
    os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)  # the length of the stop is the condition of the tests
    with contextlib.suppress(ProcessLookupError):  # the supervisor has continued and ended it
        os.kill(pid, signal.SIGCONT)


DYING = """
import sys, threading
from rig_nodes.nodes.process import run


def main(start):
    process = start("recorder", "a process of which a thread dies")
    writer = threading.Thread(target=lambda: [].pop(), name="writer")
    writer.start()
    writer.join()
    assert process.stopping


sys.argv[1:] = []
sys.exit(run(main))
"""


def test_a_thread_that_dies_is_a_process_that_dies_and_names_it():
    done = subprocess.run([sys.executable, "-P", "-c", DYING], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1, done.stderr
    assert done.stderr.splitlines()[-1] == "its thread 'writer' died of IndexError: pop from empty list"


@pytest.mark.parametrize("allowed, code, word", [([], 3, "not whole"), (["--allow-loss"], 0, "warning")])
def test_a_lost_message_is_named_in_the_last_line(tmp_path, allowed, code, word):
    ended, output = rig_run(tmp_path / "run", "--speed", "max", "--drop", "/motor/m_wej:20", *allowed, sequence=BRIEF)
    assert ended == code, output
    assert Bag(tmp_path / "run").end == {"state": "ended", "reason": "the sequence ended"}
    assert output.splitlines()[-1] == f"rig: {word}: 1 messages did not reach the bag: /motor/m_wej 1"
    assert part_of(tmp_path / "run")["lost_by_topic"] == {"/motor/m_wej": 1}


def check_tripped(run, reason):
    """The run ended by the trip of what stood still, with a bag that says so too."""
    code, output = run.end()
    end = part_of(run.folder)["end"]
    assert code == 1, output
    assert (end["state"], end["trip"]) == ("tripped", "stood_still") and reason in end["reason"], end
    assert Bag(run.folder).end == end
    return output


@pytest.mark.against_the_clock
@pytest.mark.parametrize("process", ["recorder", pytest.param("sequencer", marks=pytest.mark.campaign)])
def test_a_process_that_stands_still_trips_the_rig_within_a_second_or_so(tmp_path, process):
    run = RigRun(tmp_path / "run")
    run.until("shift to I")
    pid = Traces(run).children[process]
    os.kill(pid, signal.SIGSTOP)
    run.until("the rig is tripped")
    os.kill(pid, signal.SIGCONT)
    check_tripped(run, f"the {process} stands still for 1.")


@pytest.mark.against_the_clock
def test_a_rig_that_stood_still_trips(tmp_path):
    run = RigRun(tmp_path / "run")
    run.until("shift to I")
    stop_for(Traces(run).children["container"], 1.5)
    assert "the container stands still for 1." in check_tripped(run, "the rig stood still for 1.")


@pytest.mark.against_the_clock
def test_a_rig_that_stood_still_for_a_moment_has_lost_time_and_the_run_says_so(tmp_path):
    run = RigRun(tmp_path / "run", sequence=BRIEF)
    run.until("shift to I")
    stop_for(Traces(run).children["container"], 0.4)
    code, output = run.end()
    behind = part_of(run.folder)["behind"]
    assert code == 3, output
    assert behind["times"] >= 1 and behind["limit_s"] == 0.1 and 0.3 < behind["longest_s"] < 3.0
    assert "the rig fell behind real time by more than 100 ms" in output.splitlines()[-1]
    # while the rig catches up, the recorder may fall behind too; the messages lost by this are counted by topic
    assert part_of(run.folder)["lost"] == sum(part_of(run.folder).get("lost_by_topic", {}).values())


@pytest.mark.parametrize(
    ("process", "order", "reason"),
    [
        pytest.param("container", {}, "still for ", marks=pytest.mark.against_the_clock),
        ("recorder", {"speed": 1.0}, "the recorder stands still for "),
    ],
    ids=["real time", "lockstep"],
)
def test_a_rig_that_would_wait_for_ever_ends_with_a_bag_that_is_whole(tmp_path, monkeypatch, process, order, reason):
    graph = Graph(tmp_path / "run", **order)
    monkeypatch.setattr("rig_nodes.nodes.processes.supervisor.FOR_GOOD", 2.0)
    graph.supervisor.children[process].signal(signal.SIGSTOP)
    assert graph.supervisor.ended.wait(PATIENCE)
    end = graph.close()
    assert (end.state, end.trip) == ("tripped", "stood_still") and reason in end.reason, end
    assert float(re.search(r"still for (\d+\.\d+) s", end.reason)[1]) > 1.8  # the rig's own clock begins later
    assert Bag(graph.folder).end == end.plain()
    assert not any("was killed" in text for text in graph.reports), graph.reports
    assert exit_code(end.state, {"run": {}}, False) == 1


def test_a_machine_that_was_suspended_trips_the_rig_and_what_it_missed_is_not_caught_up(monkeypatch):
    """Only the clock of the time since boot goes on meanwhile."""
    asleep, steps, stood, real = [], [], [], time.clock_gettime_ns
    for module, name in ((gc, "freeze"), (sys, "setswitchinterval"), (realtime, "prefer")):
        monkeypatch.setattr(module, name, lambda *_: None)
    monkeypatch.setattr(time, "clock_gettime_ns", lambda clock: real(clock) + sum(asleep))

    def step():
        steps.append(time.monotonic())
        if len(steps) == 20:
            asleep.append(3600_000_000_000)

    clock = realtime.RealTime(1_000_000, 5)
    clock.run(step, lambda: len(steps) >= 40, stood.append)
    assert len(steps) == 40 and stood == [pytest.approx(3600.0, abs=2.0)]
    assert clock.summary()["behind"]["longest_s"] < 10.0, "no hour to catch up"


def of_rig(messages):
    """The statuses of the rig as a whole in messages of /diagnostics, which other nodes send too."""
    return [status for message in messages for status in message.status if status.name == "rig"]


def test_a_second_clock_is_named_within_a_second_and_the_run_is_marked(tmp_path):
    """One that stands still or jumps moves nothing of the rig, whose own nodes have its time from the rig.

    The container is killed in the end, which takes its own record of the clocks with it.
    """
    graph = Graph(tmp_path / "run", speed=1.0)
    user = Client(graph.domain)
    try:
        states, health = user.listen("/rig/state"), []
        user.node.create_subscription(DiagnosticArray, "/diagnostics", health.append, 100)
        user.until(lambda: len(states) > 100, "half a second")
        clock = user.node.create_publisher(ClockMessage, "/clock", 10)
        began = time.monotonic()
        user.until(lambda: any("/clock is sent by user too" in text for text in graph.reports), "the sentence", 5.0)
        assert time.monotonic() - began < 1.5, "and what DDS needs to know the sender"

        def told() -> bool:
            clock.publish(ClockMessage(clock=Time(sec=5000)))
            return any("/clock jumps back by up to 499" in text for text in graph.reports)

        user.until(told, "by how much the times differ", 5.0)
        namesake = rclpy.create_node("rig", context=user.context, start_parameter_services=False)
        namesake.create_publisher(ClockMessage, "/clock", 10)
        user.until(lambda: any("/clock is sent by another rig too" in text for text in graph.reports), "the node of this name", 5.0)
        seen = len(states)
        user.until(lambda: len(states) > seen + 100, "half a second more")
        stamps = [state.header.stamp.sec + state.header.stamp.nanosec * 1e-9 for state in states]
        assert np.diff(stamps) == pytest.approx(0.005) and states[-1].reason == ""
        namesake.destroy_node()
        user.node.destroy_publisher(clock)
        health.clear()
        user.until(lambda: len(of_rig(health)) >= 2, "diagnostics without the second clock")
        rig = of_rig(health)[-1]
        assert rig.level == DiagnosticStatus.WARN and rig.message.endswith(", but /clock was sent by user, another rig too")
        assert {pair.key: pair.value for pair in rig.values}["other_clocks"] == "user, another rig"
        graph.supervisor.children["container"].signal(signal.SIGKILL)
        assert graph.supervisor.ended.wait(PATIENCE)
    finally:
        user.close()
        graph.close()
    assert "container" not in facts_of(graph.folder)
    run = run_part(Bag(graph.folder), graph.folder, {}, graph.supervisor.end)
    of_user, jumps, of_namesake = run["other_clocks"]
    assert of_user == "/clock is sent by user too: nodes with use_sim_time see two times"
    assert of_namesake == of_user.replace("user", "another rig")
    lost = what_was_lost(run)
    assert jumps in lost and exit_code("ended", {"run": run, "shifts": []}, False, lost) == 3


def test_a_bag_that_was_cut_meanwhile_ends_the_run_and_is_said_to_be_damaged(tmp_path):
    run = RigRun(tmp_path / "run", "--speed", "1", sequence=BRIEF)
    run.until("wait 200 ms")
    os.truncate(run.folder / "brief_0.mcap", 100_000)
    code, output = run.end()
    assert code == 1 and part_of(run.folder)["recovered"]
    assert "was cut from outside to 100000 bytes" in output.splitlines()[-1] and "Traceback" not in output


@pytest.fixture
def nearly_full(small_disk):
    """A folder on a disk of its own with half a MB left, which is too little for a run of three seconds."""
    with small_disk(1024) as disk:
        (disk / "others").write_bytes(os.urandom(500_000))
        yield disk


def test_a_full_disk_is_named_and_what_is_in_the_bag_stays_readable(nearly_full):
    folder = nearly_full / "run"
    code, output = rig_run(folder, "--speed", "max")
    assert code == 1 and "Traceback" not in output and "JSONDecodeError" not in output, output
    [said] = [line for line in output.splitlines() if line.startswith("rig: ")]
    assert said.startswith(f"rig: recorder: {folder / 'short_0.mcap'} was ended in order at ") and "before the disk is full" in said
    bag = Bag(folder)
    assert bag.counts["/instruments/controller"] > 100
    for path in (folder / "logs").glob("*.json"):
        json.loads(path.read_text())  # each file is complete, or it does not exist


def test_a_full_disk_ends_simulate_with_a_sentence(nearly_full, rig_command):
    done = rig_command("simulate", str(SHORT), "--out", str(nearly_full / "run"))
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert done.stderr.startswith(f"rig: {nearly_full / 'run' / 'short_0.mcap'} was ended in order at ")
    bag = Bag(nearly_full / "run")
    assert bag.counts["/instruments/controller"] > 100
    printed = float(re.search(r"in order at ([\d.]+) s, before the disk is full", done.stderr)[1])
    assert max(time for topic in bag.counts for time, _ in bag.messages(topic)) / 1e9 == pytest.approx(printed, abs=2e-3)


def test_a_folder_that_is_made_read_only_ends_the_run_in_order(tmp_path, read_only):
    run = RigRun(tmp_path / "run", "--speed", "1")
    run.until("shift to I")
    read_only(run.folder)
    code, output = run.end()
    last = output.splitlines()[-1]
    assert code == 1 and "Traceback" not in output
    assert "it or its disk was made read-only; short_0.mcap was ended in order" in last, output
    assert Bag(run.folder).end["state"] == "failed"
