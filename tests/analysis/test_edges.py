# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The start of a ramp that leaves its level, also of a ramp that soon becomes flatter."""

from __future__ import annotations

import numpy as np
import pytest

from rig_nodes.analysis.edges import first_true, odd_width, ramp_start, running_mean

START = 2000


def found(points, noise=0.0, level=0.05, span=0.25, reach=200, seed=0):
    """Returns the start of a ramp through points (samples after START, height), noticed at ``level``."""
    x = np.interp(np.arange(4000) - START, *zip(*points))
    x = x + np.random.default_rng(seed).normal(0.0, noise, x.size)
    smooth = running_mean(x, 11)
    at = first_true(smooth >= level, int(np.flatnonzero(smooth[: START + 150] < level)[-1]))
    return ramp_start(x, smooth, at, span, reach)


def test_a_straight_ramp_is_followed_back():
    assert found([(0, 0.0), (300, 1.0)]) == pytest.approx(START, abs=2)
    assert found([(0, 0.0), (300, 1.0)], noise=0.01) == pytest.approx(START, abs=6)


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_a_ramp_that_soon_slows_starts_where_it_starts(noise):
    """The ramp has 0.08 in 40 samples, then 0.1 in 1000; a line across the knee would give a start 200 samples too early."""
    assert found([(0, 0.0), (40, 0.08), (1040, 0.18)], noise) == pytest.approx(START, abs=15)


def test_lost_rows_stay_lost_and_spoil_no_others():
    x = np.linspace(0.0, 1.0, 100)
    x[40:45] = np.nan
    smooth = running_mean(x, 11)
    assert np.array_equal(np.isnan(smooth), np.isnan(x))
    assert np.array_equal(smooth[:40], running_mean(x[:40], 11)) and np.array_equal(smooth[45:], running_mean(x[45:], 11))


def test_width_does_not_hang_on_the_last_bit_of_the_period():
    assert {odd_width(5e-3, 1e-4 * (1.0 + e)) for e in (-1e-12, 0.0, 1e-12)} == {49}
    assert odd_width(1e-9, 1e-4) == 1
