# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller as a Modbus TCP client: a small law to replace by yours (docs/how_to/modbus.md). Ctrl-C ends it.

The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a ramp.
"""

import logging
import sys
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

FILL, PLATEAU, SLOPE, HELD = 0.30, 220.0, 1200.0, 740.0  # s, mA, mA/s, mA
OVERLAP, RELEASE = 0.35, 130.0  # s in which both clutches are on; mA of the old one while the new one takes over
READ, OUTPUTS = 11, 3  # registers that the rig has to read; outputs of the controller
OUTPUTS_OF = {0: (), 1: (0,), 2: (1,)}  # outputs that each gear needs, from the rig


class Law:
    """A small law with its present gear and shift."""

    gear = old = 0
    since = -10.0  # no shift is running

    def step(self, now: float, request: int) -> tuple[list[float], bool]:
        """Current setpoints in mA and whether a shift is running; now in s since the run began."""
        if request != self.gear:
            self.old, self.gear, self.since = self.gear, request, now
        elapsed = now - self.since
        command = [0.0] * OUTPUTS
        if elapsed < OVERLAP + 0.2:
            for k in OUTPUTS_OF[self.old]:
                command[k] = HELD if elapsed < OVERLAP else RELEASE
        for k in OUTPUTS_OF[self.gear]:
            kept = k in OUTPUTS_OF[self.old]  # a clutch of both gears
            command[k] = HELD if kept else min(PLATEAU + SLOPE * max(0.0, elapsed - FILL), HELD)
        return command, elapsed < 1.5


def serve(client: ModbusTcpClient) -> None:
    """Until the rig goes, read a sample and write the answer to the one before with each request."""
    law, heartbeat, command, shifting, status = Law(), 0, [0.0] * OUTPUTS, False, 0
    while True:
        heartbeat = heartbeat % 65535 + 1
        written = [heartbeat, *(round(ma / 0.02) for ma in command), law.gear, int(shifting), 0, status]
        answer = client.readwrite_registers(read_address=0, read_count=READ, write_address=32, values=written)
        if answer.isError() or len(answer.registers) != READ:
            return
        sample, request = answer.registers[0] << 16 | answer.registers[1], answer.registers[2]
        status = 2 if request and not OUTPUTS_OF.get(request) else 0  # of a gear without an output: an error; the rig trips
        command, shifting = law.step(0.001 * sample, request) if status == 0 else ([0.0] * OUTPUTS, False)
        time.sleep(0.001)


def main() -> None:
    """Look for the rig, serve it, look for it again: the rig is a server for the time of one run."""
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # a rig that is not there yet is not reported
    while True:
        client = ModbusTcpClient("127.0.0.1", port=5020, timeout=0.5, retries=0)
        try:
            if client.connect():
                serve(client)
        except (ModbusException, OSError):
            pass  # the rig has gone
        finally:
            client.close()
        time.sleep(0.1)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
