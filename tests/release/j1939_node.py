#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check of the CAN plug with another J1939 stack: a node of can-j1939 claims an address and shifts the rig.

    .venv/bin/pip install --no-deps --target /tmp/can-j1939 can-j1939
    PYTHONPATH=/tmp/can-j1939 .venv/bin/python tests/release/j1939_node.py &
    ./rig simulate demo --controller "can:239.74.163.2?interface=udp_multicast"

It ends when the rig has been silent for 3 s. See README.md beside it.
"""

import struct
import sys
import time
from collections import Counter

import can
import j1939
from j1939.electronic_control_unit import MessageListener

from rig_nodes.controllers.can.loopback import LoopbackBus

RIG, OWN = 3, 33  # source addresses
ETC1, ETC2 = 61442, 61445
STATE, COMMAND = 0x10, 0x11  # low bytes of PGN 65296 and 65297: CONTROL_STATE, CONTROL_COMMAND_CURRENT
FILL, PLATEAU, SLOPE, HELD = 0.30, 220.0, 1200.0, 740.0  # s, mA, mA/s, mA
OVERLAP, RELEASE = 0.25, 130.0  # s during which both clutches are on; mA of the old one while the new one takes the torque
SILENT = 3.0  # s
REQUESTED = 250  # answers after which the node asks the rig for ETC2


class Node(can.Listener):
    """The law of the templates behind a node of can-j1939; the rig's samples come as plain frames."""

    def __init__(self, bus):
        self.bus, self.received, self.answers = bus, Counter(), 0
        self.gear = self.old = self.request = 0
        self.since, self.newest, self.tops = -10.0, None, Counter()
        ecu = self.ecu = j1939.ElectronicControlUnit(send_message=self.send)
        name = j1939.Name(
            arbitrary_address_capable=0, industry_group=0, vehicle_system=0, function=0, manufacturer_code=666, identity_number=1
        )
        self.node = j1939.ControllerApplication(name, OWN)
        ecu.add_ca(controller_application=self.node)
        self.node.subscribe(self.on_group)
        self.node.start()

    def send(self, can_id, extended_id, data, fd_format=False):
        """Send a frame of can-j1939."""
        self.bus.send(can.Message(arbitration_id=can_id, is_extended_id=extended_id, data=data, is_fd=fd_format))

    def on_group(self, priority, pgn, source, timestamp, data):
        """Count the rig's parameter groups, with the highest output speed [rpm] (SPN 191) and gear (SPN 523)."""
        if source == RIG:
            self.received[pgn] += 1
            if pgn == ETC1:
                self.tops["rpm"] = max(self.tops["rpm"], int.from_bytes(data[1:3], "little") * 0.125)
            elif pgn == ETC2:
                self.tops["gear"] = max(self.tops["gear"], data[3] - 125)

    def on_message_received(self, frame):
        """Answer a sample."""
        if frame.is_extended_id:
            return
        self.newest = time.monotonic()
        if frame.arbitration_id == 0x100:
            self.request = frame.data[0]
        elif frame.arbitration_id == 0x102 and self.node.state == j1939.ControllerApplication.State.NORMAL:
            (sample,) = struct.unpack_from("<H", frame.data)
            command, shifting = self.step(1e-3 * sample)
            state = struct.pack("<HBBBBxx", sample, self.gear, shifting, 0, 0)
            values = struct.pack("<4H", sample, *(round(ma / 0.02) for ma in command))
            for group, data in ((STATE, state), (COMMAND, values)):
                self.node.send_pgn(0, 0xFF, group, 3, list(data))
            self.answers += 1
            if self.answers == REQUESTED:
                self.node.send_request(0, ETC2, RIG)

    def step(self, now):
        """Return the setpoints [mA] and whether a shift is running."""
        if self.request != self.gear:
            self.old, self.gear, self.since = self.gear, self.request, now
        elapsed, command = now - self.since, [0.0, 0.0, 0.0]
        if self.old and elapsed < OVERLAP + 0.2:
            command[self.old - 1] = HELD if elapsed < OVERLAP else RELEASE
        if self.gear:
            command[self.gear - 1] = min(PLATEAU + SLOPE * max(0.0, elapsed - FILL), HELD)
        return command, elapsed < 1.5


def main():
    """Answer the rig until it is silent; exit code 0 when its messages came and it shifted."""
    bus = LoopbackBus("239.74.163.2")
    node = Node(bus)
    notifier = can.Notifier(bus, [node, MessageListener(node.ecu)])
    while node.newest is None or time.monotonic() - node.newest < SILENT:
        time.sleep(0.1)
    notifier.stop()
    node.ecu.stop()
    bus.shutdown()
    sound = node.tops["gear"] == 2 and node.received[ETC1] > 500
    groups = ", ".join(f"{count} of {pgn}" for pgn, count in sorted(node.received.items()))
    summary = f"{node.answers} answers; of the rig {groups}; up to gear {node.tops['gear']} and {node.tops['rpm']:.0f} rpm"
    print(f"can-j1939: {'passed' if sound else 'FAILED'}: {summary}")
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
