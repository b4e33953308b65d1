# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mains hum on a recorded channel: it is fitted where nothing moves and subtracted everywhere.

The valves' response time uses it, and single engagements, whose level stretches hum would hide.
"""

from __future__ import annotations

import numpy as np

MAINS, HARMONICS = 50.0, 10  # Hz; the thesis prints 50 Hz and a period of 2 ms, the tenth harmonic
MAINS_RANGE = 0.2  # Hz by which the frequency of a power grid may deviate
HUM_MEAN = 2e-4  # s
QUIET = 0.1  # s that must be quiet, five periods of the hum


def without_hum(t: np.ndarray, pressure: np.ndarray, quiet: int) -> tuple[np.ndarray, float, float]:
    """Subtract the hum that is fitted to the first samples of a channel.

    At least 0.1 s must be quiet. A steady drift there does not count as hum and stays.

    Parameters
    ----------
    t : (n,) array of float
        Equally spaced times [s].
    pressure : (n,) array of float
        The channel.
    quiet : int
        Number of samples at the start to which the hum is fitted.

    Returns
    -------
    clean : (n,) array of float
        The channel without hum.
    hz : float
        Frequency of the hum [Hz].
    amplitude : float
        Amplitude of the hum, in the unit of the channel.
    """
    from scipy.optimize import minimize_scalar  # imported here: it takes 0.25 s, and most reports have no hum to fit

    # fitted to means over 0.2 ms, which keep 98.4 % of the tenth harmonic and a 25th of the samples
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
        # sines over five periods and more are nearly orthogonal, so the normal equations are safe; einsum, because the
        # threads of a matrix library cost more than such a thin product where other work has the cores
        factors = np.linalg.solve(np.einsum("ij,ik->jk", b, b), np.einsum("ij,i->j", b, mean[before] - level))
        return factors, mean[before] - level - np.einsum("ij,j->i", b, factors)

    def left(hz: float) -> float:
        return float(np.sum(fitted(hz)[1] ** 2))

    # high harmonics make several minima, so the best point of a grid is found first, then the minimum near it
    grid = np.linspace(MAINS - MAINS_RANGE, MAINS + MAINS_RANGE, 17)
    best, step_hz = grid[int(np.argmin([left(hz) for hz in grid]))], grid[1] - grid[0]
    hz = float(minimize_scalar(left, bounds=(best - step_hz, best + step_hz), method="bounded", options={"xatol": 1e-4}).x)
    factors = fitted(hz)[0]
    factors[-2:] = 0.0
    hum = base(at, hz) @ factors
    return pressure - np.interp(t, at, hum), hz, float(0.5 * np.ptp(hum[before]))
