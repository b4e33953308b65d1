# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whole runs that would break the machine: each ends in the safe state by the trip that is meant for it, and says so everywhere."""

import json
from types import SimpleNamespace

import pytest

from rig_nodes.analysis import members_in, table_of
from rig_nodes.bags import Bag
from rig_nodes.base import RigError, rig_folders
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.rig import config_of_record, load_rig
from rig_nodes.rig.trip import SAFE_WITHIN
from rig_nodes.runs import Rig, RigStatus, load_sequence, record
from rig_nodes.runs.simulation import advance_with

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


def held(rig, currents, seconds, gear=0, shifting=False):
    """Hold currents at the valves until the rig trips, for at most so many seconds; return the name of the trip."""
    for _ in range(round(seconds * 1e3)):
        if rig.safe:
            break
        rig.set_current(rig.sample, currents, gear, shifting)
        rig.advance_samples(1)
    return rig.tripped_by


def test_both_clutches_on_under_load_trip_by_their_name():
    rig = driven(load=8e6)
    assert held(rig, BOTH_ON, 5.0) == "tie_up_clutch_s1_clutch_s2"
    assert rig.reason.startswith("trip tie_up_clutch_s1_clutch_s2: the surface pressure of S2 beside S1 is ")


def test_twice_the_speed_trips_by_its_name():
    rig = driven(speed=314.0)
    assert held(rig, (0.0, 0.0, 0.0), 5.0).startswith("overspeed_")
    assert 1.6 * 157.0 < rig.true("w0.speed") < 2.0 * 157.0


def test_plates_that_burn_trip_by_their_heat_before_they_glow():
    rig = driven(load=20e6)
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


def test_a_shift_that_never_ends_trips_by_its_name():
    rig = driven({"trips.shift_too_long.delay": "300 ms"})
    assert held(rig, (0.6, 0.0, 0.0), 1.0, gear=1, shifting=True) == "shift_too_long"
    assert load_rig("hydmag").value("trips.shift_too_long.delay") == 10.0


def test_a_trip_of_a_gear_fires_in_the_same_sample_wherever_the_controller_runs():
    config = load_rig("hydmag")
    inside, outside, plug = Rig(config), Rig(config, controller="external", level="duty"), load_controller("alfa46", config, "duty")
    for rig in (inside, outside):
        rig.set("motor", 100.0, True)
    for _ in range(200):
        inside.advance_samples(1)
        advance_with(outside, plug)
    inside.order_gear(1)
    plug.order(1)
    while not (inside.safe and outside.safe) and inside.sample < 3000:
        inside.advance_samples(1)
        advance_with(outside, plug)
    plug.close()
    assert inside.tripped_by == "lost_oil_supply" and inside.reason == outside.reason


def test_the_safe_state_begins_at_once_and_is_reached_within_its_stated_time():
    rig = driven(load=8e6)
    held(rig, (0.6, 0.0, 0.0), 3.0)
    torque, pressure = float(rig.motor["torque"]), float(rig.load["pressure"])
    rig.trip("a reason", "a_name")
    rig.advance_samples(1)
    assert rig.valves[0]["duty"] == 0.0 and not rig.motor["enabled"] and rig.load["pressure"] < pressure
    rig.advance_samples(round(SAFE_WITHIN * 1e3) - 1)
    assert torque > 5.0 and abs(rig.motor["torque"]) < 0.01 * torque
    assert pressure > 1e6 and rig.load["pressure"] < 0.01 * pressure
    assert rig.coil_currents()[0] < 0.01
    assert f"reached within {SAFE_WITHIN * 1e3:g} ms" in rig.config.trips[0].row()["reaction"]


def test_after_a_reset_nothing_drives_before_it_is_ordered_again():
    rig = Rig(load_rig("hydmag_hydrostatic"))
    for step, value in (("motor", 100.0), ("pump", 0.5), ("hydraulic_motor", 1.0)):
        rig.set(step, value, True)
    rig.advance(0.6)
    drive = rig.device("hydrostatic")
    assert drive["swivel_pump"] > 0.4 and drive["swivel_motor"] > 0.4
    rig.e_stop()
    rig.advance(1.0)
    rig.reset()
    rig.advance(0.1)
    assert rig.motor["torque"] == drive["swivel_pump"] == drive["swivel_motor"] == 0.0


def test_a_gear_whose_coils_the_rig_holds_open_after_a_reset_does_not_trip_as_not_reached():
    rig = driven()
    assert held(rig, (0.6, 0.0, 0.0), 1.0, gear=1) == ""
    rig.e_stop()
    rig.reset()
    assert (rig.gear, rig.shifting) == (0, False)
    rig.set("motor", 157.0, True)
    assert held(rig, (0.6, 0.0, 0.0), 1.5, gear=1) == "" and rig.status == RigStatus.STARTING


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
        end["reason"].startswith("trip overspeed_w0: the speed of w0 is 75")
        and "at its highest, above its limit of 750 rpm and for 10 ms not below 735 rpm again, at " in end["reason"]
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


def test_a_tripped_run_that_is_run_again_trips_again(tripped, tmp_path, capsys):
    _, folder = tripped
    assert main(["rerun", str(folder), "--through", "plant", "--out", str(tmp_path / "again")]) == 1
    shown = capsys.readouterr()
    assert "topics are bit for bit as recorded" in shown.out and "rig: the rig tripped: trip overspeed_w0: " in shown.err
    assert Bag(tmp_path / "again").end == Bag(folder).end
    assert json.loads((tmp_path / "again" / "report.json").read_text())["run"]["end"] == Bag(folder).end


def test_a_report_made_later_and_its_page_say_the_trip(tripped, tmp_path, capsys):
    _, folder = tripped
    page = tmp_path / "page.html"
    main(["report", str(folder), "--html", str(page)])
    assert "end: trip overspeed_w0: the speed of w0 is" in capsys.readouterr().out
    assert "trip overspeed_w0: the speed of w0 is" in page.read_text()


def test_without_trips_a_run_has_the_same_bits_and_everything_made_of_it_says_so(tmp_path, capsys):
    folder, other, page = tmp_path / "runs" / "off", tmp_path / "runs" / "on", tmp_path / "page.html"
    low = ["--set", "trips.overspeed_w0.limit=200 rpm", "--no-trips"]
    assert main(["simulate", "sample", "--out", str(folder), *low]) == 0
    main(["report", str(folder), "--html", str(page)])
    shown, said = capsys.readouterr().out, "the trips were off: nothing kept the machine within its limits"
    assert shown.count(f"trips: {said}") == 2
    assert "The trips were off" in page.read_text()
    assert main(["simulate", "sample", "--out", str(other)]) == 0
    ours, theirs = (Bag(one).canonical_hash() for one in (folder, other))
    assert ours.keys() == theirs.keys()
    assert {topic for topic in ours if ours[topic] != theirs[topic]} == {"/rig/run_info", "all"}
    capsys.readouterr()
    main(["compare", str(other), str(folder)])
    assert f"off: {said}" in capsys.readouterr().out
    assert [row[0] for row in table_of(members_in(folder.parent))[1]] == ["off, trips off", "on"]


def test_the_diagnostics_of_a_rig_say_that_its_trips_are_off():
    pytest.importorskip("rclpy")
    from rig_nodes.nodes.diagnostics import WARN
    from rig_nodes.nodes.rig_health import RigHealth

    rig = Rig(load_rig("hydmag", {"trips.watched": "off"}))
    rig.advance_samples(1)
    health = RigHealth(rig, SimpleNamespace(overruns=0), SimpleNamespace(refused={}), []).whole()
    assert health.level == WARN
    assert health.message == "ready: the motor is off, but its trips are off: nothing keeps it within its limits"


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


def test_losses_that_bend_with_the_torque_are_no_wrong_reading():
    """Annex D's losses take 136 Nm of gear I's torque at 240 Nm, for as long as the gear holds."""
    config, values = load_rig("chapter9"), {"speed": "1200 rpm", "load_up": "40 Nm", "load_down": "240 Nm", "pause": "3 s"}
    run = record(config, load_sequence("grid_point", values, "chapter9", "chapter9", config))
    assert run.end == {"state": "ended", "reason": "the sequence ended"}


@pytest.mark.parametrize("status, word", [(2, "error"), pytest.param(3, "fatal", marks=pytest.mark.campaign)])
def test_a_fault_that_the_controller_reports_trips_with_its_own_words(tmp_path, status, word):
    (tmp_path / "tcu.py").write_text(REPORTING.format(status=status))
    folder = tmp_path / "run"
    assert main(["simulate", "sample", "--controller", f"python:{tmp_path / 'tcu.py'}:Tcu", "--out", str(folder)]) == 1
    end = json.loads((folder / "report.json").read_text())["run"]["end"]
    assert (end["state"], end["trip"]) == ("tripped", "controller_failed")
    assert end["reason"].endswith(f"sample 300: status {word}: P0746 pressure control valve A stuck off")
