"""A shift controller on a CAN bus: a small law to replace by yours (docs/can.md of the rig)."""

import time
from pathlib import Path

import can
import cantools

database = cantools.database.load_file(Path(__file__).with_name("rig.dbc"))
bus = can.Bus(channel="239.74.163.2", interface="udp_multicast", hop_limit=0, fd=False)
request = database.get_message_by_name("RIG_REQUEST")
currents = database.get_message_by_name("RIG_CURRENTS")
gear = old = wanted = 0
since = -10.0  # no shift is running


def send(name, values):
    message = database.get_message_by_name(name)
    bus.send(can.Message(arbitration_id=message.frame_id, data=message.encode(values), is_extended_id=False, is_fd=False))


while True:
    frame = bus.recv()
    if frame.arbitration_id == request.frame_id:
        wanted = request.decode(frame.data, decode_choices=False)["gear_request"]
    if frame.arbitration_id != currents.frame_id:
        continue
    sample = currents.decode(frame.data)["sample"]
    if wanted != gear:
        old, gear, since = gear, wanted, time.monotonic()
    elapsed = time.monotonic() - since
    command = [0.0, 0.0, 0.0]
    if old and elapsed < 0.30:
        command[old - 1] = 300.0  # mA: the old clutch holds while the new one fills
    if gear:
        command[gear - 1] = min(180.0 + 400.0 * elapsed, 740.0)
    send("CONTROL_STATE", {"sample": sample, "gear": gear, "shifting": int(elapsed < 1.5), "flags": 0, "status": 0})
    send("CONTROL_COMMAND_CURRENT", {"sample": sample, "command_1": command[0], "command_2": command[1],
                                     "command_3": command[2]})
