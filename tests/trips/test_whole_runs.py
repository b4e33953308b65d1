# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whole runs that would break the machine: each ends in the safe state by the trip that is meant for it, and says so everywhere."""

import json

import pytest

from rig_nodes.bags import Bag
from rig_nodes.base import RigError, rig_folders
from rig_nodes.cli.main import main
from rig_nodes.rig import config_of_record, load_rig
from rig_nodes.runs import Rig, RigStatus, load_sequence, record

REPORTING = """
from rig_nodes.controllers.seam import ControllerOutputs, Status


class Tcu:
    level = "current"

    def initialize(self, info):
        pass

    def terminate(self):
        pass

    def step(self, inputs):
        if inputs.time < 0.3:
            return ControllerOutputs(command=[0.0] * len(inputs.current))
        return ControllerOutputs(status=Status({status}), message="P0746 pressure control valve A stuck off")
"""
BOTH_ON = (0.6, 0.6, 0.0)  # A at the outputs of the controller


def driven(settings=None, speed=157.0, oil=4e6, load=None, rig="hydmag"):
    """A rig whose controller stands outside, at level current, with its motor on."""
    made = Rig(load_rig(rig, settings or {}), controller="external", level="current")
    made.set("oil", oil, True)
    made.set("motor", speed, True)
    if load is not None:
        made.set("load", load, True)
    return made


def held(rig, currents, seconds, gear=0):
    """Hold currents at the valves until the rig trips, for at most so many seconds; return the name of the trip."""
    for _ in range(round(seconds * 1e3)):
        if rig.safe:
            break
        rig.set_current(rig.sample, currents, gear, False)
        rig.advance_samples(1)
    return rig.tripped_by


def test_both_clutches_on_under_load_trip_by_their_name():
    rig = driven(load=8e6)
    assert held(rig, BOTH_ON, 5.0) == "tie_up_clutch_s1_clutch_s2"
    assert rig.reason.startswith("trip tie_up_clutch_s1_clutch_s2: the surface pressure of S2 beside S1 is ")


def test_plates_that_burn_trip_by_their_heat_before_they_glow():
    rig = driven({"plate_pack.heat_capacity": "100 J/K"}, load=20e6)
    assert held(rig, (0.25, 0.0, 0.0), 60.0) in ("slip_energy_clutch_s1", "hot_plates_clutch_s1")
    assert rig.device("clutch_s1")["temperature"] < 205.0


def test_an_oil_supply_that_is_switched_off_in_gear_trips_by_its_name():
    rig = driven()
    assert held(rig, (0.6, 0.0, 0.0), 3.0, gear=1) == ""
    rig.set("oil", 4e6, False)
    assert held(rig, (0.6, 0.0, 0.0), 3.0, gear=1) == "lost_oil_supply"


def test_a_gear_whose_clutch_slips_or_is_open_trips_by_its_name():
    assert held(driven(load=1e6), (0.0, 0.0, 0.0), 4.0, gear=1) == "not_reached_I_clutch_s1"
    assert held(driven(load=8e6), (0.2, 0.0, 0.0), 4.0, gear=1) == "slip_in_gear_I_clutch_s1"


def test_the_safe_state_has_no_current_no_drive_torque_and_no_load_within_its_time():
    rig = driven(load=8e6)
    held(rig, (0.6, 0.0, 0.0), 3.0)
    torque, pressure = float(rig.motor["torque"]), float(rig.load["pressure"])
    rig.trip("a reason", "a_name")
    rig.advance_samples(1)
    assert rig.valves[0]["duty"] == 0.0
    rig.advance_samples(150)
    assert torque > 5.0 and abs(rig.motor["torque"]) < 0.01 * torque
    assert pressure > 1e6 and rig.load["pressure"] < 0.01 * pressure
    assert rig.coil_currents()[0] < 0.01


def test_the_red_button_wins_over_a_trip_and_one_reset_ends_both():
    rig = driven(load=8e6)
    held(rig, BOTH_ON, 5.0)
    assert [trip.name for trip in rig.watched.latched()] == ["tie_up_clutch_s1_clutch_s2"]
    rig.e_stop()
    assert (rig.tripped_by, rig.reason) == ("e_stop", "emergency stop")
    rig.trip("later", "other")
    assert rig.tripped_by == "e_stop"
    rig.reset()
    assert (rig.tripped_by, rig.reason, rig.watched.latched()) == ("", "", ()) and rig.status == RigStatus.STARTING


def test_a_trip_is_the_same_however_the_time_is_divided():
    def reached(parts):
        rig = Rig(load_rig("hydmag", {"trips.overspeed_w0.limit": "1000 rpm", "trips.overspeed_w0.delay": "3 ms"}))
        rig.set("motor", 157.0, True)
        while not rig.safe:
            rig.advance_samples(parts)
        return rig.sample, rig.reason, rig.warnings, rig.state_hash()

    assert reached(1) == reached(7) == reached(1900)


def test_a_snapshot_keeps_the_time_that_a_trip_has_run():
    config = load_rig("hydmag", {"trips.overspeed_w0.limit": "1000 rpm", "trips.overspeed_w0.delay": "500 ms"})
    rig, other = Rig(config), Rig(config)
    rig.set("motor", 157.0, True)
    while not rig.watched.arrays.trips["count"].any():
        rig.advance_samples(10)
    rig.advance_samples(200)
    other.restore(rig.snapshot())
    for one in (rig, other):
        one.advance_samples(1000)
    assert rig.tripped_by == other.tripped_by == "overspeed_w0" and rig.reason == other.reason


@pytest.fixture(scope="module")
def tripped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tripped") / "run"
    code = main(["simulate", "demo", "--out", str(folder), "--set", "trips.overspeed_w0.limit=750 rpm"])
    return code, folder


def test_twice_the_speed_ends_a_run_with_the_trip_in_exit_code_report_bag_and_record(tripped):
    code, folder = tripped
    report = json.loads((folder / "report.json").read_text())
    end = report["run"]["end"]
    assert code == 1 and end["state"] == "tripped" and end["trip"] == "overspeed_w0"
    assert (
        end["reason"].startswith("trip overspeed_w0: the speed of w0 is 75") and "its limit of 750 rpm for 10 ms" in end["reason"]
    )
    bag = Bag(folder)
    assert bag.end == {"state": "tripped", "reason": end["reason"], "trip": "overspeed_w0"}
    events = [(name, text) for _, topic, name, text, _ in bag.events() if topic == "/rig/events"]
    assert [event for event in events if event[0] == "rig_tripped"] == [("rig_tripped", end["reason"])]
    [warning] = [text for name, text in events if name == "rig_warning"]
    assert warning.startswith("warning overspeed_w0: the speed of w0 is 68")
    record_ = report["run"]["configuration"]
    assert record_["trips"] == {"overspeed_w0.limit": pytest.approx(78.54, abs=0.01)}
    assert config_of_record(record_, "here").value("trips.overspeed_w0.limit") == pytest.approx(78.54, abs=0.01)


def test_a_report_made_later_and_its_page_say_the_trip(tripped, tmp_path, capsys):
    _, folder = tripped
    page = tmp_path / "page.html"
    main(["report", str(folder), "--html", str(page)])
    assert "end: trip overspeed_w0: the speed of w0 is" in capsys.readouterr().out
    assert "trip overspeed_w0: the speed of w0 is" in page.read_text()


def test_without_trips_the_run_goes_on_and_every_report_says_so(tmp_path, capsys):
    folder, page = tmp_path / "run", tmp_path / "page.html"
    low = ["--set", "trips.overspeed_w0.limit=200 rpm", "--no-trips"]
    assert main(["simulate", "sample", "--out", str(folder), *low]) == 0
    main(["report", str(folder), "--html", str(page)])
    shown = capsys.readouterr().out
    assert shown.count("trips: the trips were off: nothing kept the machine within its limits") == 2
    assert "The trips were off" in page.read_text()


def test_wrong_limits_are_refused_with_what_would_be_right(tmp_path):
    with pytest.raises(RigError, match="trips.overspeed_w9.limit"):
        load_rig("hydmag", {"trips.overspeed_w9.limit": "1000 rpm"})
    with pytest.raises(RigError, match="is a torque, expected an angular velocity"):
        load_rig("hydmag", {"trips.overspeed_w0.limit": "1000 Nm"})
    for text, sentence in (
        ("  overspeed_w9: {limit: [1 rpm, assumed]}", "unknown key 'overspeed_w9' in trips"),
        ("  overspeed_w0: {limit: 1 rpm}", "trips.overspeed_w0.limit must be [value with unit"),
        ("  overspeed_w0: {limits: [1 rpm, assumed]}", "unknown key 'limits' in trips.overspeed_w0"),
    ):
        (tmp_path / "rig.yaml").write_text(f"description: a variant\nbase: hydmag\ntrips:\n{text}\n")
        with pytest.raises(RigError) as refused:
            load_rig(tmp_path)
        assert sentence in str(refused.value) and "rig.yaml:4: " in str(refused.value)


@pytest.mark.campaign
@pytest.mark.parametrize(
    "rig, sequence", [(name, path.stem) for name, folder in rig_folders().items() for path in (folder / "sequences").glob("*.yaml")]
)
def test_a_nominal_sequence_trips_nowhere(rig, sequence):
    config = load_rig(rig)
    run = record(config, load_sequence(sequence, {}, rig, rig, config))
    assert run.end == {"state": "ended", "reason": "the sequence ended"}


@pytest.mark.parametrize("status, word", [(2, "error"), (3, "fatal")])
def test_a_fault_that_the_controller_reports_trips_with_its_own_words(tmp_path, status, word):
    (tmp_path / "tcu.py").write_text(REPORTING.format(status=status))
    folder = tmp_path / "run"
    assert main(["simulate", "sample", "--controller", f"python:{tmp_path / 'tcu.py'}:Tcu", "--out", str(folder)]) == 1
    end = json.loads((folder / "report.json").read_text())["run"]["end"]
    assert (end["state"], end["trip"]) == ("tripped", "controller_failed")
    assert end["reason"].endswith(f"sample 300: status {word}: P0746 pressure control valve A stuck off")
