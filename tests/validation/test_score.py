# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Score of a validation: hold phase, trivial predictors, and the comparison with chapter 9, on records made by hand."""

from math import pi

import pytest

from rig_nodes.rigs.hydmag.laboratory.derived import gaps
from rig_nodes.rigs.hydmag.laboratory.evaluate import evaluate
from rig_nodes.rigs.hydmag.laboratory.records import Record
from rig_nodes.rigs.hydmag.laboratory.score import balanced_accuracy, trivial
from rig_nodes.rigs.hydmag.laboratory.side_by_side import closer, comparisons, farthest, mean_distance, nearest
from rig_nodes.rigs.hydmag.laboratory.targets import load_targets

RPM = pi / 30.0
TARGETS = {target.id: target for target in load_targets()}
HOLDS = [target for target in TARGETS.values() if target.quantity == "hold"]


def holds(answer):
    """Returns the rows of all 47 series for a rig that answers by (series' target)."""
    records = [
        Record(
            "profile_series",
            {"n_wej": 500.0 * RPM, "m_wyj": 30.0, "valve": one.conditions["valve"][0], "series": one.conditions["series"][0]},
            {"hold": answer(one)},
        )
        for one in HOLDS
    ]
    return [evaluate(one, records) for one in HOLDS], records


def grid(procedure, shift, rpm, nm, source=None, **values):
    more = {} if source is None else {"source": source}
    return Record(procedure, {"shift": shift, "n_wej": rpm * RPM, "m_wyj": float(nm), **more}, values)


def judged(names, records):
    return [evaluate(TARGETS[name], [r for r in records if TARGETS[name].quantity in r.values]) for name in names]


# --- hold phase and trivial predictors ------------------------------------------------------------


def test_always_hold_is_worth_a_half_whatever_the_count_says():
    rows, records = holds(lambda one: "hold")
    assert sum(row.verdict == "inside" for row in rows) == 36
    assert balanced_accuracy(rows) == balanced_accuracy(rows, ()) == 0.5
    group = trivial(rows, records)["hold"]
    assert group["predictor"] == "always hold"
    assert group["predicted"]["rig"] == group["predicted"]["trivial"] == 35  # one of the 36 repeats another series


def test_series_21_counts_only_where_it_is_asked_for():
    rows, _ = holds(lambda one: "hold" if one.id == "hold_zr_p1_21" else one.expected)
    assert balanced_accuracy(rows) == 1.0
    assert balanced_accuracy(rows, ()) == pytest.approx(0.5 * (1.0 + 10.0 / 11.0))
    undecided, _ = holds(lambda one: None)
    assert balanced_accuracy(undecided) == 0.0
    assert balanced_accuracy(rows[:1]) is None


def test_the_trivial_predictor_of_a_grid_has_no_trend_and_the_mean_of_what_is_printed():
    records = [
        grid("grid_up", "I-II", rpm, nm, t_dt_s=0.2 + 0.001 * nm) for rpm in (1000, 1200, 1500, 1800, 2000) for nm in (40, 80, 120)
    ]
    rows = judged(["up_t_dt_range", "up_t_dt_grows_with_load"], records)
    assert [row.verdict for row in rows] == ["outside", "inside"]
    group = trivial(rows, records)["grid_up"]
    # 0.33 s, the mean of 0.26 and 0.40 s, at every load
    assert group["predicted"] == {"rows": 2, "rig": 1, "trivial": 1}
    assert "no dependence on load and speed" in group["predictor"]


def test_the_trivial_predictor_of_chapter_9_takes_the_simulation_for_the_measurement():
    records = [
        grid("chapter9", "I-II", 1500, nm, source, input_torque_max_nm=peak)
        for nm in (40, 80, 120)
        for source, peak in (("simulated", 286.0), ("measured", 250.0 + nm / 10))
    ]
    rows = judged(["ch9_up_peak_1500", "ch9_up_peak_grows_more"], records)
    assert rows[0].verdict == "outside"
    # within 6 Nm of itself, but nothing grows more than itself
    assert trivial(rows, records)["chapter9"]["predicted"]["trivial"] == 1


def test_the_largest_difference_of_t_p21_stands_at_both_ends_or_not():
    def of(measured):
        loads = (40, 80, 120, 150, 180, 240)
        return gaps(
            [grid("chapter9", "II-I", 1500, nm, "simulated", t_p_s=0.05) for nm in loads]
            + [grid("chapter9", "II-I", 1500, nm, "measured", t_p_s=t) for nm, t in zip(loads, measured)]
        )

    assert of([0.02, 0.04, 0.05, 0.05, 0.04, 0.03])[0].values == {"t_p_gap": "largest at both ends"}
    assert of([0.02, 0.04, 0.05, 0.05, 0.02, 0.03])[0].values == {"t_p_gap": "not so"}
    assert of([0.02, 0.04, None, 0.05, 0.02, 0.03])[0].values == {"t_p_gap": None}


# --- chapter 9, side by side ----------------------------------------------------------------------


def test_distances_to_a_measurement_that_is_known_within_an_interval():
    assert mean_distance(10.0, ((12.0, 14.0),)) == 3.0
    assert mean_distance(13.0, ((12.0, 14.0),)) == 0.5
    assert mean_distance(10.0, ((8.0, 8.0), (14.0, 14.0))) == 3.0
    assert (nearest(10.0, ((12.0, 14.0),)), farthest(10.0, ((12.0, 14.0),))) == (2.0, 4.0)
    assert nearest(13.0, ((12.0, 14.0),)) == 0.0


def test_who_is_closer_is_said_only_where_it_does_not_depend_on_the_interval():
    assert closer(thesis=10.0, rig=13.0, pieces=((12.0, 14.0),)) == "rig"
    assert closer(thesis=13.0, rig=10.0, pieces=((12.0, 14.0),)) == "thesis"
    assert closer(thesis=12.0, rig=14.0, pieces=((12.0, 14.0),)) == "open"
    assert closer(thesis=12.0, rig=12.0, pieces=((12.0, 14.0),)) == "open"


def test_the_measured_peak_at_240_nm_is_the_one_of_two_that_is_close_to_400():
    records = [
        grid("chapter9", "II-I", 1500, 240, "simulated", input_torque_max_nm=366.0),
        grid("chapter9", "II-I", 1500, 240, "measured", input_torque_max_nm=398.0),
        grid("chapter9", "II-I", 1500, 200, "simulated", input_torque_max_nm=300.0),
        grid("chapter9", "II-I", 1500, 200, "measured", input_torque_max_nm=330.0),
    ]
    found = comparisons(records)
    assert set(found) == {"down_peak"}  # nothing is left out but what did not run
    (point,) = found["down_peak"]["points"]  # and nothing is stated for 200 Nm
    assert point["measured"] == [[402.0, 402.0]] and point["closer"] == "rig"
    assert found["down_peak"]["thesis"]["distance"] == pytest.approx(36.0)
    assert found["down_peak"]["rig"]["distance"] == pytest.approx(4.0)
    assert found["down_peak"]["closer"] == "rig" and found["down_peak"]["unit"] == "Nm"


def test_a_measured_time_lies_above_the_simulated_one_and_within_what_was_measured():
    records = [
        grid("chapter9", "II-I", 1200, 150, "simulated", t_p_s=0.025),
        grid("chapter9", "II-I", 1200, 150, "measured", t_p_s=0.022),
    ]
    (point,) = comparisons(records)["t_p21"]["points"]
    assert point["measured"] == [[0.04, pytest.approx(0.055)]] and point["closer"] == "thesis"
