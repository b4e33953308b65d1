# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An hour by hand with an order or a fault every ten seconds, all kinds in turn: nothing is lost, grows, leaks or becomes late.

`./rig test -m campaign tests/graph/test_an_hour_by_hand.py` prints the figures.
"""

import itertools
import json
import math
import time
from collections import Counter

import numpy as np
import pytest
from campaigns import PART, show, size_of
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rig_msgs.action import Shift
from rig_msgs.msg import RigState, Setpoint
from running_graph import Client, Graph
from std_srvs.srv import Trigger

from rig_nodes.analysis import gather
from rig_nodes.analysis.lost import what_was_lost
from rig_nodes.nodes.processes.result import facts_of, run_part
from rig_nodes.rig import faults_of, load_rig

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MINUTES = 60 * PART
EVERY = 10.0  # s
GROWTH = 0.5  # MB a minute
SETTLED = 60.0  # s after which what a process needs at its start is there
ENDS = min(300.0, 30.0 * MINUTES)  # s at the beginning and at the end whose lateness is compared
# ms: a tick, and half of it. Diagnostics tell the greatest lateness of each second, which has 200 ticks; in half of the seconds
# all are below the median of these, so that it lies at the 99.7th percentile of all ticks.
LATE, LATER = 5.0, 2.5
RPM = math.pi / 30.0
RESTORE, SHIFT, FAULT_ON, FAULT_OFF = range(4)  # what is done in turn


def each_kind_in_turn():
    """Returns names of faults for ever, one of each kind before the second of any kind; the parts that they are of take turns."""
    kinds = {}
    for name, one in faults_of(load_rig("hydmag", {"faults": "on"})).items():
        if not one.lacking and one.fault.part not in ("measurements", "alfa46"):  # which a rig in real time refuses
            kinds.setdefault((one.fault.part, one.fault.name), []).append(name)
    rows = itertools.zip_longest(*kinds.values())
    return len(kinds), itertools.cycle([name for row in rows for name in row if name])


class Hand:
    """A person at a rig who orders something every ten seconds, and knows which trips follow from that."""

    def __init__(self, graph, capture):
        self.graph, self.user, self._capture = graph, Client(graph.domain), capture
        self.states, self.lateness, self.sizes, self.trips = self.user.listen("/rig/state", 1), [], [], Counter()
        self._setters = {name: self.user.publisher(f"/{name}/command") for name in ("motor", "oil_supply")}
        self.user.until(lambda: self.states and self.states[-1].state == RigState.READY, "a rig that is ready")
        self._pids = {name: child.pid for name, child in graph.supervisor.children.items()}
        self.kinds, self._faults = each_kind_in_turn()
        self.began, self._speeds, self._gear, self._fault = time.monotonic(), itertools.cycle((300, 400, 500, 600)), 0, ""
        self.user.node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnostics, 100)

    def _diagnostics(self, message):
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values} if status.name == "rig" else {}
            if "lateness_ms_max" in values:
                self.lateness.append((time.monotonic() - self.began, float(values["lateness_ms_max"])))

    def one(self, number):
        """Gives an order and waits until the next is due; a trip that does not follow from a fault fails."""
        what = number % 4
        (self.restore, self.shift, self.inject, self.clear)[what]()
        due = self.began + EVERY * (number + 1)
        self.user.until(lambda: time.monotonic() > due, "the next order", 2.0 * EVERY)
        del self.states[:-1]
        tripped = self.states[-1].state == RigState.TRIPPED
        if tripped:
            assert what in (FAULT_ON, FAULT_OFF), f"{self.states[-1].reason}, without a fault since more than {EVERY} s"
            if what == FAULT_OFF:
                self.trips[self._fault, self.graph.supervisor.trip] += 1
        self.sizes.append((time.monotonic() - self.began, {name: size_of(pid) for name, pid in self._pids.items()}))
        memory = ", ".join(f"{name} {size:.0f} MB" for name, (size, _) in self.sizes[-1][1].items())
        show(self._capture, f"{number + 1}: {self._fault}, trip {self.graph.supervisor.trip or 'none'}; {memory}")

    def order_fault(self, order):
        asked = Parameter("fault", value=order).to_parameter_msg()
        answer = self.user.call(SetParameters, "/rig/set_parameters", parameters=[asked])
        assert answer.results[0].successful, answer.results[0].reason

    def inject(self):
        self._fault = next(self._faults)
        self.order_fault(self._fault)

    def clear(self):
        self.order_fault(f"{self._fault}, off=true")

    def restore(self):
        """Leaves the safe state, and sets oil and a new speed."""
        if self.states[-1].state == RigState.TRIPPED:
            self.user.until(lambda: self.user.call(Trigger, "/rig/reset").success, "a reset", 5.0)
            self.user.until(lambda: self.states[-1].state == RigState.READY, "a rig that is ready")
            self._gear = 0
        self._setters["oil_supply"].publish(Setpoint(value=4e6, enable=True))
        self._setters["motor"].publish(Setpoint(value=next(self._speeds) * RPM, enable=True))

    def shift(self):
        self._gear = 1 + self._gear % 2
        result = self.user.order(Shift, "/controller/shift", Shift.Goal(gear=self._gear)).result()
        assert result.success, result.message

    def grown(self):
        """Returns by process how its memory has grown [MB a minute], and its open files."""
        settled = [row for row in self.sizes if row[0] > min(SETTLED, self.sizes[-1][0] / 2.0)]
        (began, first), (end, last) = settled[0], settled[-1]
        minutes = (end - began) / 60.0
        return {name: ((last[name][0] - first[name][0]) / minutes, last[name][1] - first[name][1]) for name in last}


def test_an_hour_by_hand_with_an_order_or_a_fault_every_ten_seconds(tmp_path, capfd):
    graph = Graph(tmp_path / "hand", settings=["faults=on"])
    hand, orders = None, 0
    try:
        hand = Hand(graph, capfd)
        while time.monotonic() < hand.began + 60.0 * MINUTES:
            hand.one(orders)
            orders += 1
    finally:
        if hand is not None:
            hand.user.close()
        end = graph.close()
    bag = gather(graph.folder, recover=True)
    part, grown = run_part(bag, graph.folder, {}, end, graph.supervisor.restarts), hand.grown()
    first, last = (
        float(np.median([late for at, late in hand.lateness if low <= at < high]))
        for low, high in ((0.0, ENDS), (hand.lateness[-1][0] - ENDS, math.inf))
    )
    show(capfd, f"{orders} orders; {orders // 4} faults of {hand.kinds} kinds; {sum(hand.trips.values())} trips:")
    for (fault, trip), count in sorted(hand.trips.items()):
        show(capfd, f"  {fault}: {trip}, {count} times")
    show(capfd, f"growth [MB a minute, files]: {json.dumps(grown)}")
    show(
        capfd, f"end {end}; lateness at the beginning {first:.2f} ms, at the end {last:.2f} ms; of all ticks {part['lateness_ms']}"
    )
    show(capfd, f"behind {part['behind']}; lost {part['lost']}; refused {part['refused_commands']}")
    assert all(memory < GROWTH and files <= 0 for memory, files in grown.values())
    assert max(first, last) < LATE and last < first + LATER
    assert what_was_lost(part) == "" and facts_of(graph.folder)["recorder"]["overflow"] == {}
    assert end.state == "interrupted" and part["restarts"] == []
