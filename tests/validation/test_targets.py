# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's printed results: complete, consistent among themselves, and refused when badly written."""

import re
import shutil
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest

import rig_nodes
from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.base.errors import RigError
from rig_nodes.rigs.hydmag.laboratory.targets import TARGETS_FILE, load_targets
from rig_nodes.studies.validation.rows import Span

RPM = pi / 30.0
NO_HOLD = {"ZR-P1": {1, 2, 3, 4, 5, 6, 7, 8, 21, 28}, "ZR-P2": {8}}

# The main rows: id -> what is accepted in SI, set down before any calibration.
ACCEPTANCE = {
    "valve_delay_zr_p1": (0.18516, 0.20516),
    "valve_delay_zr_p2": (0.3206, 0.3406),
    "up_peak_torque_range": (244.0, 293.0),
    "up_peak_torque_spread": (None, 0.15),
    "up_t_dt_range": (0.26, 0.40),
    "down_peak_at_240": (380.0, 420.0),
    "down_t_dt_upper": (None, 0.26),
    "down_t_p_range": (0.04, 0.11),
    "down_t_o_lower": (0.1, None),
    "down_k_lower": (0.95, 1.05),
    "delay_up_dip_begins": (-0.180, -0.150),
    "up_e_loss_speed_ratio_100": (2.5, 3.5),
    "up_e_loss_speed_ratio_120": (2.5, 3.5),
    "up_t_p_at_120": (0.1, None),
}
TRENDS = {
    "up_t_dt_grows_with_load": ("grows", "m_wyj"),
    "up_t_dt_grows_with_speed": ("grows", "n_wej"),
    "down_peak_grows_with_load": ("grows", "m_wyj"),
    "down_t_dt_falls_with_load": ("falls", "m_wyj"),
    "down_t_p_falls_with_load": ("falls", "m_wyj"),
}
CALIBRATE = {
    "valve_delay_zr_p1",
    "valve_delay_zr_p2",
    "ch9_pressure_up_p1",
    "ch9_pressure_up_p2",
    "ch9_pressure_down_p1",
    "ch9_pressure_down_p2",
    "coast_down_curve",
    "coast_down_tangent_time",
    "valve_mean_torque_s1",
    "valve_mean_torque_s2",
    "delay_down_peak_19",
}


@pytest.fixture(scope="module")
def targets():
    return {target.id: target for target in load_targets()}


def test_what_the_rig_is_judged_by_first_is_there(targets):
    for name, ends in ACCEPTANCE.items():
        accepted = targets[name].low, targets[name].high
        assert accepted == tuple(end if end is None else pytest.approx(end) for end in ends), name
    assert {name: (targets[name].sign, targets[name].over) for name in TRENDS} == TRENDS
    longer = targets["down_t_o_longer_than_up"]
    assert longer.low > 0.0 and (longer.of["shift"], longer.to["shift"]) == (("II-I",), ("I-II",))
    assert {targets[name].role for name in (*ACCEPTANCE, *TRENDS)} == {"calibrate", "predict"}


def test_few_rows_may_be_fitted_and_most_must_come_out(targets):
    roles = [target.role for target in targets.values()]
    assert {name for name, target in targets.items() if target.role == "calibrate"} >= CALIBRATE
    assert roles.count("calibrate") < len(roles) / 10 and roles.count("predict") > 4 * roles.count("calibrate")


def test_a_row_that_is_no_fact_of_its_own_names_what_it_follows_from(targets):
    assert set(targets["valve_delay_p1_shorter"].implied_by) == {"valve_delay_zr_p1", "valve_delay_zr_p2"}
    for target in targets.values():
        for other, sentence in target.implied_by.items():
            assert targets[other].role in ("calibrate", "predict") and sentence.endswith("."), target.id
        assert (target.role == "implied") == bool(target.implied_by), target.id
        assert (target.role == "consistency") == target.consistent_with.endswith("."), target.id
    # the packs of the clutch bench are the thesis's model, so its statements on them are no prediction, except for their M_rest
    bench = {target.role for target in targets.values() if target.procedure == "clutch_bench" and target.quantity != "m_rest_nm"}
    assert bench == {"consistency", "information"}


SIGNS = {  # sign -> words, one of which the sentence of a row with this sign has; of a difference, its subject is the first side
    "grows": r"\b(grows?|longer|worse|more|the less the fewer|the shorter the smaller)\b",
    "falls": r"\b(falls?|sooner|less|shrinks?)\b",
    "flat": r"\b(hardly|close to|not depend|depends little|not change|no effect)\b",
    "above": r"\b(above|longer|further|more|show a torque peak)\b",
    "below": r"\b(below|lower|shorter|sooner|less)\b",
    "either": r"\b(within|off|differ)\b",
}


def test_the_sign_of_a_row_is_that_of_its_sentence(targets):
    for target in targets.values():
        sign = target.sign
        if target.kind == "difference" and not target.absolute:
            above, below = target.low is not None and target.low >= 0.0, target.high is not None and target.high <= 0.0
            sign = "above" if above else "below" if below else None
        elif target.absolute:
            sign = "either"
        if sign is not None and target.role != "information":
            assert re.search(SIGNS[sign], target.text), (target.id, sign, target.text)


def test_a_row_that_is_judged_has_a_bound_with_its_place(targets):
    for target in targets.values():
        if target.role in ("predict", "calibrate"):
            assert re.search(r"\d\.\d|tab\. \d|chapter|Annex", target.where), target.id
            assert not re.search(r"No (R2|number) is printed", target.why) or re.search(r"\b\d\.\d\.\d|9\.2\.2", target.why), (
                target.id
            )


def test_what_is_close_to_a_number_may_lie_on_both_sides_of_it(targets):
    for name in ("down_peak_1800_180", "down_peak_at_240"):
        (printed,) = targets[name].printed
        assert (targets[name].low, targets[name].high) == pytest.approx((0.95 * printed, 1.05 * printed))


def test_all_47_series_have_their_hold_phase_and_contradictions_are_named(targets):
    rows = [target for target in targets.values() if target.quantity == "hold"]
    found = {valve: {"hold": set(), "no hold": set()} for valve in NO_HOLD}
    for row in rows:
        found[row.conditions["valve"][0]][row.expected].add(row.conditions["series"][0])
    assert found == {
        valve: {"no hold": none, "hold": set(range(1, count + 1)) - none} for (valve, none), count in zip(NO_HOLD.items(), (37, 10))
    }
    for one, other in (("08", "09"), ("21", "23"), ("28", "26"), ("28", "33")):
        assert f"hold_zr_p1_{other}" in targets[f"hold_zr_p1_{one}"].conflicts


def test_every_ring_model_and_the_simulation_have_rows(targets):
    bench = [target for target in targets.values() if target.procedure == "clutch_bench"]
    rings = {
        (ring, model)
        for target in bench
        for ring in target.conditions.get("ring", ())
        for model in target.conditions.get("model", target.of.get("model", ()))
    }
    assert rings >= {
        (ring, model) for ring in ("80x115", "80x101.9", "65x115", "46x88.9", "50x76") for model in ("thesis", "osinski")
    }
    simulated = {target.quantity for target in targets.values() if target.procedure == "chapter9"}
    assert {"input_torque_max_nm", "t_p_s"} <= simulated


def test_every_row_says_why_and_every_conflict_is_a_sentence_known_at_both(targets):
    for target in targets.values():
        assert target.why.endswith(".") and target.text.endswith("."), target.id
        assert target.tolerance is not None or target.kind == "classification", target.id
        for other, sentence in target.conflicts.items():
            assert sentence.endswith("."), (target.id, other)
            assert targets[other].conflicts[target.id] == sentence


def test_shift_quantities_are_the_keys_of_the_report(targets):
    shifts = {target.quantity for target in targets.values() if target.procedure in ("grid_up", "grid_down")}
    assert {
        "t_dt_s",
        "t_p_s",
        "t_c_s",
        "t_o_s",
        "input_torque_max_nm",
        "output_speed_min_rpm",
        "k",
        "e_loss_j",
        "e_loss_settled_j",
    } == shifts & set(metric_keys())


def test_an_installed_package_has_the_file(tmp_path):
    source = tmp_path / "source"
    shutil.copytree(Path(rig_nodes.__file__).parents[1], source, ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(tmp_path / "lib")]
    built = subprocess.run(command, cwd=source, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    installed = tmp_path / "lib" / "rig_nodes" / "rigs" / "hydmag" / "targets.yaml"
    assert installed.read_bytes() == TARGETS_FILE.read_bytes()


# --- refusals -------------------------------------------------------------------------------------

SMALL = """\
procedures:
  grid_up: I to II over load and speed
quantities:
  t_p_s: [time, "speed change"]
  input_torque_max_nm: [torque, "peak"]
  dip: [ratio, "k below 0.95"]
  p1_mpa: [pressure, "pressure of S1"]
targets:
- id: peak
  text: Peaks lie between 244 and 293 Nm.
  where: 7.4.1.2
  kind: range
  quantity: input_torque_max_nm
  procedure: grid_up
  role: predict
  conditions: {shift: I-II, n_wej: [1000 rpm, 2000 rpm], m_wyj: {from: 40 Nm, to: 120 Nm}, series: all}
  printed: [244 Nm, 293 Nm]
  low: 240 Nm
  high: 295 Nm
  tolerance: 4 Nm
  why: Two digits.
  conflicts:
    falls: One grows, one falls.
- id: falls
  text: The time falls.
  where: 7.4.2.1
  kind: trend
  quantity: t_p_s
  procedure: grid_up
  role: information
  conditions: {}
  sign: falls
  over: m_wyj
  fixed: [n_wej]
  tolerance: 15 %
  why: A word.
- id: delay
  text: The delay is 330.6 ms.
  where: "7.2"
  kind: value
  quantity: t_p_s
  procedure: grid_up
  role: calibrate
  conditions: {surfaces: 18}
  statistic: mean
  across: [n_wej]
  printed: 330.6 ms
  low: 320.6 ms
  high: 340.6 ms
  tolerance: 10 ms
  why: Hum.
- id: dips
  text: It dips.
  where: 7.3.3
  kind: classification
  quantity: dip
  procedure: grid_up
  role: predict
  conditions: {}
  classes: [dip, no dip]
  expected: dip
  why: Seen.
- id: fall
  text: The pressure falls along a parabola.
  where: Annex D
  kind: curve
  quantity: p1_mpa
  procedure: grid_up
  role: calibrate
  conditions: {}
  variable: t
  variable_unit: s
  unit: MPa
  pieces:
  - [0, 0.4, [18.3, -13, 2.3]]
  - [0.4, 0.6, [0]]
  tolerance: 0.1 MPa
  why: The transducer.
- id: apart
  text: They are 6 Nm apart.
  where: 9.2.1
  kind: difference
  quantity: input_torque_max_nm
  procedure: grid_up
  role: predict
  conditions: {}
  of: {source: simulated}
  to: {source: measured}
  absolute: true
  printed: 6 Nm
  high: 6 Nm
  tolerance: 0 Nm
  why: A bound.
"""


def small(tmp_path, text):
    path = tmp_path / "tried.yaml"
    path.write_text(text)
    return {target.id: target for target in load_targets(path)}


def test_numbers_are_si_and_keep_the_laboratorys_unit(tmp_path):
    rows = small(tmp_path, SMALL)
    peak, delay, falls, fall = rows["peak"], rows["delay"], rows["falls"], rows["fall"]
    assert (peak.printed, peak.low, peak.high, peak.unit) == ((244.0, 293.0), 240.0, 295.0, "Nm")
    assert peak.conditions["n_wej"] == pytest.approx((1000.0 * RPM, 2000.0 * RPM))
    assert peak.conditions["m_wyj"] == Span(40.0, 120.0) and peak.conditions["series"] == ("all",)
    assert (delay.printed[0], delay.tolerance) == pytest.approx((0.3306, 0.01)) and delay.unit == "ms"
    assert (falls.tolerance, falls.tolerance_is_share) == (pytest.approx(0.15), True)
    assert fall.pieces[0] == (0.0, 0.4, (18.3, -13.0, 2.3)) and fall.tolerance == pytest.approx(0.1e6)
    assert rows["apart"].absolute and rows["apart"].to == {"source": ("measured",)}
    assert falls.conflicts == {"peak": "One grows, one falls."}


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("  role: calibrate", "  rol: calibrate", r":\d+: unknown key 'rol' in a target; did you mean 'role'"),
        (
            "  role: calibrate",
            "  role: fit",
            r":\d+: delay.role is 'fit', expected one of calibrate, predict, implied, consistency",
        ),
        (
            "  procedure: grid_up\n  role: information",
            "  procedure: grid\n  role: information",
            r":\d+: falls.procedure is 'grid', expected one of grid_up",
        ),
        ("quantity: t_p_s", "quantity: t_p", r":\d+: falls.quantity is 't_p', expected one of t_p_s, input_torque_max_nm"),
        ("kind: trend", "kind: slope", r":\d+: falls.kind is 'slope', expected one of value, range"),
        ("  why: Hum.\n", "", r":\d+: a target lacks the key 'why'"),
        ("why: Hum.", "why: ''", "delay.why is '', expected words"),
        ('where: "7.2"', "where: 7.2", "delay.where is 7.2, expected words .a bare number needs quotes"),
        ("low: 320.6 ms", "low: 320.6 Nm", r":\d+: delay.low: '320.6 Nm' is a torque, expected a time"),
        ("low: 320.6 ms", "low: 320.6", "delay.low: '320.6' is not a time; write a number with its unit"),
        ("low: 320.6 ms", "low: 350 ms", r":\d+: delay.low is 350 ms, above high, which is 340.6 ms"),
        ("printed: 330.6 ms", "printed: 0.3 s", "delay.printed is 0.3 s, outside of what low and high accept"),
        ("tolerance: 10 ms", "tolerance: 5 ms", "delay.tolerance is 5 ms, but low and high do not reach just that far"),
        ("tolerance: 15 %", "tolerance: -15 %", "falls.tolerance is -15 %, expected 0 or more"),
        ("printed: [244 Nm, 293 Nm]", "printed: 244 Nm", r"peak.printed is '244 Nm', expected \[lowest, highest\]"),
        ("printed: [244 Nm, 293 Nm]", "printed: [293 Nm, 244 Nm]", "peak.printed is .*, expected the lower one first"),
        ("sign: falls", "sign: down", "falls.sign is 'down', expected one of grows, falls, flat"),
        ("over: m_wyj", "over: load", "falls.over is 'load', expected one of shift, n_wej"),
        ("  sign: falls\n", "", "falls, a trend, lacks the key 'sign'"),
        ("  sign: falls", "  sign: falls\n  low: 1 s", r":\d+: unknown key 'low' in falls, a trend"),
        ("fixed: [n_wej]", "fixed: n_wej", "falls.fixed is 'n_wej', expected a list"),
        ("across: [n_wej]", "across: n_wej", "delay.across is 'n_wej', expected a list"),
        ("role: calibrate", "role: implied", "delay.role is implied; a row has the key 'implied_by' when it has the role implied"),
        ("role: calibrate", "role: consistency", "delay.role is consistency; a row has the key 'consistent_with'"),
        ("role: calibrate", "role: calibrate\n  consistent_with: It.", "delay.role is calibrate; .*'consistent_with'"),
        ("role: calibrate", "role: implied\n  implied_by: {falls: It.}", "delay.implied_by names 'falls', which has the role info"),
        ("role: calibrate", "role: implied\n  implied_by: {fell: It.}", r":\d+: delay.implied_by names 'fell', which is no row"),
        ("role: calibrate", "role: implied\n  implied_by: {peak: 3}", "delay.implied_by.peak is 3, expected one sentence"),
        ("role: calibrate", "role: implied\n  implied_by: {}", "delay.implied_by is .*, expected {id of another row: one"),
        ("  across: [n_wej]\n", "", "delay.statistic stands alone"),
        ("statistic: mean", "statistic: median", "delay.statistic is 'median', expected one of mean"),
        ("n_wej: [1000 rpm,", "n_wei: [1000 rpm,", r":\d+: unknown key 'n_wei' in peak.conditions; did you mean 'n_wej'"),
        ("n_wej: [1000 rpm,", "n_wej: [1000 Nm,", "peak.conditions.n_wej: '1000 Nm' is a torque"),
        ("from: 40 Nm, to: 120 Nm", "from: 120 Nm, to: 40 Nm", "m_wyj runs from 120 Nm to 40 Nm; expected the lower"),
        ("shift: I-II", "shift: I-III", "peak.conditions.shift is 'I-III', expected one of I-II, II-I"),
        ("surfaces: 18", "surfaces: 0", "delay.conditions.surfaces is 0, expected a whole number from 1"),
        ("expected: dip", "expected: dips", "dips.expected is 'dips', expected one of dip, no dip"),
        ("classes: [dip, no dip]", "classes: [dip]", "dips.classes is .*, expected a list of two or more names"),
        ("  unit: MPa", "  unit: Nm", "fall.unit is a torque, expected a pressure"),
        ("- [0.4, 0.6, [0]]", "- [0.5, 0.6, [0]]", "fall.pieces has .* must run forward from where the one before ends"),
        ("- [0.4, 0.6, [0]]", "- [0.4, 0.6]", r"fall.pieces has .*, expected \[from, to, \[coefficients\]\]"),
        ("  printed: 6 Nm\n  high: 6 Nm\n", "", "apart.to has nothing to be judged by; expected low, high or both"),
        ("  fixed: [n_wej]", "  fixed: [n_wej]\n  inside: many", "falls.inside is 'many', expected one of all, most"),
        ("absolute: true", "absolute: maybe", "apart.absolute is 'maybe', expected true"),
        ("    falls: One", "    fall_s: One", r":\d+: peak.conflicts names 'fall_s', which is no row"),
        ("    falls: One", "    peak: One", "peak.conflicts names the row itself"),
        ("falls: One grows, one falls.", "falls:", "peak.conflicts.falls is None, expected one sentence"),
        ("  why: A word.", "  why: A word.\n  conflicts: {peak: Again.}", "falls.conflicts names 'peak', which already"),
        ("id: delay", "id: falls", r":\d+: the id 'falls' is taken by line \d+; each id may be used once"),
        ("id: delay", "id: delay\n  id: again", r":\d+: .*duplicate key"),
        ("t_p_s: [time,", "t_p_s: [duration,", r":\d+: quantities.t_p_s must be \[dimension, .meaning.\]"),
        ("grid_up: I to II over load and speed", "grid_up:", r":\d+: procedures.grid_up must be a description"),
    ],
)
def test_a_badly_written_row_is_refused_in_one_sentence(tmp_path, old, new, sentence):
    assert old in SMALL
    with pytest.raises(RigError, match=r"tried\.yaml.*" + sentence) as refused:
        small(tmp_path, SMALL.replace(old, new, 1))
    assert "\n" not in str(refused.value)


def test_a_file_without_rows_is_refused(tmp_path):
    with pytest.raises(RigError, match=r"tried\.yaml:\d+: targets must be a list of rows"):
        small(tmp_path, SMALL.split("targets:")[0] + "targets: []\n")
