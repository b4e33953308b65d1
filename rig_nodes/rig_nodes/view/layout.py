# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The layout of a view: the shifts that it shows, the tabs of plots, and the time window with which they open.

view.convert uses it for a recorded run and view.live for a running rig; view.pages defines the contents of the plots.
"""

from __future__ import annotations

import math
import uuid
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

from ..analysis import with_ends
from ..base import RigError
from ..rig import NEUTRAL, Signal, Transmission
from .pages import Pages, Plots

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    import rerun as rr
    import rerun.blueprint as rrb

    from .moments import Moment, MomentCurves

Extremes = dict[str, tuple[float, float]]  # least and greatest value shown at places of the view's file

TIMELINE = "t"
BEFORE, AFTER = 0.2, 1.5  # s; shown before and after the order of a shift, for profiles, torque peak and the settling of the torque

LETTER, BESIDE = 6.5, 40.0  # px; width of a letter of a legend, and of its frame and dot
NUMBERS = 29.0  # px; width of the numbers at the left of a plot, from 15 to 40
SHORTEST = 0.01  # s; a bag may hold one instant only
MOST_ROOM = 0.45  # largest room for legends, as a share of the window
MARGIN = 0.06  # share of a plot's height left free above and below its curves
STEPS = 6.0  # most steps of a power of ten of whose numbers the viewer shows all in a plot of five in a window 1000 px high
MOST_MORE = 1.35  # most that a plot becomes higher for the sake of a second number
NUMBER = 0.05  # half the height of a number at the left of a plot, as a share of the plot's height
LEAST = {"energy": 1.0}  # SI; smaller values of a quantity are rounding, and are not drawn as high as a plot
HIGH, HIGHER = 920.0, 1640.0  # px; height of a column in a window 1000 px high, and in a picture
LANES, LANE = 63.0, 40.0  # px; height of a view of lanes without any, and of a lane

TABS = ("shifts", "valve", "coast_down", "run", "other", "controller")  # names on the command line
ALL = "all"  # in place of numbers of shifts
DRAWN = "with"  # place of computed curves within the place of a moment; the viewer draws in the order of names, so these lie on top
MOST_LANES = 8  # overlaid shifts whose phases are shown
MOST_COLUMNS = 4  # of shifts side by side
WIDTH, TEXTS = 1600, 0.27  # px of a picture, and the share of its width for texts

# The viewer keeps the range that linked time axes share under this fixed view id. The view with this id hands
# it the window with which the linked plots open; without it they would open with the whole run.
SHARED_AXIS = uuid.UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")


@dataclass(frozen=True)
class Shift:
    """An order of a run and the time around it; a shift when it has a number.

    Parameters
    ----------
    order : float
        Time of its order [s].
    before, after : int
        The gears.
    end : float
        End of its window [s].
    box : Transmission
        Its transmission.
    number : int
        Its number among the shifts of the run, from 1, as in the report; 0 for an order that is no shift.
    """

    order: float
    before: int
    after: int
    end: float
    box: Transmission
    number: int = 1

    @property
    def window(self) -> tuple[float, float]:
        """Start and end of the window [s]."""
        return self.order - BEFORE, self.end

    @property
    def way(self) -> str:
        """The gears of the shift, e.g. ``I → II``."""
        names = self.box.names
        return f"{names.get(self.before, '?')} → {names.get(self.after, '?')}"

    @property
    def title(self) -> str:
        """The displayed name of the shift, e.g. ``shift 2: I → II at 3.835 s``."""
        return f"shift {self.number}: {self.way} at {self.order:.3f} s"


def shifts_of(orders: list[tuple[float, int, int]], box: Transmission | None, at_rest: Collection[float] = ()) -> list[Shift]:
    """Return the orders of a run; shifts have their number in the report, and each window ends before the next order's begins.

    Parameters
    ----------
    orders : list of (float, int, int)
        Time [s], gear before and gear after of every order.
    box : Transmission or None
        The transmission; None for a rig without gears.
    at_rest : collection of float
        Times of the orders at which the input shaft stood still [s]; a gear engaged from neutral there is no shift.
    """
    found: list[Shift] = []
    if box is None:
        return found
    numbers = count(1)
    for (t, before, after), following in with_ends(orders):
        limit = float("inf") if following is None else following - BEFORE
        number = next(numbers) if after in box.ratios and not (before == NEUTRAL and t in at_rest) else 0
        found.append(Shift(t, before, after, max(min(t + AFTER, limit), t + BEFORE), box, number))
    return found


def room_for(labels: Iterable[str], columns: int, texts: float = TEXTS) -> float:
    """Return the time to show after a window, as a share of it, so that no legend with these labels covers a curve.

    Parameters
    ----------
    labels : iterable of str
        Names in the legends.
    columns : int
        Number of columns of plots in a picture.
    texts : float
        Share of the picture beside them.
    """
    legend = LETTER * max((len(label) for label in labels), default=0) + BESIDE
    beside = column_width(columns, texts) - NUMBERS - legend
    return min(legend / beside, MOST_ROOM) if beside > 0.0 else MOST_ROOM


def with_room(window: tuple[float, float], room: float) -> tuple[float, float]:
    """Return the window [s] with which plots open: a window, extended at its end by the share that the legends need."""
    start, end = window
    return start, max(end + room * (end - start), start + SHORTEST)


def window_of(pages: Pages, present: Collection[str], span: tuple[float, float], plots: Plots | None = None) -> tuple[float, float]:
    """Return the window [s] with which two columns of plots open: the span, and room for the legends of the signals present.

    By default the plots are those of the tab of the run, which has texts beside them.
    """
    texts = TEXTS if plots is None else 0.0
    plots = (*pages.run_left, *pages.run_right) if plots is None else plots
    labels = [pages.label(name) for _, names in plots for name in names if name in present]
    return with_room(span, room_for(labels, 2, texts))


def height(low: float, high: float) -> tuple[float, float]:
    """Return the range of a plot that shows values from ``low`` to ``high`` with a margin and at least two numbers at its axis.

    The viewer's steps are powers of ten, and it leaves out those of which more than STEPS would share the height of a plot.
    """
    margin = MARGIN * (high - low) or max(abs(high), 1.0) * MARGIN
    low, high = low - margin, high + margin
    step = 10.0 ** math.floor(math.log10((high - low) / 1.1))
    many = (high - low) / step > STEPS  # a taller plot shows their numbers, so the next step is worth less
    step *= 10.0 if many else 1.0
    first, last = math.ceil(low / step), math.floor(high / step)
    while last - first < 1:  # the nearer of both next numbers
        first, last = (first - 1, last) if low - step * (first - 1) < step * (last + 1) - high else (first, last + 1)
    number = NUMBER * max(high - low, step * (last - first))
    wide = min(low, step * first - number), max(high, step * last + number)
    return (low, high) if many and wide[1] - wide[0] > MOST_MORE * (high - low) else wide


def height_of(pages: Pages, names: Iterable[str], extremes: Extremes) -> tuple[float, float] | None:
    """Return the range of a plot of signals; None when none of them has values."""
    signals = [one for one in map(pages.signal, names) if entity(one) in extremes]
    if not signals:
        return None
    lows, highs = zip(*(extremes[entity(one)] for one in signals))
    least = float(signals[0].shown(LEAST.get(signals[0].quantity, 0.0)))
    rounding = max(-min(lows), max(highs)) < least
    return height(-least, least) if rounding else height(min(lows), max(highs))


def choose(shifts: list[Shift]) -> list[Shift]:
    """Return at most two shifts in order of time: the first upshift and the first downshift under way.

    An engagement from neutral is chosen only when there is no other shift.
    """
    under_way = [s for s in shifts if s.box.changes(s.before, s.after)] or shifts
    first = {}
    for shift in under_way:
        first.setdefault(shift.after > shift.before, shift)
    return sorted(first.values(), key=lambda s: s.order)


def columns_of(shifts: list[Shift], wanted: Sequence[int] | str | None) -> list[list[Shift]]:
    """Return the shifts to show, column by column; those of one column are overlaid.

    Parameters
    ----------
    shifts : list of Shift
        All shifts of the run.
    wanted : sequence of int, "all" or None
        Numbers of shifts, each of which has its own column; or "all", with one column for each change of gears; or None for the
        shifts of :func:`choose`.

    Raises
    ------
    RigError
        When the run has no such shift, or when there is no room side by side for so many.
    """
    if wanted is None:
        return [[shift] for shift in choose(shifts)]
    if not shifts:
        raise RigError("--shift: this run has no shift")
    if wanted == ALL:
        ways: dict[str, list[Shift]] = {}
        for shift in [one for one in shifts if one.box.changes(one.before, one.after)] or shifts:
            ways.setdefault(shift.way, []).append(shift)
        return list(ways.values())[:MOST_COLUMNS]
    if missing := [number for number in wanted if not 1 <= number <= len(shifts)]:
        raise RigError(
            f"--shift {missing[0]}: the run has the shifts 1 to {len(shifts)}: {'; '.join(s.title for s in shifts[:12])}"
        )
    if len(wanted) > MOST_COLUMNS:
        raise RigError(
            f"--shift: {len(wanted)} shifts have no room side by side, {MOST_COLUMNS} have; 'all' lays them over each other"
        )
    return [[shifts[number - 1]] for number in wanted]


def column_width(columns: int, texts: float = TEXTS) -> float:
    """Return the width [px] of a column of plots in a picture that has ``columns`` of them and the share ``texts`` of texts."""
    return WIDTH * (1.0 - texts) / columns


def entity(signal: Signal) -> str:
    """Return the place of a signal in the view's file: its quantity, then its name, e.g. ``torque/NAME``."""
    return f"{signal.quantity.replace(' ', '_')}/{signal.name}"


def mark_entity(title: str) -> str:
    """Return the place of the marks of the orders in a plot, e.g. ``orders/shaft_torque``."""
    return f"orders/{title.lower().replace(',', '').replace(' ', '_')}"


def own_entity(name: str) -> str:
    """Return the place in the file of a signal of the controller's own."""
    return f"controller/{name}"


def blueprint(
    pages: Pages,
    present: set[str],
    span: tuple[float, float],
    only: str | None = None,
    own: tuple[str, ...] = (),
    close: Sequence[MomentCurves] = (),
    opens: str = "",
    extremes: Extremes | None = None,
) -> rrb.Blueprint:
    """Return the layout of a recorded run as a Rerun blueprint.

    Parameters
    ----------
    pages : Pages
        The pages of the rig.
    present : set of str
        Names of the signals that the file holds; plots without any of them are left out.
    span : (float, float)
        Start and end of what the linked plots show [s]; they open with it and with room for their legends.
    only : str, optional
        One of TABS, or of the rig's pages, which is shown alone and without the viewer's own bars, for a picture; a tab
        that the run does not have is replaced by the run's.
    own : tuple of str
        Names of the controller's own signals; each has a plot in a separate tab.
    close : sequence of MomentCurves
        Curves that the first tabs show close up.
    opens : str
        The tab with which the view opens; by default the first one.
    extremes : Extremes, optional
        Plots without any fit themselves to their curves.

    Returns
    -------
    Blueprint
        The layout.
    """
    import rerun.blueprint as rrb

    axis, extremes = rrb.TimeAxis(link="LinkToGlobal"), extremes or {}
    run, rest, more = _whole_run(pages, present, axis, extremes)
    run[-1] += _plots(pages, {name for name, one in pages.plates.items() if one.heat in present}, axis, extremes, pages.warm)
    shown = more[only] if only in more else rest if only == "other" else [view for column in run for view in column] + rest
    if shown:
        open_with(shown[0], window_of(pages, present, span, pages.more_pages.get(only, ()) if only in more else None))
    made = partial(_tab, HIGH if only is None else HIGHER)
    if close:
        tabs: dict = {name: rrb.Grid(*views, grid_columns=2, name=name) for name, views in more.items()}
    else:  # no page of moments has the results
        tabs = {name: made(name, [views[::2], views[1::2]]) for name, views in more.items()}
    for one in close:
        columns = [_moments(pages, one, column, not n) for n, column in enumerate(one.page.columns)]
        tabs[one.page.key] = made(one.page.name, columns)
    tabs["run"] = made("Run", run, *(() if close or more else ("/report",)), "/run")
    if rest:
        tabs["other"] = rrb.Grid(*rest, name="Other signals")
    if own:
        views = [rrb.TimeSeriesView(name=name, origin=own_entity(name), axis_x=axis) for name in own]
        tabs["controller"] = rrb.Grid(*views, name="Controller")
    if only is not None:
        return whole(tabs.get(only, tabs["run"]), "hidden", "hidden", "paused")
    return whole(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(opens) if opens in tabs else 0), "collapsed", "expanded", "paused"
    )


def open_with(first: rrb.View, span: tuple[float, float]) -> None:
    """Set the span of time [s] with which all plots with linked time axes open; ``first`` is one of these plots."""
    import rerun.blueprint as rrb

    first.id = SHARED_AXIS
    first.properties["TimeAxis"] = rrb.TimeAxis(link="LinkToGlobal", view_range=time_range(span))


def live_blueprint(pages: Pages, seconds: float) -> rrb.Blueprint:
    """Return the layout of a running rig: plots of all signals over the newest ``seconds``."""
    import rerun as rr
    import rerun.blueprint as rrb

    newest = rr.TimeRangeBoundary.cursor_relative
    # linked axes have no moving window, so each plot has its own
    span = rr.TimeRange(start=newest(seconds=-seconds), end=newest())
    axis = rrb.TimeAxis(link="Independent", view_range=span)
    run, rest, more = _whole_run(pages, set(pages.known.signals), axis, {})
    for view in [view for column in (*run, *more.values()) for view in column] + rest:
        if isinstance(view, rrb.TimeSeriesView):
            view.properties["PlotLegend"] = rrb.PlotLegend("LeftTop")  # away from the newest values
    own, rest_of = [rrb.Grid(*views, name=name) for name, views in more.items()], rrb.Grid(*rest, name="Other signals")
    return whole(rrb.Tabs(*own, _tab(HIGH, "Run", run), rest_of, active_tab=0), "collapsed", "expanded", "following")


def whole(content: rrb.Container, panels: str, top: str, play: str) -> rrb.Blueprint:
    """Return a blueprint of a content and the states of the viewer's panels, of its top bar and of its playing."""
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        content,
        rrb.TopPanel(state=top),
        rrb.TimePanel(state=panels, timeline=TIMELINE, play_state=play),
        rrb.BlueprintPanel(state=panels),
        rrb.SelectionPanel(state=panels),
    )


def _tab(high: float, name: str, columns: list[list], *places: str) -> rrb.Horizontal:
    """Return columns of plots, ``high`` px each, and texts beside them; ``places`` has the upper ones, by default the report."""
    import rerun.blueprint as rrb

    parts = []
    for views in columns:
        if views:
            lanes = [len(view.contents) for view in views if isinstance(view, rrb.StateTimelineView)]
            share = sum(LANES + LANE * number for number in lanes) / high
            plot = (1.0 - share) / max(len(views) - len(lanes), 1)
            parts.append(rrb.Vertical(*views, row_shares=[share] * len(lanes) + [plot] * (len(views) - len(lanes))))
    # the texts contain the time, because the viewer's own time column is too narrow
    log = rrb.archetypes.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn("Body")],
    )
    texts = [rrb.TextDocumentView(name=place.strip("/").capitalize(), origin=place) for place in places or ("/report",)]
    beside = rrb.Vertical(
        rrb.Tabs(*texts, active_tab=0) if len(texts) > 1 else texts[0],
        rrb.TextLogView(name="Events", origin="/events", columns=log),
        row_shares=[2, 1],
    )
    return rrb.Horizontal(*parts, beside, column_shares=[(1.0 - TEXTS) / max(len(parts), 1)] * len(parts) + [TEXTS], name=name)


def _moments(pages: Pages, curves: MomentCurves, column: list[Moment], legend: bool) -> list:
    """Return the plots of a column of moments; ``legend`` is True for the first one only, because all have the same colours."""
    import rerun.blueprint as rrb

    first, *others = column
    start, end = curves.page.window(pages)
    # lanes have no numbers at their left, so theirs begins earlier
    earlier = (end - start) * NUMBERS / (column_width(len(curves.page.columns)) - NUMBERS)
    axis, of_lanes = (rrb.TimeAxis(link="Independent", view_range=time_range((t, end))) for t in (start, start - earlier))
    names = [*curves.page.states, *first.lanes] if not others else []
    lanes = [f"/{first.root}/{name}" for name in names if name in first.lanes or name in curves.present]
    lanes += [f"/{one.root}/{name}" for one in column[:MOST_LANES] for name in one.lanes if others]
    title = first.heading if not others else f"{first.title.partition(': ')[2].partition(' at ')[0]}: {len(column)} overlaid"
    views: list = [rrb.StateTimelineView(name=title, origin="/", contents=lanes, time_view=of_lanes)] if lanes else []
    for heading, plot in curves.page.plots:
        shown = [name for name in plot if name in curves.present]
        if not shown or heading not in curves.heights:
            continue
        unit = pages.known.signal(shown[0]).display_unit
        drawn = [f"{DRAWN}/{name}" for name, (like, _, _) in first.drawn.items() if like in shown]
        contents = [f"/{one.root}/{name}" for one in column for name in (*shown, *drawn)]
        views.append(
            rrb.TimeSeriesView(
                name=f"{heading} [{unit}]",
                origin="/",
                contents=[*contents, *(f"/{one.root}/{mark_entity(heading)}" for one in column)],
                axis_x=axis,
                axis_y=rrb.ScalarAxis(range=curves.heights[heading]),
                plot_legend=rrb.PlotLegend("RightTop", visible=legend),
            )
        )
    return views


def _whole_run(pages: Pages, present: set[str], axis: rrb.TimeAxis, extremes: Extremes) -> tuple[list[list], list, dict]:
    """Return the columns of the plots of a whole run, the plots of all other signals, and those of the rig's own pages by name."""
    import rerun.blueprint as rrb

    there = present | {name for name, (_, source) in pages.rates.items() if source in present}
    made = partial(_plots, pages, there, axis, extremes)
    own = {name: views for name, plots in pages.more_pages.items() if (views := made(plots))}
    left, right = made(pages.run_left), made(pages.run_right)
    if pages.box is None:  # what drives and what presses may have any number of plots; a single one would fill its column
        views = left + right
        left, right = views[: (len(views) + 1) // 2], views[(len(views) + 1) // 2 :]
    lanes = _contents(pages, present, pages.states)
    states = [rrb.StateTimelineView(name="States", origin="/", contents=lanes, time_view=axis)] if lanes else []
    return [states + left, right], made(pages.other_plots), own


def _plots(pages: Pages, present: set[str], axis: rrb.TimeAxis, extremes: Extremes, plots: Iterable[tuple]) -> list:
    import rerun.blueprint as rrb

    views = []
    for title, names in plots:
        contents = _contents(pages, present, names)
        if contents:
            contents.append("/" + mark_entity(title))
            unit = pages.signal(names[0]).display_unit
            ends, legend, name = height_of(pages, names, extremes), rrb.PlotLegend("RightTop"), f"{title} [{unit}]"
            high = rrb.ScalarAxis(range=ends) if ends else None
            views.append(rrb.TimeSeriesView(name=name, origin="/", contents=contents, axis_x=axis, axis_y=high, plot_legend=legend))
    return views


def _contents(pages: Pages, present: set[str], names: Iterable[str]) -> list[str]:
    return ["/" + entity(pages.signal(name)) for name in names if name in present]


def time_range(window: tuple[float, float]) -> rr.TimeRange:
    """Return a window [s] as the range of a time axis."""
    import rerun as rr

    start, end = (rr.TimeRangeBoundary.absolute(seconds=t) for t in window)
    return rr.TimeRange(start=start, end=end)
