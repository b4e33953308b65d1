# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Verdicts of single rows on records made by hand: every kind, hits, misses, ties, and missing values."""

import dataclasses
from math import inf, nan, pi

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rigs.hydmag.laboratory.evaluate import evaluate
from rig_nodes.rigs.hydmag.laboratory.records import Record, average, select
from rig_nodes.rigs.hydmag.laboratory.targets import load_targets
from rig_nodes.studies.validation.rows import Span, Target

RPM = pi / 30.0
UP = {"shift": ("I-II",), "n_wej": (1000.0 * RPM, 2000.0 * RPM), "m_wyj": Span(40.0, 120.0)}


def target(kind, quantity="input_torque_max_nm", procedure="grid_up", conditions=UP, role="predict", dimension="torque", **more):
    return Target(
        id="row",
        text="A row.",
        where="7",
        kind=kind,
        quantity=quantity,
        dimension=dimension,
        procedure=procedure,
        role=role,
        why="A reason.",
        line=1,
        conditions=conditions,
        **more,
    )


def grid(values, quantity="input_torque_max_nm", **more):
    """Returns records from {(rpm, Nm): value}."""
    return [
        Record("grid_up", {"shift": "I-II", "n_wej": rpm * RPM, "m_wyj": float(nm), **more}, {quantity: value})
        for (rpm, nm), value in values.items()
    ]


def verdict(row_target, records):
    return evaluate(row_target, records).verdict


FLAT = {(1000, 40): 250.0, (1000, 120): 260.0, (2000, 40): 270.0, (2000, 120): 280.0}


def test_a_range_takes_every_single_value_and_both_ends():
    row = evaluate(target("range", low=250.0, high=280.0), grid(FLAT))
    assert (row.verdict, row.count, row.inside, row.basis) == ("inside", 4, 4, "predicted")
    row = evaluate(target("range", low=250.0, high=279.999), grid(FLAT))
    assert (row.verdict, row.count, row.inside, row.value) == ("outside", 4, 3, 280.0)
    assert row.place == {"n_wej": pytest.approx(2000.0 * RPM), "m_wyj": 120.0}
    assert evaluate(target("range", low=255.0, high=275.0), grid(FLAT)).value in (250.0, 280.0)


def test_bounds_are_open_on_the_other_side():
    assert verdict(target("upper", high=280.0), grid(FLAT)) == "inside"
    assert verdict(target("upper", high=270.0), grid(FLAT)) == "outside"
    assert verdict(target("lower", low=250.0), grid(FLAT)) == "inside"
    assert verdict(target("value", low=251.0, high=inf), grid(FLAT)) == "outside"


def test_what_is_not_there_is_not_compared_but_a_miss_stays_a_miss():
    row = evaluate(target("upper", high=300.0), grid({(1000, 40): 250.0}))
    assert row.verdict == "not compared" and "2000 rpm" in row.reason
    assert verdict(target("upper", high=300.0), []) == "not compared"
    for bad in (None, nan, inf):
        row = evaluate(target("upper", high=300.0), grid({**FLAT, (2000, 80): bad}))
        assert row.verdict == "not compared" and "80 Nm" in row.reason, bad
        assert row.count == row.inside == 4
    assert verdict(target("upper", high=265.0), grid({**FLAT, (2000, 80): None})) == "outside"


def test_a_value_that_was_not_found_says_why():
    records = grid({(1000, 40): 250.0})
    records.append(
        Record(
            "grid_up",
            {"shift": "I-II", "n_wej": 2000.0 * RPM, "m_wyj": 40.0},
            {"input_torque_max_nm": None},
            {"input_torque_max_nm": "the output never settled"},
        )
    )
    assert "the output never settled" in evaluate(target("upper", high=300.0), records).reason


def test_information_is_shown_and_not_judged():
    row = evaluate(target("upper", high=260.0, role="information"), grid(FLAT))
    assert (row.verdict, row.basis, row.value) == ("not compared", "information", 280.0)
    assert "A reason." in row.reason


def test_other_conditions_spans_and_parts_of_a_test_are_left_out():
    records = grid({**FLAT, (2000, 20): 999.0, (1500, 80): 999.0}) + grid({(2000, 40): 999.0}, phase="before")
    records += [Record("delay_series", records[0].conditions, {"input_torque_max_nm": 999.0})]
    assert verdict(target("upper", high=280.0), records) == "inside"
    almost = grid({(1000 * (1 + 1e-12), 40.0 - 1e-11): 250.0, (2000, 120): 260.0})
    assert verdict(target("upper", high=280.0), almost) == "inside"


def test_statistics_are_taken_across_one_condition_and_within_the_others():
    spread = {"statistic": "spread", "across": ("m_wyj",), "fixed": ("n_wej",)}
    assert verdict(target("upper", high=10.0, **spread), grid(FLAT)) == "inside"
    row = evaluate(target("upper", high=9.9, **spread), grid({**FLAT, (2000, 80): 300.0}))
    assert (row.verdict, row.value, row.count, row.inside) == ("outside", 30.0, 2, 0)
    share = target("upper", high=0.15, statistic="spread_share", across=("m_wyj",), fixed=("n_wej",))
    fast = {(2000, 40): 1.0, (2000, 80): 1.0}
    assert verdict(share, grid({(1000, 40): 200.0, (1000, 120): 230.0, **fast})) == "inside"
    assert evaluate(share, grid({(1000, 40): 200.0, (1000, 120): 230.1, **fast})).value == pytest.approx(0.1505)
    highest = target("lower", low=275.0, statistic="highest", across=("n_wej",), conditions={**UP, "m_wyj": (40.0,)})
    assert evaluate(highest, grid(FLAT)).value == 270.0
    lone = evaluate(target("upper", high=9.0, **spread), grid({(1000, 40): 1.0, (2000, 40): 1.0}))
    assert lone.verdict == "not compared" and "no spread" in lone.reason
    means = target("value", low=255.0, high=275.0, statistic="mean", across=("m_wyj",), fixed=("n_wej",))
    assert verdict(means, grid(FLAT)) == "inside"


def test_all_series_must_be_there():
    conditions = {"shift": ("I-II",), "series": ("all",)}
    records = [Record("delay_series", {"shift": "I-II", "series": n}, {"input_torque_max_nm": 200.0 + n}) for n in range(1, 20)]
    row = target("upper", procedure="delay_series", conditions=conditions, high=300.0)
    assert verdict(row, records) == "inside"
    cut = evaluate(row, records[:7] + records[8:])
    assert cut.verdict == "not compared" and "series 8" in cut.reason
    spread = target(
        "value", procedure="delay_series", conditions=conditions, low=18.0, high=18.0, statistic="spread", across=("series",)
    )
    assert verdict(spread, records) == "inside"


def test_a_difference_pairs_like_with_like():
    both = {"n_wej": (1000.0 * RPM, 2000.0 * RPM), "m_wyj": Span(40.0, 120.0)}
    row = target("difference", low=100.0, conditions=both, of={"shift": ("I-II",)}, to={"shift": ("II-I",)})
    records = grid({(1000, 40): 250.0, (2000, 40): 300.0}) + grid({(1000, 40): 150.0, (2000, 40): 180.0}, shift="II-I")
    assert verdict(row, records) == "inside"
    records[-1].values["input_torque_max_nm"] = 201.0
    worst = evaluate(row, records)
    assert (worst.verdict, worst.value, worst.count) == ("outside", 99.0, 2)
    assert worst.place == {"n_wej": pytest.approx(2000.0 * RPM)}  # the load is the same in both
    other_load = grid({(1000, 80): 1.0, (2000, 80): 1.0}, shift="II-I")
    alone = evaluate(row, grid({(1000, 40): 1.0, (2000, 40): 1.0}) + other_load)
    assert alone.verdict == "not compared" and "both sides" in alone.reason


def test_a_difference_takes_every_one_against_every_one():
    row = target(
        "difference",
        low=0.0,
        conditions={"shift": ("I-II",), "m_wyj": Span(40.0, 170.0)},
        of={"n_wej": (1800.0 * RPM, 2000.0 * RPM)},
        to={"n_wej": (1000.0 * RPM, 1200.0 * RPM)},
    )
    values = {(1800, 40): 130.0, (2000, 40): 140.0, (1000, 40): 120.0, (1200, 40): 131.0}
    worst = evaluate(row, grid(values))
    assert (worst.verdict, worst.value, worst.count, worst.inside) == ("outside", -1.0, 4, 3)
    assert worst.place["n_wej"] == pytest.approx((1800.0 * RPM, 1200.0 * RPM))


def test_an_absolute_difference_and_a_ratio():
    sides = {
        "conditions": {"shift": ("I-II",), "m_wyj": (40.0,)},
        "of": {"n_wej": (2000.0 * RPM,)},
        "to": {"n_wej": (1000.0 * RPM,)},
    }
    records = grid({(2000, 40): 300.0, (1000, 40): 306.0})
    assert evaluate(target("difference", high=6.0, absolute=True, **sides), records).verdict == "inside"
    assert evaluate(target("difference", high=5.9, absolute=True, **sides), records).value == 6.0
    ratio = target("ratio", low=2.5, high=3.5, **sides)
    assert evaluate(ratio, grid({(2000, 40): 3500.0, (1000, 40): 1000.0})).verdict == "inside"
    assert evaluate(ratio, grid({(2000, 40): 3501.0, (1000, 40): 1000.0})).verdict == "outside"
    assert "denominator" in evaluate(ratio, grid({(2000, 40): 3501.0, (1000, 40): 0.0})).reason


def test_a_ratio_of_the_highest_is_not_the_highest_ratio():
    row = target(
        "ratio",
        low=2.5,
        high=3.0,
        statistic="highest",
        across=("m_wyj",),
        conditions={"shift": ("I-II",), "m_wyj": Span(40.0, 120.0)},
        of={"n_wej": (2000.0 * RPM,)},
        to={"n_wej": (1000.0 * RPM,)},
    )
    # ratios at one load are 4 and 2.5, of the highest 2.5
    values = {(2000, 40): 400.0, (2000, 120): 500.0, (1000, 40): 100.0, (1000, 120): 200.0}
    assert evaluate(row, grid(values)).value == 2.5


def test_a_difference_of_spreads():
    row = target(
        "difference",
        low=0.0,
        statistic="spread",
        across=("m_wyj",),
        conditions={"shift": ("I-II",), "m_wyj": Span(40.0, 120.0)},
        of={"source": ("measured",)},
        to={"source": ("simulated",)},
    )
    measured = grid({(1000, 40): 250.0, (1000, 120): 280.0}, source="measured")
    simulated = grid({(1000, 40): 250.0, (1000, 120): 270.0}, source="simulated")
    assert evaluate(row, measured + simulated).value == 10.0
    swapped = [
        Record(r.procedure, {**r.conditions, "source": source}, r.values)
        for source, records in (("measured", simulated), ("simulated", measured))
        for r in records
    ]
    assert verdict(row, swapped) == "outside"


LOADS = {"over": "m_wyj", "fixed": ("n_wej",)}


def line(values, rpm=(1000, 2000)):
    return grid({(speed, 40 + 20 * i): value for speed in rpm for i, value in enumerate(values)})


def test_a_trend_may_step_back_by_its_tolerance_and_no_more():
    grows = target("trend", sign="grows", tolerance=0.5, **LOADS)
    assert verdict(grows, line([1.0, 2.0, 1.5, 3.0])) == "inside"
    row = evaluate(grows, line([1.0, 2.0, 1.25, 3.0]))
    assert (row.verdict, row.value, row.low, row.judged_by) == ("outside", -0.75, -0.5, "worst step")
    assert row.place["m_wyj"] == (80.0, 60.0)
    falls = target("trend", sign="falls", tolerance=0.5, **LOADS)
    assert verdict(falls, line([3.0, 1.5, 2.0, 1.0])) == "inside"
    assert verdict(falls, line([3.0, 1.0, 1.75, 0.5])) == "outside"


def test_a_trend_must_end_on_its_side_even_within_the_tolerance():
    grows = target("trend", sign="grows", tolerance=0.5, **LOADS)
    row = evaluate(grows, line([1.0, 1.25, 1.0]))
    assert (row.verdict, row.value, row.judged_by) == ("outside", 0.0, "last less first")
    assert verdict(target("trend", sign="falls", tolerance=0.5, **LOADS), line([1.0, 1.25, 1.0])) == "outside"
    exact = target("trend", sign="grows", tolerance=0.0, **LOADS)
    assert verdict(exact, line([1.0, 1.0, 2.0])) == "inside"


def test_flat_and_a_tolerance_in_percent():
    flat = target("trend", sign="flat", tolerance=2.0, **LOADS)
    assert verdict(flat, line([10.0, 12.0, 11.0])) == "inside"
    assert evaluate(flat, line([10.0, 12.25, 11.0])).value == 2.25
    share = target("trend", sign="flat", tolerance=0.25, tolerance_is_share=True, **LOADS)
    assert verdict(share, line([10.0, 12.5, 11.0])) == "inside"
    assert verdict(share, line([10.0, 12.6, 11.0])) == "outside"


def test_a_trend_goes_through_what_is_fixed_and_averages_what_is_tested_twice():
    grows = target("trend", sign="grows", tolerance=0.0, **LOADS)
    mixed = line([1.0, 2.0], rpm=(1000,)) + line([2.0, 1.0], rpm=(2000,))
    row = evaluate(grows, mixed)
    assert (row.verdict, row.count, row.inside) == ("outside", 2, 1)
    twice = [
        Record("delay_series", {"t12": t12, "series": n}, {"input_torque_max_nm": value})
        for n, (t12, value) in enumerate([(-0.2, 1.0), (-0.2, 3.0), (-0.1, 2.5)], 1)
    ]
    over = target("trend", sign="grows", tolerance=0.0, over="t12", procedure="delay_series", conditions={"series": (1, 2, 3)})
    assert verdict(over, twice) == "inside"
    short = evaluate(grows, grid({(1000, 40): 1.0, (2000, 40): 1.0}))
    assert short.verdict == "not compared" and "m_wyj" in short.reason
    assert evaluate(grows, line([1.0, None, 3.0])).verdict == "not compared"


def test_a_trend_of_a_statistic():
    row = target("trend", sign="falls", tolerance=1.0, statistic="spread", across=("n_wej",), over="m_wyj")
    assert verdict(row, grid({(1000, 40): 10.0, (2000, 40): 15.0, (1000, 80): 20.0, (2000, 80): 22.0})) == "inside"
    assert verdict(row, grid({(1000, 40): 10.0, (2000, 40): 12.0, (1000, 80): 20.0, (2000, 80): 25.0})) == "outside"


def test_most_is_more_than_half():
    row = next(t for t in load_targets() if t.id == "up_t_dt_grows_with_speed")  # "for most loads"
    assert row.inside == "most"

    def shifts(sense):
        return grid(
            {(rpm, nm): 0.3 + sign * rpm * 1e-4 for nm, sign in sense.items() for rpm in (1000, 1200, 1500, 1800, 2000)},
            quantity="t_dt_s",
        )

    assert evaluate(row, shifts({40: 1, 80: 1, 120: -1})).verdict == "inside"
    assert evaluate(row, shifts({40: 1, 120: -1})).verdict == "outside"
    of_all = dataclasses.replace(row, inside="all")
    assert evaluate(of_all, shifts({40: 1, 80: 1, 120: -1})).verdict == "outside"
    # an unknown value decides nothing where the others do
    unknown = grid({(rpm, 150): None for rpm in (1000, 2000)}, quantity="t_dt_s")
    wide = dataclasses.replace(row, conditions={**row.conditions, "m_wyj": Span(40.0, 240.0)})
    assert evaluate(wide, [*shifts({40: 1, 80: 1, 120: 1}), *unknown]).verdict == "inside"
    assert evaluate(wide, [*shifts({40: 1, 80: 1, 120: -1}), *unknown]).verdict == "not compared"
    assert evaluate(wide, [*shifts({40: 1, 80: -1, 120: -1}), *unknown]).verdict == "outside"


def test_fits_have_their_r2():
    # y = 0, 1, 0, 1 over 0, 1, 2, 3: slope 0.2, R2 = 0.2
    row = target("fit", shape="linear", low=0.2000001, **LOADS)
    result = evaluate(row, line([0.0, 1.0, 0.0, 1.0]))
    assert result.verdict == "outside" and result.value == pytest.approx(0.2)
    assert verdict(target("fit", shape="linear", low=0.1999, **LOADS), line([0.0, 1.0, 0.0, 1.0])) == "inside"
    parabola = line([0.0, 1.0, 4.0, 9.0])
    assert evaluate(target("fit", shape="quadratic", low=0.9, **LOADS), parabola).value == pytest.approx(1.0)
    assert evaluate(target("fit", shape="linear", low=0.93, **LOADS), parabola).verdict == "outside"  # 0.9184
    few = evaluate(target("fit", shape="quadratic", low=0.9, **LOADS), line([1.0, 2.0, 5.0]))
    assert few.verdict == "not compared" and "too few" in few.reason
    level = evaluate(target("fit", shape="linear", low=0.9, **LOADS), line([5.0] * 4))
    assert level.verdict == "not compared" and "does not change" in level.reason


def test_a_fit_over_a_setting_takes_all_points_and_one_within_a_test_each_test():
    speeds = 1000.0 * RPM, 1500.0 * RPM, 2000.0 * RPM
    conditions = {"shift": ("I-II",), "n_wej": speeds, "m_wyj": Span(40.0, 120.0)}
    values = {(rpm, nm): rpm / 1000.0 + (nm - 40) / 10.0 for rpm in (1000, 1500, 2000) for nm in (40, 60)}
    row = target("fit", shape="linear", low=0.5, over="n_wej", conditions=conditions)
    # two parallel lines 2 apart, each rising by 1: total variance 1 + 1/6, explained 1/6
    assert evaluate(row, grid(values)).value == pytest.approx(1.0 / 7.0)
    rises = [
        Record("profile_series", {"valve": "ZR-P1", "series": n, "time": t}, {"pressure_rise": n * t})
        for n in (1, 2)
        for t in (0.0, 0.1, 0.2)
    ]
    each = target("fit", "pressure_rise", "profile_series", {"valve": ("ZR-P1",)}, shape="linear", low=0.99, over="time")
    result = evaluate(each, rises)
    assert (result.verdict, result.count) == ("inside", 2)


CURVE = {"variable": "t", "variable_unit": "s", "unit": "MPa", "pieces": ((0.0, 1.0, (2.0, 0.0)), (1.0, 2.0, (2.0,)))}


def trace(function, times):
    return [
        Record("grid_up", {"shift": "I-II", "n_wej": 1000.0 * RPM, "m_wyj": 40.0, "time": t}, {"p1_mpa": function(t) * 1e6})
        for t in times
    ]


def test_a_curve_is_judged_by_its_deviation_over_the_whole_span():
    row = target("curve", "p1_mpa", conditions={"shift": ("I-II",)}, dimension="pressure", tolerance=0.1e6, **CURVE)
    times = [i / 100.0 for i in range(-5, 230)]

    def printed(t):
        return 2.0 * t if t < 1.0 else 2.0

    assert evaluate(row, trace(printed, times)).value == pytest.approx(0.0, abs=1.0)
    assert evaluate(row, trace(lambda t: printed(t) + 0.0999, times)).verdict == "inside"
    result = evaluate(row, trace(lambda t: printed(t) + (0.2 if t < 1.0 else 0.0), times))
    assert result.verdict == "outside" and result.value == pytest.approx(0.2e6 / 2**0.5, rel=0.01)
    short = evaluate(row, trace(printed, [t for t in times if t < 1.5]))
    assert short.verdict == "not compared" and "covers" in short.reason


def test_a_class_must_be_the_expected_one_in_every_record():
    row = target("classification", "dip", "delay_series", {"series": (1, 2)}, classes=("dip", "no dip"), expected="dip")
    records = [Record("delay_series", {"series": n}, {"dip": "dip"}) for n in (1, 2)]
    assert verdict(row, records) == "inside"
    records[1].values["dip"] = "no dip"
    result = evaluate(row, records)
    assert (result.verdict, result.value, result.place) == ("outside", "no dip", {"series": 2})
    records[1].values["dip"] = None
    assert verdict(row, records) == "not compared"
    assert verdict(row, records[:1]) == "not compared"
    # a class that the row does not list, and a number of the same quantity, are left out
    records[1].values["dip"] = "dip"
    assert (
        verdict(
            row,
            [
                *records,
                Record("delay_series", {"series": 2}, {"dip": "monotone"}),
                Record("delay_series", {"series": 2}, {"dip": 0.9}),
            ],
        )
        == "inside"
    )


def test_repeats_are_averaged_and_none_spoils_the_mean():
    def once(peak, hold):
        return [
            Record("profile_series", {"series": 1}, {"engagement_peak_nm": peak, "hold": hold}),
            Record("profile_series", {"series": 1, "time": 0.0}, {"pressure_rise": peak}),
        ]

    (mean, first) = average([once(100.0, "hold"), once(104.0, "hold")])
    assert mean.values == {"engagement_peak_nm": 102.0, "hold": "hold"} and first.values == {"pressure_rise": 100.0}
    mean = average([once(100.0, "hold"), once(None, "no hold")])[0]
    assert mean.values == {"engagement_peak_nm": None, "hold": None} and "disagree" in mean.why["hold"]
    with pytest.raises(RigError, match="repeats"):
        average([once(1.0, "hold"), []])


def test_a_grid_row_finds_the_shifts_of_the_other_grid():
    down = Record("grid_down", {"shift": "II-I", "n_wej": 1000.0 * RPM, "m_wyj": 40.0}, {"t_dt_s": 0.2})
    assert select([down], "grid_up", "t_dt_s", {"shift": ("II-I",)}) == [down]
    assert select([down], "delay_series", "t_dt_s", {"shift": ("II-I",)}) == []


def test_every_row_of_the_file_is_judged_and_none_by_nothing():
    for row in load_targets():
        result = evaluate(row, [])
        assert result.verdict == "not compared" and result.reason, row.id
        assert result.as_dict()["id"] == row.id
