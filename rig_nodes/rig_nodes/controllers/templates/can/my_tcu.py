# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller on a CAN bus: a small law to replace by yours (docs/how_to/can.md of the rig). Ctrl-C ends it.

The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a ramp.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from time import sleep

import can
import cantools

from rig_nodes.base import quoted
from rig_nodes.controllers.can.loopback import LoopbackBus

FILL, PLATEAU, SLOPE, HELD = 0.30, 220.0, 1200.0, 740.0  # s, mA, mA/s, mA
OVERLAP, RELEASE = 0.35, 130.0  # s in which both clutches are on; mA of the old one while the new one takes over
OUTPUTS = 3  # of the controller
OUTPUTS_OF = {0: (), 1: (0,), 2: (1,)}  # outputs that each gear needs, from the rig

DBC = Path(__file__).with_name("rig.dbc")
if not DBC.is_file():
    sys.exit(f"my_tcu: {DBC} is missing; it is written by ./rig export dbc -o {quoted(DBC)}")

database = cantools.database.load_file(DBC)
rig_request = database.get_message_by_name("RIG_REQUEST")
rig_currents = database.get_message_by_name("RIG_CURRENTS")
# a rig with more than three outputs has further frames of commands, CONTROL_COMMAND_CURRENT_2 and on; the first one comes last
commands = [m for m in database.messages if m.name.startswith("CONTROL_COMMAND_CURRENT") and not m.is_extended_frame][::-1]


class Law:
    """A small law with its present gear and shift."""

    gear = old = 0
    since = -10.0  # no shift is running

    def step(self, time: float, request: int) -> tuple[list[float], bool]:
        """Current setpoints in mA and whether a shift is running; time in s since the run began."""
        if request != self.gear:
            self.old, self.gear, self.since = self.gear, request, time
        elapsed = time - self.since
        command = [0.0] * OUTPUTS
        if elapsed < OVERLAP + 0.2:
            for k in OUTPUTS_OF[self.old]:
                command[k] = HELD if elapsed < OVERLAP else RELEASE
        for k in OUTPUTS_OF[self.gear]:
            kept = k in OUTPUTS_OF[self.old]  # a clutch of both gears
            command[k] = HELD if kept else min(PLATEAU + SLOPE * max(0.0, elapsed - FILL), HELD)
        return command, elapsed < 1.5


def send(bus: can.BusABC, name: str, values: dict[str, float]) -> None:
    """Send the message of this name with these values of its signals."""
    message = database.get_message_by_name(name)
    data = message.encode(values)
    bus.send(can.Message(arbitration_id=message.frame_id, data=data, is_extended_id=False, is_fd=False))


def frames(bus: can.BusABC) -> Iterator[can.Message]:
    """Whole frames of the rig; others are left out, and the first one that cannot be read is reported."""
    told = False
    while True:
        why = ""
        try:
            frame = bus.recv()
        except can.CanOperationError as error:
            why = str(error)
            sleep(0.001)
        else:
            if frame is None or frame.is_extended_id or frame.arbitration_id not in (rig_request.frame_id, rig_currents.frame_id):
                continue
            if len(frame.data) == 8 and not frame.is_remote_frame:
                yield frame
                continue
            why = f"frame 0x{frame.arbitration_id:x} has {len(frame.data)} bytes instead of 8"
        if not told:
            told = True
            print(f"my_tcu: {why}; it is left out, as are others like it", file=sys.stderr, flush=True)


def answer(bus: can.BusABC) -> None:
    """Answer each sample, in one run after another."""
    law, request, last, time = None, 0, 0, 0.0
    for frame in frames(bus):
        if frame.arbitration_id == rig_request.frame_id:
            request = rig_request.decode(frame.data, decode_choices=False)["gear_request"]
            continue
        sample = rig_currents.decode(frame.data)["sample"]
        ahead = (sample - last) & 0xFFFF
        if law is None or ahead > 1000:  # the counter jumped back: a new run, and the law begins anew
            law, time, ahead = Law(), 0.0, 0
        last, time = sample, time + 0.001 * ahead
        if request and not OUTPUTS_OF.get(request):  # a gear without an output: the rig trips with status 2, an error
            send(bus, "CONTROL_STATE", {"sample": sample, "gear": law.gear, "shifting": 0, "flags": 0, "status": 2})
            command = [0.0] * OUTPUTS
        else:
            command, shifting = law.step(time, request)
            send(bus, "CONTROL_STATE", {"sample": sample, "gear": law.gear, "shifting": int(shifting), "flags": 0, "status": 0})
        values = {"sample": sample, **{f"command_{k}": value for k, value in enumerate(command, 1)}}
        for message in commands:
            send(bus, message.name, {one.name: values[one.name] for one in message.signals})


if __name__ == "__main__":
    try:
        with LoopbackBus("239.74.163.2") as bus:  # on a real bus: can.Bus("can0", interface="socketcan")
            answer(bus)
    except KeyboardInterrupt:
        sys.exit(130)
