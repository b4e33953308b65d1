# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every command is sent ten times as often as usual: the newest is used, nothing is lost in time, and no process grows.

`./rig test -m campaign tests/graph/test_flood.py` prints the figures.
"""

import itertools
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from campaigns import PART, show, size_of
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.task import Future
from rig_msgs.action import Shift
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers.ros.domain import environment
from rig_nodes.nodes.processes.result import facts_of

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

SECONDS = 60.0 * PART
RATE = 1000.0  # messages a second on the topic of each setpoint
# of these programs: 5000 valve commands a second from each of two, and 100 orders or calls of services a second from the others
FLOODS = ("valves", "valves", "shifts", "faults", "resets")
RPM = np.pi / 30.0
GROWTH = 5.0  # MB
SETTLED = 4  # samples of the sizes after which what answers need is there: the results of orders are kept for 10 s
NEWEST = ("p2.offset, off=true", "p2.offset, size=2 %")  # in place of the flood's
IDLE = {"motor": (0.0, False), "oil_supply": (4e6, True), "load_pump": (0.0, False)}  # setpoints, and whether they are on


def flooded(user, setters, sizes):
    """Sends setpoints for a while, the motor's a new one every 5 s; returns how many were sent, and the newest of the motor."""
    orders = {topic: serialize_message(Setpoint(value=value, enable=on)) for topic, (value, on) in IDLE.items()}
    began = due = time.monotonic()
    sent, value = 0, 0.0
    while (now := time.monotonic()) < began + SECONDS:
        if value != (value := (100.0 + 100.0 * ((now - began) // 5.0 % 5)) * RPM):
            orders["motor"] = serialize_message(Setpoint(value=value, enable=True))
        for topic, setter in setters.items():
            setter.publish(orders[topic])
        sent += len(setters)
        due += 1.0 / RATE
        if sent % 300 == 0:
            user.executor.spin_until_future_complete(Future(), 0.0)
        time.sleep(max(0.0, due - time.monotonic()))
        if now > began + SECONDS / 12.0 * (1 + len(sizes.rows)):
            sizes.take()
    return sent, value


class Sizes:
    """Memory of each process [MB], taken again and again."""

    def __init__(self, graph, capture):
        self.pids, self.rows, self._capture = {name: child.pid for name, child in graph.supervisor.children.items()}, [], capture

    def take(self):
        self.rows.append({name: size_of(pid)[0] for name, pid in self.pids.items()})
        show(self._capture, f"{len(self.rows)}: " + ", ".join(f"{name} {size:.1f} MB" for name, size in self.rows[-1].items()))

    def grown(self):
        settled = self.rows[min(SETTLED, len(self.rows) // 2)]
        return {name: self.rows[-1][name] - settled[name] for name in self.pids}


def test_a_flood_of_orders_has_the_newest_used_and_no_process_grows(tmp_path, capfd):
    graph = Graph(tmp_path / "flood", settings=["faults=on"])
    user, floods, sizes = Client(graph.domain), [], Sizes(graph, capfd)
    try:
        states, motor = user.listen("/rig/state", 1), user.listen("/motor/state", 1)
        setters = {name: user.publisher(f"/{name}/command") for name in IDLE}
        user.until(lambda: states and states[-1].state == RigState.READY, "a rig that is ready")
        environ, program = environment(graph.domain), str(Path(__file__).with_name("flooding.py"))
        for kind in FLOODS:
            command = [sys.executable, program, kind, str(SECONDS)]
            floods.append(subprocess.Popen(command, env=environ, stdout=subprocess.PIPE, text=True))
            assert floods[-1].stdout.readline() == "it begins\n"
        sent, value = flooded(user, setters, sizes)
        user.until(lambda: abs(motor[-1].speed_setpoint - value) < 1e-6, "the newest order", 2.0)
        for flood in floods[: FLOODS.count("valves")]:
            flood.kill()
        said = [flood.communicate(timeout=60.0)[0].strip() for flood in floods[FLOODS.count("valves") :]]
        for order in NEWEST:
            asked = Parameter("fault", value=order).to_parameter_msg()
            result = user.call(SetParameters, "/rig/set_parameters", parameters=[asked]).results[0]
        assert result.successful, result.reason
        gears = itertools.cycle((1, 2))
        user.until(lambda: user.order(Shift, "/controller/shift", Shift.Goal(gear=next(gears))).result().success, "a shift", 10.0)
        assert states[-1].state == RigState.RUNNING, states[-1].reason
    finally:
        for flood in floods:
            flood.kill()
            flood.wait()
        user.close()
        end = graph.close()
    facts, grown = facts_of(graph.folder), sizes.grown()
    container, recorder = facts["container"], facts["recorder"]
    show(capfd, f"{sent / SECONDS:.0f} setpoints a second; {'; '.join(said)}; refused {container['refused']}")
    show(capfd, f"end: {end}; behind {container['behind']}; overruns {container['overruns']} of {container['ticks']} ticks")
    show(capfd, f"recorder: longest queue {recorder['longest_queue']}, overflow {recorder['overflow']}; growth [MB] {grown}")
    answers = [line.split() for line in said]
    assert all(int(done) >= 0.9 * int(asked) for asked, _, _, done, _ in answers), "orders and services are answered"
    events = [event for piece in Bag.pieces(graph.folder, 1 << 24) for event in piece.events()]
    faults = [text for *_, name, text, _ in events if name == "fault_on"]
    assert faults[-1].startswith("p2.offset: ") and "2 %" in faults[-1], "the newest order"
    assert all(growth < GROWTH for growth in grown.values())
    assert end.state == "interrupted" and recorder["overflow"] == {}
