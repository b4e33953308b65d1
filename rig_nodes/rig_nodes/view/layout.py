# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a view is laid out: the shifts that it shows, tabs of plots and the window in time they open with.

Used by view.convert for a recorded run and by view.live for a running rig; what the plots show says view.pages.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..catalogue import Signal
from ..transmission import Transmission
from .pages import Pages

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import ModuleType

    import rerun as rr
    import rerun.blueprint as rrb

TIMELINE = "t"
BEFORE, AFTER = 0.2, 1.5  # s around the order of a shift: profiles, torque peak and the torque settling again

LEGEND = 0.3  # of a window, shown after it: there the legend covers nothing that matters

TABS = ("shifts", "run", "other", "controller")  # as the command line names them

# The viewer keeps the range that linked time axes share under this fixed view id. The view with this id hands
# it the window the linked plots open with; without it they would open with the whole run.
SHARED_AXIS = uuid.UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")


@dataclass(frozen=True)
class Shift:
    """A shift to be shown: time of its order [s], gear before and after, end of its window [s]; box: what was shifted."""

    order: float
    before: int
    after: int
    end: float
    box: Transmission

    @property
    def window(self) -> tuple[float, float]:
        """Start and end of the window [s]."""
        return self.order - BEFORE, self.end

    @property
    def title(self) -> str:
        """What people call it, e.g. ``I → II at 3.835 s``."""
        names = self.box.names
        return f"{names.get(self.before, '?')} → {names.get(self.after, '?')} at {self.order:.3f} s"


def shifts_of(orders: list[tuple[float, int, int]], box: Transmission | None) -> list[Shift]:
    """The shifts of a run; the window of each ends before the next one's.

    orders: (t [s], gear before, gear after) of every order; box: what was shifted, None for a rig without gears.
    """
    shifts = []
    if box is None:
        return shifts
    for i, (t, before, after) in enumerate(orders):
        limit = orders[i + 1][0] - BEFORE if i + 1 < len(orders) else float("inf")
        shifts.append(Shift(t, before, after, max(min(t + AFTER, limit), t + BEFORE), box))
    return shifts


def with_room(window: tuple[float, float]) -> tuple[float, float]:
    """The window that plots open with, so that their legends lie behind what is to be seen [s]."""
    start, end = window
    return start, end + LEGEND * (end - start)


def choose(shifts: list[Shift]) -> list[Shift]:
    """The first upshift and the first downshift under way, at most two, in order of time.

    Engaging from neutral is chosen only when there is nothing else.
    """
    under_way = [s for s in shifts if s.box.changes(s.before, s.after)] or shifts
    first = {}
    for shift in under_way:
        first.setdefault(shift.after > shift.before, shift)
    return sorted(first.values(), key=lambda s: s.order)


def entity(signal: Signal) -> str:
    """Where a signal lies in the view's file: its quantity, then its name, e.g. ``torque/NAME``."""
    return f"{signal.quantity.replace(' ', '_')}/{signal.name}"


def mark_entity(title: str) -> str:
    """Where the marks of the orders in a plot lie, e.g. ``orders/shaft_torque``."""
    return f"orders/{title.lower().replace(',', '').replace(' ', '_')}"


def own_entity(name: str) -> str:
    """Where a signal of the controller's own is in the file."""
    return f"controller/{name}"


def blueprint(
    pages: Pages,
    present: set[str],
    shifts: list[Shift],
    window: tuple[float, float] | None,
    only: str | None = None,
    own: tuple[str, ...] = (),
) -> rrb.Blueprint:
    """The layout of a recorded run as a Rerun blueprint.

    pages: of the rig. present: names of the signals the file holds; plots without any are left out. shifts: shown side by side
    in the first tab. window: start and end [s] the linked plots open with, whose tab then shows; without it
    they open with the time of the shifts, or with the whole run when there is none. only: this one of TABS, or of the rig's pages,
    alone and without the viewer's own bars, for a picture; a tab that the run does not have is the run's. own: names
    of the signals of the controller's own, a plot each in a tab of theirs.
    """
    import rerun.blueprint as rrb

    span = window or (with_room((shifts[0].window[0], shifts[-1].window[1])) if shifts else None)
    axis = rrb.TimeAxis(link="LinkToGlobal")
    run, rest = _run_columns(pages, present, axis), _plots(pages, present, pages.other_plots, axis)
    shown = rest if only == "other" else [view for column in run for view in column] + rest
    if shown:
        shown[0].id = SHARED_AXIS
        if span is not None:
            shown[0].properties["TimeAxis"] = rrb.TimeAxis(link="LinkToGlobal", view_range=_range(span))
    tabs = {}
    if shifts:
        columns = [_shift_column(pages, present, shift, shift is shifts[0]) for shift in shifts]
        tabs["shifts"] = _tab("Shifts", columns)
    tabs["run"] = _tab("Run", run)
    for name, plots in pages.more_pages.items():
        if views := _plots(pages, present, plots, axis):
            tabs[name] = rrb.Grid(*views, name=name)
    if rest:
        tabs["other"] = rrb.Grid(*rest, name="Other signals")
    if own:
        views = [rrb.TimeSeriesView(name=name, origin=own_entity(name), axis_x=axis) for name in own]
        tabs["controller"] = rrb.Grid(*views, name="Controller")
    if only is not None:
        return _whole(rrb, tabs.get(only, tabs["run"]), "hidden", "hidden", "paused")
    active = 1 if window and shifts else 0
    return _whole(rrb, rrb.Tabs(*tabs.values(), active_tab=active), "collapsed", "expanded", "paused")


def live_blueprint(pages: Pages, seconds: float) -> rrb.Blueprint:
    """The layout of a running rig: the run's plots of all signals, over the newest ``seconds``."""
    import rerun as rr
    import rerun.blueprint as rrb

    newest = rr.TimeRangeBoundary.cursor_relative
    # linked axes have no window that moves, so each plot has its own
    span = rr.TimeRange(start=newest(seconds=-seconds), end=newest())
    axis = rrb.TimeAxis(link="Independent", view_range=span)
    present = set(pages.known.signals)
    run, rest = _run_columns(pages, present, axis), _plots(pages, present, pages.other_plots, axis)
    more = {name: _plots(pages, present, plots, axis) for name, plots in pages.more_pages.items()}
    for view in [view for column in (*run, *more.values()) for view in column] + rest:
        if isinstance(view, rrb.TimeSeriesView):
            view.properties["PlotLegend"] = rrb.PlotLegend("LeftTop")  # away from the newest values
    tabs = [_tab("Run", run), *(rrb.Grid(*views, name=name) for name, views in more.items()), rrb.Grid(*rest, name="Other signals")]
    return _whole(rrb, rrb.Tabs(*tabs, active_tab=0), "collapsed", "expanded", "following")


def _whole(rrb: ModuleType, content: rrb.Container, panels: str, top: str, play: str) -> rrb.Blueprint:
    return rrb.Blueprint(
        content,
        rrb.TopPanel(state=top),
        rrb.TimePanel(state=panels, timeline=TIMELINE, play_state=play),
        rrb.BlueprintPanel(state=panels),
        rrb.SelectionPanel(state=panels),
    )


def _tab(name: str, columns: list[list]) -> rrb.Horizontal:
    """Columns of plots, and the texts at their right."""
    import rerun.blueprint as rrb

    parts = []
    for views in columns:
        if views:
            # a lane of states needs a fifth of the height of a plot
            shares = [0.25 + 0.2 * len(view.contents) if isinstance(view, rrb.StateTimelineView) else 1.0 for view in views]
            parts.append(rrb.Vertical(*views, row_shares=shares))
    # the text holds the time: the viewer's own column is too narrow for it
    log = rrb.archetypes.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn("Body")],
    )
    texts = rrb.Vertical(
        rrb.TextDocumentView(name="Report", origin="/report"),
        rrb.TextLogView(name="Events", origin="/events", columns=log),
        row_shares=[3, 2],
    )
    return rrb.Horizontal(*parts, texts, column_shares=[5.0] * len(parts) + [2.7], name=name)


def _shift_column(pages: Pages, present: set[str], shift: Shift, legend: bool) -> list:
    """Plots of one shift. legend: shown in the first column only; colours are the same in the second."""
    import rerun.blueprint as rrb

    axis = rrb.TimeAxis(link="Independent", view_range=_range(with_room(shift.window)))
    states = _states(pages, present, shift.title, pages.shift_states, axis)
    return states + _plots(pages, present, pages.shift_plots, axis, legend)


def _run_columns(pages: Pages, present: set[str], axis: rrb.TimeAxis) -> list[list]:
    left = _states(pages, present, "States", pages.states, axis) + _plots(pages, present, pages.run_left, axis)
    return [left, _plots(pages, present, pages.run_right, axis)]


def _states(pages: Pages, present: set[str], title: str, names: Iterable[str], axis: rrb.TimeAxis) -> list:
    import rerun.blueprint as rrb

    contents = _contents(pages, present, names)
    if not contents:
        return []
    return [rrb.StateTimelineView(name=title, origin="/", contents=contents, time_view=axis)]


def _plots(
    pages: Pages, present: set[str], plots: Iterable[tuple[str, Sequence[str]]], axis: rrb.TimeAxis, legend: bool = True
) -> list:
    import rerun.blueprint as rrb

    views = []
    for title, names in plots:
        contents = _contents(pages, present, names)
        if contents:
            contents.append("/" + mark_entity(title))
            unit = pages.known.signal(names[0]).display_unit
            views.append(
                rrb.TimeSeriesView(
                    name=f"{title} [{unit}]",
                    origin="/",
                    contents=contents,
                    axis_x=axis,
                    plot_legend=rrb.PlotLegend("RightTop", visible=legend),
                )
            )
    return views


def _contents(pages: Pages, present: set[str], names: Iterable[str]) -> list[str]:
    return ["/" + entity(pages.known.signal(name)) for name in names if name in present]


def _range(window: tuple[float, float]) -> rr.TimeRange:
    import rerun as rr

    start, end = (rr.TimeRangeBoundary.absolute(seconds=t) for t in window)
    return rr.TimeRange(start=start, end=end)
