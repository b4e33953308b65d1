# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metrics of a shift from the plant's states, compared with values by hand and, for the sample bag, with the transducers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import I1, I2, FakeBag, Shift

from rig_nodes.analysis.comparison import truth_lines
from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.analysis.plant_states import metrics_of_states, states_of
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.rig.configuration import load_rig

BOX = load_rig("hydmag").transmission

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"
ROW = dict.fromkeys((*metric_keys(), "fall_s")) | {
    "from_gear": 1,
    "to_gear": 2,
    "t_order_s": 1.0,
    "t_dt_s": 0.3,
    "t_c_s": 0.6,
    "t_o_s": 0.1,
}


def states():
    """Returns states at 200 Hz: S2 locks at 1.6 s, the input torque peaks at 250 Nm at 1.55 s, n_wyj dips by 10 % at 1.45 s."""
    t = np.arange(0.0, 3.0, 0.005)
    w = np.full(t.size, 150.0)
    w_wyj = np.interp(t, [1.4, 1.45, 1.5, 1.6], np.array([1 / I1, 0.9 / I1, 1 / I1, 1 / I2]) * 150.0)
    m_wej = np.interp(t, [1.3, 1.55, 1.6, 1.7], [60.0, 250.0, 240.0, 80.0])
    gearbox = {"t": t, "torque_in": m_wej, "speed_in": w, "speed_out": w_wyj}
    one = {
        "t": t,
        "mode": np.where(t < 1.3, 2.0, 0.0),
        "heat": np.interp(t, [1.2, 1.4], [0.0, 50.0]),
        "torque": np.where(t < 1.3, 70.0, -15.0),
    }
    two = {
        "t": t,
        "mode": np.select([t < 1.3, t < 1.6 - 1e-9], [0.0, 1.0], 2.0),
        "heat": np.interp(t, [1.3, 1.6, 1.65, 1.9], [10.0, 310.0, 312.0, 999.0]),
        "torque": np.where(t < 1.3, 0.0, 90.0),
    }
    return {"/gearbox/state": gearbox, "/clutch_s1/state": one, "/clutch_s2/state": two}


def test_metrics_by_hand():
    truth = metrics_of_states(states(), ROW, BOX)
    assert truth["t_lock_s"] == pytest.approx(0.6)
    assert truth["input_torque_max_nm"] == pytest.approx(250.0)
    assert truth["k"] == pytest.approx(0.9)
    assert truth["output_speed_min_rpm"] == pytest.approx(0.9 * 150 / I1 * 9.5493, rel=1e-4)
    # from 1.0 s to the settled torque at 1.7 s
    assert truth["heat_s1_j"] == pytest.approx(50.0)
    assert truth["heat_s2_j"] == pytest.approx(302.0 + 687.0 * 0.05 / 0.25)
    assert truth["torque_s1_max_nm"] == 70.0 and truth["torque_s2_max_nm"] == 90.0


def test_extremes_behind_lock_up_count_until_the_output_stops_falling():
    swings = states()
    swings["/gearbox/state"]["speed_out"][(swings["/gearbox/state"]["t"] - 1.61).round(6) == 0.0] = 0.8 * 150 / I1
    assert metrics_of_states(swings, ROW, BOX)["k"] == pytest.approx(0.9)
    assert metrics_of_states(swings, ROW | {"fall_s": 0.01}, BOX)["k"] == pytest.approx(0.8)


def test_a_clutch_that_is_still_locked_when_it_is_ordered_has_not_engaged_by_that():
    held = states()
    held["/clutch_s2/state"]["mode"][:210] = 2.0  # until 1.05 s
    assert metrics_of_states(held, ROW, BOX)["t_lock_s"] == pytest.approx(0.6)


def test_no_lock_no_states_no_truth():
    assert metrics_of_states(states(), ROW, BOX, next_order_time=1.5) is None
    assert metrics_of_states(states(), ROW | {"t_order_s": 0.0}, BOX) is None
    assert states_of(FakeBag(Shift().recording()), BOX) is None
    only_gearbox = {"/gearbox/state": [(0, SimpleNamespace(torque_in=1.0, speed_in=1.0, speed_out=1.0))]}
    assert states_of(FakeBag(Shift().recording(), only_gearbox), BOX) is None


def test_on_the_sample_bag_truth_and_transducers_agree():
    bag = Bag(SAMPLE)
    report = build_report(bag, bag.run_info(), annex_a=1.05, truth=True)
    (row,), (truth,), (account,) = report["shifts"], report["truth"], report["energy"]["shifts"]
    assert truth["t_lock_s"] == pytest.approx(row["t_c_s"], abs=0.01)
    assert truth["k"] == pytest.approx(row["k"], abs=0.01)
    # states 5 ms apart may miss the tip of the peak, or show it where the metric's mean over 2 ms lowers it
    peak = row["input_torque_max_nm"]
    assert 0.5 * peak < truth["input_torque_max_nm"] < 1.1 * peak + report["uncertainty"][0]["input_torque_max_nm"]
    for heat in ("heat_s1_j", "heat_s2_j"):
        assert truth[heat] == pytest.approx(account[heat], rel=0.02, abs=1.0)
    text = format_report(report)
    assert f"order to lock-up {truth['t_lock_s'] * 1e3:.0f} ms ({row['t_c_s'] * 1e3:.0f})" in text
    assert "not from states: t_d, t_p" in text and "Annex A" in text


def test_a_bag_without_states_says_so():
    events = [(0.5, "/controller/events", "shift_ordered", "", 1.0), (1.0, "/controller/events", "shift_ordered", "", 2.0)]
    report = build_report(FakeBag(Shift().recording(), events=events), {}, truth=True)
    assert report["truth"] == [None, None]
    assert "holds no states of a plant" in format_report(report)


def test_between_gears_that_turn_backwards_the_lowest_speed_is_the_slowest_and_k_is_the_same():
    gears = tuple(replace(one, ratio=-one.ratio) if one.ratio else one for one in BOX.gears)
    mirrored = states()
    mirrored["/gearbox/state"]["speed_out"] *= -1.0
    ahead, back = metrics_of_states(states(), ROW, BOX), metrics_of_states(mirrored, ROW, replace(BOX, gears=gears))
    assert back["k"] == pytest.approx(ahead["k"]) == pytest.approx(0.9)
    assert back["output_speed_min_rpm"] == pytest.approx(-ahead["output_speed_min_rpm"])


def test_a_change_of_direction_has_no_lowest_speed_and_no_k():
    gears = tuple(replace(one, ratio=-one.ratio) if one.name == "I" else one for one in BOX.gears)
    truth = metrics_of_states(states(), ROW, replace(BOX, gears=gears))
    assert truth["k"] is None and truth["output_speed_min_rpm"] is None
    assert "min" not in truth_lines(["I-II"], [ROW], [{}], [truth], BOX)[1]
