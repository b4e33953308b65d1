# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the labels of a plot stand: beside their curves, never over another label or an extreme, over as little as possible.

view.draw uses it. Everything here is in pixels from the lower left corner of the plot.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

ROOM = 3  # pixels between a label and what it must not touch
EXTREME = 4  # pixels around the extreme of a curve
STRUCK = 4  # cost of a pixel of a straight line under a label, which it strikes through, by that of a curve
FAR = 0.1  # cost of a pixel from the best place, by that of a pixel of a curve under the label


class Labels:
    """The plot of ``width`` by ``height`` pixels with what lies in it."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = int(width), int(height)
        self._soft = np.zeros((self.height, self.width), dtype=np.int8)
        self._hard = np.zeros((self.height, self.width), dtype=bool)
        self._sums: list[np.ndarray] | None = None

    def curve(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add a curve (n,), n > 1, whose lowest and highest points stay free."""
        columns = np.arange(self.width)
        known = np.isfinite(y)
        if known.sum() < 2:
            return
        x, y = x[known], y[known]
        edges = np.searchsorted(x, np.arange(self.width + 1))
        middle = np.interp(columns, x, y)
        low, high = np.minimum(middle, np.roll(middle, 1)), np.maximum(middle, np.roll(middle, 1))
        low[0] = high[0] = middle[0]
        filled = np.flatnonzero(edges[1:] > edges[:-1])
        if len(filled):
            heads = edges[filled]
            low[filled] = np.minimum(low[filled], np.minimum.reduceat(y[: edges[-1]], heads))
            high[filled] = np.maximum(high[filled], np.maximum.reduceat(y[: edges[-1]], heads))
        rows = np.arange(self.height)[:, None]
        self._soft |= (rows >= low - 1.5) & (rows <= high + 1.5) & (columns >= x[0]) & (columns <= x[-1])
        inside = np.flatnonzero((x >= 0) & (x < self.width))
        if len(inside):
            for at in (inside[int(y[inside].argmin())], inside[int(y[inside].argmax())]):
                self.keep_free(x[at] - EXTREME, y[at] - EXTREME, x[at] + EXTREME, y[at] + EXTREME)
        self._sums = None

    def area(self, x: np.ndarray, y: np.ndarray, base: float) -> None:
        """Add the area between a curve (n,) and a height."""
        rows, columns = np.arange(self.height)[:, None], np.arange(self.width)
        height = np.interp(columns, x, y, left=base, right=base)
        self._soft |= (rows >= np.minimum(height, base)) & (rows <= np.maximum(height, base)) & (height != base)
        self._sums = None

    def line(self, left: float, low: float, right: float, high: float) -> None:
        """Add a horizontal or a vertical line."""
        rows, columns = slice(max(0, int(low) - 1), max(0, int(high) + 2)), slice(max(0, int(left) - 1), max(0, int(right) + 2))
        self._soft[rows, columns] = STRUCK
        self._sums = None

    def leader(self, start: np.ndarray, end: tuple[float, float]) -> None:
        """Add the line from a point to its label."""
        share = np.linspace(0.0, 1.0, self.width)[:, None]
        x, y = np.rint(np.asarray(start) + share * (np.asarray(end) - start)).astype(int).T
        inside = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        self._soft[y[inside], x[inside]] |= 1
        self._sums = None

    def keep_free(self, left: float, low: float, right: float, high: float) -> None:
        """Add a box over which no label may stand."""
        rows, columns = slice(max(0, int(low)), max(0, int(high) + 1)), slice(max(0, int(left)), max(0, int(right) + 1))
        self._hard[rows, columns] = True
        self._sums = None

    def place(self, width: float, height: float, wishes: Iterable[tuple[float, float, float]]) -> tuple[float, float] | None:
        """Return the lower left corner of a label, whose place is then taken.

        Parameters
        ----------
        width, height : float
            Its size.
        wishes : iterable of (float, float, float)
            Lower left corners at which it may stand, each with its cost in pixels of distance.

        Returns
        -------
        tuple or None
            None where each place is taken or outside the plot.
        """
        wished = np.array(list(wishes), dtype=float).reshape(-1, 3)
        left, low = wished[:, 0].astype(int) - ROOM, wished[:, 1].astype(int) - ROOM
        right, high = left + int(width) + 2 * ROOM + 1, low + int(height) + 2 * ROOM + 1
        inside = (left >= 0) & (low >= 0) & (right <= self.width) & (high <= self.height)
        if self._sums is None:
            self._sums = [np.pad(one, ((1, 0), (1, 0))).cumsum(0, dtype=np.int32).cumsum(1) for one in (self._soft, self._hard)]
        left, low, right, high, cost, corners = (one[inside] for one in (left, low, right, high, wished[:, 2], wished[:, :2]))
        if not len(left):
            return None
        soft, hard = (one[high, right] - one[low, right] - one[high, left] + one[low, left] for one in self._sums)
        total = np.where(hard > 0, np.inf, soft + FAR * cost)
        best = int(total.argmin())
        if not np.isfinite(total[best]):
            return None
        x, y = corners[best]
        self.keep_free(x - ROOM, y - ROOM, x + width + ROOM, y + height + ROOM)
        return float(x), float(y)


def along(
    x: np.ndarray, y: np.ndarray, size: tuple[float, float], room: tuple[int, int], best: float
) -> list[tuple[float, float, float]]:
    """Return wishes for a label of a curve (n,): above and below it, as near as it can be.

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
    """
    width, height = size
    found = []
    known = np.isfinite(y)
    if known.sum() < 2:
        return found
    x, y = x[known], y[known]
    for left in np.linspace(ROOM + 1, room[0] - width - ROOM - 2, 40):
        if left < 0 or left > x[-1] or left + width < x[0]:
            continue
        under = np.interp(np.linspace(left, left + width, 9), x, y)
        for gap in (3, 8):
            cost = abs(left + 0.5 * width - best * room[0]) * 0.5 + 20.0 * gap / 5 + float(np.ptp(under))
            found += [(left, under.max() + gap, cost), (left, under.min() - gap - height, cost + 5.0)]
    return found


def around(point: np.ndarray, size: tuple[float, float]) -> list[tuple[float, float, float]]:
    """Return wishes for the label of a point: beside it, at growing distances."""
    (x, y), (width, height) = point, size
    found = []
    for step in (12, 26, 45, 70, 100, 140, 190, 250):
        for turn in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
            dx, dy = step * np.cos(turn), 0.5 * step * np.sin(turn)
            left = x + dx if dx >= 0.0 else x + dx - width
            found.append((left, y + dy - 0.5 * height, 2.0 * step))
    return found


def anywhere(size: tuple[float, float], room: tuple[int, int]) -> list[tuple[float, float, float]]:
    """Return wishes for a note, which belongs to no curve: all over the plot, best on the left."""
    width, height = size
    lefts, lows = np.linspace(6, max(6, room[0] - width - 6), 24), np.linspace(5, max(5, room[1] - height - 5), 14)
    return [(left, low, 0.2 * left) for left in lefts for low in lows]


def beside(x: float, size: tuple[float, float], room: int) -> list[tuple[float, float, float]]:
    """Return wishes for the label of a vertical line at ``x`` in a plot of the height ``room``: on its right, else on its left."""
    lows = np.linspace(ROOM + 1, room - size[1] - ROOM - 2, 20)
    return [(left, low, cost) for left, cost in ((x + 5, 0.0), (x - 5 - size[0], 20.0)) for low in lows]
