# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""/diagnostics as a tool of the user receives it: every device, at 1 Hz, and at once when something changes."""

import os
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph
from std_srvs.srv import Trigger

from rig_nodes.bags.reader import Bag

pytestmark = pytest.mark.against_the_clock

OK, WARN, ERROR, STALE = (getattr(DiagnosticStatus, name) for name in ("OK", "WARN", "ERROR", "STALE"))
IN_CONTAINER = {
    "rig",
    *(
        f"rig/{name}"
        for name in (
            "motor",
            "gearbox",
            "clutch_s1",
            "clutch_s2",
            "valve_zr_p1",
            "valve_zr_p2",
            "oil_supply",
            "load_pump",
            "instruments",
        )
    ),
}
ALL = IN_CONTAINER | {"rig/alfa46", "rig/sequencer", "rig/recorder"}
FAILING = """
from rig_nodes.controllers.examples.alfa46 import Alfa46


class Failing(Alfa46):
    def step(self, inputs):
        if inputs.time > 1.0:
            raise ValueError("the table is empty")
        return super().step(inputs)
"""


class Watcher(Client):
    """Keeps the newest status of each device and the arrival times of its messages."""

    def __init__(self, domain):
        super().__init__(domain)
        self.newest, self.came, self.stamps = {}, {}, []
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.on_message, 100)

    def on_message(self, message):
        self.stamps.append(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)
        for status in message.status:
            self.newest[status.name] = status
            self.came.setdefault(status.name, []).append(time.monotonic())

    def shows(self, name, level, text):
        """Waits until a device reports this; returns its values."""

        def there():
            status = self.newest.get(name)
            return status is not None and status.level == level and text in status.message

        self.until(there, f"{name} to say '{text}', not {self.newest.get(name)}")
        return {pair.key: pair.value for pair in self.newest[name].values}


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    """The graph in lockstep, where ROS is served beside the samples or between them."""
    graph = Graph(tmp_path_factory.mktemp("graph") / "diagnostics", speed=1.0)
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def user(graph):
    client = Watcher(graph.domain)
    client.until(lambda: client.newest.keys() >= ALL, f"all of {ALL}")
    yield client
    client.close()


def test_every_device_of_a_sound_rig_is_ok(user):
    user.shows("rig", OK, "ready: the motor is off")
    user.until(lambda: all(status.level == OK for status in user.newest.values()), "levels that are all OK")
    assert user.newest.keys() == ALL
    assert {status.hardware_id for status in user.newest.values()} == {"virtual_rig"}
    assert user.shows("rig/alfa46", OK, "answers the samples")["missed"] == "0"
    assert float(user.shows("rig/valve_zr_p1", OK, "follows the shift controller")["command_age_ms"]) < 50.0
    # the recorder's first status may be older than its first message
    user.until(lambda: int(user.shows("rig/recorder", OK, "records")["received"]) > 100, "a recorder that receives")


def test_it_is_told_at_1_hz_when_nothing_changes(user):
    begun = {name: len(user.came[name]) for name in ("rig/motor", "rig/alfa46", "rig/recorder", "rig/sequencer")}
    user.until(lambda: all(len(user.came[name]) >= count + 4 for name, count in begun.items()), "four more")
    for name in ("rig/alfa46", "rig/sequencer"):
        times = user.came[name][-4:]
        assert 2.7 < times[-1] - times[0] < 3.6, name
    assert max(user.stamps) > 3.0, "simulated time"


def test_a_stop_is_told_at_once_with_its_reason(user):
    publisher = user.publisher("/motor/command")

    def on() -> bool:
        publisher.publish(Setpoint(value=30.0, enable=True))
        return user.newest["rig/motor"].message == "on"

    user.until(on, "the motor being on")
    user.shows("rig", OK, "running: the motor is on")
    states = user.listen("/rig/state")
    assert user.call(Trigger, "/rig/e_stop").success
    user.until(lambda: states and states[-1].state == RigState.TRIPPED, "the safe state")
    asked = time.monotonic()
    values = user.shows("rig", ERROR, "tripped: emergency stop")
    assert time.monotonic() - asked < 0.5
    assert values["state"] == "TRIPPED" and values["reason"] == "emergency stop"
    user.shows("rig/motor", WARN, "without torque")
    user.shows("rig/valve_zr_p2", WARN, "no current")
    assert user.call(Trigger, "/rig/reset").success
    user.shows("rig", OK, "ready")
    user.shows("rig/motor", OK, "off")
    user.shows("rig/valve_zr_p2", OK, "follows")


def test_an_oil_supply_without_its_pressure_is_a_warning(user):
    publisher = user.publisher("/oil_supply/command")

    def on() -> bool:
        publisher.publish(Setpoint(value=4e6, enable=True))
        return user.newest["rig/oil_supply"].level == WARN

    user.until(on, "pressure that has to build up")
    assert "10 % below" in user.newest["rig/oil_supply"].message
    assert float(user.shows("rig/oil_supply", OK, "at its pressure")["pressure"]) > 3.6e6


def test_a_box_without_samples_is_stale(graph, user):
    container = graph.supervisor.children["container"].pid
    os.kill(container, signal.SIGSTOP)
    try:
        user.shows("rig/alfa46", STALE, "no sample for 100 ms")
    finally:
        os.kill(container, signal.SIGCONT)
    user.shows("rig/alfa46", OK, "answers the samples")


def test_it_is_in_the_bag_like_every_topic_of_the_domain(graph, user):
    """Last test with the graph: it ends the graph."""
    assert graph.close().state == "interrupted"
    assert Bag(graph.folder).counts["/diagnostics"] > 0


def test_in_real_time_a_failed_controller_is_an_error_with_its_reason(tmp_path):
    plug = tmp_path / "failing.py"
    plug.write_text(FAILING)
    graph = Graph(tmp_path / "graph", controller=f"python:{plug}:Failing")
    user = Watcher(graph.domain)
    try:
        user.shows("rig/alfa46", ERROR, "ValueError: the table is empty")
        values = user.shows("rig", ERROR, "ValueError: the table is empty")
        assert 0.0 <= float(values["lateness_ms_p50"]) <= float(values["lateness_ms_max"])
        user.shows("rig/valve_zr_p1", STALE, "no valve command for more than 100 ms")
    finally:
        user.close()
        graph.close()
