# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Single engagements: times, torques and the shape of the pressure, for engagements made by hand."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_engagement import ORDER, Engagement
from synthetic_shift import ENCODER, PERIOD, RPM

from rig_nodes.analysis.engagement import KEYS, engagement_metrics, engagement_ranks
from rig_nodes.analysis.measured_error import instruments_of
from rig_nodes.rig.configuration import load_rig

INSTRUMENTS = instruments_of(load_rig("hydmag").as_dict())

ORDERED = (ORDER, 0, 1)


def metrics(engagement=Engagement(), seed=None, hum=0.0):
    return engagement_metrics(engagement.recording(seed, hum), ORDERED, INSTRUMENTS)


def test_times_torques_and_kiss_pressure_of_a_clean_engagement():
    row = metrics()
    assert row["valid"] and row["why"] == [] and set(row) == set(KEYS)
    assert row["rise_start_s"] == pytest.approx(0.200, abs=1e-3)
    assert row["slip_end_s"] == pytest.approx(0.460, abs=1.5e-3)
    assert row["engagement_s"] == pytest.approx(0.260, abs=2e-3)
    # 50 Nm per MPa above 0.17 MPa at 0.46 s: 1.02 MPa until 0.3803 s, then 5.87 MPa/s
    peak = 50.0 * (1.02 + 5.87 * (0.46 - 0.3803) - 0.17) * 34 / 47 + 3.0
    assert row["engagement_peak_nm"] == pytest.approx(peak, abs=0.5)
    assert row["input_torque_mean_nm"] == pytest.approx(28.0, abs=0.01)
    assert row["p_kiss"] == pytest.approx(0.17e6, abs=0.03e6)
    assert row["p_rest"] == pytest.approx(0.0, abs=1.0) and row["p_end"] == pytest.approx(2.3e6, abs=1.0)


def test_hold_phase_between_fill_and_regulation():
    row = metrics()
    assert (row["hold"], row["pressure_rise"]) == ("hold", "three phases")
    assert row["hold_start_s"] == pytest.approx(0.3003, abs=4e-3)
    assert row["hold_end_s"] == pytest.approx(0.3803, abs=4e-3)
    assert row["hold_s"] == pytest.approx(0.080, abs=6e-3)
    assert row["hold_pressure"] == pytest.approx(1.02e6, abs=0.01e6)


@pytest.mark.parametrize("length, hold", [(0.0, "no hold"), (0.010, "no hold"), (0.030, "hold"), (0.200, "hold")])
def test_only_a_level_longer_than_a_mains_period_is_a_hold(length, hold):
    row = metrics(Engagement(plateau_for=length))
    assert row["hold"] == hold
    assert row["hold_s"] == pytest.approx(length if hold == "hold" else 0.0, abs=6e-3)
    assert row["level_s"] == pytest.approx(length, abs=6e-3)


@pytest.mark.parametrize(
    "engagement",
    [
        Engagement(plateau_for=0.0, ramp=1.5e6, closed=0.9),  # a slow ramp is no hold
        Engagement(plateau=0.05e6, fill_slope=0.3e6, plateau_for=0.1),  # nor a level that cannot be distinguished from the rest
        Engagement(plateau=2.15e6, plateau_for=0.1),
    ],
)  # in the last case the level near the end pressure is no hold either
def test_what_is_no_hold(engagement):
    assert metrics(engagement)["hold"] == "no hold"


@pytest.mark.parametrize("seed", range(5))
def test_noise_hum_and_encoder_steps_move_little(seed):
    row = metrics(seed=seed, hum=5e3)
    assert row["valid"], row["why"]
    assert row["engagement_s"] == pytest.approx(0.260, abs=8e-3)
    assert row["hold"] == "hold" and row["hold_s"] == pytest.approx(0.080, abs=12e-3)
    assert row["p_kiss"] == pytest.approx(0.17e6, abs=0.1e6)
    assert row["disturbed"] == "monotone"
    assert metrics(Engagement(plateau_for=0.0), seed, 5e3)["hold"] == "no hold"


def test_encoder_step_decides_when_slip_is_taken_as_gone():
    """Half a step of each encoder is 0.24 % of 500 rpm, 2.4 ms before the corner at 1 % per 1.2 ms."""
    recording = Engagement().recording()
    channels = dict(recording.channels)
    for name in ("n_wej", "n_wyj"):
        channels[name] = np.round(channels[name] / ENCODER) * ENCODER
    coarse = engagement_metrics(
        type(recording)(0.0, PERIOD, channels, recording.orders, recording.transmission), ORDERED, INSTRUMENTS
    )
    assert 0.4575 <= coarse["slip_end_s"] <= 0.4605


def test_fill_line_and_growth_around_contact():
    row = metrics()
    assert row["fill_start_s"] == pytest.approx(0.2, abs=1e-3)
    assert row["fill_end_s"] == pytest.approx(0.2863, abs=4e-3)
    assert row["fill_slope"] == pytest.approx(1.622e6, rel=0.1) and row["fill_r2"] > 0.95
    assert row["growth_fill"] < 0.1e6 and row["growth_contact"] > 0.4e6


def test_dip_after_the_steep_part():
    row = metrics(Engagement(dip=0.1e6), seed=3)
    assert row["disturbed"] == "dips"
    assert row["dip"] == pytest.approx(0.1e6, abs=0.03e6)
    # from the overshoot's top to where the pressure is back: 30 ms down, then 0.1 MPa at 5.87 MPa/s
    assert row["disturbance_start_s"] == pytest.approx(0.4003, abs=6e-3)
    assert row["disturbance_end_s"] == pytest.approx(0.4003 + 0.030 + 0.017, abs=8e-3)
    clean = metrics()
    assert clean["disturbed"] == "monotone" and clean["disturbance_start_s"] is None


@pytest.mark.parametrize(
    "change, reason",
    [
        ({"end": 0.0, "plateau": 0.0, "fill_slope": 0.0}, "did not rise"),
        ({"closed": 1.4}, "never closed|too early"),
        ({"rpm": 0.0}, "did not turn"),
        ({"length": 0.65}, "does not cover"),
    ],
)
def test_what_is_missing_is_said(change, reason):
    row = metrics(Engagement(**change))
    assert not row["valid"]
    assert any(re.search(reason, sentence) for sentence in row["why"]), row["why"]


def test_an_order_that_is_no_engagement_is_said():
    row = engagement_metrics(Engagement().recording(), (ORDER, 1, 2), INSTRUMENTS)
    assert row["why"] == ["an engagement goes from neutral (0) to gear 1 or 2, not from 1 to 2"]


def test_ranks_among_series():
    def series(peak, time, hold):
        return {"engagement_peak_nm": peak, "engagement_s": time, "hold_s": hold}

    rows = [
        series(90.0, 0.25, 0.06),
        series(100.0, 0.30, 0.10),
        series(80.0, 0.40, 0.06),
        series(70.0, 0.10, 0.0),
        series(100.0, 0.30, 0.0),
        series(90.5, 0.27, 0.08),
        series(None, 0.3, 0.1),
    ]
    # 1 is better than 2 in all three values; 3 has the lowest peak of those with a hold; 4, without a hold, is better than none
    assert engagement_ranks(rows) == [
        "not dominated",
        "dominated",
        "not dominated",
        "not dominated",
        "dominated",
        "not dominated",
        None,
    ]


def test_an_engagement_of_a_gear_that_turns_backwards_has_the_same_times():
    recording = Engagement(rpm=470 * ENCODER * RPM).recording()  # in step, both speeds are whole steps of the encoders
    box = recording.transmission
    back = replace(box, gears=tuple(replace(one, ratio=-one.ratio) if one.ratio else one for one in box.gears))
    ends = []
    for way, one in ((1.0, box), (-1.0, back)):
        channels = dict(recording.channels)
        channels["n_wej"] = np.round(channels["n_wej"] / ENCODER) * ENCODER
        channels["n_wyj"] = way * np.round(channels["n_wyj"] / ENCODER) * ENCODER
        channels["M_wyj"] = way * channels["M_wyj"]
        channels["M_wej"] = np.full_like(channels["M_wej"], 28.0)  # so that the output shows the kiss point
        ends.append(engagement_metrics(type(recording)(0.0, PERIOD, channels, recording.orders, one), ORDERED, INSTRUMENTS))
    for key in ("slip_end_s", "engagement_s", "kiss_s", "p_kiss"):
        assert ends[1][key] == ends[0][key] is not None, key
