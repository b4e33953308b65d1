# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An hour by hand with a gear, a setpoint or a fault every ten seconds: no process grows, leaks files or becomes late.

`./rig test -m campaign tests/graph/test_an_hour_by_hand.py` prints the figures.
"""

import json
import math
import time

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rig_msgs.action import Shift
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph
from std_srvs.srv import Trigger
from test_long_beside_others import size_of

from rig_nodes.bags.opened import OpenedBags
from rig_nodes.nodes.processes.result import facts_of

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MINUTES = 60
EVERY = 10.0  # s
GROWTH = 0.5  # MB a minute
RPM = math.pi / 30.0
FAULT = "p1.stuck"


def test_an_hour_by_hand_with_an_order_or_a_fault_every_ten_seconds(tmp_path, capfd):
    graph = Graph(tmp_path / "hand", settings=["faults=on"])
    user = Client(graph.domain)
    sizes, gear, orders = [], 0, 0
    try:
        states = user.listen("/rig/state", 1)
        setters = {name: user.publisher(f"/{name}/command") for name in ("motor", "oil_supply")}
        user.until(lambda: states and states[-1].state == RigState.READY, "a rig that is ready")
        setters["oil_supply"].publish(Setpoint(value=4e6, enable=True))
        children = {name: child.pid for name, child in graph.supervisor.children.items()}
        began = time.monotonic()
        while time.monotonic() < began + 60.0 * MINUTES:
            due = began + EVERY * (orders + 1)
            if orders % 3 == 0:
                setters["motor"].publish(Setpoint(value=(300.0 + 100.0 * (orders % 4)) * RPM, enable=True))
            elif orders % 3 == 1:
                gear = 1 + gear % 2
                assert user.order(Shift, "/controller/shift", Shift.Goal(gear=gear)).result().success
            else:
                order = FAULT if orders % 2 == 0 else f"{FAULT}, off=true"
                answer = user.call(
                    SetParameters, "/rig/set_parameters", parameters=[Parameter("fault", value=order).to_parameter_msg()]
                )
                assert answer.results[0].successful, answer.results[0].reason
            orders += 1
            user.until(lambda due=due: time.monotonic() > due, "the next order", 2.0 * EVERY)
            del states[:-1]
            if states[-1].state == RigState.TRIPPED:
                assert user.call(Trigger, "/rig/reset").success, states[-1].reason
            sizes.append({name: size_of(pid) for name, pid in children.items()})
    finally:
        user.close()
        end = graph.close()
    first, last = sizes[min(6, len(sizes) // 2)], sizes[-1]
    minutes = (len(sizes) - 1 - min(6, len(sizes) // 2)) * EVERY / 60.0
    grown = {name: ((last[name][0] - first[name][0]) / minutes, last[name][1] - first[name][1]) for name in last}
    container, recorder = (facts_of(graph.folder)[name] for name in ("container", "recorder"))
    with OpenedBags(sorted(graph.folder.glob("*.mcap"))) as bag:
        stored = sum(bag.counts.values())
    with capfd.disabled():
        print(f"\n{orders} orders, {stored} messages; growth [MB a minute, files]: {json.dumps(grown)}")
        print(f"end {end}; lateness {container['lateness_ms']}, behind {container['behind']}; refused {container['refused']}")
    assert all(memory < GROWTH and files <= 0 for memory, files in grown.values())
    assert recorder["overflow"] == {} and end.state == "interrupted"
