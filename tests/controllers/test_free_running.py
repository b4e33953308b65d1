# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controllers for which the rig does not wait, on CAN, Modbus TCP and ROS topics: how they and their faults affect a shift."""

import csv
import io
import itertools
import re
import socket
import struct
import threading
import time
from pathlib import Path

import can
import cantools
import numpy as np
import pymodbus.client
import pytest

from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import ControllerOutputs, load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.can.database import dbc_text
from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.examples.can_alfa46 import CanController
from rig_nodes.controllers.examples.modbus_alfa46 import ModbusController
from rig_nodes.controllers.modbus.registers import csv_text, register_map
from rig_nodes.controllers.record import record_of
from rig_nodes.controllers.wire import measured
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import conformance
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import advance_with, ask_controller, give_answer, simulate

from .conftest import MULTICAST, multicast_works

DOCS = Path(__file__).parents[2] / "docs" / "how_to"
RPM = 0.10471975511965977


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Example:
    """The example controller in a thread of its own; ``end`` stops it."""

    def __init__(self, kind, settings, place=None):
        self.stop, self.bus = threading.Event(), None
        if kind == "modbus":
            port = self.place = place or free_port()
            self.spec, controller = f"modbus:{port}", ModbusController(port, settings)
        else:
            # a bus of this kind is shared within the process or the machine, so each test uses one of its own
            channel = self.place = place or (MULTICAST if kind == "udp_multicast" else f"bus{id(self)}")
            port = {"port": 43201} if kind == "udp_multicast" else {}
            self.bus = open_bus(channel, kind, "example", **port)
            more = "&port=43201" if port else ""
            self.spec, controller = f"can:{channel}?interface={kind}{more}", CanController(self.bus, settings)
        self.thread = threading.Thread(target=controller.run, args=(self.stop,), daemon=True)
        self.thread.start()

    def end(self):
        self.stop.set()
        self.thread.join(5)
        if self.bus is not None:
            self.bus.shutdown()


@pytest.fixture
def example(config):
    """Starts the example controller of a kind; it is ended with the test."""
    made = []

    def start(kind, place=None):
        made.append(Example(kind, config, place))
        return made[-1]

    yield start
    for one in made:
        one.end()


def here(spec, settings, level=None):
    """Returns the plug after its controller's first answer; ``said`` collects its sentences for people."""
    plug = load_controller(spec, settings, level)
    plug.reports = []
    plug.say = plug.reports.append
    plug.wait(10)
    return plug


# ---- effects of the delay


class Delayed(Alfa46):
    """The Alfa46 law in lockstep with delayed setpoints, each output by its own number of samples."""

    levels, delays = ("current",), (0, 0)

    def initialize(self, info):
        super().initialize(info)
        self.late = [[(0.0, 0)] * delay for delay in (*self.delays, 0)]

    def step(self, inputs):
        out = super().step(inputs)
        now = []
        for k, queue in enumerate(self.late):
            queue.append((out.command[k], out.flags & 1 << k))
            now.append(queue.pop(0))
        return ControllerOutputs([c for c, _ in now], None, out.gear, out.shifting, sum(flag for _, flag in now))


LATEST = 60  # samples without a command in a shift; with more of them the machine is too busy for this test


def leaves(value, *keys):
    """Yields (keys, value) of all values in nested dicts."""
    if not isinstance(value, dict):
        yield keys, value
        return
    for key, inner in value.items():
        yield from leaves(inner, *keys, key)


def run_with(config, folder, plug):
    """Returns (shift of the sample sequence, the longest time in it between two commands [samples])."""
    run = simulate(config, load_sequence("sample"), folder, controller=plug)
    assert run["end"]["state"] == "ended", run["end"]["reason"]
    bag = Bag(folder)
    (shift,) = build_report(bag, run)["shifts"]
    t = bag.series("I_set_zr_p1")[0]
    return shift, round(1e3 * np.diff(t[(t > shift["t_order_s"] - 0.1) & (t < shift["t_order_s"] + 1.0)]).max())


@pytest.fixture(scope="module")
def exact():
    """A rig that shows true values, so that no noise makes two runs cross a threshold at different times."""
    return load_rig("hydmag", {"effects.transducers": "off"})


@pytest.fixture(scope="module")
def late(exact, tmp_path_factory):
    """Returns the shift of the sample sequence in lockstep with the outputs' setpoints late by some samples."""
    known = {}

    def get(*delays):
        if delays not in known:
            globals()["Late"] = type("Late", (Delayed,), {"delays": delays})
            plug = load_controller(f"python:{__name__}:Late@in-process", exact)
            known[delays], gap = run_with(exact, tmp_path_factory.mktemp("late"), plug)
            assert gap == 1
        return known[delays]

    return get


@pytest.mark.against_the_clock
@pytest.mark.parametrize("kind", [pytest.param("virtual", marks=pytest.mark.campaign), "udp_multicast", "modbus", "ros"])
def test_every_metric_is_as_the_stated_delay_makes_it(exact, example, late, tmp_path, request, kind):
    """The delay is as docs/how_to/fieldbus.md states it.

    It is one sample more than in lockstep, and more where the machine is busy, separately for each valve. The allowed range of
    every metric is its range in lockstep with setpoints of these delays.
    """
    if kind == "udp_multicast" and (why := multicast_works()):
        pytest.skip(why)
    if kind == "ros":
        request.getfixturevalue("ros_program")("free")
    spec = "ros:free?timing=free" if kind == "ros" else example(kind).spec
    for attempt in range(3):
        began = time.monotonic()
        found, gap = run_with(exact, tmp_path / f"run{attempt}", here(spec, exact))
        assert time.monotonic() - began > 2.5, "2.586 s of the sequence take as long"
        if gap <= LATEST:
            break
    else:
        pytest.skip(f"this machine is too busy to keep real time: {gap} ms between two commands")
    gap += -gap % 10  # rounded up, so that the kinds share their runs in lockstep
    corners = [late(1 + one, 1 + other) for one in (0, gap) for other in (0, gap)]
    corners = [dict(leaves(corner)) for corner in corners]
    for key, value in leaves(found):
        if key[0] in ("peak", "torques"):
            continue  # parts of the extremes, at one instant of a swing; the extremes are among the others
        if not isinstance(value, float):
            assert value == corners[0][key], key
            continue
        among = [corner[key] for corner in corners]
        slack = 0.02 * abs(among[0]) + (1e-3 if key[-1].endswith("_s") else 0.0)  # held setpoints turn ramps into steps
        assert min(among) - slack <= value <= max(among) + slack, (key, value, among)


def test_each_sample_of_delay_lets_the_clutch_close_a_millisecond_later(late):
    """The documentation predicts this."""
    later = [late(delay, delay)["t_c_s"] - late(0, 0)["t_c_s"] for delay in (1, 6)]
    assert later == pytest.approx([1e-3, 6e-3], abs=0.6e-3)


@pytest.mark.against_the_clock
@pytest.mark.parametrize("kind", ["virtual", "modbus"])
def test_either_level_and_either_gear(config, example, kind):
    """At level duty the current loop is closed over the bus; the coil's current still approaches its setpoint."""
    plug = here(example(kind).spec, config, "duty")
    rig = Rig(config, controller="external", level="duty")
    rig.set("oil", 4e6, True)
    plug.order(2)
    for _ in range(1000):
        advance_with(rig, plug)
    plug.close()
    assert (plug.gear, plug.shifting, rig.status) == (2, False, RigStatus.READY)
    assert rig.measurement("I_zr_p2") == pytest.approx(0.74, abs=0.08)


@pytest.mark.against_the_clock
@pytest.mark.parametrize("kind", ["virtual", "modbus"])
def test_what_cannot_be_asked_of_a_clock_of_its_own_says_why(config, example, monkeypatch, kind):
    monkeypatch.setattr(conformance, "DESK_SAMPLES", 300)  # fewer, because these items run in real time
    items = list(itertools.islice(conformance.Check(example(kind).spec, config).items(), 6))
    assert [(item.name, item.ok) for item in items] == [
        ("loads", True),
        ("answers", True),
        ("at rest", True),
        ("timing", None),
        ("determinism", None),
        ("restart", None),
    ]
    assert all(item.text.startswith("does not apply: ") and len(item.text) < 140 for item in items[3:])


# ---- silence and faults


@pytest.mark.against_the_clock
@pytest.mark.parametrize("kind", ["virtual", "modbus"])
def test_of_a_controller_that_disappears_nothing_is_held_after_100_ms(config, example, kind):
    controller = example(kind)
    plug = here(controller.spec, config)
    rig = Rig(config, controller="external", level="current")
    plug.order(1)
    for _ in range(600):
        advance_with(rig, plug)
    assert rig.measurement("I_zr_p1") > 0.2 and rig.status == RigStatus.READY
    controller.end()
    gone, sample = time.monotonic(), rig.sample
    while rig.status != RigStatus.TRIPPED and rig.sample < sample + 1000:
        advance_with(rig, plug)
    assert time.monotonic() - gone < 0.3, "100 ms, and what a busy machine takes"
    assert rig.sample - sample <= 103 and "older than 100 ms" in rig.reason
    lines = "\n".join(plug.reports)
    assert re.search(r"^(can|modbus):.*: no command on .* for 50 ms; the rig trips at 100 ms$", lines, re.M)
    for _ in range(200):
        advance_with(rig, plug)
    assert rig.measurement("I_zr_p1") < 0.005
    # another controller may take its place
    example(kind, controller.place)
    rig.reset()
    plug.force_neutral()
    for _ in range(2000):  # as on the graph, where nothing trips before the first command
        sample, answer = rig.sample, ask_controller(rig, plug)
        rig.advance_samples(1)
        if answer is not None:
            give_answer(rig, plug, sample, answer)
        if rig.status == RigStatus.READY:
            break
    assert rig.status == RigStatus.READY
    plug.close()


@pytest.mark.parametrize("spec", ["can:nobody?interface=virtual", "modbus:{port}"])
def test_waiting_is_visible_and_ends(config, spec):
    plug, reports = load_controller(spec.format(port=free_port()), config), []
    plug.say = reports.append
    with pytest.raises(RigError, match="no command came on .* within 1.2 s$") as refusal:
        plug.wait(1.2)
    assert refusal.value.exit_code == 2
    assert [re.sub("on .*,", "on it,", text) for text in reports] == ["waiting for controller on it, 1 s"]


def test_a_virtual_bus_says_at_once_that_nobody_outside_can_join(config):
    plug, reports = load_controller("can:nobody?interface=virtual", config), []
    plug.say = reports.append
    plug.pace(5.0)
    plug.close()
    (report,) = reports
    assert report.startswith("CAN virtual nobody is a bus inside the rig's process: no other program can join it")


@pytest.mark.against_the_clock
def test_frames_of_wrong_length_are_counted_and_said_and_never_used(config):
    stop, reports = threading.Event(), []
    bus = open_bus("short", "virtual", "test")

    def shout():
        while not stop.wait(0.005):
            for number, size in ((0x200, 8), (0x201, 6), (0x201, 0)):
                bus.send(can.Message(arbitration_id=number, data=bytes(size), is_extended_id=False))

    thread = threading.Thread(target=shout, daemon=True)
    thread.start()
    plug = load_controller("can:short?interface=virtual", config)
    plug.say = reports.append
    try:
        with pytest.raises(
            RigError,
            match=r"no command came .*; not used: frame CONTROL_COMMAND_CURRENT \(0x201\) "
            r"came with 6 bytes instead of 8 \(\d\d+ times\), "
            r"frame .* 0 bytes instead of 8 \(\d\d+ ",
        ):
            plug.wait(0.3)
    finally:
        stop.set()
        thread.join()
        bus.shutdown()
    assert sum("came with 6 bytes instead of 8; it is not used, nor are others like it" in text for text in reports) == 1


@pytest.mark.against_the_clock
@pytest.mark.parametrize(
    ("state", "command", "sentence"),
    [
        ((0, 1, 0, 0, 2), (0, 0, 0), "status error: the controller reports it on the bus"),
        ((0, 1, 0, 0, 3), (0, 0, 0), "status fatal: the controller reports it on the bus"),
        ((0, 1, 0, 0, 0), (0, 41000, 0), r"command\[1\] is 0.82, expected 0 to 0.8 A"),
        ((0, 7, 0, 0, 0), (0, 0, 0), "gear is 7, expected 0"),
    ],
)
def test_what_the_bus_says_is_checked_like_any_answer(config, state, command, sentence):
    stop = threading.Event()
    bus = open_bus("spoken", "virtual", "test")

    def speak():
        while not stop.wait(0.001):
            data = struct.pack("<HBBBB", *state).ljust(8, b"\0"), struct.pack("<H3H", 0, *command)
            for number, content in zip((0x200, 0x201), data):
                bus.send(can.Message(arbitration_id=number, data=content, is_extended_id=False))

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    plug = here("can:spoken?interface=virtual", config)
    rig = Rig(config, controller="external", level="current")
    try:
        while rig.status != RigStatus.TRIPPED and rig.sample < 500:
            advance_with(rig, plug)
    finally:
        stop.set()
        thread.join()
        bus.shutdown()
        plug.close()
    assert re.search(sentence, rig.reason)


@pytest.mark.parametrize(
    ("last", "next_one", "anew"),
    [(700, 0, True), (40_000, 0, True), (0, 12_345, True), (40_000, 40_020, False), (65_535, 0, False)],
)
def test_a_counter_that_jumps_back_begins_the_law_anew(config, last, next_one, anew):
    """A run that ends at 40 s is tested too: there the counter of 16 bits is half a cycle away from 0 in both directions."""
    bus = open_bus("jumps", "virtual", "test")
    controller, laws = CanController(bus, config), []
    names = ("n_wej", "n_wyj", "p1", "p2", "current_1", "current_2", "current_3", "gear_request")
    try:
        for sample in (last, next_one):
            controller.newest = {"sample": sample, "level": 1} | dict.fromkeys(names, 0)
            controller.answer()
            laws.append(controller.law)
    finally:
        bus.shutdown()
    assert (laws[0] is not laws[1]) == anew


@pytest.mark.against_the_clock
def test_two_controllers_on_one_bus_trip_the_rig(config, example):
    """A second program that was left running, always in neutral, answers beside the Alfa46; the answers must not be mixed."""
    stop, controller = threading.Event(), example("virtual")
    bus = open_bus(controller.place, "virtual", "forgotten")

    def answer():
        while not stop.is_set():
            if (frame := bus.recv(0.05)) and frame.arbitration_id == 0x102:
                for number in (0x200, 0x201):
                    bus.send(can.Message(arbitration_id=number, data=bytes(frame.data[:2]) + bytes(6), is_extended_id=False))

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    plug = here(controller.spec, config)
    rig = Rig(config, controller="external", level="current")
    try:
        for _ in range(200):
            advance_with(rig, plug)
        assert rig.status == RigStatus.READY, "as long as they agree there is nothing to tell them apart by"
        plug.order(1)
        while rig.status != RigStatus.TRIPPED and rig.sample < 700:
            advance_with(rig, plug)
    finally:
        stop.set()
        thread.join()
        bus.shutdown()
        plug.close()
    why = rf"another controller is at work on CAN virtual {controller.place}"
    assert re.fullmatch(
        rf"controller {re.escape(controller.spec)}, sample \d+: {why}: sample \d+ and others got "
        "two different answers; end one of the two controllers",
        rig.reason,
    )


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        ("can:x?interface=virtual&speed=3", "unknown option 'speed'; known are interface, bitrate"),
        ("modbus:5020?wait=3", "unknown option 'wait'; known are host"),
        ("can:x?interface=virtual&every=0", "option every is '0', expected 1 to 50"),
        ("can:x?interface=telepathy", "cannot be opened with the interface telepathy"),
        ("can:no_such_net?interface=socketcan", "the bus no_such_net cannot be opened with the interface socketcan: "),
        ("modbus:plc", "'plc' is no port; expected modbus:PORT"),
        ("modbus:70000", "is no port"),
    ],
)
def test_specifications_that_do_not_fit_are_refused(config, spec, sentence):
    with pytest.raises(RigError, match=sentence) as refusal:
        load_controller(spec, config)
    assert "\n" not in str(refusal.value)


def test_a_port_that_is_taken_is_said(config):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(RigError, match=f"no server on 127.0.0.1:{other.getsockname()[1]}: "):
            load_controller(f"modbus:{other.getsockname()[1]}", config)


# ---- messages on the wires


def test_the_bus_carries_j1939_by_the_standards_scaling(config):
    """By hand: 1500 rpm are 12000 x 0.125 rpm, 1000 rpm are 8000; gear I with ratio 47/34: slip 7.84 % = 20 x 0.4 %."""
    listener, bus = (can.Bus(channel="j1939", interface="virtual") for _ in range(2))
    plug = load_controller("can:j1939?interface=virtual", config)
    state = bytes([0, 0, 1, 1, 0, 0, 0, 0])  # gear 1, shifting
    for _ in range(2):
        for number, data in ((0x200, state), (0x201, bytes(8))):
            bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))
    plug.wait(5)
    for number, data in ((0x200, state), (0x201, bytes(8))):
        bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))
    plug.order(1)
    for sample in (99, 100):
        plug.step(sample, [0.1, 0.0, 0.0], [1500 * RPM, 1000 * RPM, 1e6, 0.0])
    frames = {}
    while frame := listener.recv(0.0):
        frames[frame.arbitration_id] = frame
    etc1, etc2 = (bytes(frames[number].data) for number in (0x0CF00203, 0x18F00503))
    assert [frames[n].is_extended_id for n in (0x0CF00203, 0x100)] == [True, False]
    assert etc1[0] & 0b110011 == 0b010000, "SPN 560 not engaged, SPN 574 shift in process"
    assert (etc1[1:3], etc1[3], etc1[5:7]) == (bytes([0x40, 0x1F]), 20, bytes([0xE0, 0x2E]))
    assert etc1[4] == etc1[7] == 0xFF, "what the rig does not know is not available"
    assert (etc2[0], etc2[1:3], etc2[3]) == (126, (1500).to_bytes(2, "little"), 125), "S1 slips: still neutral"
    assert struct.unpack("<4h", frames[0x101].data) == (15000, 10000, 500, 0)
    assert struct.unpack("<H3h", frames[0x102].data) == (100, 2000, 0, 0)
    plug.close()
    listener.shutdown()
    bus.shutdown()


@pytest.mark.parametrize(
    ("value", "raw"),
    [(1500 * RPM, 15000), (-0.26 * RPM, -3), (1e9, 32767), (-1e9, -32767), (float("nan"), -32768), (float("inf"), 32767)],
)
def test_a_measurement_is_the_nearest_number_of_the_wire(config, value, raw):
    n_wej = next(wire for wire in measured(record_of(config)) if wire.name == "n_wej")
    assert n_wej.encode(value) == raw
    if abs(raw) < 32767:
        assert n_wej.decode(raw) == pytest.approx(value, abs=0.05 * RPM)


def test_what_is_no_number_reaches_the_bus_as_such(config):
    bus = open_bus("nan", "virtual", "test")
    plug = load_controller("can:nan?interface=virtual", config)
    plug.gear = 1
    plug.step(0, [0.0] * 3, [float("nan"), float("inf"), 0.0, 0.0])
    frames = {}
    while frame := bus.recv(0.0):
        frames[frame.arbitration_id] = bytes(frame.data)
    assert struct.unpack("<2h", frames[0x101][:4]) == (-32768, 32767)
    assert frames[0x0CF00203][1:3] == frames[0x0CF00203][5:7] == b"\x00\xfe", "J1939's error"
    plug.close()
    bus.shutdown()


def test_the_dbc_is_what_the_plug_speaks(config, tmp_path):
    assert main(["export", "dbc", "-o", str(tmp_path / "rig.dbc")]) == 0
    read = cantools.database.load_file(tmp_path / "rig.dbc")
    assert (tmp_path / "rig.dbc").read_bytes().decode() == dbc_text(record_of(config))
    assert {m.name: m.frame_id for m in read.messages} == {
        "RIG_REQUEST": 0x100,
        "RIG_MEASURED": 0x101,
        "RIG_CURRENTS": 0x102,
        "CONTROL_STATE": 0x200,
        "CONTROL_COMMAND_CURRENT": 0x201,
        "CONTROL_COMMAND_DUTY": 0x202,
        "ETC1": 0x0CF00203,
        "ETC2": 0x18F00503,
        "CONTROL_STATE_J1939": 0x0CFF10FE,
        "CONTROL_COMMAND_CURRENT_J1939": 0x0CFF11FE,
        "CONTROL_COMMAND_DUTY_J1939": 0x0CFF12FE,
        "ACKNOWLEDGEMENT": 0x18E8FF03,
        "ADDRESS_CLAIMED": 0x18EEFF03,
    }
    shafts = read.decode_message("RIG_MEASURED", struct.pack("<4h", 15000, -10, 500, 500))
    assert shafts == pytest.approx({"n_wej": 1500.0, "n_wyj": -1.0, "p1": 1.0, "p2": 0.5})
    assert {s.name: s.unit for s in read.get_message_by_name("RIG_MEASURED").signals} == {
        "n_wej": "rpm",
        "n_wyj": "rpm",
        "p1": "MPa",
        "p2": "MPa",
    }


def test_the_register_map_is_that_of_the_export(config, tmp_path):
    assert main(["export", "registers", "-o", str(tmp_path / "map.csv")]) == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "map.csv").read_text())))
    addresses = [*range(11), *range(32, 40)]
    assert [int(row["address"]) for row in rows] == [row.address for row in register_map(record_of(config))] == addresses
    assert (tmp_path / "map.csv").read_text() == csv_text(record_of(config))


@pytest.mark.against_the_clock
def test_registers_are_read_and_written_as_the_map_says(config):
    port = free_port()
    answers = {}

    def be_a_plc():
        with pymodbus.client.ModbusTcpClient("127.0.0.1", port=port, timeout=2, retries=20) as client:
            while not client.connect():
                time.sleep(0.01)
            client.write_registers(33, [10000, 0, 0, 1, 1, 0, 0])
            client.write_register(32, 1)
            done.wait(5)
            client.write_register(33, 20000)
            client.write_register(32, 2)
            answers["read"] = client.read_input_registers(0, count=11).registers
            answers["refused"] = client.write_register(5, 1).isError()
            read.set()

    done, read = threading.Event(), threading.Event()
    thread = threading.Thread(target=be_a_plc, daemon=True)
    thread.start()
    plug = here(f"modbus:{port}", config)
    plug.order(2)
    assert plug.step(0x12345, [0.1, -0.001, 0.0], [1500 * RPM, 1000 * RPM, 1e6, 5e5]) is None
    done.set()
    assert read.wait(5)
    answer = plug.step(0x12346, [0.0] * 3, [0.0, 0.0, 0.0, 0.0])
    assert answer.command == pytest.approx((0.4, 0.0, 0.0)) and (plug.gear, plug.shifting) == (1, True)
    assert answers["read"] == [1, 0x2345, 2, 1, 2000, 0x10000 - 20, 0, 15000, 10000, 500, 500]
    assert answers["refused"]
    plug.close()
    thread.join(5)
