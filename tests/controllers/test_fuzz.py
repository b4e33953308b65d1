# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Junk on the wires of a controller: UDP, CAN and Modbus keep serving, and only what is whole commands.

Every frame is a valid one with random changes, or random bytes; a campaign sends up to 100 000 of them.
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
TOLD = 500  # samples after which a campaign prints how far it is


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

    def __init__(self, spec, config, capsys):
        self.capsys = capsys
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
            if self.sample % TOLD == 0:
                with self.capsys.disabled():
                    print(f"\n{self.sample} samples, ended in order {len(self.ended)} times", end="", flush=True)
            self.longest = max(self.longest, time.monotonic() - began)


def checked(wire, count, taken):
    with wire.capsys.disabled():
        print(
            f"\n{count} frames: {taken} commands taken, ended in order {len(wire.ended)} times, longest step {wire.longest:.2f} s"
        )
    assert wire.longest < HANGS
    assert all("\n" not in text for text in wire.ended)


@pytest.fixture
def make(config, capsys):
    made = []

    def start(spec):
        made.append(Wire(spec, config, capsys))
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
    checked(wire, count, 0)


STATES, CURRENTS = (0x200, 65296), (0x201, 65297)  # of a controller, as plain frame and as group of J1939
STEP = 2e-5  # A for a count of a command
SAMPLES = 2  # different numbers of samples in junk, so that frames go together


class CanCommands:
    """What may be taken as a command of what was on the bus: a frame of commands, after one of the state for the same sample."""

    def __init__(self):
        self._gears, self.possible = {}, []

    def sees(self, frame):
        """Takes what the bus carries."""
        number = frame.arbitration_id
        kind = (number >> 8) & 0xFFFF if frame.is_extended_id else number
        if frame.is_remote_frame or len(frame.data) != 8 or frame.is_extended_id == (kind < 0x800):
            return
        sample, *raw = struct.unpack("<4H", frame.data)
        if kind in STATES:
            self._gears.setdefault(sample, set()).add(frame.data[2])
        elif kind in CURRENTS and sample in self._gears:
            self.possible.append((raw, self._gears[sample]))

    def holds(self, command, gear):
        """Returns whether an answer is one that came."""
        return any(
            gear in gears and all(abs(value - STEP * count) < 0.6 * STEP for value, count in zip(command, raw))
            for raw, gears in self.possible
        )


def junk_on_can(draw):
    """Returns a frame of a controller with random content, or a random frame of another node than the rig.

    The rig's own frames would end the run, as another rig's do.
    """
    numbers = [0x200, 0x201, 0x202, 0x0CFF1005, 0x0CFF1105, 0x18EAFF05, 0x18EEFF05, 0x18FECA05, 0x18EA0305]
    frame = draw.choice(numbers) if draw.random() < 0.7 else draw.randrange(1 << 21) << 8 | 5
    data = draw.randbytes(8 if draw.random() < 0.7 else draw.randrange(9))
    if draw.random() < 0.7:
        state = bytes([draw.randrange(4), draw.randrange(2), 0, 0, 0, 0])
        raw = state if frame in (0x200, 0x0CFF1005) else struct.pack("<3H", *(draw.randrange(40_000) for _ in range(3)))
        data = (struct.pack("<H", draw.randrange(SAMPLES)) + raw)[: len(data)]
    extended = frame > 0x7FF or draw.random() < 0.1
    remote = draw.random() < 0.05
    return can.Message(arbitration_id=frame, data=b"" if remote else data, is_extended_id=extended, is_remote_frame=remote)


@counts("can")
def test_junk_on_can_is_no_command_unless_it_is_whole(make, count):
    draw, bus, taken = random.Random(41), CanCommands(), 0
    wire = make("can:fuzz?interface=virtual")
    stranger = open_bus("fuzz", "virtual", "test")
    try:
        for number in range(count // AT_ONCE):
            bus.possible.clear()
            for _ in range(AT_ONCE):
                frame = junk_on_can(draw)
                bus.sees(frame)
                stranger.send(frame)
            answer = wire.step()
            if answer is not None:
                taken += 1
                assert 0 <= wire.plug.gear <= 3 and bus.holds(answer.command, wire.plug.gear), (number, answer)
            while stranger.recv(0.0) is not None:
                pass
    finally:
        stranger.shutdown()
    assert taken > count // 1000, "junk that is a whole command is one"
    checked(wire, count, taken)


READ = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 11)
COMMANDS = range(32, 40)  # addresses of a command's registers
TRIPS = 3  # requests of another client after which the server has served what came before them


def request_of(draw):
    """Returns a request that is served, each with another heartbeat where it commands."""
    beat = draw.randrange(1 << 16)
    return draw.choice(
        [
            READ,
            struct.pack(">HHHBBHH", 2, 0, 6, 1, 6, 32, beat),
            struct.pack(">HHHBBHHB4H", 3, 0, 15, 1, 16, 32, 4, 8, beat, 2, 3, 4),
            struct.pack(">HHHBBHHHHB2H", 4, 0, 15, 1, 23, 0, 4, 32, 2, 4, beat, 2),
        ]
    )


def writes(stream):
    """Returns whether what a client has sent holds a whole request of Modbus TCP that writes to a command's registers."""
    for at in range(len(stream) - 11):
        _, protocol, length, _, code, first, count = struct.unpack_from(">HHHBBHH", stream, at)
        end = at + 6 + length
        if protocol or code not in (6, 16, 23) or end > len(stream):
            continue
        if code == 23 and length >= 11:
            first, count = struct.unpack_from(">HH", stream, at + 12)
        if first in COMMANDS and (code == 6 or first + count - 1 in COMMANDS):
            return True
    return False


@counts("modbus")
def test_junk_on_modbus_keeps_the_server_serving_and_commands_only_where_it_is_a_whole_request(make, count):
    port, draw, sent, taken = free_port(), random.Random(41), 0, 0
    wire = make(f"modbus:{port}")

    def connect():
        return socket.create_connection(("127.0.0.1", port), timeout=HANGS)

    while sent < count:
        stream, ends = b"", len(wire.ended)
        with connect() as line, connect() as another:
            for _ in range(min(draw.choice((1, AT_ONCE)), count - sent)):
                frame = changed(request_of(draw), draw)
                try:
                    line.sendall(frame)
                except OSError:  # the server has closed it
                    break
                sent, stream = sent + 1, stream + frame
                for _ in range(TRIPS):
                    another.sendall(READ)
                    assert another.recv(31, socket.MSG_WAITALL)[7] == 3, "another client is served meanwhile"
                answer = wire.step()
                if len(wire.ended) > ends:  # it has begun anew, with another server
                    break
                if answer is not None:
                    taken += 1
                    assert writes(stream), (sent, stream.hex())
                    assert 0 <= wire.plug.gear <= 3 and all(0.0 <= value <= 65535 * STEP for value in answer.command)
    assert taken > count // 200, "junk that is a whole request is one"
    checked(wire, sent, taken)
