# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every command is sent ten times as often as usual: the newest is used, nothing is lost in time, and no process grows.

`./rig test -m campaign tests/graph/test_flood.py` prints the figures.
"""

import subprocess
import sys
import time

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rclpy.task import Future
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph
from test_long_beside_others import size_of

from rig_nodes.controllers.ros.domain import environment
from rig_nodes.nodes.processes.result import facts_of

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

SECONDS = 60.0
RATE = 1000.0  # messages a second on the topic of each setpoint; 5000 of valve commands from each of two programs
RPM = np.pi / 30.0
GROWTH = 5.0  # MB


FLOOD = """
import sys, time
import rclpy
from rclpy.serialization import serialize_message
from rig_msgs.msg import ValveCommand

rclpy.init()
node = rclpy.create_node("flood")
publisher = node.create_publisher(ValveCommand, "/controller/command", 1000)
stale = serialize_message(ValveCommand(sample=1, duty=[0.0] * 3, setpoint=[0.0] * 3))
began = due = time.monotonic()
while due < began + float(sys.argv[1]):
    for _ in range(50):
        publisher.publish(stale)
    due += 0.01
    time.sleep(max(0.0, due - time.monotonic()))
rclpy.shutdown()
"""


def test_a_flood_of_orders_has_the_newest_used_and_no_process_grows(tmp_path, capfd):
    graph = Graph(tmp_path / "flood")
    user, floods = Client(graph.domain), []
    try:
        states, motor = user.listen("/rig/state", 1), user.listen("/motor/state", 1)
        setters = {f"/{name}/command": user.publisher(f"/{name}/command") for name in ("motor", "oil_supply", "load_pump")}
        children = {name: child.pid for name, child in graph.supervisor.children.items()}
        user.until(lambda: states and states[-1].state == RigState.READY, "a rig that is ready")
        orders = dict.fromkeys(setters, serialize_message(Setpoint(value=0.0, enable=False)))
        environ = environment(graph.domain)
        floods = [subprocess.Popen([sys.executable, "-c", FLOOD, str(SECONDS)], env=environ) for _ in range(2)]
        began = due = time.monotonic()
        sent, sizes, value = 0, [], 0.0
        while (now := time.monotonic()) < began + SECONDS:
            if value != (value := (100.0 + 100.0 * ((now - began) // 5.0 % 5)) * RPM):
                orders["/motor/command"] = serialize_message(Setpoint(value=value, enable=True))
            for topic, setter in setters.items():
                setter.publish(orders[topic])
            sent += len(setters)
            due += 1.0 / RATE
            if sent % 300 == 0:
                user.executor.spin_until_future_complete(Future(), 0.0)
            time.sleep(max(0.0, due - time.monotonic()))
            del states[:-1], motor[:-1]
            if now > began + 5.0 * (1 + len(sizes)):
                sizes.append({name: size_of(pid)[0] for name, pid in children.items()})
        user.until(lambda: abs(motor[-1].speed_setpoint - value) < 1e-6, "the newest order", 2.0)
        grown = {name: sizes[-1][name] - sizes[1][name] for name in children}
    finally:
        for flood in floods:
            flood.kill()
            flood.wait()
        user.close()
        end = graph.close()
    facts = facts_of(graph.folder)
    container, recorder = facts["container"], facts["recorder"]
    with capfd.disabled():
        print(f"\n{sent / SECONDS:.0f} setpoints a second; growth [MB] {grown}; refused {container['refused']}")
        print(f"end: {end}; behind {container['behind']}; overruns {container['overruns']} of {container['ticks']} ticks")
        print(f"recorder: longest queue {recorder['longest_queue']}, overflow {recorder['overflow']}")
    assert all(growth < GROWTH for growth in grown.values())
    assert end.state == "interrupted" and recorder["overflow"] == {}
