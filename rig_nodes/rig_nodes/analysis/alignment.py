# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock of one recording against another's, by orders of gears or by what their signals show.

`rig compare` uses it. What happens at t on the first clock happens at t (1 + drift) + offset on the other one; where the times
between the orders differ, each shift has an offset of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..bags import Recording
from ..base import RigError, brief
from .definitions import BEFORE

EVENTS, CORRELATION = "events", "correlation"
COARSE, FINE = 5e-3, 2e-4  # s, grids of the search and of the fit
SMOOTH = 10e-3  # s of the mean before the fit, so that noise does not count as slope
ROUNDS = 40
MOST_DRIFT = 5e-4  # of two clocks; crystals differ by less, and orders of two runs that differ by a tick by more
SAME = 1e-9  # s, a step after which the fit stays where it is
APART = 1e-3  # s by which orders may lie apart on one clock
ROBUST = 2.0  # robust standard deviations at which a difference has half of its weight in the fit
TAIL = 1.0  # percent of a channel's rows at either end that do not define its range
REACH, AROUND = 0.5, (0.3, 1.2)  # s around an order: how far its own place is searched, and the rows that are compared
STEP = 5  # rows of the fine grid from one offset tried to the next one
FITS = 0.9  # coefficient of correlation from which on a channel shows the same as that of the other recording


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
        Largest time by which orders lie apart on that clock [s].
    pieces : tuple of (float, float)
        Times of the first clock from which on there is another offset, and how much it is more than ``offset`` [s].
    notes : tuple of str
        Sentences on what does not fit.
    """

    offset: float = 0.0
    drift: float = 0.0
    by: str = EVENTS
    rest: float = 0.0
    pieces: tuple[tuple[float, float], ...] = ()
    notes: tuple[str, ...] = field(default=())

    def of_first(self, t: np.ndarray) -> np.ndarray:
        """Return the times of this clock [s] at times of the first one."""
        there = t * (1.0 + self.drift) + self.offset
        if not self.pieces:
            return there
        begins, more = (np.array(column) for column in zip(*self.pieces))
        at = np.searchsorted(begins, t + SAME, side="right")
        return there + np.concatenate([more[:1], more])[at]


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
        Offset and drift, with an offset for each order where they lie apart. One order alone gives no drift.

    Raises
    ------
    RigError
        When ``by`` is neither, the orders are not the same, no common signal changes, or the signals do not show the same.
    """
    if by not in (None, EVENTS, CORRELATION):
        raise RigError(f"alignment by {brief(by)}: expected by '{EVENTS}' or '{CORRELATION}'")
    gears = [[order[1:] for order in one.orders] for one in (first, other)]
    if by == EVENTS and (not gears[0] or gears[0] != gears[1]):
        raise RigError("the recordings do not hold the same orders of gears; align them by correlation")
    if by == CORRELATION or not gears[0] or gears[0] != gears[1]:
        return _by_correlation(first, other)
    a, b = (np.array([order[0] for order in one.orders]) for one in (first, other))
    drift, offset = np.polyfit(a, b, 1) - (1.0, 0.0) if len(a) > 1 else (0.0, float(b[0] - a[0]))
    if abs(drift) > MOST_DRIFT:  # the times between the orders differ in the runs themselves
        drift, offset = 0.0, float(b[0] - a[0])
    return _in_pieces(Clock(float(offset), float(drift), EVENTS), a, b - a * (1.0 + drift) - offset)


def _in_pieces(clock: Clock, orders: np.ndarray, rest: np.ndarray) -> Clock:
    """Return the clock with an offset for each order [s] where the orders lie apart by the times ``rest`` [s]."""
    apart = float(np.abs(rest).max(initial=0.0))
    if apart <= APART:
        return replace(clock, rest=apart)
    pieces = zip((orders - BEFORE).tolist(), rest.tolist())
    return replace(clock, rest=apart, pieces=tuple(pieces))


def _smoothed(recording: Recording, name: str, grid: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and means of a channel around them on a grid; missing rows are bridged, and single peaks are cut off."""
    values = np.asarray(recording.channels[name], float)
    t = recording.t0 + recording.period * np.arange(len(values))
    known = np.isfinite(values)
    values = np.interp(t, t[known], values[known]) if known.any() else np.zeros_like(t)
    low, high = np.percentile(values, (TAIL, 100.0 - TAIL))
    values = np.clip(values, low - 0.5 * (high - low), high + 0.5 * (high - low))
    width = max(1, round(SMOOTH / recording.period)) | 1
    sums = np.concatenate([[0.0], np.cumsum(np.pad(values, width // 2, mode="edge"))])
    mean = (sums[width:] - sums[:-width]) / width
    own = np.arange(t[0], t[-1], grid)
    return own, np.interp(own, t, mean)


def _by_correlation(first: Recording, other: Recording) -> Clock:
    from scipy.signal import correlate  # its import takes longer than most calls of those who only open a run

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
    pairs = {name: (_smoothed(first, name, FINE), _smoothed(other, name, FINE)) for name in names}
    clock = _fitted(pairs, start)
    if abs(clock.drift) > MOST_DRIFT:  # rows are missing or doubled, or the signals differ: it is no drift of a clock
        clock = _fitted(pairs, start, drifts=False)
    orders = np.array([order[0] for order in first.orders])
    own = np.array([_own_offset(pairs, clock, at) for at in orders])
    if (seen := ~np.isnan(own)).any():
        moved = own[seen] - own[seen][0]
        notes = [
            f"at {at:.2f} s it lies {1e3 * abs(by):.1f} ms {'later' if by > 0.0 else 'earlier'} on its clock than at "
            f"{orders[seen][0]:.2f} s: {'there are more' if by > 0.0 else 'rows are missing, or there are fewer'} rows between"
            for at, by in zip(orders[seen], moved)
            if abs(by) > APART
        ]
        clock = replace(_in_pieces(clock, orders[seen], own[seen]), notes=tuple(notes))
    return _checked(pairs, clock)


def _checked(pairs: dict, clock: Clock) -> Clock:
    """Return the clock with a note on the channels that do not show the same; RigError when most of them do not."""
    fits = {name: _coefficient(pair, clock) for name, pair in pairs.items()}
    bad = [f"{name} ({one:.2f})" for name, one in fits.items() if one < FITS]
    if 2 * len(bad) > len(fits):
        raise RigError(
            f"the signals do not show the same shifts: with the best offset, {1e3 * clock.offset:+.0f} ms, {', '.join(bad)} differ "
            "(correlation in brackets); compare runs of one sequence, and check the orders, columns and units of a file"
        )
    note = f"{', '.join(bad)}: not as in the first recording (correlation in brackets)"
    return replace(clock, notes=(*clock.notes, note)) if bad else clock


def _coefficient(pair: tuple, clock: Clock) -> float:
    """Return the coefficient of correlation of a channel of both recordings on one clock."""
    (t, a), (tb, b) = pair
    when = clock.of_first(t)
    inside = (when > tb[0]) & (when < tb[-1])
    return _correlation(a[inside], np.interp(when[inside], tb, b))


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    if a.size < 2 or a.std() < 1e-12 or b.std() < 1e-12:
        return 0.0
    return float(np.mean((a - a.mean()) * (b - b.mean())) / (a.std() * b.std()))


def _own_offset(pairs: dict, clock: Clock, order: float) -> float:
    """Return by how much an order [s of the first clock] lies later on the other clock than by its offset; NaN if not found."""
    shifts, found = np.arange(-REACH, REACH + FINE, STEP * FINE), []
    for (t, a), (tb, b) in pairs.values():
        part = (t >= order - AROUND[0]) & (t <= order + AROUND[1])
        mine, when = a[part][::STEP], clock.of_first(t[part][::STEP])
        if when.size < 100 or when[0] - REACH < tb[0] or when[-1] + REACH > tb[-1] or mine.std() < 0.05 * a.std():
            continue
        fits = np.array([_correlation(mine, np.interp(when + by, tb, b)) for by in shifts])
        best = int(fits.argmax())
        if fits[best] < FITS or best in (0, len(shifts) - 1):
            continue
        left, middle, right = fits[best - 1 : best + 2]
        bend = left - 2.0 * middle + right
        found.append(shifts[best] + (0.5 * (left - right) / bend * STEP * FINE if bend < 0.0 else 0.0))
    return float(np.median(found)) if found else np.nan


def _fitted(pairs: dict, offset: float, drifts: bool = True) -> Clock:
    """Return the clock with the least squares of all differences, by Gauss and Newton from an offset [s].

    Differences far beyond the usual ones of their channel count little, because they are no matter of time.
    """
    drift = 0.0
    for _ in range(ROUNDS):
        matrix, right = np.zeros((2, 2)), np.zeros(2)
        for (t, a), (tb, b) in pairs.values():
            when = t * (1.0 + drift) + offset
            inside = (when > tb[0]) & (when < tb[-1])
            if not inside.any():
                raise RigError("the recordings do not overlap after their alignment; align them by events")
            scale = a.std()
            slope = np.interp(when[inside], tb, np.gradient(b, FINE)) / scale
            rest = (a[inside] - np.interp(when[inside], tb, b)) / scale
            jacobian = np.stack([slope, slope * t[inside]])
            # centred, so that a transducer's zero error has no effect
            jacobian, rest = jacobian - jacobian.mean(axis=1, keepdims=True), rest - np.median(rest)
            usual = 1.4826 * float(np.median(np.abs(rest))) + 1e-3
            weight = 1.0 / (1.0 + (rest / (ROBUST * usual)) ** 2)
            matrix, right = matrix + (jacobian * weight) @ jacobian.T, right + (jacobian * weight) @ rest
        if not drifts:
            matrix[0, 1] = matrix[1, 0] = right[1] = 0.0
        if not np.linalg.det(matrix) > 0.0:
            break
        step = np.linalg.solve(matrix, right)
        offset, drift = offset + float(step[0]), drift + float(step[1])
        if np.abs(step).max() < SAME:
            break
    return Clock(offset, drift, CORRELATION)
