# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shift metrics of shifts whose times were set by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic_shift import ENCODER, I1, I2, PERIOD, RPM, Shift

from rig_nodes.analysis.metrics import DETAILS, metric_keys
from rig_nodes.analysis.quality import quality_of
from rig_nodes.analysis.shift import shift_metrics, shifts
from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.transmission import Inertias

BOX = load_rig("hydmag").transmission

UP = Shift()
DOWN = Shift(up=False, fall=0.30, depart=0.36, end=0.42, settle=0.60, peak=180.0, engage=0.20, release=0.45)


def only(recording):
    rows = shifts(recording)
    assert len(rows) == 1
    return rows[0]


@pytest.mark.parametrize("case", [UP, DOWN], ids=["up", "down"])
@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_known_times_and_values(case, seed):
    row = only(case.recording(seed))
    clean = seed is None
    assert list(row) == [*metric_keys(), *DETAILS]
    assert row["valid"] and row["why"] == []
    assert (row["from_gear"], row["to_gear"]) == ((1, 2) if case.up else (2, 1))
    assert row["input_speed_rpm"] == pytest.approx(1500.0, abs=0.01 if clean else 0.2)
    assert row["output_torque_nm"] == pytest.approx(80.0, abs=0.05)
    within = 1.0e-3 if clean else 3.0e-3
    assert row["t_c_s"] == pytest.approx(case.end, abs=within)
    assert row["t_dt_s"] == pytest.approx(case.end - case.fall, abs=within)
    assert row["t_p_s"] == pytest.approx(case.end - case.depart, abs=within)
    # the pressure passes S1's kiss pressure of 0.1 MPa slowly, so that noise moves this time more than the others
    assert row["overlap_s"] == pytest.approx(case.overlap, abs=2e-3 if clean else 10e-3)
    assert row["input_torque_max_nm"] == pytest.approx(case.peak, abs=0.1 if clean else 1.0)
    # M_wej falls linearly to 88 Nm: it is settled when it is 5 % above that
    settled = case.settle - (case.settle - case.end) * 0.05 * 88.0 / (150.0 - 88.0)
    assert row["t_o_s"] == pytest.approx(settled - case.end, abs=1.5e-3 if clean else 4e-3)
    # a downshift and its minimum end when the remaining slip is 0.1 % plus the resolution of the encoders
    assert row["output_speed_min_rpm"] == pytest.approx(1500.0 / I1, abs=0.6 if case.up else 2.2)
    assert row["k"] == pytest.approx(1.0, abs=5e-4 if case.up else 2e-3)


def test_energy_loss_by_hand():
    """Torques and input speed are constant and the output speed rises linearly: each term of (6.108) by hand."""
    w, t_d, t_p = 150.0, 0.25, 0.1
    case = dataclasses.replace(UP, rpm=w * RPM)
    torque = np.full(int(case.length / PERIOD), 100.0)
    row = only(case.recording(M_wej=torque, M_wyj=torque * 0.8))
    w1, w2 = w / I1, w / I2
    by_hand = 100.0 * w * t_d - 80.0 * (w1 * (t_d - t_p) + 0.5 * (w1 + w2) * t_p) - 0.5 * 0.1273 * I2**2 * (w2**2 - w1**2)
    assert row["e_loss_j"] == pytest.approx(by_hand, rel=3e-3)
    assert row["t_o_s"] == 0.0
    assert row["e_loss_settled_j"] == row["e_loss_j"]
    recording = case.recording(M_wej=torque, M_wyj=torque * 0.8)
    light = dataclasses.replace(recording.transmission, inertias=Inertias(0.0, 0.0))
    no_inertia = only(dataclasses.replace(recording, transmission=light))
    stored = no_inertia["e_loss_j"] - row["e_loss_j"]
    assert stored == pytest.approx(0.5 * 0.1273 * I2**2 * (w2**2 - w1**2), rel=2e-3)


def test_energy_until_settled_adds_what_follows():
    row = only(UP.recording())
    w = 1500.0 / RPM
    t_o = row["t_o_s"]
    mean_torque = 0.5 * (150.0 + 88.0 * 1.05)
    by_hand = (mean_torque * w - 80.0 * w / I2) * t_o
    assert row["e_loss_settled_j"] - row["e_loss_j"] == pytest.approx(by_hand, rel=0.02)


@pytest.mark.parametrize("seed", [None, 5])
def test_dip_shows_in_k_and_leaves_the_shift_valid(seed):
    row = only(dataclasses.replace(UP, depart=0.5, end=0.8, dip=0.4).recording(seed))
    assert row["valid"]
    assert row["k"] == pytest.approx(0.6, abs=0.01)
    assert row["output_speed_min_rpm"] == pytest.approx(0.6 * 1500.0 / I1, rel=0.01)
    assert row["t_p_s"] == pytest.approx(0.3, abs=3e-3)


@pytest.mark.parametrize("seed", [None, 6])
def test_downshift_that_dips_ends_after_the_minimum(seed):
    """The output falls through the ratio of gear I to 30 % below it, and comes back."""
    case = dataclasses.replace(DOWN, depart=0.36, end=0.66, settle=0.8, dip=0.3)
    row = only(case.recording(seed))
    assert row["valid"]
    assert row["t_c_s"] == pytest.approx(0.66, abs=3e-3)
    assert row["k"] == pytest.approx(0.7, abs=0.01)


def test_lingering_on_the_ratio_before_a_dip_does_not_end_a_downshift():
    """The 30 ms at the ratio of gear I would count as the end of the shift if no minimum followed."""
    t = np.arange(30000) * PERIOD - 1.0
    w = 1500.0 / RPM
    n_wyj = w * np.interp(t, [0.36, 0.42, 0.45, 0.50, 0.60], [1 / I2, 1 / I1, 1 / I1, 0.9 / I1, 1 / I1])
    row = only(dataclasses.replace(DOWN, end=0.60, settle=0.8).recording(n_wyj=n_wyj))
    assert row["t_c_s"] == pytest.approx(0.60, abs=1e-3)
    shallow = w * np.interp(t, [0.36, 0.42, 0.45, 0.50, 0.60], [1 / I2, 1 / I1, 1 / I1, 0.96 / I1, 1 / I1])
    row = only(dataclasses.replace(DOWN, end=0.60, settle=0.8).recording(n_wyj=shallow))
    assert row["t_c_s"] == pytest.approx(0.42, abs=1e-3)
    assert row["k"] == pytest.approx(0.96, abs=1e-3), "the lowest of the signal (7.1.5: t_dtr ends behind it)"


@pytest.mark.parametrize("seed", [None, 8])
def test_a_swing_behind_lock_up_counts_in_k_until_the_output_stops_falling(seed):
    """The clutch holds from 0.46 s on; input and output go on falling together by 2.5 %, and swing once more 0.1 s later."""
    t = np.arange(30000) * PERIOD - 1.0
    w = 1500.0 / RPM * np.interp(t, [0.46, 0.47, 0.49, 0.56, 0.57, 0.60], [1.0, 0.975, 1.0, 1.0, 0.95, 1.0])
    n_wyj = w * np.interp(t, [0.36, 0.46], [1 / I2, 1 / I1])
    torque = np.interp(t, [0.30, 0.40, 0.46, 0.475, 0.50, 0.8], [60.0, 150.0, 140.0, 190.0, 88.0, 88.0])
    row = only(dataclasses.replace(DOWN, end=0.46, settle=0.8).recording(seed, n_wej=w, n_wyj=n_wyj, M_wej=torque))
    assert row["valid"]
    assert row["t_c_s"] == pytest.approx(0.46, abs=1e-3)
    assert row["k"] == pytest.approx(0.975, abs=2e-3) and row["fall_s"] == pytest.approx(0.01, abs=1.5e-3)
    assert row["output_speed_min_rpm"] == pytest.approx(0.975 * 1500.0 / I1, rel=2e-3)
    assert row["input_torque_max_nm"] < 175.0 < row["input_torque_high_nm"], "the torque that ends the fall comes behind it"


def test_sagging_input_is_no_departure_of_the_output():
    """A tie-up slows input and output together; the speed change begins when the old clutch releases."""
    channels = UP.channels()
    t = np.arange(channels["p1"].size) * PERIOD - 1.0
    sag = np.interp(t, [0.45, 0.62, 1.0], [1.0, 0.97, 1.0])
    row = only(UP.recording(n_wej=channels["n_wej"] * sag, n_wyj=channels["n_wyj"] * sag))
    assert row["t_p_s"] == pytest.approx(0.1, abs=1e-3)
    assert row["input_speed_rpm"] == pytest.approx(1500.0, abs=0.01)
    assert row["k"] == pytest.approx(np.interp(0.60, [0.45, 0.62], [1.0, 0.97]), abs=2e-3)


def test_gap_between_the_clutches_is_a_negative_overlap():
    case = dataclasses.replace(UP, fall=0.20, release=0.40, engage=0.55, depart=0.42)
    row = only(case.recording(7))
    assert row["overlap_s"] == pytest.approx(case.overlap, abs=6e-3) and case.overlap < -0.15


def test_slow_end_of_the_slip_is_met_at_the_threshold():
    """The last 1 % of slip disappears over 0.2 s: 0.05 % remain 10 ms before the end."""
    t = np.arange(30000) * PERIOD - 1.0
    n_wyj = 1500.0 / RPM * np.interp(t, [0.60, 0.70, 0.90], [1 / I1, 0.99 / I2, 1 / I2])
    assert only(UP.recording(n_wyj=n_wyj))["t_c_s"] == pytest.approx(0.89, abs=1.5e-3)


def test_undithered_encoders_do_not_hide_a_locked_clutch():
    """Rounding alone may cause a slip above the threshold all the time, which must not make the shift invalid."""
    rounded_worst = 0.0
    for rpm in (1001.1, 1004.2, 1500.0, 2008.9):
        channels = dataclasses.replace(UP, rpm=rpm).channels()
        for name in ("n_wej", "n_wyj"):
            channels[name] = np.round(channels[name] / ENCODER) * ENCODER
        rounded_worst = max(rounded_worst, abs(1 - channels["n_wyj"][-1] * I2 / channels["n_wej"][-1]))
        row = only(Recording(0.0, PERIOD, channels, [(1.0, 1, 2)], BOX))
        assert row["valid"], row["why"]
        assert row["t_c_s"] == pytest.approx(0.70, abs=1e-3)
    assert rounded_worst > 0.0009


def test_half_a_percent_of_slip_is_no_lock():
    channels = UP.channels()
    after = np.arange(channels["p1"].size) * PERIOD - 1.0 > 0.65
    channels["n_wyj"] = np.where(after, np.minimum(channels["n_wyj"], 0.995 * channels["n_wej"] / I2), channels["n_wyj"])
    row = only(Recording(0.0, PERIOD, channels, [(1.0, 1, 2)], BOX))
    assert not row["valid"]
    assert row["t_dt_s"] is None and row["e_loss_j"] is None
    assert "never settled on the ratio of gear II" in row["why"][0]


def test_no_supply_pressure():
    """Without pressure no clutch is clamped: neither the engagement nor the shift after it is valid, and no error is raised."""
    n = 60000
    channels = dict.fromkeys(("M_wyj", "n_wyj", "p1", "p2"), np.zeros(n))
    channels |= {"M_wej": np.full(n, 5.0), "n_wej": np.full(n, 157.0)}
    rows = shifts(Recording(0.0, PERIOD, channels, [(1.0, 0, 1), (3.0, 1, 2)], BOX))
    assert [row["valid"] for row in rows] == [False, False]
    assert any("p1 did not rise" in reason for reason in rows[0]["why"])
    reasons = " / ".join(rows[1]["why"])
    assert "gear I was not in" in reasons and "p1 was not up" in reasons and "p2 never rose" in reasons
    verdict = quality_of(rows[1], BOX)
    assert verdict is not None and verdict["reasons"] == [
        "gear II was not reached"
    ]  # a drive that was not there was not interrupted


def test_swapped_valves():
    """The gearbox is in II where the order states I, and shifts in the opposite direction."""
    channels = DOWN.channels()
    rows = shifts(Recording(0.0, PERIOD, channels, [(1.0, 1, 2)], BOX))
    assert not rows[0]["valid"]
    assert any("gear I was not in when II was ordered" in reason for reason in rows[0]["why"])


def test_engagement_from_neutral_counts_from_the_pressure():
    t = np.arange(30000) * PERIOD - 1.0
    w = 1500.0 / RPM
    n = t.size
    channels = {
        "M_wej": np.interp(t, [0.3, 0.5, 0.501], [10.0, 120.0, 70.0]),
        "n_wej": np.full(n, w),
        "M_wyj": np.interp(t, [0.3, 0.5], [0.0, 80.0]),
        "n_wyj": w / I1 * np.interp(t, [0.3, 0.5], [0.0, 1.0]),
        "p1": np.interp(t, [0.2, 0.3, 0.6], [0.0, 0.17e6, 2.3e6]),
        "p2": np.zeros(n),
    }
    row = only(Recording(0.0, PERIOD, channels, [(1.0, 0, 1)], BOX))
    assert row["valid"], row["why"]
    assert row["t_dt_s"] == pytest.approx(0.3, abs=2e-3)
    assert row["t_p_s"] == pytest.approx(0.2, abs=2e-3)
    assert row["t_c_s"] == pytest.approx(0.5, abs=2e-3)
    assert row["k"] is None and row["overlap_s"] is None


@pytest.mark.parametrize(
    "order, reason",
    [
        # the order has wrong gears: gear II has been engaged for 0.5 s and stays so, or gear I is about to be left
        ((2.2, 0, 2), "gear II was in when II was ordered from neutral (slip 0.0 %)"),
        ((1.0, 0, 1), "gear I was in when I was ordered from neutral (slip 0.0 %)"),
        ((1.0, 0, 2), "gear I was in when II was ordered from neutral (slip 0.0 %)"),
        # the time of the order is too late: the shift was over
        ((1.75, 1, 2), "gear I was not in when II was ordered"),
    ],
)
def test_an_order_that_comes_after_what_it_ordered_is_not_valid(order, reason):
    row = shift_metrics(dataclasses.replace(UP.recording(1), orders=[order]), order)
    assert not row["valid"] and any(why.startswith(reason) for why in row["why"])
    times = [row[key] for key in ("t_dt_s", "t_p_s", "t_c_s", "t_o_s")]
    assert all(value is None or value >= 0.0 for value in times)


def test_the_same_gear_ordered_again_is_no_shift():
    recording = UP.recording(1)
    twice = dataclasses.replace(recording, orders=[*recording.orders, (2.5, 2, 2)])
    assert shifts(twice) == shifts(recording)


def test_two_shifts_do_not_see_each_other():
    """After an upshift comes a downshift 2 s later; the evaluation of the first ends with the second order."""
    up, down = UP.channels(), DOWN.channels()
    channels = {name: np.concatenate([up[name], down[name]]) for name in up}
    channels["M_wej"][30001:] = np.maximum(channels["M_wej"][30001:], 88.0)
    rows = shifts(Recording(5.0, PERIOD, channels, [(9.0, 2, 1), (6.0, 1, 2)], BOX))
    assert [row["t_order_s"] for row in rows] == [6.0, 9.0]
    assert [row["valid"] for row in rows] == [True, True]
    assert rows[0]["t_c_s"] == pytest.approx(0.70, abs=1e-3)
    assert rows[1]["t_c_s"] == pytest.approx(0.42, abs=1e-3)
    assert shifts(Recording(5.0, PERIOD, channels, [(6.0, 1, 2), (9.0, 2, 0)], BOX))[0]["valid"]


def test_recording_that_ends_too_soon_names_what_is_missing():
    full = UP.channels()
    cut = {name: values[:17050] for name, values in full.items()}  # 5 ms after lock-up
    row = only(Recording(0.0, PERIOD, cut, [(1.0, 1, 2)], BOX))
    assert not row["valid"] and row["t_c_s"] is None and row["input_speed_rpm"] == pytest.approx(1500.0)
    cut = {name: values[:17600] for name, values in full.items()}
    row = only(Recording(0.0, PERIOD, cut, [(1.0, 1, 2)], BOX))
    assert row["t_dt_s"] == pytest.approx(0.25, abs=1e-3) and row["t_o_s"] is None
    assert row["why"] == ["M_wej had no time to settle: the recording ends at 1.760 s"]
    cut = {name: values[:9000] for name, values in full.items()}
    assert "does not cover the order" in only(Recording(0.0, PERIOD, cut, [(1.0, 1, 2)], BOX))["why"][0]
    empty = {name: values[:0] for name, values in full.items()}
    assert not only(Recording(0.0, PERIOD, empty, [(1.0, 1, 2)], BOX))["valid"]


def test_nan_is_a_reason_not_a_crash():
    channels = UP.channels()
    channels["M_wej"][12000] = np.nan
    row = shift_metrics(Recording(0.0, PERIOD, channels, [], BOX), (1.0, 1, 2))
    assert not row["valid"] and row["why"] == ["M_wej has no values for 0.1 ms at 1.20 s"]


def test_missing_rows_are_named_with_their_place_and_the_longest_of_several_gaps():
    channels = {name: values.copy() for name, values in UP.channels().items()}
    for values in channels.values():
        values[12000:12350] = values[14000:14010] = np.nan
    row = shift_metrics(Recording(0.0, PERIOD, channels, [], BOX), (1.0, 1, 2))
    assert row["why"] == ["the file has no rows for in 2 gaps, the longest 35 ms at 1.20 s"]


def test_missing_channel_is_one_sentence():
    channels = UP.channels()
    del channels["p1"], channels["M_wyj"]
    with pytest.raises(RigError, match="no channel M_wyj, p1; shift metrics need M_wej"):
        Recording(0.0, PERIOD, channels, [], BOX)
    channels = UP.channels()
    channels["p2"] = channels["p2"][:-1]
    with pytest.raises(RigError, match="1-D of one length"):
        Recording(0.0, PERIOD, channels, [], BOX)


def test_a_fall_that_slows_down_starts_where_it_starts():
    """As on the rig, 0.15 MPa fall within 8 ms, then follow a slow part and the rest, with the noise of the rig's transducers."""
    shift = Shift()
    recording = shift.recording()
    t = np.arange(recording.rows) * recording.period - 1.0
    fall = [shift.fall, shift.fall + 8e-3, shift.fall + 40e-3, shift.fall + 0.14, shift.release, shift.release + 0.06]
    p1 = np.interp(t, fall, [2.3e6, 2.15e6, 2.05e6, 0.8e6, 0.17e6, 0.0])
    p1 = p1 + np.random.default_rng(1).normal(0.0, 5e3, t.size)
    row = shift_metrics(
        Recording(0.0, recording.period, recording.channels | {"p1": p1}, recording.orders, BOX), recording.orders[0]
    )
    assert row["t_dt_s"] == pytest.approx(shift.end - shift.fall, abs=2.5e-3)


@pytest.mark.parametrize("dip, stands", [(0.4, False), (0.97, False), (1.4, True)])
def test_an_output_that_stood_still_is_no_valid_shift_and_a_deep_dip_is_one(dip, stands):
    case = dataclasses.replace(UP, dip=dip)
    row = only(case.recording(1, n_wyj=np.maximum(case.channels()["n_wyj"], 0.0)))
    assert row["k"] == pytest.approx(max(1.0 - dip, 0.0), abs=2e-2) and row["e_loss_j"] is not None
    assert row["valid"] is not stands
    assert [reason.partition(" for ")[0] for reason in row["why"]] == ["the output stood still"] * stands


def test_the_order_that_came_first_is_named_and_not_the_end_of_the_recording():
    recording = UP.recording()
    order = recording.orders[0]
    soon = shift_metrics(recording, order, order[0] + UP.end + 0.05)
    assert soon["why"] == ["M_wej had no time to settle: the next order came at 1.750 s"] and soon["t_dt_s"] is not None
    (sooner,) = shift_metrics(recording, order, order[0] + 0.5)["why"][-1:]
    assert "never settled on the ratio of gear II" in sooner and sooner.endswith("the next order came at 1.500 s")
    assert shift_metrics(recording, order, order[0] + 0.02)["why"] == ["the next order came at 1.020 s, 0.020 s after this one"]


def test_a_clutch_that_cannot_carry_the_torque_is_said_to_slip_with_what_it_carries():
    stalled = dataclasses.replace(UP, end=6.0, depart=0.6, dip=1.0)  # n_wyj falls towards zero
    channels = stalled.channels()
    late = slice(-2000, None)
    channels["n_wyj"][late] = 50.0  # steady at the end, while gear II would give 153.2 rad/s
    channels["M_wyj"] = np.where(np.arange(channels["M_wyj"].size) < 12000, 240.0, 171.0)
    row = only(Recording(0.0, PERIOD, channels, [(1.0, 1, 2)], BOX))
    slip = 1500.0 - I2 * 50.0 * RPM
    assert row["why"][-1] == (
        f"clutch S2 still slips at the end by {slip:.0f} rpm of the input: it carries 171 Nm to the "
        "output at 2.30 MPa, 240 Nm were asked before the order"
    )
    open_clutch = only(Recording(0.0, PERIOD, channels | {"p2": np.zeros_like(channels["p2"])}, [(1.0, 1, 2)], BOX))
    assert not any("slips" in reason for reason in open_clutch["why"])
