"""Orders that are taken back or cannot be carried out, from a process of the user's own, in real time and in lockstep."""

import math
import os
import signal

import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rig_msgs.action import RunSequence, Shift
from rig_msgs.msg import RigState
from running_graph import Client, Graph

from rig_nodes.bags.reader import Bag
from rig_nodes.graph.result import facts_of, lost_messages

RPM = math.pi / 30.0
LONG = """
description: the motor turns, then a long wait
steps:
  - oil: {pressure: 4 MPa}
  - motor: {speed: 300 rpm}
  - wait: {for: 20 s}
  - motor: {off: true}
"""


@pytest.fixture(scope="module", params=[None, 1.0], ids=["real time", "lockstep"])
def graph(request, tmp_path_factory):
    # a small pump, which reaches 500 Nm at rest with no setting that the rig takes: 59 MPa
    graph = Graph(tmp_path_factory.mktemp("graph") / "orders", speed=request.param,
                  settings=["load_pump.displacement=40 cm3/rev", "load_pump.pressure_limit=100 MPa"])
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def user(graph):
    client = Client(graph.domain)
    client.events = {topic: client.listen(topic) for topic in ("/alfa46/events", "/sequencer/events")}
    client.states = client.listen("/rig/state")
    client.until(lambda: client.states and client.states[-1].state == RigState.READY, "a rig that is ready")
    yield client
    client.close()


def told(user, topic, name):
    """The newest event of this name, when it has come."""
    return user.until(lambda: [e for e in user.events[topic] if e.name == name][-1:], name)[0]


@pytest.fixture
def long_sequence(tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text(LONG)
    return str(path)


def test_a_cancelled_sequence_gives_no_more_orders_and_leaves_what_is_set(user, long_sequence):
    motor = user.listen("/motor/state")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=long_sequence))
    user.until(lambda: any(feedback.step == 3 for feedback in goal.feedback), "the long wait")
    answer = goal.cancel()
    assert answer.return_code == CancelGoal.Response.ERROR_NONE and len(answer.goals_canceling) == 1
    result = goal.result()
    assert goal.status == GoalStatus.STATUS_CANCELED
    assert not result.success and result.steps_done == 2
    assert result.message == ("sequence 'long' was cancelled in step 3 of 4 (wait 20 s); "
                              "motor, load and oil stay as they are set")
    event = told(user, "/sequencer/events", "sequence_cancelled")
    assert event.text == result.message and event.value == 2.0
    seen = len(motor)
    user.until(lambda: len(motor) > seen + 100, "half a second more")
    assert motor[-1].enabled and motor[-1].speed_setpoint == pytest.approx(300.0 * RPM, rel=0.2)
    assert user.states[-1].state == RigState.RUNNING


def test_the_next_sequence_is_taken_after_a_cancel(user, tmp_path):
    path = tmp_path / "off.yaml"
    path.write_text("description: off\nsteps:\n  - motor: {off: true}\n  - wait: {for: 50 ms}\n")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    assert goal.result().success and goal.status == GoalStatus.STATUS_SUCCEEDED
    user.until(lambda: user.states[-1].state == RigState.READY, "a rig that is ready")
    late = goal.cancel()
    assert late.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED and not late.goals_canceling


def test_a_shift_that_has_begun_is_carried_to_its_end(user):
    goal = user.order(Shift, "/alfa46/shift", Shift.Goal(gear=1))
    user.until(lambda: goal.feedback, "feedback of the shift")
    answer = goal.cancel()
    assert answer.return_code == CancelGoal.Response.ERROR_REJECTED and not answer.goals_canceling
    event = told(user, "/alfa46/events", "cancel_refused")
    assert "the shift to I has begun and is carried to its end" in event.text and event.value == 1.0
    result = goal.result()
    assert result.success and result.gear == 1 and goal.status == GoalStatus.STATUS_SUCCEEDED


def test_an_order_that_the_controller_has_not_seen_is_withdrawn(graph, user):
    container = graph.supervisor.children["container"].process.pid
    os.kill(container, signal.SIGSTOP)  # no sample, so nobody takes the order
    try:
        goal = user.order(Shift, "/alfa46/shift", Shift.Goal(gear=2))
        answer = goal.cancel()
        assert answer.return_code == CancelGoal.Response.ERROR_NONE and len(answer.goals_canceling) == 1
        result = goal.result()
    finally:
        os.kill(container, signal.SIGCONT)
    assert goal.status == GoalStatus.STATUS_CANCELED and not result.success and result.gear == 1
    assert result.message == "shift to II withdrawn before the controller took it"
    assert told(user, "/alfa46/events", "shift_withdrawn").text == result.message
    seen = len(user.states)
    user.until(lambda: len(user.states) > seen + 40, "the rig going on")
    commands = user.listen("/alfa46/command")
    user.until(lambda: commands, "a valve command")
    assert commands[-1].gear == 1 and not commands[-1].shifting
    assert user.order(Shift, "/alfa46/shift", Shift.Goal(gear=0)).result().success, "the next order is taken"


def test_a_sequence_cancelled_in_a_shift_leaves_the_shift_to_its_end(user, tmp_path):
    path = tmp_path / "shift.yaml"
    path.write_text("description: x\nsteps:\n  - shift: {to: I}\n  - motor: {speed: 300 rpm}\n")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    user.until(lambda: goal.feedback, "feedback of the sequence")
    assert len(goal.cancel().goals_canceling) == 1
    result = goal.result()
    assert result.steps_done == 0 and result.message.endswith("as they are set, the shift goes on to its end")
    commands = user.listen("/alfa46/command")
    user.until(lambda: commands and commands[-1].gear == 1 and not commands[-1].shifting, "the end of the shift")
    assert user.states[-1].state == RigState.READY, "the motor was never ordered"
    # the end of that shift is not the end of the next one that a sequence orders
    path.write_text("description: x\nsteps:\n  - shift: {to: neutral}\n")
    assert user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path))).result().success


def test_a_setpoint_that_the_rig_refuses_fails_the_sequence_at_once(user, tmp_path):
    path = tmp_path / "much.yaml"
    path.write_text("description: x\nsteps:\n  - load: {torque: 500 Nm}\n  - wait: {for: 60 s}\n")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    result = goal.result()
    assert goal.status == GoalStatus.STATUS_ABORTED and result.steps_done == 0
    assert "much.yaml:3: load torque 500 Nm asks" in result.message and "expected 0 to 4e+07 Pa" in result.message
    step, failed = (told(user, "/sequencer/events", name) for name in ("step", "sequence_failed"))
    assert failed.stamp == step.stamp and failed.text == result.message


def test_all_of_it_stands_in_the_bag(graph, user):
    """Last of the file: ends the graph."""
    assert graph.close().state == "interrupted"
    bag = Bag(graph.folder)
    assert lost_messages(bag, facts_of(graph.folder)) == {}
    names = [name for _, _, name, *_ in bag.events()]
    assert names.count("sequence_cancelled") == 2
    assert names.count("cancel_refused") == names.count("shift_withdrawn") == 1
