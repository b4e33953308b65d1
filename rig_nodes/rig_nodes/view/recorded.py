# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording of any length in the size of a figure: extremes of its signals, and a stretch of time with all samples.

The figures of runs and shifts and the viewer's file take their samples from here; the bag is read piece by piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis import LOGGER
from ..bags import PIECE, Bag
from ..base import RigError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from .pages import Pages

BINS = 900  # stretches of time of a figure, about one a pixel
BESIDE = 4  # stretches on both sides, which the envelope of a band takes too, so that it holds periods of up to 9 of them
OVER = 0.05  # s of a mean for a time derivative


class Envelope:
    """The lowest and the highest value of a signal in each of some equal stretches of time.

    Its size does not depend on how many samples it has taken, and no peak is lost.

    Attributes
    ----------
    low, high : (BINS,) array of float
        The extremes; those of a stretch without a sample are inf and -inf.
    """

    def __init__(self, start: float, end: float, bins: int = BINS) -> None:
        """Prepare an envelope of the samples between two times [s]."""
        self.start, self.end = start, end
        self.low, self.high = np.full(bins, np.inf), np.full(bins, -np.inf)

    def add(self, t: np.ndarray, values: np.ndarray) -> None:
        """Add samples (n,) at growing times (n,) [s]; those outside the window and those that are NaN are left out."""
        good = np.isfinite(values) & (t >= self.start) & (t <= self.end)
        if not good.any():
            return
        t, values = t[good], values[good]
        bins = np.minimum(((t - self.start) / (self.end - self.start) * len(self.low)).astype(int), len(self.low) - 1)
        heads = np.flatnonzero(np.diff(bins, prepend=-1))
        where = bins[heads]
        self.low[where] = np.minimum(self.low[where], np.minimum.reduceat(values, heads))
        self.high[where] = np.maximum(self.high[where], np.maximum.reduceat(values, heads))

    @property
    def filled(self) -> np.ndarray:
        """True for the stretches (BINS,) that have a sample."""
        return self.low <= self.high

    @property
    def times(self) -> np.ndarray:
        """Middles of the stretches (BINS,) [s]."""
        return self.start + (np.arange(len(self.low)) + 0.5) * (self.end - self.start) / len(self.low)

    @property
    def middle(self) -> np.ndarray:
        """Mean of both extremes (BINS,); NaN without a sample."""
        return np.where(self.filled, 0.5 * (np.where(self.filled, self.low, 0.0) + np.where(self.filled, self.high, 0.0)), np.nan)

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest of all samples."""
        return float(self.low[self.filled].min()), float(self.high[self.filled].max())

    @property
    def band(self) -> tuple[np.ndarray, np.ndarray]:
        """The extremes (BINS,) of each stretch and of those beside it; inf and -inf without a sample."""
        places = np.arange(-BESIDE, BESIDE + 1) + np.arange(len(self.low))[:, None]
        places = np.clip(places, 0, len(self.low) - 1)
        return self.low[places].min(axis=1), self.high[places].max(axis=1)

    @property
    def swing(self) -> np.ndarray:
        """Height (BINS,) of the band; 0 without a sample."""
        low, high = self.band
        return np.subtract(high, low, out=np.zeros(len(low)), where=self.filled)


@dataclass(frozen=True)
class Samples:
    """Times (n,) [s] and values (n,) [SI] of a signal."""

    time: np.ndarray
    values: np.ndarray

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self.values, dtype)


def envelopes_of(path: str | Path, pages: Pages, names: Collection[str], span: tuple[float, float]) -> dict[str, Envelope]:
    """Return the extremes of signals, in the unit that people read; those without a sample are left out.

    Parameters
    ----------
    path : str or Path
        Folder of a run or its .mcap file; of a damaged one what is left is read.
    pages : Pages
        The pages of its rig.
    names : collection of str
        The signals.
    span : (float, float)
        First and last time [s].
    """
    found: dict[str, Envelope] = {}
    for name, t, values in samples_of(path, pages, names):
        found.setdefault(name, Envelope(*span)).add(t, pages.signal(name).shown(values))
    return {name: one for name, one in found.items() if one.filled.any()}


def windows_of(
    path: str | Path, pages: Pages, names: Collection[str], windows: Sequence[tuple[float, float]]
) -> list[dict[str, Samples]]:
    """Return the signals in each of some windows, first and last time [s]; other arguments as for :func:`envelopes_of`."""
    kept: list[dict[str, list[tuple[np.ndarray, np.ndarray]]]] = [{} for _ in windows]
    for name, t, values in samples_of(path, pages, names):
        for window, found in zip(windows, kept):
            part = slice(*np.searchsorted(t, window))
            if len(t[part]):
                found.setdefault(name, []).append((t[part], values[part]))
    return [{name: Samples(*map(np.concatenate, zip(*parts))) for name, parts in found.items()} for found in kept]


def samples_of(path: str | Path, pages: Pages, names: Collection[str]) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, times (n,) [s] and values (n,) [SI] of signals, piece by piece of a bag."""
    for piece in Bag.pieces(path, PIECE, recover=True):
        yield from samples_in(piece, pages, names, rows_of(piece))


def rows_of(piece: Bag) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return times (n,) [s] and values (n,) of the logger's columns in a piece; none where the report names a problem of them."""
    if not piece.counts.get(LOGGER):
        return {}
    try:
        logger = piece.logger(LOGGER, fill=True)
    except RigError:
        return {}
    t = logger.time()
    return {name: (t, values) for name, values in logger.channels.items()}


def samples_in(
    piece: Bag, pages: Pages, names: Iterable[str], rows: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, times (n,) [s] and values (n,) [SI] of signals and time derivatives in a piece; ``rows`` come before topics."""
    for name in names:
        of = pages.rates[name][1] if name in pages.rates else name
        signal = pages.known.signals.get(of)
        if of in rows:
            t, values = rows[of]
        elif signal and piece.counts.get(signal.topic) and piece.has_field(signal):
            t, values = piece.series(signal)
        else:
            continue
        yield name, *((t, values) if of == name else derivative(t, values))


def derivative(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times and time derivative of samples (n,), of their means over OVER seconds; nothing of fewer than two such means."""
    span = t[-1] - t[0] if len(t) else 0.0
    if span <= 0.0:
        return np.empty(0), np.empty(0)
    width = max(1, round(OVER * (len(t) - 1) / span))
    whole = len(t) // width * width
    at, means = (one[:whole].reshape(-1, width).mean(axis=1) for one in (t, values))
    return 0.5 * (at[1:] + at[:-1]), np.diff(means) / np.diff(at)
