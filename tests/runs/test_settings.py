# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One table of settings: a value has one name, one range and one sentence wherever and whenever it is changed."""

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.base.names import installed
from rig_nodes.rig.configuration import load_rig, with_overrides
from rig_nodes.rig.recorded_rig import config_of_record
from rig_nodes.rig.settings import settings_of
from rig_nodes.rig.structure import structure_of
from rig_nodes.rig.trips import TRIPS
from rig_nodes.runs.fmu.rig_variables import enable_of, rig_variables
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.studies.sweep.plan import Plan, make_plan

UNKNOWN = "there is no value of motor 'ramb'; did you mean 'ramp'"


@pytest.mark.parametrize("name", installed("rigs"))
def test_a_bag_knows_the_settings_of_its_rig(name):
    config = load_rig(name)
    record = config.as_dict()
    assert config_of_record(record, "bag").settings == config.settings
    own = {name: one for name, one in config.settings.items() if one.owner != TRIPS}  # limits of trips follow from the whole rig
    assert settings_of(structure_of(record["structure"]), record) == own


@pytest.mark.parametrize("name", installed("rigs"))
def test_a_rig_keeps_each_value_that_it_has_when_it_is_set_to_it(name):
    config = load_rig(name)
    kept = [one for one in config.settings.kept() if one.name != "wiring"]
    same = with_overrides(config, {one.name: one.written(config.value(one.name)) for one in kept if one.key.count(".") < 2})
    for one in kept:
        value = config.value(one.name)
        assert same.value(one.name) == (value if isinstance(value, str) else pytest.approx(value, rel=1e-5)), one.name


@pytest.mark.parametrize("name", [name for name in installed("rigs") if load_rig(name).structure.shifts])
def test_the_variables_of_an_fmu_are_the_settings(name):
    config = load_rig(name)
    variables = {one.name: one for one in rig_variables(config)}
    for one in config.settings.kept():
        if one.is_number and one.owner not in ("kernel", "cut"):
            assert (variables[one.name].low, variables[one.name].high, variables[one.name].text) == (one.low, one.high, one.text)
    for one in config.settings.steps.values():
        known = variables[one.setpoint.name]
        assert (known.causality, known.low, known.high, known.text) == ("input", one.low, one.high, one.text)
        assert variables[enable_of(one.setpoint)].causality == "input"


def test_who_changes_a_value_is_told_the_same_of_a_name_that_nobody_knows():
    config = load_rig("hydmag")
    with pytest.raises(RigError, match=f"^setting motor.ramb=1 rpm/s: {UNKNOWN}"):
        load_rig("hydmag", {"motor.ramb": "1 rpm/s"})
    with pytest.raises(RigError, match=f"--vary motor.ramb: {UNKNOWN}"):
        make_plan(Plan("demo", "hydmag"), {"motor.ramb": "1 rpm/s, 2 rpm/s"})
    with pytest.raises(RigError, match=f"^{UNKNOWN}"):
        Rig(config).set_value("motor.ramb", 1.0)


def test_what_changes_at_the_wrong_time_is_refused_with_the_right_one():
    with pytest.raises(RigError, match=r"motor.speed is set while the rig runs, by a step 'motor' of a sequence or by ./rig set"):
        load_rig("hydmag", {"motor.speed": "1500 rpm"})
    with pytest.raises(RigError, match=r"motor.ramp cannot be set while the rig runs; give --set motor.ramp=... to the run"):
        Rig(load_rig("hydmag")).set_value("motor.ramp", 1.0)


def test_setpoints_and_switches_are_set_by_the_names_of_their_settings():
    rig = Rig(load_rig("three_speed"))
    rig.set_value("motor.speed", 50.0)
    assert rig.value("motor.speed") == 50.0 and rig.value("motor.enabled") is False
    rig.set_value("motor.enabled", True)
    assert rig.value("motor.speed") == 50.0 and rig.value("motor.enabled") is True
    rig.set_value("oil_supply.temperature", 60.0)
    assert rig.value("oil_supply.temperature") == rig.config.oil_supply.temperature == 60.0
    rig.set_value("instruments.noise.p_b1", 1e4)
    assert rig.value("instruments.noise.p_b1") == 1e4


def test_a_setpoint_of_what_the_rig_leaves_out_is_no_parameter_of_a_node():
    assert [one.name for one in load_rig("spring_bench").settings.at("testing_machine")] == [
        "testing_machine.travel",
        "testing_machine.enabled",
    ]
    bench = load_rig("clutch_bench")
    assert bench.settings.at("testing_machine") == []
    with pytest.raises(RigError, match="'clutch_bench' has no testing machine; its cylinder.testing_machine is off"):
        Rig(bench).set_value("testing_machine.travel", 1e-3)


def test_a_step_of_a_sequence_keeps_to_the_range_of_its_setting(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("description: x\nsteps:\n  - motor: {speed: 4000 rpm}\n")
    high = load_rig("hydmag").settings.find("motor.speed").written(load_rig("hydmag").settings.find("motor.speed").high)
    assert high == "314.2 rad/s"
    with pytest.raises(RigError, match=r"s.yaml:3: motor.speed is 4000 rpm; the rig takes 0 to 3000 rpm"):
        load_sequence(path, default="hydmag")


def test_half_a_point_of_a_profile_is_a_value_of_its_own():
    config = load_rig("hydmag", {"alfa46.output_1.P1.current": "170 mA"})
    assert config.value("alfa46.output_1.P1") == pytest.approx((load_rig("hydmag").value("alfa46.output_1.P1.time"), 0.17))
    with pytest.raises(RigError, match="alfa46.output_1.P1 is set as a whole and in part"):
        load_rig("hydmag", {"alfa46.output_1.P1.current": "170 mA", "alfa46.output_1.P1": "200 ms 160 mA"})
