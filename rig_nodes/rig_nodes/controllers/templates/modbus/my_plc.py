"""A shift controller as a Modbus TCP client: a small law to replace by yours (docs/modbus.md of the rig)."""

import logging
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # that the rig is not there yet is no news
client = ModbusTcpClient("127.0.0.1", port=5020, timeout=1)
while not client.connect():
    time.sleep(0.2)
gear = old = heartbeat = 0
since = -10.0  # no shift is running
command = [0.0, 0.0, 0.0]
while True:
    heartbeat = heartbeat % 65535 + 1
    elapsed = time.monotonic() - since
    written = [heartbeat, *(round(ma / 0.02) for ma in command), gear, int(elapsed < 1.5), 0, 0]
    try:
        answer = client.readwrite_registers(read_address=0, read_count=11, write_address=32, values=written)
    except ModbusException:
        raise SystemExit("the rig has gone")
    request = answer.registers[2]
    if request != gear:
        old, gear, since = gear, request, time.monotonic()
    elapsed = time.monotonic() - since
    command = [0.0, 0.0, 0.0]
    if old and elapsed < 0.30:
        command[old - 1] = 300.0  # mA: the old clutch holds while the new one fills
    if gear:
        command[gear - 1] = min(180.0 + 400.0 * elapsed, 740.0)
    time.sleep(0.001)
