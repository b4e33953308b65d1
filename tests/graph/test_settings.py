# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything that can be set while the rig runs: it acts within two ticks, or is refused with a reason, and is in the bag."""

import math

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rig_msgs.action import Shift
from rig_msgs.msg import RigState, Setpoint
from rig_msgs.srv import SetProfile
from running_graph import Client, Graph
from std_srvs.srv import Trigger

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers.alfa46.box import Alfa46
from rig_nodes.controllers.load import load_controller
from rig_nodes.nodes.processes.result import facts_of, lost_messages
from rig_nodes.plant import alfa46_law as law
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

pytestmark = pytest.mark.against_the_clock

TWO_TICKS = 0.0101
NAN = math.nan
ALWAYS = ("/controller/events", "/rig/events", "/rig/state")  # topics to which the user listens in every test
PROFILE_1 = load_rig("hydmag").alfa46.profiles[0]


def seconds(message) -> float:
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


class User(Client):
    """A user's process that sets parameters, and keeps the names of the accepted ones."""

    def __init__(self, domain):
        super().__init__(domain)
        self.accepted, self._nodes, self._topics = [], {}, {}
        self.events = {topic: self.messages_of(topic) for topic in ALWAYS[:2]}
        self.messages_of(ALWAYS[2])

    def messages_of(self, topic) -> list:
        if topic not in self._topics:
            self._topics[topic] = self.listen(topic)
        return self._topics[topic]

    def forget(self):
        """Ends the subscriptions of one test, because with all topics a busy machine could not process the old messages."""
        always = [self._subscriptions.pop(0) for _ in ALWAYS]
        super().forget()
        self._subscriptions, self._topics = always, {topic: self._topics[topic] for topic in ALWAYS}

    def _at(self, node):
        if node not in self._nodes:
            self._nodes[node] = AsyncParameterClient(self.node, node)
            self.until(self._nodes[node].services_are_ready, f"the parameters of {node}")
        return self._nodes[node]

    def ask(self, node, **values):
        """Returns the SetParametersResult of values that are set together; a dot in a name is written as a double underscore."""
        names = {name.replace("__", "."): value for name, value in values.items()}
        future = self._at(node).set_parameters_atomically([Parameter(n, value=v) for n, v in names.items()])
        self.until(future.done, f"the answer of {node}")
        if future.result().result.successful:
            self.accepted += [f"{node}.{name}" for name in names]
        return future.result().result

    def set(self, node, **values) -> float:
        """Sets valid values; returns the time [s] at which they were accepted, from the event that reports it."""
        topic = "/controller/events" if node == "alfa46" else "/rig/events"
        events, states = self.events[topic], self.messages_of("/rig/state")
        seen = len(events)
        result = self.ask(node, **values)
        assert result.successful, result.reason
        count = len(states)
        self.until(lambda: len(states) > count + 1, "the rig going on")
        now = seconds(states[-1])
        changed = self.until(lambda: [e for e in events[seen:] if e.name == "setting_changed"], "the event")
        self.until(lambda: len([e for e in events[seen:] if e.name == "setting_changed"]) >= len(values), "all events")
        assert changed[0].text.startswith(f"{node}.{next(iter(values)).replace('__', '.')} = ")
        assert seconds(changed[0]) < now + TWO_TICKS, "done by then, counted from the answer"
        return seconds(changed[0])

    def get(self, node, name):
        future = self._at(node).get_parameters([name])
        self.until(future.done, f"the answer of {node}")
        return Parameter.from_parameter_msg(type("Message", (), {"name": name, "value": future.result().values[0]})()).value

    def acted(self, topic, when: float, is_new):
        """Checks that the setting acts in every message from two ticks after its acceptance on, and in none before it."""
        messages = self.messages_of(topic)
        after = self.until(lambda: [m for m in messages if seconds(m) >= when + TWO_TICKS][:3], f"what {topic} says then")
        assert all(is_new(message) for message in after), after
        assert not any(is_new(message) for message in messages if when - 0.05 < seconds(message) < when)

    def shift(self, gear):
        """Returns the result of a shift."""
        return self.order(Shift, "/controller/shift", Shift.Goal(gear=gear)).result()

    def set_profile(self, output, points):
        """Returns the response of the service that sets a whole profile."""
        client = self.node.create_client(SetProfile, "/alfa46/set_profile")
        self.until(client.service_is_ready, "the service")
        times, currents = np.asarray(points, float).T
        future = client.call_async(SetProfile.Request(output=output, times=times, currents=currents))
        self.until(future.done, "the answer of the service")
        if future.result().success:
            self.accepted += [f"alfa46.output_{output}.times", f"alfa46.output_{output}.currents"]
        return future.result()


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    graph = Graph(tmp_path_factory.mktemp("graph") / "settings")
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def joined(graph):
    user = User(graph.domain)
    yield user
    user.close()


@pytest.fixture
def user(joined):
    yield joined
    joined.forget()


@pytest.mark.parametrize(
    "node, values, topic, is_new",
    [
        ("oil_supply", {"pressure": 3e6}, "/oil_supply/state", lambda m: m.pressure_setting == 3e6),
        ("oil_supply", {"enabled": True}, "/oil_supply/state", lambda m: m.enabled and m.pressure > 0.0),
        ("oil_supply", {"temperature": 55.0}, "/oil_supply/state", lambda m: abs(m.temperature - 55.0) < 0.1),
        ("oil_supply", {"temperature": 60.0}, "/oil_supply/t_oil", lambda m: abs(m.value - 60.0) < 1.0),
        ("load_pump", {"relief_pressure": 5e6}, "/load_pump/state", lambda m: m.relief_setting == 5e6),
        ("load_pump", {"enabled": True}, "/load_pump/state", lambda m: m.pressure > 0.0),
        ("motor", {"enabled": True}, "/motor/state", lambda m: m.enabled),
        ("motor", {"speed": 60.0}, "/motor/state", lambda m: m.speed_setpoint > 0.0),
        ("motor", {"enabled": False}, "/motor/state", lambda m: not m.enabled),
    ],
    ids=lambda part: "-".join(part) if isinstance(part, dict) else "" if callable(part) else str(part),
)
def test_a_device_takes_a_setting_within_two_ticks(user, node, values, topic, is_new):
    user.until(lambda: len(user.messages_of(topic)) > 10, topic)
    user.acted(topic, user.set(node, **values), is_new)
    name, value = next(iter(values.items()))
    assert user.get(node, name) == value


def test_noise_is_set_per_channel_and_switched_off_and_on(user):
    blocks, mirror = user.messages_of("/instruments/hmg4000"), user.messages_of("/instruments/p1_absolute")

    def spread(since: float, column: int = 4) -> float:
        """Returns the spread of p1 over the rows of the blocks, from two ticks after a setting on."""
        later = user.until(lambda: (b := [b for b in blocks if seconds(b) >= since + TWO_TICKS])[3:] and b, "logger blocks")
        return max(np.ptp(np.reshape(block.data, (block.rows, -1))[:, column]) for block in later)

    usual, most = spread(0.0), load_rig("hydmag").settings.find("instruments.noise.p1").high
    # p1 is not shown further below zero than its largest error, so half of the noise remains at an idle clutch
    assert spread(user.set("instruments", noise__p1=most)) > 5.0 * usual
    assert spread(user.set("instruments", noise=False)) == 0.0
    assert user.get("instruments", "noise.p1") == most
    seen = len(mirror)
    user.until(lambda: len(mirror) > seen + 2, "the mirror")
    assert mirror[-1].variance == 0.0
    assert spread(user.set("instruments", noise=True)) > 5.0 * usual


def test_the_box_takes_gains_hold_current_and_delays(user):
    commands = user.messages_of("/controller/command")
    assert user.shift(1).success
    currents = [*PROFILE_1[:2, 1], 0.6, *PROFILE_1[3:, 1]]
    user.acted("/controller/command", user.set("alfa46", output_1__currents=currents), lambda m: m.setpoint[0] == 0.6)
    later = [0.4, 0.8, 50.0, *PROFILE_1[3:, 0]]
    when = user.set("alfa46", output_1__times=later)
    user.until(lambda: seconds(commands[-1]) > when + 0.1, "the gear being held")
    assert {m.setpoint[0] for m in commands if seconds(m) > when} == {0.6}, "a gear that is in stays in"
    user.set("alfa46", output_1__times=PROFILE_1[:, 0].tolist())
    when = user.set("alfa46", gain_p=0.0, gain_i=0.0, gain_d=0.0)
    user.until(lambda: seconds(commands[-1]) > when + 0.1, "the box without gains")
    held = {m.duty[0] for m in commands if seconds(m) >= when + TWO_TICKS}
    assert len(held) == 1, "without gains the duty stays where it was"
    assert len({m.duty[0] for m in commands if when - 0.05 < seconds(m) < when}) > 5
    user.set("alfa46", gain_p=20.0, gain_i=1000.0, gain_d=1.0, derivative_time=0.03)
    user.set("alfa46", t12=1.0, t21=1.1)
    config = load_rig("hydmag").alfa46
    for gear, delay in ((2, 1.0), (1, 1.1)):
        result = user.shift(gear)
        assert result.success
        # Tab. 7.5: the shift ends with P3 of the engaging output, which starts after the delay
        assert result.t_end - result.t_order == pytest.approx(delay + config.profiles[gear - 1, 2, 0], abs=0.003)


@pytest.mark.parametrize(
    "node, values, reason",
    [
        ("motor", {"speed": NAN}, "out of range"),
        ("motor", {"speed": math.inf}, "out of range"),
        ("motor", {"speed": -1.0}, "Min: 0.0, Max: 314.2"),
        ("motor", {"speed": 315.0}, "Min: 0.0, Max: 314.2"),
        ("motor", {"speed": 314.20001}, "expected 0 to 314.2 rad/s"),
        ("motor", {"speed": "fast"}, "STRING"),
        ("motor", {"enabled": 1.0}, "DOUBLE"),
        ("load_pump", {"relief_pressure": 5e7}, "Max: 40000000.0"),
        ("oil_supply", {"pressure": -1.0}, "Min: 0.0"),
        ("oil_supply", {"temperature": 200.0}, "Max: 150.0"),
        ("instruments", {"noise__p1": -1.0}, "Min: 0.0"),
        ("instruments", {"noise__I_zr_p1": NAN}, "out of range"),
        ("alfa46", {"t12": 6.0}, "Max: 5.0"),
        ("alfa46", {"t21": NAN}, "out of range"),
        ("alfa46", {"gain_p": -1.0}, "Min: 0.0"),
        ("alfa46", {"derivative_time": 0.0}, "Min: 0.001"),
        ("alfa46", {"output_1__times": [0.2, 0.1, 0.6, 0.2, 0.3, 0.4]}, "output_1.P2 is at 100 ms; it must come after P1"),
        ("alfa46", {"output_1__times": [0.1, NAN, 0.6, 0.2, 0.3, 0.4]}, "output_1.P2 is at nan"),
        ("alfa46", {"output_2__currents": [0.2, 0.2, 0.9, 0.2, 0.1, 0.0]}, "output_2.P3 asks for 900 mA"),
        ("alfa46", {"output_2__currents": [0.2, NAN, 0.7, 0.2, 0.1, 0.0]}, "takes 0 to 800 mA"),
        ("alfa46", {"output_3__times": [0.1, 0.2, 0.3]}, "must have 6 numbers"),
        ("alfa46", {"t12": 0.5, "output_3__times": [0.1, 0.2, 0.3]}, "must have 6 numbers"),
    ],
    ids=lambda part: "-".join(f"{k}={v}" for k, v in part.items()) if isinstance(part, dict) else str(part),
)
def test_a_wrong_value_is_refused_with_the_reason_and_changes_nothing(user, node, values, reason):
    names = [name.replace("__", ".") for name in values]
    before = [user.get(node, name) for name in names]
    seen = sum(map(len, user.events.values()))
    result = user.ask(node, **values)
    assert not result.successful and reason in result.reason
    assert [user.get(node, name) for name in names] == before
    count = len(user.messages_of("/rig/state"))
    user.until(lambda: len(user.messages_of("/rig/state")) > count + 4, "the rig going on")
    assert sum(map(len, user.events.values())) == seen


def test_a_profile_is_set_as_a_whole(user):
    points = [[0.1, 0.0], [0.2, 0.0], [0.35, 0.1], [0.1, 0.1], [0.2, 0.05], [0.3, 0.0]]
    answer = user.set_profile(3, points)
    assert answer.success and answer.message == "profile of output_3 set"
    columns = [user.get("alfa46", f"output_3.{name}") for name in ("times", "currents")]
    assert np.column_stack(columns).tolist() == points
    for output, wrong, reason in (
        (0, points, "no output 0"),
        (4, points, "expected 1 to 3"),
        (3, points[::-1], "must come after"),
        (3, [*points[:5], [0.3, 0.9]], "output_3.P6 asks for 900 mA"),
    ):
        answer = user.set_profile(output, wrong)
        assert not answer.success and reason in answer.message
    assert list(user.get("alfa46", "output_3.times")) == [point[0] for point in points]


def test_during_a_shift_its_own_profiles_stay(user):
    goal = user.order(Shift, "/controller/shift", Shift.Goal(gear=2))
    for output in (1, 2):
        answer = user.set_profile(output, PROFILE_1 * [1.1, 1.0])
        assert not answer.success and f"output_{output} is in use by a shift" in answer.message
    assert user.ask("alfa46", t12=-0.22, output_3__currents=[0.0] * 6).successful
    assert goal.result().success
    assert user.set_profile(1, PROFILE_1).success


def test_parameters_follow_the_setpoint_topics_and_the_last_one_wins(user):
    publisher, states = user.publisher("/load_pump/command"), user.messages_of("/load_pump/state")
    publisher.publish(Setpoint(value=2e6, enable=False))
    user.until(lambda: user.get("load_pump", "relief_pressure") == 2e6, "the parameter")
    assert user.get("load_pump", "enabled") is False
    user.acted("/load_pump/state", user.set("load_pump", relief_pressure=2.5e6), lambda m: m.relief_setting == 2.5e6)
    publisher.publish(Setpoint(value=1e6, enable=False))
    user.until(lambda: states[-1].relief_setting == 1e6, "the setpoint")


def test_a_tripped_rig_does_not_let_the_motor_be_switched_on(user):
    states = user.messages_of("/rig/state")
    user.set("motor", enabled=True)
    assert user.call(Trigger, "/rig/e_stop").success
    result = user.ask("motor", enabled=True)
    assert not result.successful and "tripped (emergency stop)" in result.reason and "/rig/reset" in result.reason
    user.until(lambda: user.get("motor", "enabled") is False, "the parameter that follows the trip")
    assert user.call(Trigger, "/rig/reset").success
    user.until(lambda: states[-1].state == RigState.READY, "a rig that is ready")
    assert user.ask("motor", enabled=True).successful and user.ask("motor", enabled=False).successful


@pytest.mark.parametrize("node", ["alfa46", "motor", "load_pump", "oil_supply", "instruments"])
def test_every_setting_is_described(user, node):
    client = AsyncParameterClient(user.node, node)
    user.until(client.services_are_ready, node)
    names = client.list_parameters()
    user.until(names.done, "the names")
    ours = [n for n in names.result().result.names if n not in ("use_sim_time", "start_type_description_service")]
    described = client.describe_parameters(ours)
    user.until(described.done, "the descriptors")
    for descriptor in described.result().descriptors:
        assert descriptor.description, descriptor.name
        if descriptor.type == Parameter.Type.DOUBLE.value:
            assert descriptor.description.endswith("]") and len(descriptor.floating_point_range) == 1, descriptor.name
            assert descriptor.floating_point_range[0].to_value >= 0.1, descriptor.name
        if descriptor.type == Parameter.Type.DOUBLE_ARRAY.value:
            assert descriptor.description.endswith("]") and descriptor.additional_constraints, descriptor.name
    assert len(ours) == {"alfa46": 14, "motor": 2, "load_pump": 2, "oil_supply": 3, "instruments": 11}[node]


def test_all_of_it_stands_in_the_bag(graph, user):
    """Last test with the graph: it ends the graph."""
    assert graph.close().state == "interrupted"
    bag = Bag(graph.folder)
    assert lost_messages(bag, facts_of(graph.folder)) == {}
    names = [text.partition(" = ")[0] for _, _, name, text, _ in bag.events() if name == "setting_changed"]
    assert sorted(names) == sorted(user.accepted) and len(names) > 20
    texts = [text for _, _, name, text, _ in bag.events() if name == "setting_changed"]
    assert {
        "motor.speed = 60 rad/s",
        "instruments.noise = false",
        "alfa46.t12 = 1 s",
        "alfa46.output_3.currents = 0 0 0.1 0.1 0.05 0 A",
    } <= set(texts)
    assert {value for *_, text, value in bag.events() if text == "motor.speed = 60 rad/s"} == {60.0}


def test_a_controller_of_ones_own_refuses_settings_while_it_runs():
    config = load_rig("hydmag")
    plug = load_controller("python:rig_nodes.controllers.examples.alfa46:Alfa46", config)
    with pytest.raises(RigError, match="reads its settings when it starts"):
        plug.check_change(config.alfa46)
    plug.close()


def test_the_same_settings_again_change_no_bit():
    rig = load_rig("hydmag")
    config, box = rig.alfa46, rig.transmission
    one, other = Alfa46(config, box), Alfa46(config, box)
    for box in (one, other):
        box.order(law.GEAR_I)
    for sample in range(2000):
        if sample % 100 == 50:
            other.change(config)
        assert [v.tolist() for v in one.step(sample, [0.1] * 3)] == [v.tolist() for v in other.step(sample, [0.1] * 3)]


@pytest.mark.parametrize(
    "name, value, sentence",
    [
        ("oil_supply.temperature", NAN, "expected -30 to 150 degC"),
        ("instruments.noise.T_oil", 1.0, "there is no value of instruments 'noise.T_oil'; did you mean"),
        ("instruments.noise.p1", -1.0, "expected 0 to"),
        ("w0.inertia", 1.0, "cannot be set while the rig runs"),
        ("alfa46.t12", 9.0, "expected -5 to 5 s"),
        ("motor.speed", 400.0, "motor.speed of 400 rad/s refused; expected 0 to 314.2 rad/s"),
    ],
)
def test_the_rig_refuses_what_cannot_be_set(name, value, sentence):
    with pytest.raises(RigError, match=sentence):
        Rig(load_rig("hydmag")).set_value(name, value)


def test_settings_of_a_controller_that_is_not_the_rigs_are_not_the_rigs_to_change():
    with pytest.raises(RigError, match="alfa46.t12 is the shift controller's"):
        Rig(load_rig("hydmag"), 1, "external", "duty").set_value("alfa46.t12", 0.1)
