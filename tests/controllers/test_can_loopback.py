# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The CAN bus over UDP multicast uses only this machine's loopback, and foreign packets end no program."""

import re
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import pytest
from can.io import mf4

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.can.loopback import LoopbackBus
from rig_nodes.controllers.examples.can_alfa46 import CanController

from .conftest import multicast_works

GROUP, PORT = "239.74.163.77", 43211
FOREIGN = [b"x", b"", b"\xff" * 50, b"\x07", b"\x81\xa1a\x01", b"\x85" + b"\xa4data" * 3, bytes(4096)]


@pytest.fixture(autouse=True)
def multicast():
    if why := multicast_works():
        pytest.skip(why)


def shout(port=PORT, group=GROUP):
    """Sends packets that are not frames to all programs on the bus."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for data in FOREIGN:
            stranger.sendto(data, (group, port))


def test_the_bus_is_on_loopback_and_on_no_other_network():
    bus = open_bus(GROUP, "udp_multicast", "test", port=PORT)
    try:
        listening = [line.split()[1] for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
        there = {address for address in listening if address.endswith(f":{PORT:04X}")}
        device, joined = "", set()
        for line in Path("/proc/net/igmp").read_text().splitlines()[1:]:
            if not line.startswith("\t"):
                device = line.split()[1]
            elif line.split()[0] == socket.inet_aton(GROUP)[::-1].hex().upper():
                joined.add(device)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"x", ("127.0.0.1", PORT))
        assert bus.recv(0.1) is None, "what is sent to the port of an address does not come in"
    finally:
        bus.shutdown()
    assert there == {f"{socket.inet_aton(GROUP)[::-1].hex().upper()}:{PORT:04X}"}, "bound to the group alone"
    assert joined == {"lo"}


@pytest.mark.parametrize("ending", ["asc", "blf", "log", "trc", "csv", "mf4"])
def test_a_log_of_the_bus_has_the_times_of_arrival_and_a_channel(ending, tmp_path):
    if ending == "mf4" and mf4.asammdf is None:
        pytest.skip("asammdf of the lock file does not run with numpy 1.26")
    sender, bus = (open_bus(GROUP, "udp_multicast", "test", port=PORT) for _ in range(2))
    began = time.time()
    try:
        with can.Logger(tmp_path / f"trace.{ending}") as log:
            arrived = []
            for number in range(3):
                sender.send(can.Message(arbitration_id=0x101, data=bytes([number]), is_extended_id=False))
                frame = bus.recv(5.0)
                log.on_message_received(frame)
                arrived.append(frame.timestamp)
                assert began <= frame.timestamp <= time.time() and frame.channel == 0
                assert bus.sender == sender._sender.getsockname()[1], "whoever needs it knows the program that has sent"
    finally:
        sender.shutdown()
        bus.shutdown()
    found = list(can.LogReader(tmp_path / f"trace.{ending}"))
    times = [one.timestamp for one in found]
    assert [one.data[0] for one in found] == [0, 1, 2] and arrived == sorted({*arrived})
    assert [one - times[0] for one in times] == pytest.approx([one - arrived[0] for one in arrived], abs=1.1e-3)
    assert {one.channel for one in found} <= {0, 1, "can0", None}, "candump names channels, and csv has none"


@pytest.mark.parametrize("channel", ["127.0.0.1", "ff15::1", "nowhere"])
def test_a_channel_that_is_no_group_is_refused(config, channel):
    with pytest.raises(RigError, match=f"the bus {channel} cannot be opened with the interface udp_multicast: ") as refusal:
        load_controller(f"can:{channel}?interface=udp_multicast", config)
    assert "\n" not in str(refusal.value)


def test_foreign_packets_are_counted_and_named_once(config):
    """The plug and the example controller continue their work on a bus on which another program sends such packets."""
    bus, stop, reports = open_bus(GROUP, "udp_multicast", "test", port=PORT), threading.Event(), []
    controller = CanController(bus, config)
    thread = threading.Thread(target=controller.run, args=(stop,), daemon=True)
    thread.start()
    plug = load_controller(f"can:{GROUP}?interface=udp_multicast&port={PORT}", config)
    plug.say = reports.append
    try:
        shout()
        plug.wait(10)
        shout()
        until, answered, sample = time.monotonic() + 60.0, 0, 0
        while answered < 50 and time.monotonic() < until:  # a busy machine answers fewer of them in time
            answered += plug.step(sample, [0.0] * 3, [0.0, 0.0, 0.0, 0.0]) is not None
            sample += 1
    finally:
        stop.set()
        thread.join()
        plug.close()
        bus.shutdown()
    assert answered == 50
    sentence = "what came could not be read (CanOperationError: a packet is no frame of python-can)"
    assert plug.ignored.counts == {sentence: 2 * len(FOREIGN)} and controller.ignored.counts == plug.ignored.counts
    assert [text for text in reports if "could not be read" in text] == [
        f"{plug.name}: {sentence}; it is not used, nor are others like it",
        f"{plug.name}: {2 * len(FOREIGN)} times in all something came that is not used: {sentence}",
    ]


def test_a_simulated_run_goes_on_while_a_stranger_sends_a_byte_to_its_port(tmp_path, config, capsys):
    """The byte is sent in each millisecond of the run, between the frames of rig and controller."""
    port, stop = 43212, threading.Event()
    bus = open_bus(GROUP, "udp_multicast", "test", port=port)
    controller = CanController(bus, config)
    sequence = tmp_path / "gear.yaml"
    sequence.write_text("description: gear I at rest\nsteps:\n  - oil: {pressure: 4 MPa}\n  - shift: {to: I, timeout: 3 s}\n")

    def ring():
        while not stop.wait(1e-3):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
                stranger.sendto(b"x", (GROUP, port))

    threads = [threading.Thread(target=work, daemon=True) for work in (lambda: controller.run(stop), ring)]
    for thread in threads:
        thread.start()
    try:
        spec = f"can:{GROUP}?interface=udp_multicast&port={port}&timeout=2"
        code = main(["simulate", str(sequence), "--controller", spec, "--out", str(tmp_path / "run")])
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        bus.shutdown()
    printed = capsys.readouterr().out
    sentence = "what came could not be read (CanOperationError: a packet is no frame of python-can)"
    assert code == 0 and "end: the sequence ended" in printed
    assert printed.count(f"{sentence}; it is not used, nor are others like it") == 1
    assert controller.ignored.counts[sentence] > 100, "and the controller on the same bus goes on too"


@pytest.mark.parametrize("program", ["example", "template"])
def test_foreign_packets_end_no_program(tmp_path, program):
    group = {"example": "239.74.163.78", "template": "239.74.163.79"}[program]
    if program == "example":
        command = ["-m", "rig_nodes.controllers.examples.can_alfa46", group, "--interface", "udp_multicast", "--rig", "hydmag"]
    else:
        assert main(["controller", "new", "can", str(tmp_path / "mine")]) == 0
        assert main(["export", "dbc", "-o", str(tmp_path / "mine" / "rig.dbc")]) == 0
        path = tmp_path / "mine" / "my_tcu.py"
        path.write_text(path.read_text().replace("239.74.163.2", group))
        command = [str(path)]
    ears = LoopbackBus(group)
    process = subprocess.Popen([sys.executable, *command], stderr=subprocess.PIPE, text=True)
    rung = threading.Event()

    def ring():
        while not rung.wait(0.05):  # repeated until the program listens
            shout(43113, group)

    thread = threading.Thread(target=ring, daemon=True)
    thread.start()
    try:
        line = process.stderr.readline()
        rung.set()
        thread.join()
        assert "a packet is no frame of python-can" in line
        plug_frames(ears)
        assert answer_of(ears), "it goes on answering"
        assert process.poll() is None
    finally:
        rung.set()
        process.terminate()
        rest = process.communicate()[1]
        ears.shutdown()
    assert "Traceback" not in line + rest


def plug_frames(bus):
    """Sends one sample as the rig sends it."""
    for number in (0x100, 0x101, 0x102):
        data = bytes([0, 1]).ljust(8, b"\0") if number == 0x100 else bytes(8)
        bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False, is_fd=False))


def answer_of(bus):
    """Returns the command that answers, or None when there is none within 60 s, as the first one may compile the law."""
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        try:
            frame = bus.recv(0.5)
        except can.CanOperationError:
            continue  # one of the foreign packets sent before
        if frame is not None and frame.arbitration_id == 0x201:
            return bytes(frame.data)
    return None


def test_a_second_program_on_the_bus_is_refused_and_named(config):
    """Two programs on one bus answer at once: the first one is the master, and the commands of the other one are not used."""
    first, second = (open_bus(GROUP, "udp_multicast", "test", port=PORT) for _ in range(2))
    plug, reports = load_controller(f"can:{GROUP}?interface=udp_multicast&port={PORT}", config), []
    plug.say = reports.append
    try:
        for sample in range(20):
            for bus, gear, command in ((first, 1, 10000), (second, 2, 40000)):
                state = struct.pack("<HBBBB", sample, gear, 0, 0, 0).ljust(8, b"\0")
                for number, data in ((0x200, state), (0x201, struct.pack("<4H", sample, command, 0, 0))):
                    bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False, is_fd=False))
            answer = plug.step(sample, [0.0] * 3, [0.0, 0.0, 0.0, 0.0])
            if sample:
                assert answer.command == pytest.approx((0.2, 0.0, 0.0)) and plug.gear == 1
    finally:
        plug.close()
        first.shutdown()
        second.shutdown()
    refusal, total = [text for text in reports if "refused" in text]
    assert re.search(r": \d+ times in all something came that is not used", total)
    assert "a command of the program on port" in refusal and "commands, until it leaves or has been silent for 1 s" in refusal
