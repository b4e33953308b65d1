# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The moments of a run that the view shows close up, on time axes of their own: shifts, responses of valves, a coast-down.

view.convert uses it, and view.layout arranges the plots. Time zero of a shift is its order, so that one plot can show
several. Only the stretch of the bag around a moment is read, however long the run is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import LOGGER, LONGEST, RPM, Part, shift_metrics, without_slip
from ..bags import UNREADABLE, Recording, cdr
from ..base import RigError
from ..rig import NEUTRAL
from . import layout
from .curves import NO_TEXT, OWN_TOPIC, fits, log_state_styles, state_of, style, thinned, times
from .figure_of_shift import marks_of, stretches_of
from .pages import ALARM, WAITING, Colour, Pages, Plots
from .palette import OTHER, RULE, rgb
from .recorded import rows_of, samples_in

if TYPE_CHECKING:
    from types import ModuleType

    from rerun import RecordingStream

    from ..bags import Bag, OpenedBags
    from .figure import Stretch

EVENT = "rig_msgs/msg/Event"
SPARE = 0.1  # s read before and after a moment, because the log time of a message may differ from the time of its values
STEP = 8.0  # s; part of a long stretch that is in memory at a time
LONGER, SHORTEST = 1.5, 0.75  # what is shown behind an order: a share of its shift's course, and at least [s]
COARSE = 4  # with at least so many moments in one column, they are drawn at 1 kHz


@dataclass(frozen=True)
class Moment:
    """A stretch of a run.

    Parameters
    ----------
    root : str
        Place of the moment in the view's file.
    title : str
        Displayed name.
    zero : float
        Time of the run at its time zero [s].
    start, end : float
        Beginning and end, from time zero [s].
    marks : tuple of float
        Times from zero on [s] at which its plots have a vertical line.
    lanes : mapping of str to list of (Part, Colour)
        Stretches of time shown as bars, by the name of their lane; times from zero on [s].
    drawn : mapping of str to (str, times, values)
        Computed curves by name: a signal in whose plot and unit they are drawn, times from zero on [s], values [SI].
    """

    root: str
    title: str
    zero: float
    start: float
    end: float
    marks: tuple[float, ...]
    lanes: Mapping[str, list[tuple[Part, Colour]]]
    drawn: Mapping[str, tuple[str, np.ndarray, np.ndarray]]

    @property
    def heading(self) -> str:
        """The displayed name with the lengths of its stretches, as few bars are long enough for theirs."""
        parts = sorted((part for bars in self.lanes.values() for part, _ in bars), key=lambda one: one.start)
        lengths = ", ".join(one.name.replace(" phase", "").removesuffix(" ms") for one in parts)
        return f"{self.title}; {lengths} ms" if lengths else self.title


@dataclass(frozen=True)
class Page:
    """A tab of moments: its name on the command line and for people, columns of moments, their plots and lanes of states."""

    key: str
    name: str
    columns: list[list[Moment]]
    plots: Plots
    states: tuple[str, ...]

    @property
    def moments(self) -> list[Moment]:
        """All moments of the page."""
        return [moment for column in self.columns for moment in column]

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of all plots [s], which are common to all columns."""
        return min(one.start for one in self.moments), max(one.end for one in self.moments)

    def window(self, pages: Pages) -> tuple[float, float]:
        """Return the time [s] with which all plots open: the span, and room for the legends behind it."""
        labels = [pages.label(name) for _, names in self.plots for name in names]
        return layout.with_room(self.span, layout.room_for(labels, len(self.columns)))


def shift_page(pages: Pages, columns: Sequence[Sequence[layout.Shift]], rows: Sequence[Mapping]) -> Page:
    """Return the page of shifts.

    Parameters
    ----------
    pages : Pages
        The pages of the rig.
    columns : sequence of sequence of Shift
        Shifts of each column; those of one column are overlaid.
    rows : sequence of mapping
        Metrics of the shifts, in any order; a shift without a row has no phases.
    """
    found = {round(row["t_order_s"], 6): row for row in rows}
    return Page(
        "shifts",
        "Shifts",
        [[_shift(one, found.get(round(one.order, 6)), len(column) > 1) for one in column] for column in columns],
        pages.shift_plots,
        pages.shift_states,
    )


def lanes_of(stretches: Iterable[Stretch]) -> dict[str, list[tuple[Part, Colour]]]:
    """Return a shift's phases, of a figure in ms, as bars by their lane with times in s.

    A lane shows one phase at a time; one that overlaps another has its own.
    """
    lanes: dict[str, list[tuple[Part, Colour]]] = {}
    for one in stretches:
        part = Part(one.texts[1], 1e-3 * one.start, 1e-3 * one.end)
        apart = any(part.start < other.end - 1e-9 for other, _ in lanes.get("phases", []))
        lanes.setdefault(one.kind if apart else "phases", []).append((part, rgb(one.kind)))
    return lanes


def _shift(shift: layout.Shift, row: Mapping | None, overlaid: bool) -> Moment:
    lanes = {} if row is None else lanes_of(stretches_of(row, shift.box))
    marks = (0.0,) if row is None or overlaid else tuple(1e-3 * one.t for one in marks_of(row, shift.box))
    last = 0.0 if row is None else max((1e-3 * one.t for one in marks_of(row, shift.box)), default=0.0)
    end = min(shift.end - shift.order, max(LONGER * last, SHORTEST) if last else np.inf)
    return Moment(f"shift_{shift.number}", shift.title, shift.order, -layout.BEFORE, end, marks, lanes, {})


def measured_pages(pages: Pages, found: Mapping, ends: tuple[float, float]) -> list[Page]:
    """Return the pages of a valve's response and of a coast-down of a run without a change of gear, each if the run has it.

    Parameters
    ----------
    pages : Pages
        The pages of the rig.
    found : mapping
        Results of the run (analysis.no_change.measured).
    ends : (float, float)
        First and last time of the run [s].
    """
    box, out = pages.box, []
    responses = []
    for n, row in enumerate(found.get("valve_responses", []), 1):
        begin, pulse, rise = row["t_order_s"], row["t_pulse_s"], row["t_rise_s"]
        marks = [0.0, *(t - begin for t in (pulse, rise) if t is not None)]
        bars = {}
        if pulse is not None and rise is not None:
            bars = {"delay": [(Part(f"delay {1e3 * (rise - pulse):.0f} ms", pulse - begin, rise - begin), rgb(OTHER))]}
        last = min(begin + 1.0 if rise is None else rise + 0.5, ends[1]) - begin
        title = f"valve response: {box.names[row['gear']]} at {begin:.3f} s"
        responses.append(Moment(f"response_{n}", title, begin, -0.08, max(last, 0.1), tuple(marks), bars, {}))
    if responses:
        columns = [[one] for one in responses[:2]] if len(responses) <= 2 else [responses]
        out.append(Page("valve", "Valve response", columns, pages.valve_plots, ()))
    row = found.get("coast_down")
    if row and not row["why"]:
        cut, last, speed = row["t_cut_s"], row["t_end_s"], box.input.speed
        t = np.linspace(0.0, last, 200)
        tangent = np.linspace(0.0, min(row["coast_down_tangent_s"], last), 50)
        full = row["coefficients"][-1]
        drawn = {
            "fit": (speed, t, np.polyval(row["coefficients"], t)),
            "tangent": (speed, tangent, full * (1.0 - tangent / row["coast_down_tangent_s"])),
        }
        title = f"coast-down from {full * RPM:.0f} rpm at {cut:.3f} s"
        end = min(1.1 * last, ends[1] - cut)
        moment = Moment("coast_down", title, cut, -0.1 * last, end, (0.0,), {}, drawn)
        out.append(Page("coast_down", "Coast-down", [[moment]], pages.coast_plots, ()))
    return out


def log_offset(small: Bag) -> int:
    """Return log time less stamp of a bag's events [ns]; 0 for a bag of this rig, whose log is in the rig's own time."""
    for topic, ros_type in small.types.items():
        if ros_type == EVENT:
            for log, data in small.raw(topic):
                return log - cdr.stamp(data)
    return 0


class Reader:
    """Reader of stretches of a bag."""

    def __init__(self, index: OpenedBags, pages: Pages, small: Bag, offset: int) -> None:
        """Prepare.

        Parameters
        ----------
        index : OpenedBags
            The bag.
        pages : Pages
            The pages of the rig.
        small : Bag
            Events and columns of loggers of the whole run.
        offset : int
            Log time less stamp of the bag's messages [ns].
        """
        self._index, self._pages, self._offset = index, pages, offset
        self._columns = {topic: small.columns(topic) for topic in (LOGGER, OWN_TOPIC) if index.counts.get(topic)}

    def read(self, names: Iterable[str], start: float, end: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return times [s] and values [SI] of signals from ``start`` to ``end``, as far as the bag has them."""
        names = list(names)
        logged = self._columns.get(LOGGER, [])
        topics = {LOGGER if name in logged else self._pages.known.signal(name).topic for name in names}
        piece = self._piece(topics, start, end)
        nothing = dict.fromkeys(logged, (np.empty(0), np.empty(0)))  # what the logger has is not taken from elsewhere
        found = samples_in(piece, self._pages, names, nothing | rows_of(piece))
        return {name: _between(t, values, start, end) for name, t, values in found}

    def recording(
        self, order: tuple[float, int, int], start: float = SPARE + layout.BEFORE, end: float = LONGEST
    ) -> Recording | None:
        """Return the logger's rows from ``start`` before an order to ``end`` behind it [s]; None without them."""
        piece = self._piece([LOGGER], order[0] - start - SPARE, order[0] + end + SPARE)
        if not piece.counts.get(LOGGER):
            return None
        try:
            logger = piece.logger(LOGGER, fill=True)
            return Recording(logger.t0, logger.period, logger.channels, [order], self._pages.box)
        except (*UNREADABLE, RigError):
            return None

    def engages_at_rest(self, order: tuple[float, int, int]) -> bool:
        """Return True when an order from neutral is no shift (metrics.without_slip); False where the bag does not show it."""
        recording = self.recording(order, 0.0, 0.0) if order[1] == NEUTRAL and self._pages.box is not None else None
        return recording is not None and without_slip(recording, order)

    def pieces(self, start: float, end: float) -> Iterator[Bag]:
        """Yield the bag from ``start`` to ``end`` [s] piece by piece, with all topics."""
        for begin in np.arange(start, end, STEP).tolist():
            first, after = (max(round(1e9 * t) + self._offset, 0) for t in (begin, min(begin + STEP, end)))
            yield self._index.bag(self._index.types, first, after, dict(self._columns))

    def _piece(self, topics: Iterable[str], start: float, end: float) -> Bag:
        begin, after = (round(1e9 * t) + self._offset for t in (start - SPARE, end + SPARE))
        return self._index.bag(set(topics), max(begin, 0), max(after, 1), dict(self._columns))


def metrics_of(reader: Reader, shifts: Iterable[layout.Shift], ends: Mapping[float, float | None]) -> list[dict]:
    """Return the metrics of some shifts of a run that has no report; ``ends`` gives the time of the order after each order [s]."""
    rows = []
    for shift in shifts:
        order = (shift.order, shift.before, shift.after)
        if (recording := reader.recording(order)) is not None and shift.after in shift.box.ratios:
            rows.append(shift_metrics(recording, order, ends.get(shift.order)))
    return rows


def _between(t: np.ndarray, values: np.ndarray, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    part = (t >= start - 1e-9) & (t <= end + 1e-9)
    return t[part], np.array(values[part])


class MomentCurves:
    """Curves, states, marks and lanes of a page of moments.

    Attributes
    ----------
    heights : dict of str to (float, float)
        Range of each plot by its title, in its display unit, common to all columns.
    present : set of str
        Signals that at least one moment has.
    """

    def __init__(self, reader: Reader, pages: Pages, names: Iterable[str], page: Page) -> None:
        """Read the moments.

        Parameters
        ----------
        reader : Reader
            The bag.
        pages : Pages
            The pages of the rig.
        names : iterable of str
            Signals that the bag holds.
        page : Page
            The page.
        """
        self.page, self._pages = page, pages
        held = set(names)
        wanted = [name for name in dict.fromkeys([*page.states, *(one for _, plot in page.plots for one in plot)]) if name in held]
        self._data: list[tuple[Moment, dict[str, tuple[np.ndarray, np.ndarray]]]] = []
        for column in page.columns:
            for moment in column:
                found = reader.read(wanted, moment.zero + moment.start, moment.zero + moment.end)
                thin = len(column) > COARSE
                self._data.append((moment, {name: thinned(*one) if thin else one for name, one in found.items()}))
        self.present = {name for _, found in self._data for name, (t, _) in found.items() if len(t)}
        self.heights = {title: height for title, plot in page.plots if (height := self._height(plot)) is not None}

    def _height(self, names: Sequence[str]) -> tuple[float, float] | None:
        parts = [self._shown(name, found[name][1]) for _, found in self._data for name in names if name in found]
        values = np.concatenate([np.empty(0), *parts])
        values = values[np.isfinite(values)]
        return layout.height(float(values.min()), float(values.max())) if len(values) else None

    def _shown(self, name: str, values: np.ndarray) -> np.ndarray:
        return self._pages.known.signal(name).shown(values)

    def send(self, rr: ModuleType, rec: RecordingStream) -> None:
        """Send everything to a recording."""
        start, end = self.page.window(self._pages)
        width = (layout.column_width(len(self.page.columns)) - layout.NUMBERS) / (end - start)
        for moment, found in self._data:
            for name, (t, values) in found.items():
                if not len(t):
                    continue
                signal, place = self._pages.known.signal(name), f"{moment.root}/{name}"
                if signal.states:
                    change = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
                    since = t[change] - moment.zero
                    lasts = np.diff(np.append(since, moment.end)) * width
                    states = [state_of(signal, value, px) for value, px in zip(values[change], lasts)]
                    log_state_styles(rr, rec, self._pages, signal, place)
                    _send_states(rr, rec, place, since, states, moment.end)
                else:
                    rec.log(place, style(rr, self._pages, signal), static=True)
                    rec.send_columns(place, [times(rr, t - moment.zero)], rr.Scalars.columns(scalars=signal.shown(values)))
            for name, (like, t, values) in moment.drawn.items():
                line = rr.SeriesLines(names=name, colors=WAITING if name == "fit" else ALARM, widths=1.0)
                place = f"{moment.root}/{layout.DRAWN}/{name}"
                rec.log(place, line, static=True)
                rec.send_columns(place, [times(rr, t)], rr.Scalars.columns(scalars=self._shown(like, values)))
            for lane, bars in moment.lanes.items():
                send_lane(rr, rec, f"{moment.root}/{lane}", bars, end, width)
            for title, height in self.heights.items():
                send_marks(rr, rec, f"{moment.root}/{layout.mark_entity(title)}", moment.start, moment.marks, height)


def send_lane(rr: ModuleType, rec: RecordingStream, place: str, bars: list[tuple[Part, Colour]], end: float, width: float) -> None:
    """Send bars to a place, up to a time [s] at which the lane ends; one too short for its text, at ``width`` px/s, has none."""
    if not bars:
        return  # the run ended before the first of them
    looks: dict[str, tuple[str, tuple[int, ...]]] = {}
    at, states = [], []
    for n, (part, colour) in enumerate(bars):
        state = f"{n + 1}"
        looks[state] = (part.name if fits(part.name, (part.end - part.start) * width) else NO_TEXT, (*colour, 255))
        at.append(part.start)
        states.append(state)
        following = bars[n + 1][0].start if n + 1 < len(bars) else None
        if following is None or following > part.end + 1e-4:
            at.append(part.end)
            states.append("")
    labels, colours = zip(*looks.values())
    colours = np.array([int.from_bytes(bytes(colour), "big") for colour in colours], np.uint32)
    rec.log(place, rr.StateConfiguration(values=list(looks), labels=list(labels), colors=colours), static=True)
    _send_states(rr, rec, place, np.array(at), states, end)


def _send_states(rr: ModuleType, rec: RecordingStream, place: str, t: np.ndarray, states: list[str], end: float) -> None:
    """Send states and, at the end of the moment, an empty one, so that a lane ends there."""
    if end > t[-1]:
        t, states = np.append(t, end), [*states, ""]
    rec.send_columns(place, [times(rr, t)], rr.StateChange.columns(state=states))


def send_marks(
    rr: ModuleType, rec: RecordingStream, place: str, start: float, marks: Sequence[float], height: tuple[float, float]
) -> None:
    """Send upright lines of a plot to a place: at some times [s], with nothing before them from ``start`` on."""
    t = np.append(start, np.repeat(marks, 3))
    values = np.append(np.nan, np.tile([*height, np.nan], len(marks)))
    # both ends of a line lie at the same time; averaging would reduce them to a point
    rec.log(place, rr.SeriesLines(names="order and phases", colors=rgb(RULE), widths=1.0, aggregation_policy="Off"), static=True)
    rec.send_columns(place, [times(rr, t)], rr.Scalars.columns(scalars=values))
