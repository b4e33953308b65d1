# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the labels of a plot stand: beside their curves, never over another label or an extreme, over as little as possible.

view.draw uses it. Everything here is in pixels from the lower left corner of the plot.
"""

from __future__ import annotations

import numpy as np

ROOM, BESIDE = 3, 12  # pixels between two labels, above each other and side by side, where they would read as one
NEAR = 1  # pixels between a label and a curve
EXTREME = 4  # pixels around the extreme of a curve
CURVE = 1024  # cost of a pixel of a curve, a level or an area under a label, by that of a pixel from the best place
THIN = 1  # cost of a pixel of a phase's upright line or of zero, which is left out behind a label
NEXT_TO, NEARBY = (3, 8), (3, 8, 14, 20)  # pixels between a level, or a curve, and its label
STEP = 4  # pixels between two places at which a label is tried


class Labels:
    """The plot of ``width`` by ``height`` pixels with what lies in it."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = int(width), int(height)
        self._soft = np.zeros((self.height, self.width), dtype=np.int32)
        self._hard = np.zeros((self.height, self.width), dtype=bool)
        self._sums: list[np.ndarray] | None = None
        self.taken: list[tuple[float, float, float, float]] = []  # left, low, right and high of each label

    def curve(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add a curve (n,), n > 1, whose lowest and highest points stay free."""
        columns = np.arange(self.width)
        known = np.isfinite(y)
        if known.sum() < 2:
            return
        x, least, most = _outline(x[known], y[known])
        edges = np.searchsorted(x, np.arange(self.width + 1))
        low, high = np.interp(columns, x, least), np.interp(columns, x, most)
        low[1:], high[1:] = np.minimum(low[1:], low[:-1]), np.maximum(high[1:], high[:-1])
        filled = np.flatnonzero(edges[1:] > edges[:-1])
        if len(filled):
            heads = edges[filled]
            low[filled] = np.minimum(low[filled], np.minimum.reduceat(least[: edges[-1]], heads))
            high[filled] = np.maximum(high[filled], np.maximum.reduceat(most[: edges[-1]], heads))
        rows = np.arange(self.height)[:, None]
        self._soft[(rows >= low - 1.5) & (rows <= high + 1.5) & (columns >= x[0]) & (columns <= x[-1])] = CURVE
        inside = np.flatnonzero((x >= 0) & (x < self.width))
        if len(inside):
            for y, at in ((least, inside[int(least[inside].argmin())]), (most, inside[int(most[inside].argmax())])):
                self.keep_free(x[at] - EXTREME, y[at] - EXTREME, x[at] + EXTREME, y[at] + EXTREME)
        self._sums = None

    def area(self, x: np.ndarray, y: np.ndarray, base: float) -> None:
        """Add the area between a curve (n,) and a height."""
        rows, columns = np.arange(self.height)[:, None], np.arange(self.width)
        height = np.interp(columns, x, y, left=base, right=base)
        self._soft[(rows >= np.minimum(height, base)) & (rows <= np.maximum(height, base)) & (height != base)] = CURVE
        self._sums = None

    def level(self, y: float) -> None:
        """Add a line across the plot."""
        self._soft[max(0, int(y) - 1) : max(0, int(y) + 2)] = CURVE
        self._sums = None

    def thin(self, at: float, upright: bool = True) -> None:
        """Add a line across the plot that is left out behind a label: an upright one, or that of zero."""
        part = slice(max(0, int(at) - 1), max(0, int(at) + 2))
        part = (slice(None), part) if upright else (part, slice(None))
        self._soft[part] = np.maximum(self._soft[part], THIN)
        self._sums = None

    def gaps(self, at: float, upright: bool) -> list[float]:
        """Return such a line's ends and those of its gaps (n,) as shares of the plot, with nan within each gap."""
        spans = [(left, right, low, high) if upright else (low, high, left, right) for left, low, right, high in self.taken]
        behind = sorted((low, high) for first, last, low, high in spans if first <= at <= last)
        return [0.0, *(end / (self.height if upright else self.width) for low, high in behind for end in (low, np.nan, high)), 1.0]

    def leader(self, start: np.ndarray, end: tuple[float, float]) -> None:
        """Add the line from a point to its label."""
        share = np.linspace(0.0, 1.0, self.width)[:, None]
        x, y = np.rint(np.asarray(start) + share * (np.asarray(end) - start)).astype(int).T
        inside = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        self._soft[y[inside], x[inside]] = CURVE
        self._sums = None

    def keep_free(self, left: float, low: float, right: float, high: float) -> None:
        """Add a box over which no label may stand."""
        rows, columns = slice(max(0, int(low)), max(0, int(high) + 1)), slice(max(0, int(left)), max(0, int(right) + 1))
        self._hard[rows, columns] = True
        self._sums = None

    def best(self, width: float, height: float, wishes: np.ndarray) -> tuple[float, float, float] | None:
        """Return what the best place of a label costs, and its lower left corner there.

        Parameters
        ----------
        width, height : float
            Its size.
        wishes : (n, 3) array of float
            Lower left corners at which it may stand, each with its cost in pixels of distance.

        Returns
        -------
        tuple or None
            CURVE and more where it lies over a curve, a level or an area; None where each place is taken or outside the plot.
        """
        left, low = (wishes[:, :2].astype(int) - NEAR).T
        right, high = left + int(width) + 2 * NEAR + 1, low + int(height) + 2 * NEAR + 1
        inside = (left >= 0) & (low >= 0) & (right <= self.width) & (high <= self.height)
        if not inside.any():
            return None
        if self._sums is None:
            self._sums = [np.pad(one, ((1, 0), (1, 0))).cumsum(0, dtype=np.int32).cumsum(1) for one in (self._soft, self._hard)]
        left, low, right, high, wishes = (one[inside] for one in (left, low, right, high, wishes))
        soft, hard = (one[high, right] - one[low, right] - one[high, left] + one[low, left] for one in self._sums)
        total = np.where(hard > 0, np.inf, soft + wishes[:, 2])
        place = int(total.argmin())
        x, y = map(float, wishes[place, :2])
        return (float(total[place]), x, y) if np.isfinite(total[place]) else None

    def take(self, x: float, y: float, width: float, height: float) -> None:
        """Put a label at a place."""
        self.taken.append((x, y, x + width, y + height))
        self.keep_free(x - BESIDE, y - ROOM, x + width + BESIDE, y + height + ROOM)


def _outline(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return growing x of a curve (n,) and its lowest and highest y there: of one that turns back, pixel by pixel."""
    if (np.diff(x) >= 0.0).all():
        return x, y, y
    passed = np.cumsum(np.append(0.0, np.maximum(1.0, np.ceil(np.abs(np.diff(x))))))
    every = np.arange(passed[-1] + 1.0)
    x, y = np.rint(np.interp(every, passed, x)), np.interp(every, passed, y)
    columns, place = np.unique(x, return_inverse=True)
    least, most = np.full(len(columns), np.inf), np.full(len(columns), -np.inf)
    np.minimum.at(least, place, y)
    np.maximum.at(most, place, y)
    return columns, least, most


def along(
    x: np.ndarray, y: np.ndarray, size: tuple[float, float], room: tuple[int, int], best: float, gaps: tuple[int, ...] = NEARBY
) -> np.ndarray:
    """Return wishes (n, 3) for a label of a curve (n,): above and below it, as near as it can be.

    Parameters
    ----------
    x, y : (n,) array of float
        The curve.
    size : (float, float)
        Width and height of the label.
    room : (int, int)
        Width and height of the plot.
    best : float
        Where it should stand, as a share of the plot's width.
    gaps : tuple of int
        Distances from the curve [px]; of a level only small ones, as its label may be taken for that of another level.
    """
    width, height = size
    known = np.isfinite(y)
    if known.sum() < 2:
        return np.empty((0, 3))
    x, least, most = _outline(x[known], y[known])
    left = np.arange(ROOM + 1.0, room[0] - width - ROOM, STEP)
    left = left[(left <= x[-1]) & (left + width >= x[0])]
    under = left[:, None] + np.linspace(0.0, width, 9)
    low, high = np.interp(under, x, least).min(axis=1), np.interp(under, x, most).max(axis=1)
    sideways = np.abs(left + 0.5 * width - best * room[0]) * 0.5 + high - low
    found = []
    for gap in gaps:
        cost = sideways + 4.0 * gap
        found += [np.column_stack([left, high + gap, cost]), np.column_stack([left, low - gap - height, cost + 5.0])]
    return np.concatenate(found)


def around(point: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return wishes (n, 3) for the label of a point: beside it, at growing distances."""
    width, height = size
    step, turn = np.meshgrid((12, 26, 45, 70, 100, 140, 190, 250), np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False))
    dx, dy = step * np.cos(turn), 0.5 * step * np.sin(turn)
    left = point[0] + np.where(dx >= 0.0, dx, dx - width)
    return np.stack([left, point[1] + dy - 0.5 * height, 2.0 * step], axis=-1).reshape(-1, 3)


def anywhere(size: tuple[float, float], room: tuple[int, int]) -> np.ndarray:
    """Return wishes (n, 3) for a note, which belongs to no curve: all over the plot, best on the left."""
    left, low = np.meshgrid(*(np.arange(ROOM + 2.0, max(ROOM + 3.0, whole - own - ROOM), STEP) for whole, own in zip(room, size)))
    return np.stack([left, low, 0.2 * left], axis=-1).reshape(-1, 3)


def beside(x: float, size: tuple[float, float], room: int) -> np.ndarray:
    """Return wishes (n, 3) for the label of an upright line in a plot of the height ``room``: on its right, else on its left."""
    low = np.arange(ROOM + 1.0, room - size[1] - ROOM, STEP)
    return np.concatenate(
        [np.column_stack(np.broadcast_arrays(left, low, cost)) for left, cost in ((x + 5, 0.0), (x - 5 - size[0], 20.0))]
    )
