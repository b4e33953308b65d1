# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of the instruments and of the metrics, compared with the thesis's table and with sums computed by hand."""

from __future__ import annotations

import dataclasses
import math
from itertools import product

import pytest

from rig_nodes.analysis.engagement import KEYS as ENGAGEMENT_KEYS
from rig_nodes.analysis.measured_error import (
    Instrument,
    coast_down_uncertainty,
    engagement_uncertainty,
    instruments_of,
    temperature_error,
    uncertainty,
)
from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.analysis.shift import shifts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

HYDMAG = load_rig("hydmag")
INSTRUMENTS = instruments_of(HYDMAG.as_dict())
BOX = HYDMAG.transmission

ROW = dict.fromkeys(metric_keys()) | {
    "from_gear": 1,
    "to_gear": 2,
    "input_speed_rpm": 1500.0,
    "output_torque_nm": 80.0,
    "t_dt_s": 0.37,
    "t_p_s": 0.10,
    "t_c_s": 0.65,
    "t_o_s": 0.14,
    "input_torque_max_nm": 264.0,
    "output_speed_min_rpm": 925.0,
    "k": 0.852,
    "e_loss_j": 1800.0,
    "e_loss_settled_j": 1200.0,
    "overlap_s": 0.16,
}


def test_table_7_1():
    errors = {name: instrument.error for name, instrument in INSTRUMENTS.items()}
    assert errors["torque"] == pytest.approx(1.01)
    assert errors["p1"] == pytest.approx(0.1e6)
    assert errors["p2"] == pytest.approx(0.0625e6)  # printed 0.063
    assert errors["speed"] == pytest.approx(0.1047, abs=1e-4)  # 1 rpm, printed as 0.017 rev/s
    assert temperature_error(40.0) == pytest.approx(0.5)


def test_metrics_by_hand():
    found = uncertainty(ROW, INSTRUMENTS, BOX)
    assert found["output_torque_nm"] == pytest.approx(1.01)
    assert found["output_speed_min_rpm"] == pytest.approx(1.0)
    assert found["k"] == pytest.approx(0.852 * (1.0 / 925 + 1.0 / 1500), rel=1e-3)
    # 1 ms of a rise of 264 Nm in 45 ms
    assert found["input_torque_max_nm"] == pytest.approx(1.01 + 264 / 45, rel=1e-3)
    # 0.105 rad/s of each encoder in 157 rad/s are 0.135 % of slip, which changes by 25.9 % in 0.1 s: 0.52 ms
    slip_end = 1.1e-3 + 0.1 * (0.10472 * 2.025 / 157.08) / (1 - 41 / 40 * 34 / 47)
    assert found["t_c_s"] == pytest.approx(slip_end, rel=1e-3)
    assert found["t_p_s"] == pytest.approx(2 * slip_end, rel=1e-3)
    # 0.1 MPa at 13.028 MPa/s
    assert found["t_dt_s"] == pytest.approx(slip_end + 1.1e-3 + 0.1 / 13.028, rel=1e-3)
    # from 264 - 80 / 1.025 = 186 Nm above the settled torque into 5 % of it, 3.9 Nm, in 0.14 s: 108 Nm/s at the end
    assert found["t_o_s"] == pytest.approx(slip_end + 1.1e-3 + 1.01 / 107.7, rel=2e-3)
    w_in, w_out = 157.08, 157.08 / 1.025
    by_hand = (1.01 * (w_in + w_out) + 0.10472 * 344) * 0.37 + 1800 / 0.37 * found["t_dt_s"]
    by_hand += 2 * 0.10472 * (0.709 * w_in + 0.1273 * 1.025**2 * w_out)
    assert found["e_loss_j"] == pytest.approx(by_hand, rel=1e-3)
    assert found["e_loss_settled_j"] > 0.0


def test_a_peak_that_a_swing_behind_lock_up_exceeds_is_as_uncertain_as_the_end_of_its_window():
    plain, early, late = (
        uncertainty(ROW | {"input_torque_high_nm": 284.0, "t_high_s": at}, INSTRUMENTS, BOX) for at in (None, 0.64, 0.66)
    )
    slope = math.pi / 2.0 * (284.0 - 264.0) / 0.01  # the steepest of a quarter of a swing that takes 10 ms
    assert early["input_torque_max_nm"] == plain["input_torque_max_nm"]
    assert late["input_torque_max_nm"] == pytest.approx(plain["input_torque_max_nm"] + slope * late["t_c_s"])


def test_better_instruments_give_smaller_errors_only_where_they_count():
    fine = {**INSTRUMENTS, "torque": Instrument(500.0, 0.02)}
    plain, better = (uncertainty(ROW, INSTRUMENTS, BOX), uncertainty(ROW, fine, BOX))
    assert better["output_torque_nm"] == pytest.approx(0.1)
    assert better["e_loss_j"] < plain["e_loss_j"]
    assert better["k"] == plain["k"] and better["t_p_s"] == plain["t_p_s"]


def test_errors_are_those_of_the_rigs_own_instruments():
    configuration = load_rig("hydmag").as_dict()
    of_the_rig = {name: instrument.error for name, instrument in instruments_of(configuration).items()}
    assert of_the_rig["torque"] == pytest.approx(1.01) and of_the_rig["p2"] == pytest.approx(0.0625e6)
    assert of_the_rig["speed"] == pytest.approx(2 * math.pi / 60)  # 1 rpm, which the table rounds to 0.017 rev/s
    coarse = load_rig("hydmag", {"instruments.torque_class": "2 %", "instruments.speed_step": "3 rpm"}).as_dict()
    found = uncertainty(ROW, instruments_of(coarse), BOX)
    assert found["output_torque_nm"] == pytest.approx(10.01) and found["input_speed_rpm"] == pytest.approx(3.0)
    # with true values only a sample and half the filter remain, at each end
    true = uncertainty(ROW, instruments_of(load_rig("hydmag", {"effects.transducers": "off"}).as_dict()), BOX)
    assert true["output_torque_nm"] == true["k"] == 0.0
    assert true["t_dt_s"] == pytest.approx(2.2e-3) and true["t_c_s"] == pytest.approx(1.1e-3)


def test_of_two_torque_meters_with_errors_of_their_own_the_worse_counts(tmp_path):
    (tmp_path / "rig.yaml").write_text(
        "description: meters of its own\nbase: hydmag\n"
        "transducers: {M_wej: {like: M_in}, M_wyj: {like: M_out}, n_wyj: {like: n_out}}\n"
        "instruments: {torque_noise: ~, torque_range: ~, torque_class: ~, torque_hum: ~, M_in_range: [500 Nm, x], "
        "M_in_class: [0.2 %, x], M_out_range: [500 Nm, x], M_out_class: [1 %, x], n_out_range: [3600 rpm, x], "
        "n_out_step: [4 rpm, x], n_out_gate: [1 ms, x]}\n"
    )
    found = instruments_of(load_rig(tmp_path).as_dict())
    assert found["torque"].error == pytest.approx(5.01)
    assert found["speed"].error == pytest.approx(4 * 2 * math.pi / 60)


def test_a_pressure_that_reads_wrong_by_all_that_it_may_moves_the_overlap_by_no_more_than_is_said():
    run = record(load_rig("hydmag", {"effects.transducers": "off"}), load_sequence("grid_point")).recording
    true, used = shifts(run), INSTRUMENTS
    for name, sign in product(("p1", "p2"), (1.0, -1.0)):
        channels = run.channels | {name: run.channels[name] + sign * used[name].error}
        for row, read in zip(true, shifts(dataclasses.replace(run, channels=channels)), strict=True):
            assert abs(read["overlap_s"] - row["overlap_s"]) < uncertainty(row, INSTRUMENTS, BOX)["overlap_s"]


def test_a_sample_of_a_slower_logger_counts_as_such():
    by_default, slow = (uncertainty(ROW, INSTRUMENTS, BOX), uncertainty(ROW, INSTRUMENTS, BOX, period=10e-3))
    assert slow["t_c_s"] - by_default["t_c_s"] == pytest.approx(9.9e-3)
    assert slow["t_p_s"] - by_default["t_p_s"] == pytest.approx(19.8e-3)
    assert slow["input_torque_max_nm"] == pytest.approx(1.01 + 264 * 5 / 45)  # half a sample of a rise in 45 ms


def test_what_is_missing_has_no_error():
    assert uncertainty(dict.fromkeys(metric_keys()) | {"from_gear": 1, "to_gear": 2}, INSTRUMENTS, BOX) == {}
    half = uncertainty(ROW | {"t_p_s": None, "k": None, "e_loss_settled_j": None}, INSTRUMENTS, BOX)
    assert {"t_p_s", "k", "t_dt_s", "e_loss_j", "e_loss_settled_j"}.isdisjoint(half)
    assert half["input_torque_max_nm"] > 1.01
    # for an output at rest, the error of n_wyj / n_wej is the encoder's 1 rpm, times i1
    assert uncertainty(ROW | {"output_speed_min_rpm": 0.0, "k": 0.0}, INSTRUMENTS, BOX)["k"] == pytest.approx(
        47 / 34 * 1.0 / 1500, rel=1e-3
    )
    neutral = uncertainty(ROW | {"from_gear": 0, "k": None, "overlap_s": None}, INSTRUMENTS, BOX)
    assert "k" not in neutral and neutral["t_dt_s"] > 0.0
    assert all(math.isfinite(value) for value in neutral.values())


def test_the_printed_coast_down():
    """1.01 of 8.32 Nm are 12 %, two encoder steps (1 rpm each) of 11.736 rad/s in the first second 1.8 %: J = 0.709 +- 0.099."""
    printed = {
        "coast_down_torque_nm": 8.32,
        "coast_down_tangent_s": 4.198,
        "inertia": 0.709,
        "coefficients": [0.5735, -11.736, 49.274],
    }
    found = coast_down_uncertainty(printed, INSTRUMENTS)
    assert found["coast_down_torque_nm"] == pytest.approx(1.01)
    assert found["coast_down_tangent_s"] == pytest.approx(4.198 * 0.20944 / 11.736, rel=1e-3)
    assert found["inertia"] == pytest.approx(0.709 * (1.01 / 8.32 + 0.0182), rel=1e-2)


def test_an_engagement_by_hand():
    row = dict.fromkeys(ENGAGEMENT_KEYS) | {
        "gear": 1,
        "input_speed_before": 52.36,
        "p_rest": 0.0,
        "p_end": 2.3e6,
        "p_kiss": 0.17e6,
        "engagement_s": 0.26,
        "engagement_peak_nm": 90.0,
        "input_torque_mean_nm": 28.0,
        "fill_slope": 1.622e6,
        "growth_contact": 0.5e6,
        "hold_s": 0.08,
    }
    found = engagement_uncertainty(row, INSTRUMENTS, BOX)
    assert found["p_end"] == pytest.approx(0.1e6) and found["input_torque_mean_nm"] == pytest.approx(1.01)
    assert found["p_kiss"] == pytest.approx(0.1e6 + 0.5e6 * 1.01 / 10.0)
    assert found["engagement_peak_nm"] == pytest.approx(1.01 + 90.0 / 45.0)
    slip = 0.10472 * (1 + 47 / 34) / 52.36 * 0.26
    assert found["engagement_s"] == pytest.approx(2.2e-3 + 0.1 / 1.622 + slip, rel=1e-3)
    assert found["hold_s"] == pytest.approx(2.2e-3) and "hold_pressure" not in found
    assert set(engagement_uncertainty(dict.fromkeys(ENGAGEMENT_KEYS) | {"gear": 2}, INSTRUMENTS, BOX)) == set()


def test_errors_do_not_depend_on_the_way_in_which_the_output_turns():
    back = dataclasses.replace(
        BOX, gears=tuple(dataclasses.replace(one, ratio=-one.ratio) if one.ratio else one for one in BOX.gears)
    )
    course = {"input_torque_high_nm": 264.0, "input_torque_low_nm": -40.0, "t_high_s": 0.6, "reversed_s": 0.02}
    ahead, behind = (
        uncertainty(ROW | course | {"output_torque_nm": load}, INSTRUMENTS, box) for load, box in ((80.0, BOX), (-80.0, back))
    )
    assert behind == pytest.approx(ahead) and behind["reversed_s"] > 0.0
    engaged = dict.fromkeys(ENGAGEMENT_KEYS) | {"gear": 1, "input_speed_before": 52.36, "engagement_s": 0.26, "fill_slope": 1.6e6}
    one, other = (engagement_uncertainty(engaged, INSTRUMENTS, box) for box in (BOX, back))
    assert other == pytest.approx(one)
