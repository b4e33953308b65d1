# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs without a gear change under way: the report gives their measured values, as their procedures evaluate them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import PERIOD, FakeBag, Shift

from rig_nodes.analysis.definitions import NO_SEQUENCE
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.logged import Recording
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

BOX = load_rig("hydmag").transmission


def simulated(tmp_path, capsys, sequence):
    """Returns the report.json of a run and its output on the terminal."""
    assert main(["simulate", sequence, "--out", str(tmp_path / sequence)]) == 0
    return json.loads((tmp_path / sequence / "report.json").read_text()), capsys.readouterr().out


def test_a_valve_response_shows_the_valves_delay(tmp_path, capsys):
    report, shown = simulated(tmp_path, capsys, "valve_response")
    (row,) = report["measured"]["valve_responses"]
    assert (row["gear"], row["t_order_s"]) == (1, pytest.approx(1.005)) and row["why"] == []
    assert row["valve_delay_s"] == pytest.approx(0.195, abs=0.01)  # thesis 7.2 has 0.195 s
    assert report["measured"]["coast_down"] is None and report["shifts"] == []
    assert "no shift: valve_response (one valve switched on at standstill, 5 s) changes no gear" in shown
    assert f"p1 rose {row['valve_delay_s'] * 1e3:.0f} ms after the first pulse on ZR-P1" in shown


def test_a_coast_down_shows_the_inertia(tmp_path, capsys):
    report, shown = simulated(tmp_path, capsys, "coast_down")
    found = report["measured"]["coast_down"]
    assert found["inertia"] == pytest.approx(0.709, abs=found["errors"]["inertia"])
    assert found["inertia_half"] == pytest.approx(0.709, rel=0.02)
    assert report["measured"]["valve_responses"] == report["measured"]["engagements"] == []
    assert f"coast-down from 470 rpm: inertia of the driving side {found['inertia']:.3f} +- 0.1" in shown
    assert "no shift: coast_down (470 rpm, both clutches open" in shown


def test_a_drive_that_is_switched_off_with_a_clutch_closed_is_no_coast_down():
    t = np.arange(0.0, 6.0, PERIOD)
    w = 50.0 - 20.0 * np.maximum(t - 2.0, 0.0)
    nothing = np.zeros(t.size)
    channels = {
        "n_wej": np.maximum(w, 0.0),
        "M_wej": nothing + 10.0,
        "n_wyj": nothing,
        "M_wyj": nothing,
        "p1": nothing,
        "p2": nothing,
    }
    off = {"/motor/command": [(int(at * 1e9), SimpleNamespace(enable=on)) for at, on in ((0.0, True), (2.0, False))]}
    found = build_report(FakeBag(Recording(0.0, PERIOD, channels, [], BOX), off), {})["measured"]["coast_down"]
    assert found["inertia"] == pytest.approx(0.5, rel=0.01)  # 10 Nm slow it down by 20 rad/s2
    closed = Recording(0.0, PERIOD, channels | {"p1": nothing + 2.3e6}, [], BOX)
    assert build_report(FakeBag(closed, off), {})["measured"]["coast_down"] is None


def test_an_engagement_is_shown_where_no_gear_is_changed():
    orders = [(t, "/controller/events", "shift_ordered", "", gear) for t, gear in ((0.3, 1.0), (1.0, 2.0))]
    assert "measured" not in build_report(FakeBag(Shift().recording(1), events=orders), {})
    found = build_report(FakeBag(Shift().recording(1), events=orders[:1]), {})
    (row,) = found["measured"]["engagements"]
    assert row["gear"] == 1 and "engagement of S1 at 0.30 s: " in format_report(found)


def test_a_bag_without_its_channels_does_not_claim_that_no_shift_was_made():
    broken = FakeBag(Shift().recording())
    broken.recording.channels.pop("p1")
    text = format_report(build_report(broken, {}))
    assert "no shifts: there is nothing to look for them in" in text
    assert "problem: no shift metrics: the recording has no channel p1" in text


def test_a_run_by_hand_without_a_shift_is_called_this_run():
    report = build_report(FakeBag(Shift().recording(1)), {"sequence": NO_SEQUENCE, "description": "ordered over ROS"})
    assert "no shift: this run changes no gear while the input shaft turns" in format_report(report)


def test_orders_that_the_recorder_left_out_are_not_called_no_change_of_gear():
    report = build_report(FakeBag(Shift().recording(1)), {"sequence": "demo", "left_out": {"/controller/events": 6}})
    text = format_report(report)
    assert "no shift: the orders of gears were not recorded" in text and "changes no gear" not in text
    assert "left out by the recorder's options: 6 messages of 1 topics" in text
