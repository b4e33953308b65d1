# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transducers that a user adds to a rig: the meaning of their signs, their ranges, their order and their errors."""

from dataclasses import MISSING

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.base.units import UNITS
from rig_nodes.cli.main import main
from rig_nodes.plant.instruments.transducers import HIGH, LOW
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.quantities import QUANTITIES
from rig_nodes.rig.transducer_types import TRANSDUCER_TYPES
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.session import Session


@pytest.fixture
def variant(tmp_path):
    """A function that writes a variant of hydmag with further lines, and returns its folder."""

    def write(text: str):
        into = tmp_path / "variant"
        into.mkdir(exist_ok=True)
        (into / "rig.yaml").write_text(f"description: a variant\nbase: hydmag\n{text}")
        return into

    return write


def test_the_sign_of_a_current_speaks_of_a_clutch_only_where_the_rig_says_so(variant):
    added = "{type: current, logged: no, shows: valve_zr_p1.current, at: motor, range: [0 A, 1 A], text: Current of something.}"
    signals = load_rig(variant(f"transducers:\n  I_own: {added}\n")).catalogue.signals
    assert signals["I_own"].sign == "positive when it flows from its supply"
    assert signals["I_zr_p1"].sign == "positive opens supply to the clutch"


BACKWARDS = """\
meshes:
  - {bodies: [w0, z3], teeth: [34, 47], reversed: yes, source: own}
  - {bodies: [wk, intermediate_shaft], teeth: [41, 41], source: own}
  - {bodies: [wk, z5], teeth: [41, 40], source: own}
"""


def test_an_output_that_a_gear_turns_backwards_needs_transducers_of_both_signs(variant):
    with pytest.raises(RigError, match=r"rig.yaml:\d+: transducers.n_wyj.range begins at 0, but gear I turns the output backwards"):
        load_rig(variant(BACKWARDS))
    torque = "transducers: {n_wyj: {range: [-314.2 rad/s, 314.2 rad/s]}, M_wyj: {range: [0 Nm, 500 Nm]}}\n"
    with pytest.raises(RigError, match=r"transducers.M_wyj.range begins at 0, but gear I turns the output backwards"):
        load_rig(variant(BACKWARDS + torque))
    both = load_rig(variant(BACKWARDS + torque.replace("[0 Nm", "[-500 Nm")))
    assert both.transmission.ratios[1] == pytest.approx(-47 / 34)
    assert both.transmission.ranges["n_wyj"][0] == -both.transmission.ranges["n_wyj"][1] < 0.0


def test_check_warns_of_an_output_that_turns_faster_than_its_transducer_shows(variant, tmp_path, capsys):
    like = "n_wyj: {like: n_out, range: [0 rpm, 2000 rpm]}"
    folder = variant(
        f"transducers: {{{like}}}\ninstruments: {{n_out_range: [2500 rpm, x], n_out_step: [1 rpm, x], n_out_gate: [2 ms, x]}}\n"
    )
    assert main(["check", str(folder), "--picture", str(tmp_path / "x.svg")]) == 0
    warning = "warning: gear II turns the output at 2927 rpm when n_wej is at 3000 rpm, and n_wyj shows at most 2500 rpm"
    assert warning in capsys.readouterr().out
    assert main(["check", "hydmag", "--picture", str(tmp_path / "x.svg")]) == 0
    assert "warning" not in capsys.readouterr().out


def test_each_type_of_transducer_has_a_quantity_a_dimension_and_a_range():
    dimensions = {dimension for dimension, _ in UNITS.values()}
    for name, one in TRANSDUCER_TYPES.items():
        assert one.quantity in QUANTITIES and one.dimension in dimensions, name
        errors = one.errors()
        assert errors["range"].metadata["dimension"] == one.dimension, name
        assert errors["range"].default is MISSING, f"the full scale of {name} must be written"
        assert ("offset" in errors) == ("gain" in errors) and ("step" in errors) == ("gate" in errors), name


P_MORE = "  p_more: {type: pressure, like: p1, shows: clutch_s1.pressure, at: clutch_s1, range: [0 MPa, 40 MPa], text: Another.}\n"
M_MORE = "  M_more: {type: torque, shows: input_shaft.torque, at: motor, range: [-500 Nm, 500 Nm], text: A second torque meter.}\n"
T_MORE = (
    "  T_more: {type: temperature, logged: no, shows: oil_supply.oil_temperature, at: oil_supply, range: [0 degC, 120 degC], "
    "text: A second thermometer.}\n"
)
N_BOTH = "  n_both: {type: speed, shows: wk.speed, at: motor, range: [-300 rad/s, 300 rad/s], text: Speed of wk either way.}\n"


def test_a_variant_adds_transducers_behind_the_logger_columns_of_its_base(variant):
    config, base = load_rig(variant(f"transducers:\n{T_MORE}{P_MORE}{M_MORE}{N_BOTH}")), load_rig("hydmag")
    columns, those_of_base = ([one.name for one in rig.catalogue.logger_channels()] for rig in (config, base))
    assert columns == [*those_of_base, "p_more", "M_more", "n_both"] == list(Rig(config).channels[: len(columns)])
    rig = turned_on(Rig(load_rig(variant(f"transducers:\n{P_MORE}{M_MORE}{T_MORE}{N_BOTH}"), {"effects.transducers": "off"})))
    for more, like in (("p_more", "p1"), ("M_more", "M_wej"), ("T_more", "T_oil")):
        assert rig.measurement(more) == rig.measurement(like) != 0.0


def turned_on(rig):
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.order_gear(1)
    rig.set("motor", 50.0, True)
    rig.advance(1.0)
    return rig


def test_a_range_below_zero_makes_a_transducer_measure_both_signs(variant):
    """Otherwise a reading would end at the error below 0."""
    # with the others, so that its plant is compiled already
    rig = Rig(load_rig(variant(f"transducers:\n{T_MORE}{P_MORE}{M_MORE}{N_BOTH}")))
    low, high = (float(rig.gauges.table[row, rig.channels.index("n_both")]) for row in (LOW, HIGH))
    assert low == -high == -rig.config.instruments.speed_range
    assert rig.gauges.table[LOW, rig.channels.index("n_wyj")] == 0.0


WRONG = {
    "a pressure without its errors": (
        "transducers:\n" + P_MORE.replace("like: p1, ", ""),
        r"variant/rig\.yaml:4: transducers\.p_more: instruments has no pressure_range for it; write it there with its value and "
        "source, or share the errors of others by like: p1$",
    ),
    "a torque with the errors of a pressure": (
        "transducers:\n" + M_MORE.replace("type: torque, ", "type: torque, like: p1, "),
        r"variant/rig\.yaml:4: transducers\.M_more has the errors of 'p1', which are those of p1, a transducer of type pressure",
    ),
    "a range beyond the instrument": (
        "transducers:\n" + M_MORE.replace("500 Nm]", "600 Nm]"),
        r"variant/rig\.yaml:4: transducers\.M_more\.range goes to 600 Nm, and instruments\.torque_range ends at 500 Nm "
        r"\(.*hydmag/rig\.yaml:\d+\); expected a range within what its instrument can show$",
    ),
    "a range beyond the instrument the other way": (
        "transducers:\n" + M_MORE.replace("-500 Nm", "-600 Nm"),
        r"range goes to -600 Nm, and instruments\.torque_range ends at 500 Nm",
    ),
    "an instrument that ends before the range of the base": (
        'instruments:\n  p1_range: [25 MPa, "tried"]\n',
        r"variant/rig\.yaml:4: instruments\.p1_range ends at 25 MPa, and transducers\.p1\.range goes to 40 MPa "
        r"\(.*hydmag/rig\.yaml:\d+\)",
    ),
    "a coil current that nothing measures": (
        "transducers: {I_zr_p1: ~}\n",
        r"hydmag/rig\.yaml:\d+: parts\.valve_zr_p1: nothing measures its current, which a controller needs; give transducers one "
        r"with type: current, shows: valve_zr_p1\.current; this line is of the base: in \S*variant/rig\.yaml",
    ),
    "a pressure of a clutch that nothing measures": (
        "parts: {valve_zr_p1: {beside: ~}}\ntransducers: {p1: ~}\n",
        r"hydmag/rig\.yaml:\d+: parts\.clutch_s1: nothing measures its pressure, which a controller needs; give transducers one "
        r"with type: pressure, shows: clutch_s1\.pressure",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_transducer_that_cannot_be_is_refused_where_it_stands(variant, what):
    text, sentence = WRONG[what]
    with pytest.raises(RigError, match=sentence):
        load_rig(variant(text))


def test_a_variant_with_meters_of_other_names_is_told_what_to_write_and_where(variant):
    meter = "{type: torque, shows: input_shaft.torque, at: motor, range: [-500 Nm, 500 Nm], text: A meter.}"
    folder = variant(f"transducers:\n  M_wej: ~\n  M_in: {meter}\n")
    with pytest.raises(RigError, match=r"; write in \S*variant/rig\.yaml input: \{torque: M_in\}, because"):
        load_rig(folder)
    folder = variant(f"transducers:\n  M_wej: ~\n  M_in: {meter}\ninput: {{torque: M_in}}\n")
    assert load_rig(folder).structure.input.torque == "M_in"


def test_what_is_not_fitted_may_have_any_range():
    assert load_rig("clutch_bench").instruments.force_fitted is False
    for name in ("hydmag", "chapter9", "three_speed", "cylinder_bench", "spring_bench"):
        load_rig(name)


BOTH_WAYS = (
    "transducers: {n_wyj: {range: [-314.2 rad/s, 314.2 rad/s]}}\n"
    'trips: {too_fast: {signal: n_wyj, above: [400 rpm, "assumed"], delay: [50 ms, "assumed"]},\n'
    '  backwards: {signal: n_wyj, below: [-400 rpm, "assumed"], delay: [50 ms, "assumed"]}}\n'
)


def test_a_trip_of_a_speed_that_has_both_signs_watches_it_as_shown(variant):
    with Session(load_rig(variant(BACKWARDS + BOTH_WAYS))) as session:
        session.set("oil", "4 MPa")
        session.advance(0.3)
        session.set("shift", "I")
        session.advance(0.5)
        session.set("motor", "800 rpm")
        session.advance(1.5)
        assert session.read("n_wyj") < 0.0
        assert session.reason.startswith("trip backwards: the reading of n_wyj is -4"), session.reason
        assert "below its limit of -400 rpm and for 50 ms not above -392 rpm again" in session.reason


def test_a_temperature_below_zero_is_no_size(variant):
    cold = 'trips: {cold: {signal: T_oil, below: [5 degC, "assumed"]}}\n'
    with Session(load_rig(variant(cold), {"oil_supply.temperature": "-20 degC"})) as session:
        session.advance(0.1)
        assert session.reason.startswith("trip cold: ")


def test_the_torques_of_a_gear_that_turns_backwards_may_differ_as_much_as_those_of_one_that_turns_forwards(variant):
    both, forwards = load_rig(variant(BACKWARDS + BOTH_WAYS)), load_rig("hydmag")
    limits = [{trip.name: trip.limit for trip in rig.trips}["contradicts_M_wej_I"] for rig in (both, forwards)]
    assert limits[0] == pytest.approx(limits[1])
