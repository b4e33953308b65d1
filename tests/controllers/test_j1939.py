# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig as a J1939 node on the CAN bus: its messages, its address, the requests to it, and the exported database.

The numbers are computed by hand from J1939-21 (identifiers), -71 (messages, ranges) and -81 (NAME, address claim).
"""

import itertools
import struct
import threading
import time

import can
import cantools
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.can.database import dbc_text
from rig_nodes.controllers.examples.can_alfa46 import CanController
from rig_nodes.controllers.record import record_of
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.simulation import advance_with

RPM = 0.10471975511965977
ETC1, ETC2 = 61442, 61445
NAMES = itertools.count()


class Bus:
    """A bus in this process with the rig's plug on it; ``heard`` returns the messages since its last call."""

    def __init__(self, settings, options=""):
        channel = f"j1939-{next(NAMES)}"
        self.spec = f"can:{channel}?interface=virtual{options}"
        self.bus, self.reports = open_bus(channel, "virtual", "test"), []
        self.plug = load_controller(self.spec, settings)
        self.plug.say = self.reports.append

    def put(self, number, data):
        self.bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=number > 0x7FF, is_fd=False))

    def frames(self, extended=True):
        """Returns [(identifier, data)]."""
        frames = []
        while frame := self.bus.recv(0.0):
            if frame.is_extended_id == extended:
                frames.append((frame.arbitration_id, bytes(frame.data)))
        return frames

    def step(self, sample, n_wej=0.0, n_wyj=0.0, p1=0.0, p2=0.0):
        self.plug.step(sample, [0.0] * 3, [n_wej, n_wyj, p1, p2])

    def message(self, pgn):
        """Returns the data of the newest message of a group."""
        return [data for number, data in self.frames() if number >> 8 & 0x3FFFF == pgn][-1]

    def answer(self, sample, source=None, gear=0, shifting=0, command=0, status=0):
        """Sends a whole answer, as plain frames or as groups of a source address."""
        state = struct.pack("<HBBBB", sample, gear, shifting, 0, status).ljust(8, b"\0")
        numbers = (0x200, 0x201) if source is None else (0x0CFF1000 | source, 0x0CFF1100 | source)
        for number, data in zip(numbers, (state, struct.pack("<4H", sample, command, 0, 0))):
            self.put(number, data)


@pytest.fixture
def make(config):
    made = []

    def start(options=""):
        made.append(Bus(config, options))
        return made[-1]

    yield start
    for one in made:
        one.plug.close()
        one.bus.shutdown()


# ---- content of the messages


def test_the_current_gear_is_what_the_clutches_hold(config):
    """On the rig: through a shift it is the gear engaged last, the new one once its clutch is locked, and neutral at the end."""
    bus = open_bus("j1939-gears", "virtual", "test")
    ears = open_bus("j1939-gears", "virtual", "test")
    stop = threading.Event()
    thread = threading.Thread(target=CanController(bus, config).run, args=(stop,), daemon=True)
    thread.start()
    plug = load_controller("can:j1939-gears?interface=virtual", config)
    rig, seen, locked_at = Rig(config, controller="external", level="current"), [], {}
    try:
        plug.wait(10)
        rig.set("oil", 4e6, True)
        rig.set("motor", 60.0, True)
        for gear in (0, 1, 2, 0):
            if gear != plug.gear:
                plug.order(gear)
                ordered = rig.sample
            for _ in range(400 if gear == 0 and not seen else 1600):
                advance_with(rig, plug)
                while frame := ears.recv(0.0):
                    if frame.is_extended_id and frame.arbitration_id >> 8 & 0x3FFFF == ETC2:
                        seen.append((rig.sample, frame.data[3] - 125, rig.locked_gear()))
            if gear:
                locked_at[gear] = ordered
    finally:
        stop.set()
        thread.join()
        plug.close()
        bus.shutdown()
        ears.shutdown()
    assert rig.status == RigStatus.READY or rig.reason == ""
    assert [gear for gear, _ in itertools.groupby(gear for _, gear, _ in seen)] == [0, 1, 2, 0]
    for gear in (1, 2):
        sample, _, locked = next(row for row in seen if row[1] == gear)
        assert locked & gear, f"gear {gear} is told while its clutch does not hold"
        assert sample > locked_at[gear] + 150, "and not with the order"


@pytest.mark.parametrize(
    ("n_wej", "n_wyj", "raw"),
    [
        (1500 * RPM, 1000 * RPM, 1500),
        (3000 * RPM, 11 * RPM, 0xFAFF),
        (-20 * RPM, 1000 * RPM, 0),
        (1500 * RPM, 5 * RPM, 0xFFFF),
        (float("nan"), 1000 * RPM, 0xFE00),
        (1500 * RPM, float("inf"), 0xFE00),
    ],
)
def test_the_ratio_stays_below_the_reserved_range(make, n_wej, n_wyj, raw):
    """SPN 526: values to 0xFAFF, "error" 0xFExx for a transducer without a reading, 0xFFFF at standstill."""
    bus = make()
    bus.step(0, n_wej, n_wyj)
    assert int.from_bytes(bus.message(ETC2)[1:3], "little") == raw


def test_states_of_two_bits_know_error_and_not_available(make):
    bus = make()
    bus.step(0)
    assert bus.message(ETC1)[0] & 0b110011 == 0b110000, "no controller yet: a shift in process is not available"
    bus.answer(0, shifting=1)
    bus.step(10, 100.0, 100.0 * 34 / 47, 2e6, 0.0)
    bus.step(20, 100.0, 100.0 * 34 / 47, 2e6, 0.0)
    assert bus.message(ETC1)[0] & 0b110011 == 0b010001, "S1 holds, a shift is in process"
    bus.step(30, float("nan"), 70.0, 2e6, 0.0)
    etc1, etc2 = bus.message(ETC1), None
    assert etc1[0] & 0b11 == 0b10 and etc1[3] == 0xFE and etc1[5:7] == b"\x00\xfe", "error"
    bus.step(100, float("nan"), 70.0, 2e6, 0.0)
    etc2 = bus.message(ETC2)
    assert etc2[3] == 0xFE, "which gear is engaged cannot be told"
    for sample in range(101, 161):
        bus.step(sample, 100.0, 70.0, 2e6, 0.0)
    assert bus.message(ETC1)[0] & 0b110000 == 0b100000, "of a controller that is silent: error"


# ---- the address


def test_the_rig_claims_its_address_before_it_speaks(make):
    bus = make()
    bus.step(0)
    (number, name), *rest = bus.frames()
    assert number == 0x18EEFF03, "address claimed, to all, from address 3"
    assert name[5] == 3 and name[7] == 0, "function transmission, all industry groups, an address that stays"
    assert {0x0CF00203, 0x18F00503} <= {number for number, _ in rest}


@pytest.mark.parametrize(
    ("destination", "asked", "answer"),
    [
        (0xFF, 60928, 0x18EEFF03),
        (0x03, 60928, 0x18EEFF03),
        (0xFF, ETC1, 0x0CF00203),
        (0x03, ETC2, 0x18F00503),
        (0x03, 65262, 0x18E8FF03),
        (0xFF, 65262, None),
        (0x21, ETC1, None),
    ],
)
def test_a_request_is_answered(make, destination, asked, answer):
    """A request to all nodes or to the rig is answered at once by the claim and by both messages.

    Other requests are refused only when they are sent to the rig alone.
    """
    bus = make()
    bus.step(1)
    bus.frames()
    bus.put(0x18EA0021 | destination << 8, asked.to_bytes(3, "little"))
    bus.step(2)
    found = bus.frames()
    assert [number for number, _ in found] == ([answer] if answer else [])
    if answer == 0x18E8FF03:
        assert found[0][1] == bytes([1, 0xFF, 0xFF, 0xFF, 0x21]) + asked.to_bytes(3, "little"), "negative, PGN 59392"


def test_of_two_nodes_the_lower_name_has_the_address(make):
    bus = make()
    bus.step(0)
    name = bus.frames()[0][1]
    bus.put(0x18EEFF03, b"\xff" * 8)
    bus.step(1)
    assert bus.frames() == [(0x18EEFF03, name)], "a higher NAME: the rig claims again"
    bus.put(0x18EEFF03, name)
    bus.step(2)
    assert bus.frames() == [], "its own claim, come back"
    bus.put(0x18EEFF03, bytes(8))
    with pytest.raises(
        ControllerFailed, match=r"the J1939 address 3 is another node's \(NAME 0{16}\); choose another one with &address=N"
    ):
        bus.step(3)
    assert bus.frames() == [(0x18EEFFFE, name)], "cannot claim, and nothing else any more"


@pytest.mark.parametrize("pgn", [ETC1, 65296, 65262], ids=["ETC1", "a command", "of no use to the rig"])
def test_a_node_that_sends_from_the_rigs_address_trips_the_run(make, pgn):
    """It claims nothing; the other devices on the bus would take its messages for the rig's."""
    bus = make()
    bus.answer(0)
    bus.step(0)
    bus.put(0x0C000003 | pgn << 8, bytes(8))
    with pytest.raises(ControllerFailed, match=rf"another node sends from the J1939 address 3 of the rig \(PGN {pgn}\); choose"):
        bus.step(1)


def test_an_address_that_another_node_defends_is_not_started_with(make):
    bus = make()
    bus.put(0x18EEFF03, bytes(8))
    with pytest.raises(RigError, match="the J1939 address 3 is another node's"):
        bus.plug.wait(10.0)


def test_another_address_or_none_is_chosen_by_an_option(make):
    bus = make("&address=33")
    bus.step(0)
    assert {number & 0xFF for number, _ in bus.frames()} == {33}
    bus = make("&address=none")
    bus.put(0x18EAFFF9, (60928).to_bytes(3, "little"))
    bus.answer(0, source=0x21, command=10000)
    bus.step(0)
    bus.step(10)
    assert bus.frames() == [] and bus.plug.gear == 0
    assert bus.plug.ignored.counts == {}


def test_a_node_of_a_dynamic_address_waits_a_quarter_of_a_second(make):
    bus, began = make("&address=200"), time.monotonic()
    sample = itertools.count(0, 10)
    while time.monotonic() < began + 0.2:
        bus.step(next(sample))
    early = {number for number, _ in bus.frames()}
    while time.monotonic() < began + 0.3:
        bus.step(next(sample))
    assert early == {0x18EEFFC8} and 0x0CF002C8 in {number for number, _ in bus.frames()}


@pytest.mark.parametrize("value", ["254", "-1", "three", ""])
def test_an_address_that_is_none_is_refused(config, value):
    with pytest.raises(RigError, match=f"option address is '{value}', expected 0 to 253"):
        load_controller(f"can:x?interface=virtual&address={value}", config)


# ---- commands as J1939 groups, and one master


def test_commands_are_taken_from_one_source_address(make):
    """The commands are proprietary groups 65296 and 65297; a second address is refused and named once until the first is silent."""
    bus = make()
    bus.answer(0, source=0x21, command=10000)
    bus.step(0)
    for sample in range(1, 20):
        bus.answer(sample, source=0x22, gear=2, command=40000)
        bus.answer(sample, source=0x21, gear=1, command=10000)
        answer = bus.plug.step(sample, [0.0] * 3, [0.0, 0.0, 0.0, 0.0])
        assert answer.command == pytest.approx((0.2, 0.0, 0.0)) and bus.plug.gear == 1
    assert [text for text in bus.reports if "refused" in text] == [
        f"{bus.spec}: a command of J1939 address 34 is refused: J1939 address 33 commands, until it leaves or has been "
        "silent for 1 s; it is not used, nor are others like it"
    ]
    assert sum(bus.plug.ignored.counts.values()) == 38
    bus.plug._mastered -= 1.0  # as a second later
    bus.answer(20, source=0x22, gear=2, command=20000)
    assert bus.plug.step(20, [0.0] * 3, [0.0, 0.0, 0.0, 0.0]).command == pytest.approx((0.4, 0.0, 0.0))


def test_a_program_on_plain_frames_is_refused_beside_a_source_address(make):
    bus = make()
    bus.answer(0, source=0x21)
    bus.answer(0, gear=2)
    bus.step(0)
    assert bus.plug.gear == 0
    assert any("a command of plain frames is refused: J1939 address 33 commands" in text for text in bus.reports)


# ---- the database


def test_the_dbc_says_what_j1939_tools_look_for():
    read = cantools.database.load_string(dbc_text(record_of(load_rig("hydmag"))), "dbc")
    assert read.dbc.attributes["ProtocolType"].value == "J1939"
    assert read.dbc.attribute_definitions["VFrameFormat"].choices[3] == "J1939PG"
    groups = {message.name: message for message in read.messages if message.protocol == "j1939"}
    assert {name: message.dbc.attributes["PGN"].value for name, message in groups.items()} == {
        "ETC1": 61442,
        "ETC2": 61445,
        "ADDRESS_CLAIMED": 60928,
        "ACKNOWLEDGEMENT": 59392,
        "CONTROL_STATE_J1939": 65296,
        "CONTROL_COMMAND_CURRENT_J1939": 65297,
        "CONTROL_COMMAND_DUTY_J1939": 65298,
    }
    for message in groups.values():
        parts = cantools.j1939.frame_id_unpack(message.frame_id)
        specific = parts.pdu_specific if parts.pdu_format >= 240 else 0  # else it is the address of all nodes
        pgn = cantools.j1939.pgn_pack(parts.reserved, parts.data_page, parts.pdu_format, specific)
        assert pgn == message.dbc.attributes["PGN"].value
    spns = {s.name: s.spn for name in ("ETC1", "ETC2") for s in groups[name].signals}
    assert spns == {
        "TransDrivelineEngaged": 560,
        "TransShiftInProcess": 574,
        "TransOutputShaftSpeed": 191,
        "PercentClutchSlip": 522,
        "TransInputShaftSpeed": 161,
        "TransSelectedGear": 524,
        "TransActualGearRatio": 526,
        "TransCurrentGear": 523,
    }
    assert {message.name: message.cycle_time for message in read.messages}["ETC2"] == 100
    assert read.get_message_by_name("CONTROL_STATE").protocol is None


def test_every_frame_that_the_rig_sends_is_in_the_exported_database(make, config, tmp_path):
    (tmp_path / "rig.dbc").write_text(dbc_text(record_of(config)))
    database = cantools.database.load_file(tmp_path / "rig.dbc")
    bus = make()
    bus.put(0x18EA0321, bytes([0, 0xF0, 0]))  # another node asks for a group that the rig does not have
    for sample in range(120):
        bus.step(sample)
    sent = [*bus.frames(extended=True)]
    named = {database.get_message_by_frame_id(number).name: data for number, data in sent}
    assert {*named} == {"ADDRESS_CLAIMED", "ACKNOWLEDGEMENT", "ETC1", "ETC2"}
    name = database.get_message_by_name("ADDRESS_CLAIMED").decode(named["ADDRESS_CLAIMED"])
    assert (name["Function"], name["IndustryGroup"], name["ArbitraryAddressCapable"]) == (3, 0, 0)
    answer = database.get_message_by_name("ACKNOWLEDGEMENT").decode(named["ACKNOWLEDGEMENT"])
    assert (answer["ControlByte"], answer["AddressAcknowledged"], answer["PGNRequested"]) == (1, 0x21, 61440)
