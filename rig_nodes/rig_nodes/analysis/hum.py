# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mains hum on a recorded channel, fitted where nothing moves and taken off everywhere.

Used by the valves' response time and by single engagements, whose level stretches hum would hide.
"""

from __future__ import annotations

import numpy as np

MAINS, HARMONICS = 50.0, 10  # Hz; the thesis prints 50 Hz and a period of 2 ms, the tenth harmonic
MAINS_RANGE = 0.2  # Hz that a power grid strays
HUM_MEAN = 2e-4  # s
QUIET = 0.1  # s that must be quiet: five periods


def without_hum(t: np.ndarray, pressure: np.ndarray, quiet: int) -> tuple[np.ndarray, float, float]:
    """The pressure less the hum fitted to its first ``quiet`` samples; the hum's frequency [Hz] and amplitude.

    t: equally spaced times [s]. At least 0.1 s must be quiet; a steady drift there is no hum and stays.
    """
    from scipy.optimize import minimize_scalar  # takes a quarter of a second, and most reports have no hum to fit

    # on means over 0.2 ms, which leave 98.4 % of the tenth harmonic and a 25th of the samples
    step = max(1, int(round(HUM_MEAN * (t.size - 1) / (t[-1] - t[0]))))
    rows = t.size // step * step
    at, mean = (x[:rows].reshape(-1, step).mean(axis=1) for x in (t, pressure))
    before = slice(0, max(1, quiet // step))
    level = float(np.mean(mean[before]))

    def base(times: np.ndarray, hz: float) -> np.ndarray:
        first = np.exp(2j * np.pi * hz * times)
        turns = np.multiply.accumulate(np.broadcast_to(first[:, None], (times.size, HARMONICS)), axis=1)
        return np.hstack([turns.imag, turns.real, (times - at[0])[:, None], np.ones((times.size, 1))])

    def fitted(hz: float) -> tuple[np.ndarray, np.ndarray]:
        b = base(at[before], hz)
        # sines over five periods and more are nearly orthogonal: the normal equations are safe. einsum, because the
        # threads of a matrix library cost more than such a thin product where other work has the cores
        factors = np.linalg.solve(np.einsum("ij,ik->jk", b, b), np.einsum("ij,i->j", b, mean[before] - level))
        return factors, mean[before] - level - np.einsum("ij,j->i", b, factors)

    def left(hz: float) -> float:
        return float(np.sum(fitted(hz)[1] ** 2))

    # high harmonics make several minima: the best of a grid, then the best near it
    grid = np.linspace(MAINS - MAINS_RANGE, MAINS + MAINS_RANGE, 17)
    best, step_hz = grid[int(np.argmin([left(hz) for hz in grid]))], grid[1] - grid[0]
    hz = float(minimize_scalar(left, bounds=(best - step_hz, best + step_hz), method="bounded", options={"xatol": 1e-4}).x)
    factors = fitted(hz)[0]
    factors[-2:] = 0.0
    hum = base(at, hz) @ factors
    return pressure - np.interp(t, at, hum), hz, float(0.5 * np.ptp(hum[before]))
