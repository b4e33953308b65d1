# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Junk on the wires of a controller: UDP, CAN and Modbus keep serving, and nothing of it commands; a campaign sends 100 000 frames.

Every frame is a valid one with random changes, or random bytes.
"""

import random
import socket
import struct
import threading
import time

import can
import pytest

from rig_nodes.controllers import ControllerFailed, ControllerOutputs, load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.udp import frames

from .test_free_running import free_port

HANGS = 5.0  # s for a step
AT_ONCE = 20  # frames between two samples


def changed(data, draw):
    """Returns bytes with some random changes."""
    data = bytearray(data)
    for _ in range(draw.randint(1, 3)):
        how, place = draw.randrange(5), draw.randrange(len(data) + 1)
        if how < 2 and place < len(data):
            data[place] = draw.randrange(256)
        elif how == 2:
            del data[place:]
        elif how == 3:
            data[place:place] = draw.randbytes(draw.choice((1, 8, 2000)))
        else:
            data = bytearray(draw.randbytes(draw.randrange(1, 300)))
    return bytes(data)


class Wire:
    """A plug under junk. Junk that happens to be a command which no valve can be given ends it in order; it then begins anew."""

    def __init__(self, spec, config):
        self._spec, self._config, self.longest, self.sample, self.ended = spec, config, 0.0, 0, []
        self.begin()

    def begin(self):
        self.plug = load_controller(self._spec, self._config)
        self.plug.say = lambda text: None
        self.plug.pace(0.002)

    def step(self):
        """Gives the plug a sample; returns what it takes as an answer, None for nothing."""
        began = time.monotonic()
        try:
            return self.plug.step(self.sample, [0.0] * 3, [0.0] * 4)
        except ControllerFailed as failure:
            assert "could not get its answer" not in str(failure), failure  # a fault that the plug did not foresee
            self.ended.append(str(failure))
            self.plug.close()
            self.begin()
            return None
        finally:
            self.sample += 1
            self.longest = max(self.longest, time.monotonic() - began)


def checked(wire, count):
    print(f"{count} frames: ended in order {len(wire.ended)} times, longest step {wire.longest:.2f} s")
    assert wire.longest < HANGS
    assert all("\n" not in text for text in wire.ended)


@pytest.fixture
def make(config):
    made = []

    def start(spec):
        made.append(Wire(spec, config))
        return made[-1]

    yield start
    for one in made:
        one.plug.close()


COUNTS = {"udp": (2_000, 100_000), "can": (2_000, 20_000), "modbus": (300, 20_000)}


def counts(kind):
    few, many = COUNTS[kind]
    return pytest.mark.parametrize("count", [few, pytest.param(many, marks=pytest.mark.campaign)])


class Steady:
    """A controller that gives 0.5 on the first output."""

    def initialize(self, info):
        pass

    def step(self, inputs):
        return ControllerOutputs([0.5, 0.0, 0.0])

    def terminate(self):
        pass


@counts("udp")
def test_junk_on_udp_is_no_command_and_keeps_no_controller_from_its_own(make, count):
    port, draw = free_port(), random.Random(41)
    wire = make(f"udp:{port}")
    client = frames.Client(Steady(), "127.0.0.1", port)
    thread = threading.Thread(target=client.serve, kwargs={"once": True}, daemon=True)
    thread.start()
    wire.plug.wait(10.0)
    wire.plug.pace(2.0)
    valid = [
        frames.pack(frames.HELLO, 0, 0, 3, 0, ""),
        frames.pack(frames.READY, 0, 1, 0, 0),
        frames.pack(frames.ASK, 0, 2, 0, 0),
        frames.pack(frames.ANSWER, 0, 3, 0, 1, 0, 0, "", more=[0.25] * 6),
        frames.pack(frames.OWN, 0, 4, 0, frames.WANT, 0.0, "p1", ""),
        frames.pack(frames.BYE, 0, 5, "end"),
    ]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for _ in range(count // AT_ONCE):
            for _ in range(AT_ONCE):
                stranger.sendto(changed(draw.choice(valid), draw), ("127.0.0.1", port))
            assert wire.step().command[0] == 0.5
    wire.plug.close()
    thread.join(10.0)
    assert not wire.ended
    checked(wire, count)


@counts("can")
def test_junk_on_can_is_no_command(make, count):
    draw = random.Random(41)
    wire = make("can:fuzz?interface=virtual")
    # those of a controller, and groups of another node than the rig, whose own frames would end the run as another rig's do
    numbers = [0x200, 0x201, 0x202, 0x0CFF1005, 0x0CFF1105, 0x18EAFF05, 0x18EEFF05, 0x18FECA05, 0x18EA0305]
    stranger = open_bus("fuzz", "virtual", "test")
    try:
        for number in range(count // AT_ONCE):
            for _ in range(AT_ONCE):
                frame = draw.choice(numbers) if draw.random() < 0.7 else draw.randrange(1 << 21) << 8 | 5
                data = draw.randbytes(draw.randrange(9))
                extended = frame > 0x7FF or draw.random() < 0.1
                remote = draw.random() < 0.05
                stranger.send(
                    can.Message(arbitration_id=frame, data=b"" if remote else data, is_extended_id=extended, is_remote_frame=remote)
                )
            answer = wire.step()
            assert answer is None or 0 <= wire.plug.gear <= 3, (number, answer)
            while stranger.recv(0.0) is not None:
                pass
    finally:
        stranger.shutdown()
    checked(wire, count)


@counts("modbus")
def test_junk_on_modbus_keeps_the_server_serving(make, count):
    port, draw = free_port(), random.Random(41)
    wire = make(f"modbus:{port}")
    valid = [
        struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 11),
        struct.pack(">HHHBBHH", 2, 0, 6, 1, 6, 32, 1),
        struct.pack(">HHHBBHHB4H", 3, 0, 15, 1, 16, 32, 4, 8, 1, 2, 3, 4),
        struct.pack(">HHHBBHHHHB", 4, 0, 11, 1, 23, 0, 4, 32, 0, 0),
    ]
    for _ in range(count // AT_ONCE):
        with socket.create_connection(("127.0.0.1", port), timeout=5) as line:
            line.settimeout(0.001)
            for _ in range(AT_ONCE):
                try:
                    line.sendall(changed(draw.choice(valid), draw))
                    line.recv(4096)
                except TimeoutError:
                    pass
                except OSError:  # the server has closed it
                    break
        wire.step()
    with socket.create_connection(("127.0.0.1", port), timeout=5) as line:
        line.sendall(valid[0])
        assert line.recv(31, socket.MSG_WAITALL)[7] == 3, "it serves again after the junk"
    checked(wire, count)
