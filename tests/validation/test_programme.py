# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""From runs to records: the values that the readers find in synthetic shifts, the series, and the necessary runs."""

from functools import cache
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import PERIOD, Shift

from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory import programme, readers
from rig_nodes.rigs.hydmag.laboratory.derived import derive, dip_begins
from rig_nodes.rigs.hydmag.laboratory.evaluate import evaluate
from rig_nodes.rigs.hydmag.laboratory.records import Record
from rig_nodes.rigs.hydmag.laboratory.targets import load_targets
from rig_nodes.runs.procedure import run_repeat
from rig_nodes.runs.workers import Workers

BOX = load_rig("hydmag").transmission

RPM = pi / 30.0
UP = {"shift": "I-II", "n_wej": 1500.0 * RPM, "m_wyj": 80.0}
TARGETS = {target.id: target for target in load_targets()}


def run_of(recording):
    return SimpleNamespace(recording=recording, end={"state": "ended", "reason": ""}, events=[])


# --- readers --------------------------------------------------------------------------------------


def test_a_shift_gives_si_values_and_what_follows_from_them():
    (records,) = readers.grid_up(UP, run_of(Shift(peak=250.0).recording()))
    whole = records[0]
    # made by hand: fall 0.45, departure 0.60, end 0.70, settled 0.80 s after the order
    assert whole.values["t_dt_s"] == pytest.approx(0.25, abs=3e-3)
    assert whole.values["t_p_s"] == pytest.approx(0.10, abs=3e-3)
    assert whole.values["speed_delay_s"] == pytest.approx(0.15, abs=4e-3)
    assert whole.values["t_c_s"] == pytest.approx(0.70, abs=3e-3)
    assert whole.values["peak_share"] == pytest.approx(250.0 / 80.0, rel=5e-3)
    assert whole.values["output_speed_min_rpm"] == pytest.approx(1500.0 * RPM * 34.0 / 47.0, rel=2e-3)  # rad/s
    assert whole.values["e_loss_release_j"] == pytest.approx(whole.values["e_loss_settled_j"] - whole.values["e_loss_j"])
    phases = {r.conditions["phase"]: r.values["input_torque_max_nm"] for r in records if "phase" in r.conditions}
    assert phases == {"shift": pytest.approx(250.0, rel=5e-3), "before": pytest.approx(88.0, abs=0.1)}


def test_pressures_are_counted_from_their_own_start():
    (records,) = readers.grid_up(UP, run_of(Shift(fall_rate=13e6).recording()))
    falling = {r.conditions["time"]: r.values["p1_mpa"] for r in records if "p1_mpa" in r.values}
    assert falling[0.0] == pytest.approx(2.3e6, abs=0.03e6)
    assert falling[0.1] == pytest.approx(2.3e6 - 1.3e6, abs=0.03e6)
    rising = {r.conditions["time"]: r.values["p2_mpa"] for r in records if "p2_mpa" in r.values}
    assert rising[0.0] == pytest.approx(0.0, abs=0.01e6)
    assert rising[0.05] == pytest.approx(0.5 * 0.369e6, abs=0.01e6)  # the kiss pressure in 0.1 s
    assert max(rising) == pytest.approx(0.6)


def test_a_run_without_its_shift_says_so_in_every_value():
    recording = Shift().recording()
    empty = run_of(Recording(recording.t0, recording.period, recording.channels, [], BOX))
    series = SimpleNamespace(procedure="grid_up", conditions=UP)
    assert programme.measure(series, empty) == "the shift I-II did not take place"
    stopped = SimpleNamespace(recording=recording, end={"state": "failed", "reason": "/x/y/a.yaml:5: did not come true"})
    assert programme.measure(series, stopped) == "a.yaml:5: did not come true"  # the reason does not contain the machine's folders
    records = readers.failed("grid_up", UP, "step 5 did not come true")
    row = evaluate(TARGETS["up_t_p_upper"], records)
    assert row.verdict == "not compared" and "step 5" in row.reason
    both = {r.conditions["shift"] for r in readers.failed("delay_series", {"series": 3}, "why")}
    assert both == {"I-II", "II-I"}


def test_each_shift_of_the_delay_sequence_is_a_repeat():
    parts = [Shift(up=True), Shift(up=False), Shift(up=True, peak=270.0), Shift(up=False)]
    channels = [part.channels() for part in parts]
    joined = {name: np.concatenate([c[name] for c in channels]) for name in channels[0]}
    recording = Recording(
        0.0, PERIOD, joined, [(1.0 + 3.0 * i, 1 if part.up else 2, 2 if part.up else 1) for i, part in enumerate(parts)], BOX
    )
    conditions = {"series": 19, "t12": -0.22, "t21": -0.22, "n_wej": 500.0 * RPM, "m_wyj": 60.0}
    repeats = readers.delay_series(conditions, run_of(recording))
    assert len(repeats) == 2
    peaks = [[r.values["input_torque_max_nm"] for r in one if "input_torque_max_nm" in r.values] for one in repeats]
    assert peaks[0][0] == pytest.approx(250.0, rel=5e-3) and peaks[1][0] == pytest.approx(270.0, rel=5e-3)
    classes = [r.values["pressure_rise"] for one in repeats for r in one if "pressure_rise" in r.values]
    assert classes == ["monotone", "monotone"]


def test_a_coast_down_gives_inertia_and_speed_over_time():
    t = np.arange(0.0, 10.0, 1e-3)
    w = np.where(t < 2.0, 49.2, np.maximum(0.0, 49.2 - 11.7 * (t - 2.0) + 0.57 * (t - 2.0) ** 2))
    w[t > 7.9] = 0.0
    channels = {name: np.zeros(t.size) for name in ("M_wyj", "n_wyj", "p1", "p2")}
    recording = Recording(0.0, 1e-3, {**channels, "n_wej": w, "M_wej": np.full(t.size, 8.32)}, [], BOX)
    (records,) = readers.coast_down({"n_wej": 470.0 * RPM}, run_of(recording))
    assert records[0].values["coast_down_tangent_s"] == pytest.approx(49.2 / 11.7, rel=0.02)
    assert records[1].conditions == {"side": "driving"}
    assert records[1].values["inertia"] == pytest.approx(8.32 / 11.7, rel=0.02)
    speeds = {r.conditions["time"]: r.values["w_wej"] for r in records[2:]}
    assert speeds[1.0] == pytest.approx(49.2 - 11.7 + 0.57, abs=0.2)


# --- derived --------------------------------------------------------------------------------------


def delays(values, shift="I-II", quantity="k"):
    """Returns records from {series: (t12, value)}."""
    return [
        Record(
            "delay_series",
            {"shift": shift, "series": n, "t12": t12, "t21": t12, "n_wej": 500.0 * RPM, "m_wyj": 60.0},
            {"k": 1.0, "input_torque_max_nm": 250.0, "t_dt_s": 0.3, quantity: value},
        )
        for n, (t12, value) in values.items()
    ]


def test_the_dip_begins_where_k_crosses_its_bound_for_the_last_time():
    series = delays({1: (0.0, 0.80), 2: (-0.1, 0.90), 3: (-0.2, 1.00), 4: (-0.3, 1.00)})
    assert dip_begins(series) == (pytest.approx(-0.15), "")
    twice = delays({1: (0.0, 0.80), 2: (-0.1, 0.90), 3: (-0.1, 0.96), 4: (-0.2, 0.97)})
    assert dip_begins(twice)[0] == pytest.approx(-0.15)  # the mean of both at -100 ms is 0.93
    assert "no dip" in dip_begins(delays({1: (0.0, 0.96), 2: (-0.1, 0.97)}))[1]
    assert "every series" in dip_begins(delays({1: (0.0, 0.90), 2: (-0.1, 0.91)}))[1]
    assert dip_begins(delays({1: (0.0, None)}))[0] is None


def test_a_result_of_all_series_answers_a_row_on_all_series():
    series = delays({n: (-0.025 * n, 0.85 + 0.0125 * n) for n in range(1, 20)})
    row = evaluate(TARGETS["delay_up_dip_begins"], [r for r in derive(series) if "dip_begins_s" in r.values])
    assert row.value == pytest.approx(-0.2) and row.count == 1  # 0.95 at series 8
    assert evaluate(TARGETS["delay_up_dips_1_to_6"], derive(series)).verdict == "inside"


def test_smallest_and_shortest_within_what_counts_as_equal():
    found = derive(delays({1: (0.0, 250.0), 19: (-0.2, 249.1), 3: (-0.1, 248.5)}, quantity="input_torque_max_nm"))
    words = {
        r.conditions["series"]: r.values["input_torque_max_nm"]
        for r in found
        if isinstance(r.values.get("input_torque_max_nm"), str)
    }
    assert words == {1: "not smallest", 19: "smallest", 3: "smallest"}
    found = derive(delays({1: (0.0, 0.30), 19: (-0.2, 0.289), 3: (-0.1, 0.285)}, "II-I", "t_dt_s"))
    words = {r.conditions["series"]: r.values["t_dt_s"] for r in found if isinstance(r.values.get("t_dt_s"), str)}
    assert words == {1: "not shortest", 19: "shortest", 3: "shortest"}


def test_a_dominated_series_is_worse_in_all_three_and_one_without_a_hold_has_no_rank():
    def series(n, peak, time, hold):
        return Record(
            "profile_series", {"valve": "ZR-P1", "series": n}, {"engagement_peak_nm": peak, "engagement_s": time, "level_s": hold}
        )

    found = derive(
        [series(1, 100.0, 0.30, 0.06), series(2, 90.0, 0.25, 0.03), series(3, 80.0, 0.35, 0.02), series(4, 50.0, 0.1, 0.0)]
    )
    ranks = {r.conditions["series"]: r.values["engagement_rank"] for r in found if "engagement_rank" in r.values}
    assert ranks == {1: "dominated", 2: "not dominated", 3: "not dominated", 4: "no hold"}


def test_the_gap_of_a_peak_has_the_sign_of_the_measured_one():
    def shift(load, source, peak):
        where = {"shift": "II-I", "n_wej": 1500.0 * RPM, "m_wyj": load}
        procedure, source = ("grid_down", {}) if source == "measured" else ("chapter9", {"source": source})
        return Record(procedure, {**where, **source}, {"input_torque_max_nm": peak, "t_p_s": 0.05})

    found = derive(
        [
            *(shift(load, "simulated", peak) for load, peak in ((180.0, 277.0), (240.0, 366.0), (80.0, 129.0))),
            *(shift(load, "measured", peak) for load, peak in ((180.0, 300.0), (240.0, 294.0), (40.0, 100.0))),
            Record(  # with another inertia, so no measurement of the laboratory
                "grid_down",
                {"shift": "II-I", "n_wej": 1500.0 * RPM, "m_wyj": 180.0, "inertia": 0.6365},
                {"input_torque_max_nm": 200.0, "t_p_s": 0.05},
            ),
        ]
    )
    assert {r.conditions["m_wyj"]: r.values["peak_gap_nm"] for r in found if "peak_gap_nm" in r.values} == {
        180.0: 23.0,
        240.0: -72.0,
    }


def test_a_hold_is_classed_by_the_mean_of_its_repeats():
    """The shortest hold phase is one period of the mains hum, 20 ms."""
    found = derive(
        [
            Record(
                "profile_series",
                {"valve": "ZR-P1", "series": n},
                {"level_s": level, "engagement_peak_nm": 90.0, "engagement_s": 0.2},
                {"level_s": "no rise"},
            )
            for n, level in ((1, 0.0201), (2, 0.0199), (3, None))
        ]
    )
    holds = {r.conditions["series"]: (r.values["hold"], r.why) for r in found if "hold" in r.values}
    assert holds == {1: ("hold", {}), 2: ("no hold", {}), 3: (None, {"hold": "no rise"})}
    phases = [r.values["pressure_rise"] for r in found if "pressure_rise" in r.values]
    assert phases == ["three phases", "no hold", None]


@pytest.mark.parametrize("peak_at, event", [(0.3, "not below it"), (0.45, "below the speed of gear I")])
def test_the_peak_of_a_downshift_is_placed_by_the_output_speed_at_its_time(peak_at, event):
    """The output leaves the speed of gear II at 0.4 s, and it is 3 % below that of gear I from 0.43 s on; slip ends at 0.44 s."""
    t = 1e-4 * np.arange(10_000)
    first, second = (150.0 / BOX.ratios[gear] for gear in (1, 2))
    channels = {
        "n_wej": np.interp(t, [0.43, 0.44, 0.47, 0.5], [150.0, 0.97 * 150.0, 0.97 * 150.0, 150.0]),
        "n_wyj": np.interp(t, [0.4, 0.43, 0.47, 0.5], [second, 0.97 * first, 0.97 * first, first]),
        "M_wej": 100.0 + 200.0 * np.exp(-(((t - peak_at) / 0.01) ** 2)),
        **dict.fromkeys(("M_wyj", "p1", "p2"), np.zeros(t.size)),
    }
    row = {"t_order_s": 0.0, "t_c_s": 0.44, "t_dt_s": 0.2, "t_o_s": 0.1, "input_speed_rpm": 150.0 / RPM, "to_gear": 1, "why": []}
    record = readers.peak_event("grid_down", {}, Recording(0.0, 1e-4, channels, [], BOX), row)
    assert record.values == {"peak_event": event}
    unmade = readers.peak_event("grid_down", {}, Recording(0.0, 1e-4, channels, [], BOX), {**row, "t_c_s": None, "why": ["no end"]})
    assert (unmade.values, unmade.why) == ({"peak_event": None}, {"peak_event": "no end"})


# --- what runs ------------------------------------------------------------------------------------


def test_rows_are_chosen_by_name_and_procedure():
    assert {t.id for t in programme.choose(["valve_delay_*"])} == {
        "valve_delay_zr_p1",
        "valve_delay_zr_p2",
        "valve_delay_p1_shorter",
    }
    assert {t.procedure for t in programme.choose([], ["grid_up"])} == {"grid_up"}
    assert len(programme.choose()) == len(TARGETS)
    with pytest.raises(RigError, match="row 'peaks'"):
        programme.choose(["peaks"])
    with pytest.raises(RigError, match="procedure 'grid'; did you mean 'grid_"):
        programme.choose([], ["grid"])
    with pytest.raises(RigError, match="no row of coast_down is called up_"):
        programme.choose(["up_*"], ["coast_down"])


def test_only_what_rows_need_is_run():
    assert programme.needed([TARGETS["up_t_dt_range"]]) == ("grid_up",)
    assert programme.needed([TARGETS["down_t_dt_below_up"]]) == ("grid_up", "grid_down")
    assert programme.needed([TARGETS["concl_shift_below_half_second"]]) == ("grid_up", "grid_down")
    assert programme.needed([TARGETS["logger_rate"]]) == ()
    assert programme.needed(TARGETS.values())[0] == "valve_response"


def test_the_series_hold_every_condition_that_rows_list():
    """A row with a list or a single value without a series could never be evaluated."""
    lacking, series_of = [], cache(programme.series_of)
    for target in TARGETS.values():
        if target.procedure not in programme.READERS or target.role == "information":
            continue
        procedures = programme.GRIDS if target.procedure in programme.GRIDS else (target.procedure,)
        series = [one for name in procedures for one in series_of(name)]
        for side in (target.conditions, target.of, target.to):
            for name, wanted in side.items():
                if name in ("phase", "side", "source", "model", "time") or not isinstance(wanted, tuple) or wanted == ("all",):
                    continue
                there = [one.conditions[name] for one in series if name in one.conditions]
                if name == "shift" and not there:
                    continue  # the delay sequence shifts both ways
                lacking += [
                    (target.id, name, one)
                    for one in wanted
                    if not any(one == value or (isinstance(one, float) and abs(one - value) < 1e-9) for value in there)
                ]
    assert lacking == []


def test_series_beyond_the_laboratorys_are_named_apart():
    without = [one for one in programme.series_of("grid_up") if one.conditions["m_wyj"] == 0.0]
    assert len(without) == 5 and all(one.parameters["load_up"] == "0 Nm" for one in without)
    beyond = [one for one in programme.series_of("delay_series") if "series" not in one.conditions]
    assert [one.overrides["alfa46.t21"] for one in beyond] == ["-240 ms", "-260 ms"]
    assert all(one.conditions["t12"] == pytest.approx(-0.22) for one in beyond)


def test_a_procedure_runs_and_its_rows_are_judged():
    result = programme.validate(programme.choose(["coast_down_*"]))
    assert {row.target.id for row in result.rows} == {
        "coast_down_curve",
        "coast_down_tangent_time",
        "coast_down_torque",
        "coast_down_inertia",
    }
    assert all(row.verdict in ("inside", "outside") and row.value is not None for row in result.rows)
    # the inertia that the rig was given is found again from its own coast-down
    inertia = next(row.value for row in result.rows if row.target.id == "coast_down_inertia")
    assert inertia == pytest.approx(0.709, rel=0.05)


def test_chapter_8_is_judged_by_what_the_bench_measured():
    series = {one.label: one for one in programme.series_of("clutch_bench")}
    assert len(series) == 32 and all(one.parameters["wetting"] == "1 s" for one in series.values())
    records = []
    for label in ("46x88.9-18", "50x76-10"):
        repeats = programme.measure(series[label], run_repeat(series[label], 0))
        assert isinstance(repeats, list), repeats
        records += repeats[0]

    def judged(name):
        target = next(one for one in programme.choose([name]) if one.id == name)
        return evaluate(target, [r for r in records if target.quantity in r.values])

    # thesis over Osinski for 46x88.9 with 18 surfaces at a product of 0.00696: docs/background/friction_models.md
    assert judged("bench_46x88_9_k_kor_osinski").value == pytest.approx(1.60, rel=0.005)
    assert judged("bench_46x88_9_k_kor").verdict == "inside"
    miss = judged("bench_50x76_n10_error")
    # the pack follows the model, so of the laboratory's 12 % only the instruments' errors remain
    assert miss.verdict == "outside" and 0.0 < miss.value < 0.01
    assert judged("bench_80x115_2_scatter").basis == "information"
    steel, lined = (r for r in records if "m_rest_nm" in r.values)
    # the steel plates were given no M_rest, and the line of what the instruments read goes through zero that closely
    assert steel.values["m_rest_nm"] == pytest.approx(0.0, abs=5.0)
    # the gearbox's plates have the M_rest of its clutches on the bench too
    own = load_rig("hydmag").plate_pack.rest_torque
    assert series["50x76-10"].overrides["plate_pack.rest_torque"] == f"{own:g} Nm"
    assert lined.values["m_rest_nm"] == pytest.approx(own, abs=5.0)


def test_the_settings_of_the_gearbox_do_not_touch_the_benches():
    programme.check_settings(["clutch_bench", "spring_bench"], {"motor.ramp": "500 rpm/s"})
    with Workers(1) as workers:
        result = programme.validate(programme.choose(["cylinder_*", "spring_*"]), workers, settings={"motor.ramp": "500 rpm/s"})
    rows = {row.target.id: row for row in result.rows}
    assert {row.verdict for row in rows.values()} == {"inside"} and len(rows) == 3


@pytest.mark.campaign
def test_the_whole_programme_judges_every_row_that_can_be():
    with Workers(2) as workers:
        result = programme.validate(programme.choose(), workers)
    counts = programme.counts(result.rows)
    assert sum(c["rows"] for c in counts.values()) == len(TARGETS)
    assert set(programme.summary(result)["chapter9"]) == {"up_peak", "down_peak", "t_p12", "t_p21"}
    for row in result.rows:
        if row.basis != "information":
            assert row.verdict != "not compared" or row.reason, row.target.id
            assert row.verdict == "not compared" or row.value is not None, row.target.id
