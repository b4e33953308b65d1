# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigs that name another one and the values that differ, and clutch pressures that are prescribed."""

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

CHAPTER9 = (RIGS_DIR / "chapter9" / "rig.yaml").read_text()


def test_what_is_not_named_is_that_of_the_base():
    base, other = load_rig("hydmag"), load_rig("chapter9")
    assert other.name == "chapter9" and other.oil_supply == base.oil_supply and other.load_pump == base.load_pump
    assert not other.effects.motor_speed and base.effects.motor_speed
    assert other.alfa46.values.t12 == 0.0 and base.alfa46.values.t12 == -0.22
    assert other.as_dict()["prescribed"]["forces"][0]["contact_force"] == 389.0 and "prescribed" not in base.as_dict()


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("base: hydmag", "base: hydmga", r"rig\.yaml:\d+: base: there is no rig 'hydmga'"),
        ("    ramp: [750 rpm/s", "    rmap: [750 rpm/s", r"rig\.yaml:\d+: unknown key 'rmap' in motor"),
        ('[off, "chapter 9: n_wej is constant"]', '[of, "x"]', "is 'of', expected one of on, off"),
        ("- [0.38869, 2.3, -13.028, 18.294, 0]", "- [0.38869, 2.3, -13.028, 18.294]", "a row is"),
        ("- [0.38869, 2.3, -13.028, 18.294, 0]", "- 5", r"rig\.yaml:\d+: .* a row is .* found \[5\]"),
        ("      - [end, 0, 0, 0, 0]\n", "", 'the last of them up to "end"'),
        ("    contact_force: [389 N", "    contact_force: [389 Nm", "expected a force"),
        ("output_speed: bounded", "output_speed: bound", r"rig\.yaml:\d+: .* one of bounded, free, found 'bound'"),
    ],
)
def test_a_wrong_rig_on_a_base_is_refused(tmp_path, old, new, sentence):
    assert old in CHAPTER9
    path = tmp_path / "rig.yaml"
    path.write_text(CHAPTER9.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        load_rig(path)


def test_prescribed_pressures_follow_the_printed_curves_from_the_order_on():
    """S2 engages: 1.3297 t MPa at first, 2.3 MPa from 0.2829 s; then S2 releases: 2.3 - 11.788 t + 18.322 t^2."""
    rig = Rig(load_rig("chapter9"))
    rig.advance(0.1)
    rig.order_gear(2)
    line = rig.world.record["oil"]["pressure"][0, 1:]  # of both clutches
    rig.advance(0.2)
    assert line[1] == pytest.approx(1.3297e6 * 0.2, rel=0.01) and line[0] == 0.0
    rig.advance(1.0)
    assert line[1] == pytest.approx(2.3e6)
    rig.order_gear(0)
    rig.advance(0.1)
    assert line[1] == pytest.approx((2.3 - 1.1788 + 0.18322) * 1e6, rel=0.01)
    # Annex D: 123.55 p^2 + 2454.4 p - 242.45 N less 657 N at the kiss point
    p = line[1] * 1e-6
    assert rig.clutches[1]["clamp"] == pytest.approx(123.55 * p * p + 2454.4 * p - 242.45 - 657.0, rel=1e-6)


def shift_up(rig):
    """Returns the speeds of input and output [rad/s] every ms of 0.6 s from the order I to II on, at 100 rad/s under load."""
    rig.order_gear(1)
    rig.advance(1.3)
    rig.set("motor", 100.0, True)
    rig.set("load", 5e6, True)
    rig.advance(4.0)
    rig.order_gear(2)
    out = []
    for _ in range(600):
        rig.advance(0.001)
        out.append([float(v) for v in rig.v])
    assert rig.locked_gear() == 2
    return zip(*out)


def test_a_constant_input_speed_stays_and_bounds_the_output_whatever_the_shift_asks_for(tmp_path):
    """With a bound the output's speed at 100 rad/s stays between those of gear I and of gear II; without it the speed falls."""
    rig = Rig(load_rig("chapter9"))
    driving, driven = shift_up(rig)
    assert driving == pytest.approx([100.0] * 600, abs=0.01)
    assert min(driven) == pytest.approx(driven[0], rel=1e-4) and max(driven) == pytest.approx(driven[-1], rel=1e-4)
    # The motor gives the torque that the gearbox takes at 100 rad/s, the drag of the open S1 included, and does the work of
    # that torque.
    torque, before = float(rig.motor["torque"]), rig.energy()["motor"]
    assert torque == pytest.approx(float(rig.true("M_wej")) + rig.clutches[0]["drag"] * 34 / 47 * rig.slip(0), abs=1e-3)
    rig.advance(0.1)
    assert rig.energy()["motor"] - before == pytest.approx(torque * 100.0 * 0.1, rel=1e-3) and torque > 50.0
    path = tmp_path / "rig.yaml"
    path.write_text(CHAPTER9.replace("output_speed: bounded", "output_speed: free", 1))
    _, free = shift_up(Rig(load_rig(path)))
    assert free[0] == pytest.approx(driven[0]) and min(free) < 0.9 * free[0]


# ---- a variant leaves out and replaces


def variant(tmp_path, text: str):
    """Returns the rig three_speed with changes."""
    (tmp_path / "rig.yaml").write_text(f"description: a variant\nbase: three_speed\n{text}")
    return load_rig(tmp_path)


def test_a_variant_leaves_out_what_it_names_with_nothing(tmp_path):
    """Without its transducer, the temperature of the oil is no signal; all other signals remain."""
    base, other = (
        load_rig("three_speed"),
        variant(
            tmp_path, "transducers: {T_oil: ~}\ninstruments: {temperature_range: ~, temperature_offset: ~, temperature_gain: ~}\n"
        ),
    )
    assert set(base.catalogue.signals) - set(other.catalogue.signals) == {"T_oil"} and other.motor == base.motor


def test_a_device_of_another_type_takes_nothing_from_the_one_that_it_replaces(tmp_path):
    text = "parts:\n  ring_stop: {part: freewheel, joins: [ground, ring]}\n  loss_out: {part: freewheel, joins: [output, ring]}\n"
    assert variant(tmp_path, text).structure.device("loss_out").part == "freewheel"


def test_what_a_variant_must_leave_out_of_its_base_as_well_is_said_with_both_files(tmp_path):
    sentence = (
        rf"three_speed/rig\.yaml:\d+: unknown key 'temperature_range'.*; .* of the base: in {tmp_path}/rig\.yaml, leave it out"
    )
    with pytest.raises(RigError, match=sentence):
        variant(tmp_path, "transducers: {T_oil: ~}\n")


def test_what_the_base_has_not_cannot_be_left_out(tmp_path):
    with pytest.raises(RigError, match=r"rig\.yaml:3: parts\.ring_stop must be a map"):
        variant(tmp_path, "parts: {ring_stop: ~}\n")
