# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters and edge finding for sampled channels, used by the shift metrics.

Every filter here is symmetric in time, so that it widens an edge but does not delay it.
"""

from __future__ import annotations

import numpy as np


def odd_width(seconds: float, period: float) -> int:
    """Return the odd number of samples nearest to a filter length, at least one.

    Parameters
    ----------
    seconds : float
        Filter length [s].
    period : float
        Time between samples [s].
    """
    # rounded first, because the division's rounding error would otherwise decide between 49 and 51 samples for 50
    return max(1, 2 * int(round((round(seconds / period, 6) - 1.0) / 2.0)) + 1)


def running_mean(x: np.ndarray, width: int) -> np.ndarray:
    """Return the centred mean over ``width`` samples (odd); at the ends, over the samples that exist.

    Parameters
    ----------
    x : (n,) array of float
        The channel.
    width : int
        Number of samples, odd.

    Returns
    -------
    (n,) array of float
        The filtered channel.
    """
    known = np.isfinite(x)
    if not known.all():  # rows that were lost: what lies between them is averaged by itself
        out = np.full(x.size, np.nan)
        for begin, end in np.flatnonzero(np.diff(known, prepend=False, append=False)).reshape(-1, 2):
            out[begin:end] = running_mean(x[begin:end], width)
        return out
    half = width // 2
    if half == 0 or x.size == 0:
        return np.array(x, dtype=float)
    # values relative to the first sample, so that the running sum stays small and loses no digits
    total = np.zeros(x.size + 1)
    np.cumsum(x - x[0], out=total[1:])
    out = np.empty(x.size)
    if x.size > 2 * half:
        np.subtract(total[2 * half + 1 :], total[: -2 * half - 1], out=out[half : x.size - half])
        out[half : x.size - half] /= 2 * half + 1
        ends = np.r_[:half, x.size - half : x.size]
    else:
        ends = np.arange(x.size)
    low, high = np.maximum(ends - half, 0), np.minimum(ends + half + 1, x.size)
    out[ends] = (total[high] - total[low]) / (high - low)
    out += x[0]
    return out


def mean_ahead(x: np.ndarray, width: int) -> np.ndarray:
    """Return the mean over the ``width`` samples from each sample on; NaN where fewer are left."""
    out = np.full(x.size, np.nan)
    if x.size >= width:
        total = np.concatenate(([0.0], np.cumsum(x)))
        out[: x.size - width + 1] = (total[width:] - total[:-width]) / width
    return out


def all_ahead(ok: np.ndarray, width: int) -> np.ndarray:
    """Return True where this sample and the ``width - 1`` next ones are all true, and False where fewer are left."""
    return np.nan_to_num(mean_ahead(ok.astype(float), width)) > 1.0 - 0.5 / width


def quantum(x: np.ndarray) -> float:
    """Return the smallest step between occurring values: the resolution of a quantised channel, about 0 for others."""
    steps = np.diff(np.unique(x))
    return float(steps.min()) if steps.size else 0.0


def white_noise(x: np.ndarray) -> float:
    """Return the standard deviation of the fast part of ``x``, from its successive differences."""
    return float(np.std(np.diff(x)) / np.sqrt(2.0)) if x.size > 2 else 0.0


def first_true(mask: np.ndarray, start: int = 0) -> int | None:
    """Return the index of the first true sample at or after ``start``, or None."""
    start = max(0, start)
    hits = np.flatnonzero(mask[start:])
    return int(hits[0]) + start if hits.size else None


def ramp_start(rise: np.ndarray, smooth: np.ndarray, at: int, span: float, reach: int) -> float:
    """Return the fractional index at which a ramp that is seen at ``at`` left its level.

    A threshold alone would find every start late by threshold / slope. So a line is fitted from ``at`` to where the
    distance has grown by ``span``, and is followed back to zero. The result is never after ``at``, at most ``reach``
    samples before it, and never before the last sample at which ``smooth`` was still at its level, because the line across
    a knee of the ramp is too flat.

    Parameters
    ----------
    rise : (n,) array of float
        Distance from the level, unfiltered and growing.
    smooth : (n,) array of float
        The same distance, filtered.
    at : int
        Sample at which the ramp is seen.
    span : float
        Growth of the distance over which the line is fitted, in the unit of ``rise``.
    reach : int
        Largest number of samples that the line is followed back.

    Returns
    -------
    float
        Fractional index of the start.
    """
    stop = first_true(smooth[: at + 5 * reach] >= smooth[at] + span, at)
    stop = min(at + 5 * reach, rise.size - 1) if stop is None else stop
    if stop - at < 3:
        return float(at)
    index = np.arange(at, stop + 1)
    slope, offset = np.polyfit(index - at, rise[index], 1)
    if slope <= 0.0:
        return float(at)
    earliest = max(0, at - reach)
    level = np.flatnonzero(smooth[earliest:at] <= 0.0)
    if level.size:
        earliest += int(level[-1])
    return float(min(at, max(earliest, at - offset / slope)))
