# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The running graph, tested from a process of the user."""

import itertools
import math

import pytest
from rcl_interfaces.msg import Log
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rig_msgs.action import RunSequence, Shift
from rig_msgs.msg import RigState, Setpoint, ValveCommand
from running_graph import SHORT, Client, Graph
from std_srvs.srv import Trigger

from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import facts_of, lost_messages
from rig_nodes.rig.configuration import load_rig

CATALOGUE = load_rig("hydmag").catalogue

pytestmark = pytest.mark.against_the_clock

RPM = math.pi / 30.0


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    graph = Graph(tmp_path_factory.mktemp("graph") / "live")
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def client(graph):
    client = Client(graph.domain)
    yield client
    client.close()


@pytest.fixture
def user(client):
    yield client
    client.forget()


@pytest.fixture
def still(user):
    """After each test the motor is off, and the rig was never tripped."""
    states = user.listen("/rig/state")
    yield
    publisher = user.publisher("/motor/command")

    def ready() -> bool:
        publisher.publish(Setpoint(value=0.0, enable=False))
        return states and states[-1].state == RigState.READY

    user.until(ready, "a rig that is ready")
    assert RigState.TRIPPED not in {state.state for state in states}


def logs(user) -> list:
    """Returns a list that grows with the messages of /rosout, including earlier ones."""
    messages = []
    profile = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    user.node.create_subscription(Log, "/rosout", messages.append, profile)
    return messages


def test_every_node_and_topic_is_seen(user):
    nodes = {topic.node for topic in CATALOGUE.topics.values()} | {"recorder"}
    user.until(lambda: nodes <= set(user.node.get_node_names()), f"the nodes {nodes}")
    # endpoints are discovered one after the other
    for topic in CATALOGUE.topics.values():

        def offered(name=topic.name) -> list[str]:
            return [info.node_name for info in user.node.get_publishers_info_by_topic(name)]

        user.until(lambda expected=[topic.node], offered=offered: offered() == expected, f"{topic.name} of {topic.node}")
        assert dict(user.node.get_topic_names_and_types())[topic.name] == [topic.ros_type]
    of_other_runs = set(CATALOGUE.all_topics) - set(CATALOGUE.topics)
    assert not of_other_runs & set(dict(user.node.get_topic_names_and_types()))


def test_torque_is_read_without_gaps_and_in_time(user):
    torque = user.listen("/motor/m_wej")
    user.until(lambda: len(torque) >= 50, "50 readings")
    seqs = [message.seq for message in torque]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    stamps = [message.header.stamp.sec + message.header.stamp.nanosec * 1e-9 for message in torque]
    assert all(abs(b - a - 0.01) < 1e-9 for a, b in itertools.pairwise(stamps))


def test_a_sequence_is_run_by_action(user, still):
    messages = logs(user)
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(SHORT)))
    user.until(lambda: goal.feedback, "feedback of the sequence")
    again = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(SHORT))).result()
    assert not again.success and "still running" in again.message
    result = goal.result()
    assert result.success and result.steps_done == 8
    assert "shift to II" in {feedback.text for feedback in goal.feedback}
    user.until(lambda: sum(log.msg.startswith("step 8 of 8: ") for log in messages), "the last step in /rosout")
    steps = [log for log in messages if log.msg.startswith("step ")]
    assert [log.msg.partition(":")[0] for log in steps] == [f"step {number} of 8" for number in range(1, 9)]
    assert steps[2].msg == "step 3 of 8: shift to I" and {(log.name, log.level) for log in steps} == {("sequencer", 20)}


def test_an_unknown_sequence_is_refused_with_the_known_ones(user, still):
    result = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name="dmeo")).result()
    assert not result.success and "demo" in result.message


def test_a_shift_gives_feedback_and_result_and_refuses_another(user, still):
    events, commands = user.listen("/controller/events"), user.listen("/controller/command")
    before = user.until(lambda: commands and commands[-1], "a valve command").gear
    new = 1 if before != 1 else 2
    goal = user.order(Shift, "/controller/shift", Shift.Goal(gear=new))
    user.until(lambda: goal.feedback, "feedback of the shift")
    during = user.order(Shift, "/controller/shift", Shift.Goal(gear=0)).result()
    assert not during.success and "still running" in during.message
    result = goal.result()
    assert result.success and result.gear == new
    # Tab. 7.5: the longest profile of a shift takes well over half a second; feedback comes at 20 Hz
    assert 0.5 < result.t_end - result.t_order < 2.0
    assert len(goal.feedback) >= 8 and {feedback.phase for feedback in goal.feedback} - {""}
    assert max(max(feedback.setpoint) for feedback in goal.feedback) > 0.3
    user.until(lambda: len(events) >= 3, "the events of the shift")
    assert [(event.name, event.value) for event in events] == [("shift_ordered", new), ("shift_refused", 0.0), ("shift_done", new)]
    assert events[0].header.stamp.sec + events[0].header.stamp.nanosec * 1e-9 == pytest.approx(result.t_order)
    same = user.order(Shift, "/controller/shift", Shift.Goal(gear=new)).result()
    assert not same.success and "already" in same.message


def test_a_gear_that_there_is_not_is_rejected_with_a_logged_reason(user, still):
    messages = logs(user)
    client = ActionClient(user.node, Shift, "/controller/shift")
    user.until(client.server_is_ready, "the action")

    future = client.send_goal_async(Shift.Goal(gear=7))
    user.until(future.done, "the answer")
    assert not future.result().accepted
    log = user.until(lambda: [log for log in messages if "no gear 7" in log.msg], "the reason in /rosout")[0]
    assert log.name == "alfa46"
    assert log.msg == "shift refused: there is no gear 7; order 0 (neutral), 1 (I) or 2 (II)"


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 1e6])
def test_a_wrong_setpoint_is_refused_and_the_old_one_stays(user, still, value):
    states, events = user.listen("/motor/state"), user.listen("/rig/events")
    publisher = user.publisher("/motor/command")

    def turning() -> bool:
        # published repeatedly, because the publisher discovers its receiver a moment before the receiver discovers it
        publisher.publish(Setpoint(value=300.0 * RPM, enable=True))
        return states and states[-1].speed_setpoint == pytest.approx(300.0 * RPM)

    user.until(turning, "the motor at 300 rpm")
    publisher.publish(Setpoint(value=value, enable=True))
    user.until(lambda: any(event.name == "command_refused" for event in events), "the refusal")
    assert "/motor/command" in next(event.text for event in events if event.name == "command_refused")
    seen = len(states)
    user.until(lambda: len(states) > seen + 20, "the motor going on")
    assert states[-1].enabled and states[-1].speed_setpoint == pytest.approx(300.0 * RPM)


def test_nan_in_a_valve_command_is_refused_and_the_controller_stays_in_charge(user, still):
    events, valve = user.listen("/rig/events"), user.listen("/valve_zr_p1/state")
    profile = QoSProfile(depth=1)
    publisher = user.publisher("/controller/command", profile)
    wrong = ValveCommand(sample=1, duty=[math.nan, 0.0, 0.0], setpoint=[0.0] * 3)

    def refused() -> bool:
        publisher.publish(wrong)  # published repeatedly, because only the newest valve command counts
        return any(event.name == "command_refused" for event in events)

    user.until(refused, "the refusal")
    seen = len(valve)
    user.until(lambda: len(valve) > seen + 20, "the valve going on")
    assert all(math.isfinite(state.duty) and not state.safe and state.command_age < 0.1 for state in valve)


def test_e_stop_beats_everything_until_reset(user):
    states, motor = user.listen("/rig/state"), user.listen("/motor/state")
    publisher = user.publisher("/motor/command")
    publisher.publish(Setpoint(value=300.0 * RPM, enable=True))
    user.until(lambda: states and states[-1].state == RigState.RUNNING, "a running rig")
    assert user.call(Trigger, "/rig/e_stop").success
    user.until(lambda: states[-1].state == RigState.TRIPPED, "the safe state")
    assert states[-1].e_stop and states[-1].reason == "emergency stop"
    publisher.publish(Setpoint(value=300.0 * RPM, enable=True))
    seen = len(motor)
    user.until(lambda: len(motor) > seen + 40, "200 ms in the safe state")
    assert states[-1].state == RigState.TRIPPED
    assert all(abs(state.torque) < 1.0 for state in motor[-20:])
    assert user.call(Trigger, "/rig/reset").success
    user.until(lambda: states[-1].state in (RigState.READY, RigState.RUNNING), "a rig that is ready again")
    assert not states[-1].e_stop and states[-1].reason == ""
    publisher.publish(Setpoint(value=0.0, enable=False))
    user.until(lambda: states[-1].state == RigState.READY, "a rig that is ready")


@pytest.mark.parametrize("discovery", ["LOCALHOST", "SUBNET"])
def test_joining_and_leaving_tools_do_not_hold_up_the_rig(graph, user, still, discovery):
    valve = user.listen("/valve_zr_p1/state")
    user.until(lambda: valve, "the valve")
    for _ in range(3):
        other = Client(graph.domain, discovery)
        torque = other.listen("/motor/m_wej")
        other.until(lambda: len(torque) > 5, "torque")
        other.close()
    seen = len(valve)
    user.until(lambda: len(valve) > seen, "the valve going on")
    assert max(state.command_age for state in valve) < 0.1


def test_nothing_of_all_this_is_lost(graph, user):
    """Last test of the file: it ends the graph and compares what was published with the bag."""
    user.until(lambda: graph.supervisor.time > 3.0, "three seconds of run")
    end = graph.close()
    assert end.state == "interrupted"
    bag, facts = Bag(graph.folder), facts_of(graph.folder)
    assert set(facts) == {"recorder", "container", "alfa46", "sequencer"}
    assert lost_messages(bag, facts) == {} and facts["recorder"]["overflow"] == {}
    counted = [topic for topic, ros_type in bag.types.items() if ros_type.startswith("rig_msgs/")]
    foreign = {"/motor/command", "/controller/command"}  # this file published there too, without sequence numbers
    assert {topic: count for topic, count in bag.gaps().items() if topic not in foreign} == {}
    assert len(counted) >= 25
    assert bag.logger().rows == facts["container"]["ticks"] * 50
    assert [name for _, topic, name, *_ in bag.events() if topic == "/rig/events"][-1] == "rig_tripped"
