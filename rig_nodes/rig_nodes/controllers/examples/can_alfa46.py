# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 law, or a controller given by its specification, on a CAN bus by its own clock: the example behind ``can:``.

    .venv/bin/python -m rig_nodes.controllers.examples.can_alfa46 239.74.163.2 --interface udp_multicast --rig hydmag
    ./rig simulate demo --controller "can:239.74.163.2?interface=udp_multicast"

It needs python-can and cantools, and of the rig the messages (`./rig export dbc`) and the law. Ctrl-C ends it.
"""

from __future__ import annotations

import math
import sys
import threading
from typing import TYPE_CHECKING

from rig_nodes.base import RigError
from rig_nodes.controllers.can.bus import open_bus, receive
from rig_nodes.controllers.can.database import database
from rig_nodes.controllers.examples.command import parser, run
from rig_nodes.controllers.ignored import Ignored
from rig_nodes.controllers.load import IN_PROCESS, load_controller
from rig_nodes.controllers.record import record_of
from rig_nodes.controllers.seam import LEVELS
from rig_nodes.controllers.wire import currents, measured
from rig_nodes.rig import NEUTRAL, RigConfig, load_gearbox_rig

if TYPE_CHECKING:
    import can
    from cantools.database.can import Message

    from rig_nodes.controllers.plug import Plug

ALFA46 = f"python:rig_nodes.controllers.examples.alfa46:Alfa46{IN_PROCESS}"
GAP = 1000  # samples: a counter further ahead of the last one than this has jumped back


class CanController:
    """Takes the rig's frames and answers each sample by the controller that ``spec`` names, which waits for its samples."""

    def __init__(self, bus: can.BusABC, config: RigConfig, spec: str = ALFA46) -> None:
        import can

        self.bus, self.config, self.spec, self.frame = bus, config, spec, can.Message
        self.record = record_of(config)
        messages = database(self.record).messages
        self.messages = {message.frame_id: message for message in messages}
        self.names = {message.name: message for message in messages}
        self.currents, self.measured = currents(self.record), measured(self.record)
        self.newest = {}  # newest value by signal
        self.ignored = Ignored("can_alfa46", lambda text: print(text, file=sys.stderr, flush=True))
        self.law: Plug | None = None
        self.sample, self.request = 0, NEUTRAL

    def run(self, stop: threading.Event) -> None:
        """Answer until ``stop`` is set."""
        try:
            while not stop.is_set():
                if frame := receive(self.bus, 0.1, self.ignored.add):
                    self.hear(frame)
        finally:
            self.end()
            self.ignored.conclude()

    def hear(self, frame: can.Message) -> None:
        """Take a frame of the rig, and answer with the last one of a sample."""
        if frame.is_extended_id or frame.is_error_frame or frame.arbitration_id not in self.messages:
            return
        message = self.messages[frame.arbitration_id]
        if message.senders != ["RIG"]:
            return
        if why := self.take(message, frame):
            self.ignored.add(f"a frame {message.name} {why}")
        elif message.name == "RIG_CURRENTS" and "level" in self.newest and self.measured[0].name in self.newest:
            self.answer()

    def begin(self, level: str) -> Plug:
        """Return the controller for a new run; RigError when it cannot work at the level or would not wait for samples."""
        self.end()
        self.law, self.request = load_controller(self.spec, self.config, level), NEUTRAL
        if self.law.own_clock:
            raise RigError(f"controller {self.spec} has a clock of its own; expected one that waits for its samples")
        self.law.pace(None)
        return self.law

    def end(self) -> None:
        """End the controller of the run, if there is one."""
        if self.law:
            self.law.close()

    def take(self, message: Message, frame: can.Message) -> str:
        """Keep the values of a frame; return instead why no rig like this one sends it."""
        if frame.is_remote_frame or len(frame.data) != message.length:
            return f"has {len(frame.data)} bytes, expected {message.length}"
        values = message.decode_simple(bytes(frame.data), decode_choices=False)
        if values.get("level", 0) >= len(LEVELS) or values.get("gear_request", 0) not in self.record.gear_names:
            return f"asks for gear {values['gear_request']} at level {values['level']}, which this rig does not have"
        for wire in (*self.currents, *self.measured):
            if values.get(wire.name, 0.0) < wire.range[0]:
                return f"has no reading of {wire.name}"
        self.newest.update(values)
        return ""

    def answer(self) -> None:
        """Compute one sample of the law in SI; a counter that jumps back begins a new run."""
        newest, law = self.newest, self.law
        ahead = (newest["sample"] - self.sample) & 0xFFFF
        if law is None or ahead > GAP:
            law, self.sample, ahead = self.begin(LEVELS[newest["level"]]), newest["sample"], 0
        self.sample += ahead
        self.order(law, newest["gear_request"])
        current, seen = ([newest[wire.name] / wire.scale for wire in wires] for wires in (self.currents, self.measured))
        answer = law.step(self.sample, current, seen, [math.nan] * len(law.wants))  # the bus carries no further transducers
        if answer is None:
            return  # as the controller wants: no command for this sample
        counter = newest["sample"]
        self.send(
            "CONTROL_STATE", {"sample": counter, "gear": law.gear, "shifting": int(law.shifting), "flags": law.flags, "status": 0}
        )
        name, factor = ("CONTROL_COMMAND_CURRENT", 1e3) if newest["level"] else ("CONTROL_COMMAND_DUTY", 100.0)
        commands = {f"command_{k}": value * factor for k, value in enumerate(answer.command, 1)}
        self.send(name, {"sample": counter, **commands})

    def order(self, law: Plug, request: int) -> None:
        """Give the controller the gear that the rig requests, when it changes."""
        if request == self.request:
            return
        self.request = request
        try:
            law.order(request)
        except RigError:
            if request != NEUTRAL:
                raise
            law.force_neutral()  # after a trip the rig asks for neutral in a shift too

    def send(self, name: str, values: dict[str, float]) -> None:
        """Send the message with this name and these values of its signals."""
        message = self.names[name]
        data = message.encode(values, strict=False)
        self.bus.send(self.frame(arbitration_id=message.frame_id, data=data, is_extended_id=False, is_fd=False))


def main() -> None:
    """Open the bus and answer until Ctrl-C."""
    given = parser(__doc__, "can_alfa46")
    given.add_argument("channel")
    given.add_argument("--interface", default="socketcan")
    given.add_argument("--rig", required=True, help="whose Alfa46 settings are used")
    given.add_argument("--controller", default=ALFA46, metavar="SPEC", help="another law, e.g. c:FILE.c (the Alfa46's)")
    arguments = given.parse_args()
    config = load_gearbox_rig(arguments.rig, None, "this example")
    bus = open_bus(arguments.channel, arguments.interface, "this example")
    print(f"answering on CAN {arguments.interface} {arguments.channel}, until Ctrl-C", flush=True)
    try:
        CanController(bus, config, arguments.controller).run(threading.Event())
    finally:
        bus.shutdown()


if __name__ == "__main__":
    run(main)
