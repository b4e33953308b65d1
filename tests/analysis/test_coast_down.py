# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertia from a coast-down, for the thesis's own parabola and for runs integrated by hand."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_shift import ENCODER

from rig_nodes.analysis.coasting import coast_down
from rig_nodes.base.errors import RigError

STEP = 1e-3


def printed(lead=1.0):
    """Returns (7.7) from ``lead`` seconds on, before that its first value; the shaft is at rest after the zero at 5.90 s."""
    t = np.arange(0.0, lead + 8.0, STEP)
    s = np.clip(t - lead, 0.0, 5.90)
    return t, np.maximum(0.5735 * s**2 - 11.736 * s + 49.274, 0.0)


def run_down(inertia, lead=1.0, dry=5.0, viscous=0.067):
    """Returns the speed of J dw/dt = -(dry + viscous w) from 49.2 rad/s: w = (w0 + d/v) exp(-v s / J) - d/v."""
    t = np.arange(0.0, lead + 12.0, STEP)
    s = np.maximum(t - lead, 0.0)
    w = (49.2 + dry / viscous) * np.exp(-viscous * s / inertia) - dry / viscous
    return t, np.maximum(w, 0.0), dry + viscous * 49.2


def test_the_printed_parabola_gives_the_printed_inertia():
    t, w = printed()
    found = coast_down(t, w, 8.32)
    assert found["coast_down_tangent_s"] == pytest.approx(4.198, abs=0.02)
    assert found["inertia"] == pytest.approx(0.709, abs=0.004)
    assert found["coefficients"] == pytest.approx([0.5735, -11.736, 49.274], rel=0.01)
    assert found["t_cut_s"] == pytest.approx(1.0, abs=0.01)
    assert found["coast_down_torque_nm"] == 8.32


def test_given_cut_gives_the_parabola_back_exactly():
    t, w = printed()
    found = coast_down(t, w, 8.32, t_cut=1.0)
    assert found["coefficients"] == pytest.approx([0.5735, -11.736, 49.274], rel=1e-4)
    assert found["coast_down_tangent_s"] == pytest.approx(49.274 / 11.736, abs=1e-3)
    assert found["residual"] < 1e-3


@pytest.mark.parametrize("share", [0.8, 1.0, 1.2])
def test_inertia_comes_back_within_2_percent_from_encoder_steps(share):
    """The losses are not those of a parabola: they are constant and grow with speed."""
    true = 0.709 * share
    t, w, torque = run_down(true)
    w = np.round((w + np.random.default_rng(4).normal(0.0, 0.01, w.size)) / ENCODER) * ENCODER
    channel = torque + np.random.default_rng(5).normal(0.0, 0.2, t.size)
    found = coast_down(t, w, channel, down_to=0.3)
    assert found["inertia"] == pytest.approx(true, rel=0.02)
    assert found["inertia_half"] == pytest.approx(true, rel=0.02)
    assert found["coast_down_torque_nm"] == pytest.approx(torque, abs=0.05)


def test_a_run_up_before_it_is_no_coast_down():
    t, w = printed(lead=3.0)
    w = np.where(t < 1.0, 51.0 * t, w)
    assert coast_down(t, w, 8.32)["t_cut_s"] == pytest.approx(3.0, abs=0.02)


def test_a_recording_that_starts_with_it():
    t, w = printed(lead=0.0)
    found = coast_down(t, w, 8.32)
    assert found["t_cut_s"] == 0.0 and found["w_start"] is None
    assert found["inertia"] == pytest.approx(0.709, abs=0.002)
    with pytest.raises(RigError, match="must be given as a number"):
        coast_down(t, w, np.full(t.size, 8.32))


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"w": np.full(9000, 49.0)}, "no coast-down"),
        ({"torque": np.zeros(3)}, "shape"),
        ({"down_to": 1.0}, "share of its speed"),
        ({"t_cut": 20.0}, "ends before"),
    ],
)
def test_what_cannot_be_answered_is_refused(change, sentence):
    t, w = printed()
    given = {"t": t, "w": w, "torque": 8.32} | change
    with pytest.raises(RigError, match=sentence):
        coast_down(**given)
