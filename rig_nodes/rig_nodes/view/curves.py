# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The curves and states of a run, sent to Rerun piece by piece of its bag, and the vertical lines at its orders.

view.convert uses it; view.live also uses the names, units and colours of curves.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import LOGGER, above_the_oil
from ..bags import Bag
from ..base import RigError
from ..rig import Signal
from . import layout
from .pages import Pages
from .palette import RULE, rgb
from .recorded import derivative, samples_in

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from rerun import RecordingStream, SeriesLines, TimeColumn

FAST = 5e-4  # s between rows below which a channel can be thinned out
BIN = 20  # rows per stretch of a thinned curve, of which it keeps the lowest and the highest
LETTER = 7.0  # px of a letter in a bar of a state
NO_TEXT = " "  # not empty, because the viewer would replace an empty text by the state's value
SHORT = "short "  # before the name of a state in a bar that is too short for it
OWN_TOPIC = "/controller/signals"


def times(rr: ModuleType, t: Sequence[float] | np.ndarray) -> TimeColumn:
    """Return times [s] as the time column of every view."""
    return rr.TimeColumn(layout.TIMELINE, duration=np.round(np.asarray(t) * 1e9).astype("timedelta64[ns]"))


def thinned(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest of each BIN rows of a fast channel at their times; other signals stay as they are."""
    if len(t) < BIN or t[1] - t[0] > FAST:
        return t, values
    whole = len(t) // BIN * BIN
    rows = values[:whole].reshape(-1, BIN)
    # NaN counts as both the lowest and the highest row, so that a gap remains a gap
    place = np.stack([rows.argmin(axis=1), rows.argmax(axis=1)]) + BIN * np.arange(len(rows))
    kept = np.unique(np.append(place, np.arange(whole, len(t))))
    return t[kept], values[kept]


def style(rr: ModuleType, pages: Pages, signal: Signal) -> SeriesLines:
    """Return the name with unit, the colour and the width of a curve.

    Where a pixel has many values the viewer would draw their mean, which cuts off peaks; with this style it draws the least and the
    greatest.
    """
    return rr.SeriesLines(
        names=pages.label(signal.name),
        colors=pages.colour(signal.name),
        widths=pages.width(signal.name),
        aggregation_policy="MinMax",
    )


def log_style(rr: ModuleType, rec: RecordingStream, pages: Pages, signal: Signal) -> None:
    """Log the look of a signal's curve of the whole run."""
    rec.log(layout.entity(signal), style(rr, pages, signal), static=True)


def log_state_styles(rr: ModuleType, rec: RecordingStream, pages: Pages, signal: Signal, place: str = "") -> None:
    """Log the labels and colours of the states of a signal at its place; short bars have the same colours without a label."""
    known = {state: label for label in signal.states.values() for state in (label, SHORT + label)}
    labels = [label if state == label else NO_TEXT for state, label in known.items()]
    colours = [pages.state_colour(signal.name, label) for label in known.values()]
    rec.log(place or layout.entity(signal), rr.StateConfiguration(values=list(known), labels=labels, colors=colours), static=True)


def fits(text: str, width: float) -> bool:
    """Return True when a text has room in a bar of a width [px]."""
    return width > LETTER * (len(text) + 1)


def state_of(signal: Signal, value: float, width: float) -> str:
    """Return the name of a state of a signal for a bar of a width [px], see :func:`log_state_styles`."""
    label = signal.states.get(int(value))
    return str(int(value)) if label is None else label if fits(label, width) else SHORT + label


def extend(extremes: layout.Extremes, place: str, values: np.ndarray) -> None:
    """Extend the least and the greatest value at a place by further ones."""
    seen = values[np.isfinite(values)]
    if len(seen):
        low, high = extremes.get(place, (np.inf, -np.inf))
        extremes[place] = min(low, float(seen.min())), max(high, float(seen.max()))


class Curves:
    """Sender of the curves of each piece of a bag.

    Attributes
    ----------
    ends : (float, float)
        First and last time of everything sent so far [s].
    extremes : layout.Extremes
        Of all curves sent so far.
    problems : list of str
        Sentences on what could not be drawn.
    """

    def __init__(
        self,
        rr: ModuleType,
        rec: RecordingStream,
        pages: Pages,
        names: Collection[str],
        orders: Sequence[layout.Shift],
        thin: bool = False,
        second: float = 1.0,
    ) -> None:
        """Prepare a recording.

        Parameters
        ----------
        rr : module
            The rerun module.
        rec : RecordingStream
            The recording that receives the curves.
        pages : Pages
            The pages of the rig.
        names : collection of str
            Signals of the rig to draw.
        orders : sequence of Shift
            Orders of layout.shifts_of.
        thin : bool
            True to draw fast channels with fewer points, by :func:`thinned`.
        second : float
            Width of a second in the tab of the run [px].
        """
        self._second = second
        self._thin = thin
        self._rr, self._rec, self._pages, self._names, self._orders = rr, rec, pages, names, orders
        self.ends = (np.inf, -np.inf)
        self.problems: list[str] = []
        self.extremes: layout.Extremes = {}
        self._styled: set[str] = set()
        self._states: dict[str, float] = {}  # last value of each state
        self._open: dict[str, tuple[float, float]] = {}  # time [s] and value of each state that has not ended
        self._due: dict[str, float] = {}  # time [s] of the next row of each logger
        # last time [s] of the piece before, and at this time the heat [J] of plates and their temperature above the oil's [K]
        self._plates: dict[str, tuple[float, float, float]] = {}

    def add(self, piece: Bag) -> None:
        """Send all signals of the next piece."""
        rows = self._rows(piece, LOGGER)
        for name in self._names:
            try:
                for _, t, values in samples_in(piece, self._pages, [name], rows):
                    if len(t):
                        self._send_signal(self._pages.known.signal(name), t, values)
            except RigError as error:
                self._tell(str(error))
        for name, (t, values) in self._rows(piece, OWN_TOPIC).items():
            if self._first(name):
                self._rec.log(layout.own_entity(name), self._rr.SeriesLines(names=name), static=True)
            self._send(layout.own_entity(name), t, values)

    def _send_signal(self, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
        """Send samples of a signal, and what follows from them: the temperature of plates by their heat, and time derivatives."""
        self.ends = min(self.ends[0], t[0]), max(self.ends[1], t[-1])
        if signal.states:
            self._send_states(signal, t, values)
        else:
            self._send_series(signal, *(thinned(t, values) if self._thin else (t, values)))
        for name, plates in self._pages.plates.items():
            if plates.heat == signal.name:
                over = above_the_oil(t, values, plates.capacity, plates.cooling, self._plates.get(name))
                self._plates[name] = float(t[-1]), float(values[-1]), float(over[-1])
                self._send_series(plates.signal, t, plates.oil + over)
        for rate, source in self._pages.rates.values():
            if source == signal.name:
                self._send_series(rate, *derivative(t, values))

    def _tell(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)

    def _rows(self, piece: Bag, topic: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return time [s] and values of a logger's columns, with a gap where rows are missing, also between two pieces.

        Columns of earlier pieces of which this one has no rows are empty.
        """
        nothing = dict.fromkeys(piece.columns(topic) if topic in self._due else (), (np.empty(0), np.empty(0)))
        if not piece.counts.get(topic):
            return nothing
        try:
            logger = piece.logger(topic, fill=True)
        except RigError as error:
            self._tell(f"no rows of the logger: {error}")
            return nothing
        t, due = logger.time(), self._due.get(topic)
        self._due[topic] = t[-1] + logger.period
        if due is None or t[0] < due + 0.5 * logger.period:
            return {name: (t, values) for name, values in logger.channels.items()}
        t = np.append(due, t)
        return {name: (t, np.append(np.nan, values)) for name, values in logger.channels.items()}

    def _first(self, entity: str) -> bool:
        """Return True at the first call for an entity."""
        known = entity in self._styled
        self._styled.add(entity)
        return not known

    def _send(self, entity: str, t: np.ndarray, values: np.ndarray) -> None:
        if len(t):
            self._rec.send_columns(entity, [times(self._rr, t)], self._rr.Scalars.columns(scalars=values))

    def _send_series(self, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
        if self._first(signal.name):
            log_style(self._rr, self._rec, self._pages, signal)
        place, values = layout.entity(signal), signal.shown(values)
        extend(self.extremes, place, values)
        self._send(place, t, values)

    def _send_states(self, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
        """Send one row for each state that has ended; the last one is held, because its bar's width is not known."""
        if self._first(signal.name):
            log_state_styles(self._rr, self._rec, self._pages, signal)
        change = np.flatnonzero(np.diff(values, prepend=self._states.get(signal.name, np.nan)) != 0)
        self._states[signal.name] = values[-1]
        rows = [
            *([self._open[signal.name]] if signal.name in self._open else []),
            *zip(t[change].tolist(), values[change].tolist()),
        ]
        self._open[signal.name] = rows[-1]
        self._send_bars(signal, rows[:-1], rows[-1][0])

    def _send_bars(self, signal: Signal, rows: Sequence[tuple[float, float]], end: float) -> None:
        """Send states with the times [s] at which they begin; the last of them ends at ``end`` [s]."""
        if rows:
            begins = [begin for begin, _ in rows]
            widths = np.diff([*begins, end]) * self._second
            states = [state_of(signal, value, width) for (_, value), width in zip(rows, widths)]
            self._rec.send_columns(layout.entity(signal), [times(self._rr, begins)], self._rr.StateChange.columns(state=states))

    def finish(self) -> None:
        """Send what depends on the end of the run: the last state of each signal, and the marks at the orders."""
        for name, last in self._open.items():
            self._send_bars(self._pages.known.signal(name), [last], self.ends[1])
        self._send_marks()

    def _send_marks(self) -> None:
        """Send a vertical line at each order, as high as the plot."""
        for title, names in self._pages.marked_plots:
            ends = layout.height_of(self._pages, names, self.extremes)
            orders = [one.order for one in self._orders if self.ends[0] <= one.order <= self.ends[1]]
            if rows := [(t, value) for t in orders for value in (*ends, np.nan)] if ends else ():
                t, values = np.array(rows).T
                path = layout.mark_entity(title)
                # both ends lie at the same time; averaging would reduce them to a point
                line = self._rr.SeriesLines(names="shift ordered", colors=rgb(RULE), widths=1.0, aggregation_policy="Off")
                self._rec.log(path, line, static=True)
                self._send(path, t, values)
