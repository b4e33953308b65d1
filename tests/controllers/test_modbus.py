# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's Modbus server, called by pymodbus and by raw bytes: the client that may write, refusals, and its timeout."""

import socket
import struct
import time

import can
import pymodbus.client
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.simulation import advance_with

from .test_free_running import free_port


class Server:
    """A plug that serves a free port, and clients of it."""

    def __init__(self, settings, options=""):
        self.port, self.reports, self._clients = free_port(), [], []
        self.plug = load_controller(f"modbus:{self.port}{options}", settings)
        self.plug.say = self.reports.append

    def client(self):
        client = pymodbus.client.ModbusTcpClient("127.0.0.1", port=self.port, timeout=5)
        assert client.connect()
        self._clients.append(client)
        return client

    def step(self, sample):
        return self.plug.step(sample, [0.0] * 3, [0.0, 0.0, 0.0, 0.0])

    def end(self):
        for client in self._clients:
            client.close()
        self.plug.close()


@pytest.fixture
def make(config):
    made = []

    def start(options=""):
        made.append(Server(config, options))
        return made[-1]

    yield start
    for one in made:
        one.end()


def command(heartbeat, current, gear):
    return [heartbeat, current, 0, 0, gear, 0, 0, 0]


def test_the_first_client_that_writes_is_the_master(make):
    """The second client may read; its writes, by each of the three functions, are refused, reported once, and change nothing."""
    server = make()
    watching, master = server.client(), server.client()
    assert watching.read_holding_registers(0, count=11).registers, "to read makes no master"
    assert watching.write_register(5, 1).exception_code == 2, "nor does what the map does not let be written"
    assert not master.write_registers(32, command(1, 10000, 1)).isError()
    assert server.step(0).command == pytest.approx((0.2, 0.0, 0.0))
    for answer in (
        watching.write_registers(32, command(7, 40000, 2)),
        watching.write_register(33, 40000),
        watching.readwrite_registers(read_address=0, read_count=11, write_address=32, values=command(8, 40000, 2)),
    ):
        assert answer.isError() and answer.exception_code == 6
    assert server.step(1) is None and server.plug.gear == 1, "no command has come"
    assert watching.read_input_registers(32, count=8).registers == command(1, 10000, 1)
    assert not master.write_register(32, 2).isError()
    assert server.step(2).command == pytest.approx((0.2, 0.0, 0.0)), "the registers still hold what the master wrote"
    (report,) = [text for text in server.reports if "a command of" in text]
    assert report.startswith(f"modbus:{server.port}: a command of the client 127.0.0.1:") and (
        "commands, until it leaves or has been silent for 1 s; it is not used, nor are others like it" in report
    )


def test_one_block_over_the_whole_map_is_read_and_what_is_not_in_it_is_not_written(make):
    server = make()
    server.plug.step(70000, [0.1, 0.2, 0.0], [100.0, 50.0, 1.0e6, 0.5e6])
    client = server.client()
    assert client.write_registers(32, command(1, 20000, 2)).isError() is False
    block = client.read_holding_registers(0, count=40).registers
    assert block == [1, 4464, 0, 1, 2000, 4000, 0, 9549, 4775, 500, 500, *[0] * 21, *command(1, 20000, 2)]
    for first, count in ((0, 12), (8, 32), (11, 21), (20, 5), (31, 2)):
        assert client.read_input_registers(first, count=count).registers == block[first : first + count]
    refused = (11, [7]), (31, [7]), (30, [7] * 10), (10, [7, 7]), (38, [0, 0, 0]), (40, [7])
    assert [client.write_registers(first, values).exception_code for first, values in refused] == [2] * 6
    assert client.read_holding_registers(0, count=41).exception_code == 2
    assert client.read_holding_registers(0, count=40).registers == block, "what was refused changed nothing"


def test_another_client_may_write_when_the_master_has_left(make):
    server = make()
    master, other = server.client(), server.client()
    assert not master.write_registers(32, command(1, 10000, 1)).isError()
    assert other.write_registers(32, command(2, 20000, 2)).exception_code == 6
    master.close()
    until = time.monotonic() + 5.0
    while other.write_registers(32, command(3, 20000, 2)).isError():  # until the server has noticed that the master has left
        assert time.monotonic() < until
    assert server.plug._mastered - time.monotonic() < 0.5, "well before the second of silence"
    assert server.step(0).command == pytest.approx((0.4, 0.0, 0.0)) and server.plug.gear == 2


def test_another_client_may_write_when_the_master_has_been_silent(make):
    server = make()
    master, other = server.client(), server.client()
    master.write_registers(32, command(1, 10000, 1))
    server.plug._mastered -= 0.9
    assert other.write_registers(32, command(2, 20000, 2)).exception_code == 6
    server.plug._mastered -= 0.2
    assert not other.write_registers(32, command(2, 20000, 2)).isError()
    assert master.write_registers(32, command(3, 10000, 1)).exception_code == 6, "it has lost its place"


def test_functions_that_the_page_does_not_name_are_refused(make):
    """Every other function code, with the body that the function has where it exists, is an illegal function.

    The connection remains open.
    """
    server = make()
    served = {
        3: struct.pack(">HH", 0, 1),
        4: struct.pack(">HH", 0, 1),
        6: struct.pack(">HH", 33, 0),
        16: struct.pack(">HHBH", 33, 1, 2, 0),
        23: struct.pack(">HHHHBH", 0, 1, 33, 1, 2, 0),
    }
    bodies = {
        1: struct.pack(">HH", 0, 1),
        2: struct.pack(">HH", 0, 1),
        5: struct.pack(">HH", 33, 0xFF00),
        8: struct.pack(">HH", 0, 1),
        15: struct.pack(">HHBB", 33, 1, 1, 1),
        22: struct.pack(">HHH", 33, 0, 1),
        24: struct.pack(">H", 0),
        43: bytes([14, 1, 0]),
        20: bytes([7, 6, 0, 1, 0, 0, 0, 1]),
        21: bytes([9, 6, 0, 1, 0, 0, 0, 1, 0, 0]),
    }
    found = {}
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as line:
        for code in (*served, *(code for code in range(1, 128) if code not in served)):
            pdu = bytes([code]) + served.get(code, bodies.get(code, b""))
            line.sendall(struct.pack(">HHHB", code, 0, len(pdu) + 1, 1) + pdu)
            number, _, length, _ = struct.unpack(">HHHB", line.recv(7, socket.MSG_WAITALL))
            answer = line.recv(length - 1, socket.MSG_WAITALL)
            assert number == code
            found[code] = answer[0] if answer[0] == code else tuple(answer)
    assert {code for code, answer in found.items() if answer == code} == set(served)
    assert {code: answer for code, answer in found.items() if code not in served} == {
        code: (code | 0x80, 1) for code in range(1, 128) if code not in served
    }


def test_requests_that_are_refused_and_junk_are_counted(make):
    server = make()
    server.step(0)
    with socket.create_connection(("127.0.0.1", server.port), timeout=5) as line:
        for pdu in (bytes([5, 0, 33, 255, 0]), bytes([99]), bytes([6, 0, 5, 0, 1])):  # a coil, no function, an input register
            line.sendall(struct.pack(">HHHB", 7, 0, len(pdu) + 1, 1) + pdu)
            assert line.recv(9, socket.MSG_WAITALL)[7] == pdu[0] | 0x80
        line.sendall(b"GET / HTTP/1.1\r\n\r\n")
        time.sleep(0.1)
        line.sendall(struct.pack(">HHHBBHH", 7, 0, 6, 1, 3, 0, 1))
        assert line.recv(11, socket.MSG_WAITALL)[7] == 3, "the connection serves again after the junk"
    server.step(1)
    assert server.plug.ignored.counts == {
        "a request with function code 5 is refused with exception 1": 1,
        "a request with function code 99 is refused with exception 1": 1,
        "a request with function code 6 is refused with exception 2": 1,
        "what came is no frame of Modbus TCP": 1,
    }
    assert any("function code 5 is refused" in text for text in server.reports)


@pytest.mark.parametrize("unit", [0, 1, 17, 247, 255])
def test_any_unit_id_is_the_rig(make, unit):
    server = make()
    server.step(7)
    assert server.client().read_holding_registers(1, count=3, device_id=unit).registers == [7, 0, 1]


# ---- a slow controller


def on_can(settings, _port):
    bus = open_bus("slow", "virtual", "test")
    plug = load_controller("can:slow?interface=virtual&timeout=0.3", settings)
    for number, data in ((0x200, bytes([0, 0, 1, 0, 0, 0, 0, 0])), (0x201, struct.pack("<4H", 0, 10000, 0, 0))):
        bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False, is_fd=False))
    return plug, bus.shutdown


def on_modbus(settings, port):
    plug = load_controller(f"modbus:{port}?timeout=0.3", settings)
    client = pymodbus.client.ModbusTcpClient("127.0.0.1", port=port, timeout=5)
    assert client.connect() and not client.write_registers(32, command(1, 10000, 1)).isError()
    return plug, client.close


@pytest.mark.parametrize("made", [on_can, on_modbus])
def test_a_slow_controller_is_waited_for_as_long_as_it_was_told(config, made):
    """One command arrives at the first sample and none after it: with timeout=0.3 the rig holds it and trips at 300 ms."""
    plug, end = made(config, free_port())
    plug.reports = []
    plug.say = plug.reports.append
    rig = Rig(config, controller="external", level="current")
    try:
        while rig.status != RigStatus.TRIPPED and rig.sample < 1000:
            advance_with(rig, plug)
    finally:
        plug.close()
        end()
    assert "older than 100 ms" in rig.reason and 300 <= rig.sample <= 303
    assert rig.measurement("I_zr_p1") > 0.1, "the valve was driven until then"
    assert any("for 150 ms; the rig trips at 300 ms" in text for text in plug.reports)


@pytest.mark.parametrize("spec", ["modbus:{port}?timeout={value}", "can:x?interface=virtual&timeout={value}"])
@pytest.mark.parametrize("value", ["0.05", "11", "soon", "nan", ""])
def test_a_timeout_that_is_none_is_refused(config, spec, value):
    with pytest.raises(RigError, match=rf"option timeout is '{value}', expected 0.1 to 10$"):
        load_controller(spec.format(port=free_port(), value=value), config)
