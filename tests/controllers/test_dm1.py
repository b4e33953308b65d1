# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trouble codes on CAN: DM1 of J1939-73 in one frame and in several, as another program reads it, and in the CAN log of a run."""

import pytest

from rig_nodes.cli.main import main
from rig_nodes.controllers import ADDRESS, load_controller
from rig_nodes.controllers.can.dm1 import DM1, Code, dm1_data, dm1_frames
from rig_nodes.controllers.can.j1939 import parts
from rig_nodes.rig import load_rig
from rig_nodes.rig.bench_trips import RULES
from rig_nodes.runs import Rig
from rig_nodes.runs.simulation import advance_with

CODES = [Code(520_192, 5, 1), Code(524_287, 31, 126), Code(177, 0, 3)]


def test_a_code_is_in_the_bits_of_the_standard():
    assert dm1_data([]) == bytes([0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF])
    # SPN 1208, FMI 3, count 10: the example of SAE J1939-73
    assert dm1_data([Code(1208, 3, 10)])[2:6] == bytes([0xB8, 0x04, 0x03, 0x0A])
    assert dm1_data([Code(524_287, 31, 500)])[2:6] == bytes([0xFF, 0xFF, 0xFF, 0x7E])
    with pytest.raises(ValueError, match="does not fit into a trouble code"):
        dm1_data([Code(524_288, 0)])


def test_more_than_one_code_is_announced_and_sent_in_pieces():
    ((number, data),) = dm1_frames(CODES[:1], 3)
    assert parts(number).pgn == DM1 and parts(number).source == 3 and len(data) == 8
    (announce, head), *pieces = dm1_frames(CODES, 3)
    assert parts(announce).pgn == 60416 and head == bytes([32, 14, 0, 2, 0xFF, 0xCA, 0xFE, 0x00])
    assert [piece[0] for _, piece in pieces] == [1, 2] and b"".join(piece[1:] for _, piece in pieces)[:14] == dm1_data(CODES)


def test_another_program_reads_them():
    j1939 = pytest.importorskip("j1939")  # not beside a system ROS 2
    application = j1939.ControllerApplication(j1939.Name(identity_number=1), 128)
    for codes in (CODES, CODES[:1], []):
        heard = []
        listener = j1939.Dm1(application)
        listener._subscribers.append(lambda source, lamps, found, time, heard=heard: heard.append((lamps, list(found))))
        listener._receive(6, DM1, 3, 0.0, list(dm1_data(codes)))
        ((lamps, found),) = heard
        assert [(one["spn"], one["fmi"], one["oc"]) for one in found] == [tuple(code) for code in codes or [Code(0, 0, 0)]]
        assert (lamps["rsl"] == j1939.DtcLamp.ON) == bool(codes)


def test_the_can_log_of_a_tripped_run_has_the_code_of_its_trip(tmp_path, capsys):
    can = pytest.importorskip("can")
    (tmp_path / "ill.yaml").write_text(
        "description: a broken wire\nrig: hydmag\nsteps:\n  - oil: {pressure: 4 MPa}\n  - wait: {for: 200 ms}\n"
        "  - shift: {to: I}\n  - fault: {name: valve_zr_p1.coil_open}\n  - wait: {for: 3 s}\n"
    )
    assert main(["simulate", str(tmp_path / "ill.yaml"), "--faults", "--out", str(tmp_path / "run")]) == 1
    assert main(["export", "log", str(tmp_path / "run"), "--out", str(tmp_path / "run.log")]) == 0
    with can.LogReader(tmp_path / "run.log") as log:
        sent = [message for message in log if message.is_extended_id and parts(message.arbitration_id).pgn == DM1]
    trip = next(one for one in load_rig("hydmag").trips if one.name == "coil_open_valve_zr_p1")
    assert [bytes(message.data) for message in sent] == [dm1_data([Code(trip.spn, trip.fmi, 1)])]


def test_a_running_rig_sends_its_trip_every_second_and_once_more_when_it_is_over():
    can, j1939 = pytest.importorskip("can"), pytest.importorskip("j1939")
    config = load_rig("hydmag")
    trip, button = next(one for one in config.trips if one.name == "overspeed_w0"), RULES["e_stop"]
    rig = Rig(config, controller="external")
    bus, plug = can.Bus("dm1", interface="virtual"), load_controller("can:dm1?interface=virtual", config)
    heard, now = [], 0
    ecu = j1939.ElectronicControlUnit()
    other = ecu.add_ca(name=j1939.Name(identity_number=1), device_address=200)
    j1939.Dm1(other).subscribe(lambda source, _, found, __: heard.append((now, source, [one["spn"] for one in found])))
    try:
        for now in range(3590):
            if now == 100:
                rig.trip(trip.sentence(2.0 * trip.limit, rig.time), trip.name)
            if now == 2500:
                rig.e_stop()
            if now == 3500:
                rig.reset()
                rig.ask_anew()
            advance_with(rig, plug)
            while (frame := bus.recv(0)) is not None:
                ecu.notify(frame.arbitration_id, frame.data, frame.timestamp)
    finally:
        plug.close()
        bus.shutdown()
        ecu.stop()
    both = [trip.spn, button.spn]  # in an announce and two pieces, 50 ms apart
    alone = [(when, ADDRESS, [trip.spn]) for when in (100, 1100, 2100)]
    assert heard == [*alone, (2600, ADDRESS, both), (3500, ADDRESS, [0])]
