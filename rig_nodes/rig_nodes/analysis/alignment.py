# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The offset and drift of one recording's clock against another's, by orders of gears or by cross-correlation.

`rig compare` uses it. What happens at t on the first clock happens at t (1 + drift) + offset on the other one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate

from ..errors import RigError
from .metrics import Recording

EVENTS, CORRELATION = "events", "correlation"
COARSE, FINE = 5e-3, 2e-4  # s, grids of the search and of the fit
SMOOTH = 10e-3  # s of the mean before the fit, so that noise does not count as slope
ROUNDS = 40
MOST_DRIFT = 5e-4  # of two clocks; crystals differ by less, and orders of two runs that differ by a tick by more
SAME = 1e-9  # s, a step after which the fit stays where it is


@dataclass(frozen=True)
class Clock:
    """The clock of a recording against that of the first one.

    Attributes
    ----------
    offset : float
        Its time at time 0 of the first clock [s].
    drift : float
        Share by which it goes faster; 50e-6 is 50 ppm.
    by : str
        EVENTS or CORRELATION.
    rest : float
        Largest time that is left between orders [s]; 0 by correlation.
    """

    offset: float = 0.0
    drift: float = 0.0
    by: str = EVENTS
    rest: float = 0.0

    def of_first(self, t: np.ndarray) -> np.ndarray:
        """Return the times of this clock [s] at times of the first one."""
        return t * (1.0 + self.drift) + self.offset

    def on_first(self, t: np.ndarray | float) -> np.ndarray | float:
        """Return times of the first clock [s] at times of this one."""
        return (t - self.offset) / (1.0 + self.drift)


def align(first: Recording, other: Recording, by: str | None = None) -> Clock:
    """Return the clock of a recording against the first one.

    Parameters
    ----------
    first, other : Recording
        The recordings.
    by : str, optional
        EVENTS or CORRELATION; by default events when both hold the same orders.

    Returns
    -------
    Clock
        Offset and drift. One order alone gives no drift.

    Raises
    ------
    RigError
        When the orders are not the same, no common signal changes, or what is found is no drift of a clock.
    """
    gears = [[order[1:] for order in one.orders] for one in (first, other)]
    if by == EVENTS and (not gears[0] or gears[0] != gears[1]):
        raise RigError("the recordings do not hold the same orders of gears; align them by correlation")
    if by == CORRELATION or not gears[0] or gears[0] != gears[1]:
        return _by_correlation(first, other)
    a, b = (np.array([order[0] for order in one.orders]) for one in (first, other))
    drift, offset = np.polyfit(a, b, 1) - (1.0, 0.0) if len(a) > 1 else (0.0, float(b[0] - a[0]))
    if abs(drift) > MOST_DRIFT:  # the times between the orders differ in the runs themselves
        drift, offset = 0.0, float(b[0] - a[0])
    return Clock(float(offset), float(drift), EVENTS, float(np.abs(b - a * (1.0 + drift) - offset).max()))


def _smoothed(recording: Recording, name: str, grid: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and means of a channel around them on a grid; missing rows are bridged."""
    values = np.asarray(recording.channels[name], float)
    t = recording.t0 + recording.period * np.arange(len(values))
    known = np.isfinite(values)
    values = np.interp(t, t[known], values[known]) if known.any() else np.zeros_like(t)
    width = max(1, round(SMOOTH / recording.period)) | 1
    sums = np.concatenate([[0.0], np.cumsum(np.pad(values, width // 2, mode="edge"))])
    mean = (sums[width:] - sums[:-width]) / width
    own = np.arange(t[0], t[-1], grid)
    return own, np.interp(own, t, mean)


def _by_correlation(first: Recording, other: Recording) -> Clock:
    names, total, last = [], None, 0
    for name in first.transmission.channels:
        if name not in first.channels or name not in other.channels:
            continue
        (_, a), (_, b) = (_smoothed(one, name, COARSE) for one in (first, other))
        if a.std() < 1e-12 or b.std() < 1e-12:
            continue
        found = correlate((b - b.mean()) / b.std(), (a - a.mean()) / a.std(), "full", "fft")
        total = found if total is None else total + found
        names.append(name)
        last = len(a) - 1
    if total is None:
        raise RigError("no signal that both recordings hold changes, so they cannot be aligned by correlation")
    start = other.t0 - first.t0 + COARSE * (int(np.argmax(total)) - last)
    return _fitted(first, other, names, start)


def _fitted(first: Recording, other: Recording, names: list[str], offset: float) -> Clock:
    """Return the clock with the least squares of all differences, by Gauss and Newton from an offset [s]."""
    pairs = [(_smoothed(first, name, FINE), _smoothed(other, name, FINE)) for name in names]
    drift = 0.0
    for _ in range(ROUNDS):
        matrix, right = np.zeros((2, 2)), np.zeros(2)
        for (t, a), (tb, b) in pairs:
            when = t * (1.0 + drift) + offset
            inside = (when > tb[0]) & (when < tb[-1])
            if not inside.any():
                raise RigError("the recordings do not overlap after their alignment; align them by events")
            scale = a.std()
            slope = np.interp(when[inside], tb, np.gradient(b, FINE)) / scale
            rest = (a[inside] - np.interp(when[inside], tb, b)) / scale
            jacobian = np.stack([slope, slope * t[inside]])
            # centred, so that a transducer's zero error has no effect
            jacobian, rest = jacobian - jacobian.mean(axis=1, keepdims=True), rest - rest.mean()
            matrix, right = matrix + jacobian @ jacobian.T, right + jacobian @ rest
        if not np.linalg.det(matrix) > 0.0:
            break
        step = np.linalg.solve(matrix, right)
        offset, drift = offset + float(step[0]), drift + float(step[1])
        if np.abs(step).max() < SAME:
            break
    if abs(drift) > MOST_DRIFT:
        raise RigError(
            f"the signals fit best with a drift of {drift * 1e6:.0f} ppm, more than the {MOST_DRIFT * 1e6:.0f} of two clocks, so "
            "they are not of the same orders; compare runs of one sequence"
        )
    return Clock(offset, drift, CORRELATION)
