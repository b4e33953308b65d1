# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orders that are withdrawn or cannot be carried out, from a process of the user, in real time and in lockstep."""

import math
import os
import signal

import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rig_msgs.action import RunSequence, Shift
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import facts_of, lost_messages

# test_by_hand.py and test_refused_orders.py stop, cancel and refuse orders in real time; in lockstep, in addition, the order must
# not reach the box before its process is stopped
REAL_TIME = pytest.param(None, marks=(pytest.mark.against_the_clock, pytest.mark.campaign))

RPM = math.pi / 30.0
LONG = """
description: the motor turns, then a long wait
steps:
  - oil: {pressure: 4 MPa}
  - motor: {speed: 300 rpm}
  - wait: {for: 20 s}
  - motor: {off: true}
"""


@pytest.fixture(scope="module", params=[REAL_TIME, 1.0], ids=["real time", "lockstep"])
def graph(request, tmp_path_factory):
    # a small pump, for which 500 Nm at rest would need 59 MPa, more than the rig takes
    graph = Graph(
        tmp_path_factory.mktemp("graph") / "orders",
        speed=request.param,
        settings=["load_pump.displacement=40 cm3/rev", "load_pump.pressure_limit=100 MPa"],
    )
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def user(graph):
    client = Client(graph.domain)
    client.events = {topic: client.listen(topic) for topic in ("/controller/events", "/sequencer/events")}
    client.states = client.listen("/rig/state")
    client.until(lambda: client.states and client.states[-1].state == RigState.READY, "a rig that is ready")
    yield client
    client.close()


def event_of(user, topic, name):
    """Returns the newest event of this name as soon as there is one."""
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
    assert result.message == ("sequence 'long' was cancelled in step 3 of 4 (wait 20 s); motor, load and oil stay as they are set")
    event = event_of(user, "/sequencer/events", "sequence_cancelled")
    assert event.text == result.message and event.value == 2.0
    seen = len(motor)
    user.until(lambda: len(motor) > seen + 100, "half a second more")
    assert motor[-1].enabled and motor[-1].speed_setpoint == pytest.approx(300.0 * RPM, rel=0.2)
    assert user.states[-1].state == RigState.RUNNING


def test_the_sequence_with_which_a_rig_was_started_is_cancelled_too(tmp_path, long_sequence):
    graph = Graph(tmp_path / "own", long_sequence, speed=1.0)
    client = Client(graph.domain)
    try:
        client.until(lambda: any("wait 20 s" in text for text in graph.reports), "the long wait")
        answer = client.call(CancelGoal, "/sequencer/run/_action/cancel_goal")
        assert answer.return_code == CancelGoal.Response.ERROR_NONE and len(answer.goals_canceling) == 1
        client.until(graph.supervisor.ended.is_set, "the end of the run", 10.0)
    finally:
        client.close()
        end = graph.close()
    assert end.state == "failed" and end.reason.startswith("sequence 'long' was cancelled in step 3 of 4"), end


def test_the_next_sequence_is_taken_after_a_cancel(user, tmp_path):
    path = tmp_path / "off.yaml"
    path.write_text("description: off\nsteps:\n  - motor: {off: true}\n  - wait: {for: 50 ms}\n")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    assert goal.result().success and goal.status == GoalStatus.STATUS_SUCCEEDED
    user.until(lambda: user.states[-1].state == RigState.READY, "a rig that is ready")
    late = goal.cancel()
    assert late.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED and not late.goals_canceling


def test_a_shift_that_has_begun_is_carried_to_its_end(user):
    goal = user.order(Shift, "/controller/shift", Shift.Goal(gear=1))
    user.until(lambda: goal.feedback, "feedback of the shift")
    answer = goal.cancel()
    assert answer.return_code == CancelGoal.Response.ERROR_REJECTED and not answer.goals_canceling
    event = event_of(user, "/controller/events", "cancel_refused")
    assert "the shift to I has begun and is carried to its end" in event.text and event.value == 1.0
    result = goal.result()
    assert result.success and result.gear == 1 and goal.status == GoalStatus.STATUS_SUCCEEDED


def test_an_order_that_the_controller_has_not_seen_is_withdrawn(graph, user):
    container = graph.supervisor.children["container"].pid
    os.kill(container, signal.SIGSTOP)  # without samples the controller does not accept the order
    try:
        user.until_silent(user.states)
        goal = user.order(Shift, "/controller/shift", Shift.Goal(gear=2))
        answer = goal.cancel()
        assert answer.return_code == CancelGoal.Response.ERROR_NONE and len(answer.goals_canceling) == 1
        result = goal.result()
    finally:
        os.kill(container, signal.SIGCONT)
    assert goal.status == GoalStatus.STATUS_CANCELED and not result.success and result.gear == 1
    assert result.message == "shift to II withdrawn before the controller took it"
    assert event_of(user, "/controller/events", "shift_withdrawn").text == result.message
    seen = len(user.states)
    user.until(lambda: len(user.states) > seen + 40, "the rig going on")
    commands = user.listen("/controller/command")
    user.until(lambda: commands, "a valve command")
    assert commands[-1].gear == 1 and not commands[-1].shifting
    assert user.order(Shift, "/controller/shift", Shift.Goal(gear=0)).result().success, "the next order is taken"


def test_a_sequence_cancelled_in_a_shift_leaves_the_shift_to_its_end(user, tmp_path):
    """The shift takes two seconds, so that it is still running when a cancel arrives late on a busy machine."""
    path = tmp_path / "shift.yaml"
    steps = ("shift: {to: I}", "set: {alfa46.t12: 2 s}", "shift: {to: II}", "motor: {speed: 300 rpm}")
    path.write_text("description: x\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    user.until(lambda: any(feedback.step == 3 for feedback in goal.feedback), "the shift to II")
    assert len(goal.cancel().goals_canceling) == 1
    result = goal.result()
    assert result.steps_done == 2 and result.message.endswith("as they are set, the shift goes on to its end")
    commands = user.listen("/controller/command")
    user.until(lambda: commands and commands[-1].gear == 2 and not commands[-1].shifting, "the end of the shift")
    assert user.states[-1].state == RigState.READY, "the motor was never ordered"
    # the end of that shift must not count as the end of the next one that a sequence orders; the delay stays for the test below
    path.write_text("description: x\nsteps:\n  - shift: {to: neutral}\n")
    assert user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path))).result().success


def test_a_setpoint_that_the_rig_refuses_fails_the_sequence_at_once(user, tmp_path):
    path = tmp_path / "much.yaml"
    path.write_text("description: x\nsteps:\n  - load: {torque: 500 Nm}\n  - wait: {for: 60 s}\n")
    goal = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(path)))
    result = goal.result()
    assert goal.status == GoalStatus.STATUS_ABORTED and result.steps_done == 0
    assert "much.yaml:3: load torque 500 Nm needs too much of the relief valve" in result.message
    assert "expected 0 to 40 000 000 Pa" in result.message
    step, failed = (event_of(user, "/sequencer/events", name) for name in ("step", "sequence_failed"))
    assert failed.header.stamp == step.header.stamp and failed.text == result.message


def test_an_emergency_stop_takes_every_order_back(user):
    """After the reset only a new order clamps a clutch, regardless of the clutches and orders before."""
    clutch, valve, motor = (user.listen(f"/{name}/state") for name in ("clutch_s1", "valve_zr_p1", "motor"))
    logs = []
    user.node.create_subscription(Log, "/rosout", logs.append, 100)
    setters = {name: user.publisher(f"/{name}/command") for name in ("oil_supply", "motor")}

    def set_to(name, value, reached):
        def there():
            setters[name].publish(Setpoint(value=value, enable=value > 0.0))
            return reached()

        user.until(there, f"{name} at {value}")

    def order(gear):
        return user.order(Shift, "/controller/shift", Shift.Goal(gear=gear))

    def newest(messages):
        seen = len(messages)
        return user.until(lambda: len(messages) > seen + 2, "new messages") and messages[-1]

    user.service(Trigger, "/rig/e_stop")  # connected now, so that the call during the shift does not have to wait
    set_to("oil_supply", 4e6, lambda: True)
    set_to("motor", 300.0 * RPM, lambda: user.states[-1].state == RigState.RUNNING)
    # a rig that is not stopped is not reset
    answer = user.call(Trigger, "/rig/reset")
    assert not answer.success and answer.message == "the rig is not in its safe state; nothing done"
    assert newest(motor).enabled and user.states[-1].state == RigState.RUNNING
    assert order(1).result().success
    user.until(lambda: clutch[-1].pressure > 1.5e6, "a clutch that is clamped")

    running = order(2)
    user.until(lambda: running.feedback, "feedback of the shift")
    assert user.call(Trigger, "/rig/e_stop").success
    result = running.result()
    assert running.status == GoalStatus.STATUS_ABORTED and not result.success and result.gear == 0
    assert result.message == "the rig is in its safe state: emergency stop; the shift to II was given up"
    assert event_of(user, "/controller/events", "shift_aborted").text == result.message
    refused = order(1)
    assert refused.result().message == ("shift refused: the rig is in its safe state (emergency stop); call /rig/reset first")
    assert refused.status == GoalStatus.STATUS_ABORTED

    assert user.call(Trigger, "/rig/reset").success
    user.until(lambda: user.states[-1].state == RigState.READY, "a rig that is ready")
    assert not newest(motor).enabled
    before = len(valve), len(clutch)
    user.until(lambda: len(valve) > before[0] + 100, "half a second more")
    # the remaining coil current and pressure may still fall
    assert max(state.current for state in valve[before[0] + 50 :]) < 0.02
    assert max(state.pressure for state in clutch[before[1] + 50 :]) < 0.5e6
    assert order(1).result().success
    user.until(lambda: clutch[-1].pressure > 1.5e6, "a clutch that is ordered anew")

    user.until(lambda: any(log.msg == "safe state left" for log in logs), "the reset in /rosout")
    assert [log.level for log in logs if log.name == "rig" and log.msg == "safe state: emergency stop"] == [40]
    assert order(0).result().success
    set_to("oil_supply", 0.0, lambda: True)


def test_a_stamp_of_the_wall_clock_is_logged_when_it_came(graph, user):
    """A node that stamps with its own clock, without simulated time, sends such a message."""
    health = []
    user.node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: health.extend(m.status), 100)
    publisher = user.publisher("/oil_supply/command")
    publisher.publish(Setpoint(header=Header(stamp=Time(sec=1_790_000_000)), value=3e6, enable=False))
    status = user.until(
        lambda: [s for s in health if s.name == "rig/recorder" and s.level == DiagnosticStatus.WARN], "a warning of the recorder"
    )[0]
    assert "/oil_supply/command" in status.message and "use_sim_time" in status.message
    publisher.publish(Setpoint(value=2e6, enable=False))
    seen = len(user.states)
    user.until(lambda: len(user.states) > seen + 40, "the rig going on")


def test_all_of_it_stands_in_the_bag(graph, user):
    """Last test of the file: it ends the graph."""
    assert graph.close().state == "interrupted"
    bag = Bag(graph.folder)
    facts = facts_of(graph.folder)
    assert lost_messages(bag, facts) == {} and facts["recorder"]["ahead"] == {"/oil_supply/command": 1}
    end = max(time for time, *_ in bag.timeline()) * 1e-9
    assert end == pytest.approx(facts["container"]["time_s"], abs=0.01), "no message is of another clock"
    at = {message.value: time * 1e-9 for time, message in bag.messages("/oil_supply/command")}
    assert end - 20.0 < at[3e6] <= at[2e6] <= end
    assert bag.events()[-1][3] == "the rig was ended by hand"
    names = [name for _, _, name, *_ in bag.events()]
    assert names.count("sequence_cancelled") == 2
    assert names.count("cancel_refused") == names.count("shift_withdrawn") == 1
