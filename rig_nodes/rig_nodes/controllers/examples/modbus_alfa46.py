# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 law as a Modbus TCP client, by its own clock: the example of a controller behind ``modbus:``.

    .venv/bin/python -m rig_nodes.controllers.examples.modbus_alfa46 5020 --rig hydmag
    ./rig simulate demo --controller modbus:5020

It needs pymodbus, and of the rig the registers (`./rig export registers`) and the law. Either may start first; it
connects again when the rig goes and comes. Ctrl-C ends it.
"""

from __future__ import annotations

import logging
import sys
import threading
from typing import TYPE_CHECKING

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.examples.command import address, parser, port, run
from rig_nodes.controllers.ignored import Ignored
from rig_nodes.controllers.modbus.registers import COMMAND_BASE, register_map
from rig_nodes.controllers.record import controller_info, record_of
from rig_nodes.controllers.wire import NO_NUMBER, commands, given
from rig_nodes.rig import RigConfig, load_gearbox_rig

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pymodbus.client import ModbusTcpClient

LEVELS = ("duty", "current")
PERIOD = 1e-3  # s of a sample


class ModbusController:
    """Reads a sample and writes the answer to the previous one in the same request (function 23), one request after another."""

    def __init__(self, port: int, config: RigConfig, host: str = "127.0.0.1") -> None:
        self.host, self.port, self.config = host, port, config
        self.record = record_of(config)
        self.wires, self.outputs = given(self.record), len(self.record.outputs)
        self.read = len([row for row in register_map(self.record) if row.access == "read"])
        self.law: Alfa46 | None = None
        self.sample, self.heartbeat = -1, 0
        self.ignored = Ignored("modbus_alfa46", lambda text: print(text, file=sys.stderr, flush=True))

    def run(self, stop: threading.Event) -> None:
        """Answer until ``stop`` is set."""
        from pymodbus.client import ModbusTcpClient
        from pymodbus.exceptions import ModbusException

        while not stop.is_set():
            client = ModbusTcpClient(self.host, port=self.port, timeout=0.5, retries=0)
            try:
                if client.connect():
                    self.serve(client, stop)
            except (ModbusException, OSError):
                pass  # the rig has gone: connect again
            finally:
                client.close()
            stop.wait(0.1)

    def serve(self, client: ModbusTcpClient, stop: threading.Event) -> None:
        """Send requests until the rig goes."""
        written = [1, *[0] * (self.outputs + 4)]
        while not stop.is_set():
            answer = client.readwrite_registers(read_address=0, read_count=self.read, write_address=COMMAND_BASE, values=written)
            if answer.isError():
                return
            if why := self.wrong(answer.registers):
                self.ignored.add(why)
                return
            found = self.answer(answer.registers)
            written = found or written
            if not found or self.sample == 0:  # no new sample yet, or no run: leave the processor to others
                stop.wait(2e-4 if not found else 2e-3)

    def wrong(self, registers: Sequence[int]) -> str:
        """Return why registers are not those of a rig like this one; empty when they are."""
        if len(registers) != self.read:
            return f"the server has sent {len(registers)} registers, expected {self.read}"
        if registers[3] >= len(LEVELS) or registers[2] not in self.record.gear_names:
            return f"the server asks for gear {registers[2]} at level {registers[3]}, which this rig does not have"
        if NO_NUMBER & 0xFFFF in registers[4:]:
            return "a transducer has no reading"
        return ""

    def answer(self, registers: Sequence[int]) -> list[int] | None:
        """Return the registers to write for those that were read; None when the sample is answered already."""
        sample = registers[0] << 16 | registers[1]
        if sample == self.sample and sample != 0:
            return None
        if self.law is None or sample < self.sample or sample == 0:
            self.law = Alfa46()
            self.law.initialize(controller_info(self.record, self.config.alfa46, LEVELS[registers[3]]))
        self.sample = sample
        values = [wire.decode(raw - 0x10000 if raw > 0x7FFF else raw) for wire, raw in zip(self.wires, registers[4:], strict=True)]
        current, measured = tuple(values[: self.outputs]), tuple(values[self.outputs :])
        out = self.law.step(self.record.inputs(sample, sample * PERIOD, registers[2], current, measured))
        self.heartbeat = self.heartbeat % 0xFFFF + 1
        wires = commands(self.record, LEVELS[registers[3]])
        raw = [wire.encode(value) for wire, value in zip(wires, out.command, strict=True)]
        return [self.heartbeat, *raw, out.gear, int(out.shifting), out.flags, 0]


def main() -> None:
    """Answer the rig until Ctrl-C."""
    given = parser(__doc__, "modbus_alfa46")
    given.add_argument("port", type=port)
    given.add_argument("--host", type=address, default="127.0.0.1")
    given.add_argument("--rig", required=True, help="whose Alfa46 settings are used")
    arguments = given.parse_args()
    config = load_gearbox_rig(arguments.rig, None, "this example")
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # a rig that is not there yet is no error
    print(f"answering the rig at {arguments.host}:{arguments.port}, until Ctrl-C", flush=True)
    ModbusController(arguments.port, config, arguments.host).run(threading.Event())


if __name__ == "__main__":
    run(main)
