# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orders in a bag: each was accepted by the rig, or the bag has its refusal as an event with the reason, and people a line."""

import math

import pytest
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Log
from rclpy.qos import QoSProfile
from rig_msgs.action import RunSequence
from rig_msgs.msg import Event, RigState, Setpoint, ValveCommand
from running_graph import Client, Graph
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from test_failed_orders import NOT_SO

from rig_nodes.analysis.lost import what_was_lost
from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import facts_of, lost_messages, run_part

pytestmark = pytest.mark.against_the_clock

RPM = math.pi / 30.0
PLAIN = QoSProfile(depth=1)  # as `ros2 topic pub` offers it, without a deadline


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    graph = Graph(tmp_path_factory.mktemp("graph") / "refused")
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def user(graph):
    client = Client(graph.domain)
    client.states, client.refusals = client.listen("/rig/state"), client.listen("/rig/events")
    client.until(lambda: client.states and client.states[-1].state == RigState.READY, "a rig that is ready")
    yield client
    client.close()


def refused(user, text) -> str:
    """Returns the refusal with this text as soon as it has come."""
    return user.until(
        lambda: [e.text for e in user.refusals if e.name == "command_refused" and text in e.text], f"a refusal with '{text}'"
    )[-1]


def test_one_valve_command_without_a_deadline_is_heard_and_refused_with_the_reason(user):
    user.publisher("/controller/command", PLAIN).publish(ValveCommand(sample=1, duty=[0.5, 0.0, 0.0], setpoint=[0.0] * 3))
    text = refused(user, "/controller/command: valve command for sample 1 refused")
    assert "expected one after" in text
    assert "2 nodes send it, and the first answer to a sample counts" in text


def test_a_sequence_that_fails_is_a_line_for_people(graph, user, tmp_path):
    user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name="no_such_sequence")).result()
    sequence = tmp_path / "not_so.yaml"
    sequence.write_text(NOT_SO)
    user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(sequence))).result()
    for line in ("sequence 'no_such_sequence' was ordered: ", "step 2 of 3 failed: "):
        user.until(lambda line=line: any(line in text for text in graph.reports), f"a line with '{line}'")


def test_orders_in_the_safe_state_are_refused_with_its_reason(graph, user):
    assert user.call(Trigger, "/rig/e_stop").success
    user.until(lambda: user.states[-1].state == RigState.TRIPPED, "the safe state")
    why = "/motor/command: refused: the rig is in its safe state (emergency stop); call /rig/reset first"
    publisher = user.publisher("/motor/command")
    for _ in range(50):
        publisher.publish(Setpoint(value=300.0 * RPM, enable=True))
    assert refused(user, "/motor/command") == why
    user.until(lambda: why in graph.reports, "a line for people")
    publisher = user.publisher("/controller/command", PLAIN)

    def asks():
        publisher.publish(ValveCommand(sample=user.states[-1].tick * 5 + 4, gear=1, duty=[0.5, 0.0, 0.0], setpoint=[0.0] * 3))
        return any("does not act: the rig is in its safe state (emergency stop)" in e.text for e in user.refusals)

    user.until(asks, "a valve command that does not act")
    user.node.destroy_publisher(publisher)
    assert user.call(Trigger, "/rig/reset").success
    user.until(lambda: user.states[-1].state == RigState.READY, "a rig that is ready")
    assert graph.reports.count(why) == 1, "one line for them all"


def test_what_cannot_be_stored_is_named_and_the_recording_goes_on(user):
    logs = []
    user.node.create_subscription(Log, "/rosout", logs.append, 100)
    user.publisher("/motor/command").publish(Setpoint(header=Header(stamp=Time(sec=-5)), value=0.0, enable=False))
    cut = user.node.create_publisher(Event, "/sequencer/events", 10)
    user.until(lambda: cut.get_subscription_count() >= 1, "the recorder")
    cut.publish(b"\x00\x01\x00\x00" + bytes(8))  # 12 bytes, while an event has at least 20
    garbled = b"\x00\x01\x00\x00" + bytes(16) + b"\xff\xff\xff\x7f" + bytes(16)  # states a name of two thousand million bytes
    cut.publish(garbled)
    short = user.publisher("/load_pump/command")
    short.publish(b"\x00\x01\x00\x00" + bytes(8))
    assert "12 bytes are no Setpoint" in refused(user, "/load_pump/command")
    seen = len(user.states)
    user.until(lambda: len(user.states) > seen + 100, "half a second more")


def test_all_of_it_stands_in_the_bag(graph, user):
    """Last test of the file: it ends the graph."""
    end = graph.close()
    bag, facts = Bag(graph.folder), facts_of(graph.folder)
    assert bag.check() == [] and lost_messages(bag, facts) == {}
    run = run_part(bag, graph.folder, {}, end)
    assert run["unreadable"] == {"/sequencer/events": 2, "/load_pump/command": 1}
    assert what_was_lost(run) == "3 messages could not be stored: /sequencer/events 2, /load_pump/command 1", "and exit code 3"
    assert run["stamps_ahead"] == {"/motor/command": 1}, "it stands in the bag at the time at which it came"
    assert max(time for time, *_ in bag.timeline()) * 1e-9 == pytest.approx(facts["container"]["time_s"], abs=0.01)
    commands = [message.sample for _, message in bag.messages("/controller/command")]
    assert commands.count(1) >= 1
    texts = [text for *_, name, text, _ in bag.events() if name == "command_refused"]
    for text in ("sample 1 refused", "/motor/command: refused: the rig is in its safe state", "does not act", "12 bytes"):
        assert any(text in stored for stored in texts), text
