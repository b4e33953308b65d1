# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plots of a run's page: each shift with marked phases and times, and the whole run, collected piece by piece from the bag.

view.page_of_report puts them into the page. Which signals a plot has is decided in view.pages.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import FILL, INERTIA, INTERRUPTED, LOGGER, TORQUE, moments_of, phases_of, shift_name, times_of
from ..bags import PIECE, Bag
from ..base import RigError
from .html_page import Axis, Curve, Envelope, Stretch, captioned, legend
from .pages import Pages
from .palette import LIGHT

if TYPE_CHECKING:
    from ..rig import Signal, Transmission

MOST_SHIFTS = 12  # largest number of shifts whose plots are on a page
BEFORE, AFTER, UNKNOWN = 0.15, 0.2, 1.5  # s shown before the order, after the settled torque, and after an order without an end
ENDS = {
    FILL: "fill, to the kiss point",
    TORQUE: TORQUE,
    INTERRUPTED: "interrupted: no clutch carries",
    INERTIA: "inertia phase, to lock-up",
}
TIME = "#666"


class Plots:
    """Collects the curves of a run; its size does not depend on the length of the run.

    Attributes
    ----------
    left_out : int
        Number of shifts that have no plot because the page has enough.
    """

    def __init__(self, pages: Pages, rows: Sequence[Mapping], first: float, last: float) -> None:
        """Prepare for a recording.

        Parameters
        ----------
        pages : Pages
            The pages of the rig.
        rows : sequence of mapping
            Metrics of its shifts.
        first, last : float
            Beginning and end of the recording [s].
        """
        self._pages, self._rows = pages, list(rows[:MOST_SHIFTS])
        self.left_out = max(0, len(rows) - MOST_SHIFTS)
        self._whole = (first, max(last, first + 1e-3))
        later = [row["t_order_s"] for row in rows[1:]] + [np.inf]
        self._windows = [window_of(row, self._whole, after) for row, after in zip(self._rows, later)]
        self._envelopes: dict[tuple[int, str], Envelope] = {}  # by the number of the window, -1 for the whole run, and signal
        self._shift_names = {name for _, names in pages.shift_plots for name in names}
        self._run_plots = pages.run_left + pages.run_right
        self._run_names = {name for _, names in self._run_plots for name in names}

    @property
    def names(self) -> set[str]:
        """Signals that the plots need."""
        return (self._shift_names if self._rows else set()) | self._run_names

    def add(self, name: str, t: np.ndarray, values: np.ndarray) -> None:
        """Add the next samples of a signal [SI] at growing times [s]."""
        if not len(t):
            return
        values = self._pages.known.signals[name].shown(values)
        windows = enumerate(self._windows) if name in self._shift_names else ()
        for number, window in (*windows, *([(-1, self._whole)] if name in self._run_names else [])):
            if t[-1] >= window[0] and t[0] <= window[1]:
                self._envelopes.setdefault((number, name), Envelope(*window)).add(t, values)

    def add_piece(self, piece: Bag) -> None:
        """Add the next piece of a bag."""
        logged: Mapping[str, np.ndarray] = {}
        t = np.empty(0)
        if piece.counts.get(LOGGER):
            try:
                logger = piece.logger(LOGGER, fill=True)
                logged, t = logger.channels, logger.time()
            except RigError:
                logged = {}  # the report names the problem
        for name in self.names:
            if name in logged:
                self.add(name, t, logged[name])
            elif piece.counts.get((signal := self._pages.known.signals[name]).topic):
                self._add_series(piece, signal)

    def _add_series(self, piece: Bag, signal: Signal) -> None:
        try:
            self.add(signal.name, *piece.series(signal))
        except RigError:
            return  # the bag is of another version of the message

    def shift_figures(self) -> list[str]:
        """Return the figure of each shift, without those of which nothing was recorded."""
        return [figure for number, row in enumerate(self._rows) if (figure := self._shift(number, row))]

    def _shift(self, number: int, row: Mapping) -> str:
        axis = Axis(*self._windows[number])
        axis.phases = [Stretch(one.name, one.start, one.end, LIGHT[one.name]) for one in phases_of(row)]
        axis.moments = list(moments_of(row).values())
        bars = [Stretch(one.name, one.start, one.end, one.colour, ENDS[one.name]) for one in axis.phases]
        bars += [Stretch(one.name, one.start, one.end, TIME, f"{one.name} {1e3 * one.length:.0f} ms") for one in times_of(row)]
        plots = self._plots(axis, self._pages.shift_plots, number, every=len(self._pages.shift_plots))
        box = self._pages.box
        title = heading_of(number + 1, row, box) if box else ""
        return f"<figure><h3>{escape(title)}</h3>{axis.bars(bars) if bars else ''}{plots}</figure>" if plots else ""

    def run_figure(self) -> str:
        """Return the figure of the whole run; empty when the rig's pages have no plot of it."""
        axis = Axis(*self._whole, moments=[row["t_order_s"] for row in self._rows])
        plots = self._plots(axis, self._run_plots, -1, every=4)
        return f"<figure>{plots}</figure>" if plots else ""

    def _plots(self, axis: Axis, plots: Iterable[tuple[str, Sequence[str]]], number: int, every: int) -> str:
        """Return the plots of a window that have recorded signals; every ``every``-th of them, and the last, has a time axis."""
        there = [(title, [name for name in names if (number, name) in self._envelopes]) for title, names in plots]
        there = [(title, names) for title, names in there if names]
        drawn = []
        for place, (title, names) in enumerate(there):
            unit = self._pages.known.signals[names[0]].display_unit
            curves = self._curves(number, names)
            caption = legend(((one.name, one.colour) for one in curves), f"{title} [{unit}]")
            drawn.append(captioned(caption, axis.plot(curves, title, times=place == len(there) - 1 or place % every == every - 1)))
        return "".join(drawn)

    def _curves(self, number: int, names: Sequence[str]) -> list[Curve]:
        """Return the curves of a plot, the dashed ones last."""
        looks = {name: self._pages.look(name) for name in names}
        curves = [Curve(name, LIGHT[one.colour], self._envelopes[number, name], one.demanded) for name, one in looks.items()]
        return sorted(curves, key=lambda one: not one.dashed)


def heading_of(number: int, row: Mapping, box: Transmission) -> str:
    """Return the name of a shift as a heading, e.g. ``Shift 1, I → II at 3.85 s``."""
    name = shift_name(number, row, box, " → ")
    return name[0].upper() + name[1:]


def window_of(row: Mapping, whole: tuple[float, float], next_order: float) -> tuple[float, float]:
    """Return the times between which a shift is shown [s]."""
    order, times = row["t_order_s"], times_of(row)
    end = max((one.end for one in times), default=order + UNKNOWN - AFTER) + AFTER
    start = max(order - BEFORE, whole[0])
    return start, max(min(end, next_order, whole[1]), start + 1e-3)


def plots_of_bag(path: str, pages: Pages, rows: Sequence[Mapping], first: float, last: float) -> Plots:
    """Return the plots of a bag, which is read piece by piece.

    Parameters
    ----------
    path : str
        Folder of a run or its .mcap file.
    pages, rows, first, last
        As for Plots.
    """
    plots = Plots(pages, rows, first, last)
    for piece in Bag.pieces(path, PIECE, recover=True):
        plots.add_piece(piece)
    return plots
