# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trips that a rig's file describes on what a transducer shows: they fire, are in the record, and are refused in a sentence."""

import json
import math

import pytest

from rig_nodes.base import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig import config_of_record, load_rig

HEAD = "description: a variant\nbase: hydmag\ntrips:\n"
OWN = '  too_fast: {signal: n_wej, above: [700 rpm, "assumed"], delay: [50 ms, "assumed"]}\n'


@pytest.fixture
def variant(tmp_path):
    def write(text):
        (tmp_path / "rig.yaml").write_text(HEAD + text)
        return tmp_path

    return write


def test_a_trip_of_its_own_ends_the_run_and_is_in_its_record(variant, tmp_path, capsys):
    rig = variant(OWN)
    assert main(["simulate", "demo", "--rig", str(rig), "--out", str(tmp_path / "run")]) == 1
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert report["run"]["end"]["trip"] == "too_fast"
    assert report["run"]["end"]["reason"].startswith("trip too_fast: the reading of n_wej is 7")
    recorded = config_of_record(report["run"]["configuration"], "here")
    assert recorded.trips[-1].name == "too_fast" and recorded.trips == load_rig(rig).trips
    capsys.readouterr()
    assert main(["list", "trips", "--rig", str(rig), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)[-1]["threshold"] == "700 rpm"


def test_its_limit_can_be_set_and_it_falls_away_with_its_transducer(tmp_path):
    pressed = '  pressed: {signal: F_ps, above: [4 kN, "assumed"]}\n  full: {signal: p_z, above: [2 MPa, "assumed"]}\n'
    (tmp_path / "rig.yaml").write_text(HEAD.replace("hydmag", "cylinder_bench") + pressed)
    first, second = load_rig(tmp_path, {"trips.pressed.limit": "3 kN"}).trips[-2:]
    assert (first.name, first.limit, second.name) == ("pressed", 3000.0, "full")
    left = load_rig(tmp_path, {"instruments.force_fitted": "off"})
    assert [trip.name for trip in left.trips if trip.name in ("pressed", "full")] == ["full"]
    assert left.trips[-1].spn == second.spn


@pytest.mark.parametrize(
    "text, sentence",
    [
        ('  fast: {signal: n_wex, above: [700 rpm, "assumed"]}', "there is no transducer 'n_wex'"),
        ('  fast: {signal: n_wej, above: [700 Nm, "assumed"]}', "is a torque, expected an angular velocity"),
        ("  fast: {signal: n_wej, above: 700 rpm}", "must be [value with unit"),
        ("  fast: {signal: n_wej}", "needs one of above and below"),
        ('  fast: {signal: n_wej, above: [1 rpm, "a"], below: [1 rpm, "a"]}', "needs one of above and below"),
        ('  fast: {signal: n_wej, above: [90000 rpm, "a"]}', "trips.fast.above is 90000 rpm, outside 0 to 3600 rpm"),
        ('  fast: {signal: M_wej, below: [-501 Nm, "a"]}', "trips.fast.below is -501 Nm, outside -500 to 500 Nm"),
        ('  watched: {signal: n_wej, above: [1 rpm, "a"]}', "trips.watched: that is the name of the switch"),
        ('  fast: {signal: n_wej, above: [1 rpm, "a"], wait: 2}', "unknown key 'wait' in trips.fast"),
        ('  fast: {above: [1 rpm, "a"]}', "unknown key 'fast' in trips"),
        ("  fast: 3", "unknown key 'fast' in trips"),
        ('  fast: {signal: [n_wej], above: [1 rpm, "a"]}', "there is no transducer"),
        ('  a-b: {signal: n_wej, above: [1 rpm, "a"]}', "letters, digits and _"),
        ('  e_stop: {signal: n_wej, above: [1 rpm, "a"]}', "the name of a rule of the bench"),
    ],
)
def test_what_is_no_trip_is_refused_with_file_and_line(variant, text, sentence):
    with pytest.raises(RigError) as refused:
        load_rig(variant(text + "\n"))
    assert sentence in str(refused.value) and "rig.yaml:4: " in str(refused.value)


def test_a_limit_below_zero_is_taken_and_set_within_what_the_transducer_shows(variant):
    braked = '  braked: {signal: M_wej, below: [-20 Nm, "a"]}\n  pulled: {signal: M_wej, above: [-20 Nm, "a"]}\n'
    rig = variant(braked + '  cold: {signal: T_oil, below: [-10 degC, "a"]}\n')
    braked, pulled, cold = load_rig(rig, {"trips.braked.limit": "-30 Nm"}).trips[-3:]
    assert (braked.limit, braked.clear, braked.quantity.magnitude) == (-30.0, pytest.approx(-29.4), False)
    assert (pulled.warning, pulled.warning_over, pulled.clear) == pytest.approx((-22.0, -22.44, -20.4))
    assert cold.limit == -10.0 and cold.sentence(-12.0, 1.0) == (
        "trip cold: the reading of T_oil is -12 degC, below its limit of -10 degC, at 1.000 s"
    )
    for setting, sentence in (
        ({"trips.braked.limit": "-501 Nm"}, "is -501 Nm, outside -500 to 500 Nm"),
        ({"trips.cold.limit": "1000 degC"}, "is 1000 degC, outside "),
    ):
        with pytest.raises(RigError, match=sentence):
            load_rig(rig, setting)


def test_a_trip_of_a_magnitude_says_so():
    trip = next(one for one in load_rig("hydmag").trips if one.name == "overspeed_w0")
    assert trip.row()["criterion"] == "above, without its sign"
    said = trip.sentence(2500.0 * math.pi / 30.0, 1.0)
    assert "the speed of w0 is 2500 rpm without its sign at its highest, above its limit of " in said


def test_trips_without_an_entry_are_none(variant):
    assert load_rig(variant("")).trips == load_rig("hydmag").trips


@pytest.mark.parametrize("text", ["  5", "  [fast]"])
def test_trips_that_are_no_map_are_refused(variant, text):
    with pytest.raises(RigError, match=r"rig\.yaml:\d+: trips must be a map of keys, found"):
        load_rig(variant(text + "\n"))


def test_a_record_says_where_a_limit_is_from(variant):
    rig = variant('  overspeed_w0: {limit: [750 rpm, "the maker\'s sheet"]}\n')
    for settings, source in (
        ({}, "the maker's sheet"),
        ({"trips.overspeed_w0.delay": "20 ms"}, "set for this run"),
        ({"trips.overspeed_wk.delay": "20 ms"}, "the maker's sheet"),
    ):
        recorded = config_of_record(json.loads(json.dumps(load_rig(rig, settings).as_dict())), "here")
        assert {trip.name: trip.source for trip in recorded.trips}["overspeed_w0"] == source, settings
