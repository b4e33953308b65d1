# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The layout of a view: the shifts that it shows, the tabs of plots, and the time window with which they open.

view.convert uses it for a recorded run and view.live for a running rig; view.pages defines the contents of the plots.
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
BEFORE, AFTER = 0.2, 1.5  # s around the order of a shift, for profiles, torque peak and the settling of the torque

LEGEND = 0.3  # share of a window that is shown after it, where the legend covers no relevant curve

TABS = ("shifts", "run", "other", "controller")  # names on the command line

# The viewer keeps the range that linked time axes share under this fixed view id. The view with this id hands
# it the window with which the linked plots open; without it they would open with the whole run.
SHARED_AXIS = uuid.UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")


@dataclass(frozen=True)
class Shift:
    """A shift to be shown: time of its order [s], gear before and after, end of its window [s], and its transmission ``box``."""

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
        """The displayed name of the shift, e.g. ``I → II at 3.835 s``."""
        names = self.box.names
        return f"{names.get(self.before, '?')} → {names.get(self.after, '?')} at {self.order:.3f} s"


def shifts_of(orders: list[tuple[float, int, int]], box: Transmission | None) -> list[Shift]:
    """Return the shifts of a run; the window of each ends before the next shift's.

    Parameters
    ----------
    orders : list of (float, int, int)
        Time [s], gear before and gear after of every order.
    box : Transmission or None
        The transmission; None for a rig without gears.
    """
    shifts = []
    if box is None:
        return shifts
    for i, (t, before, after) in enumerate(orders):
        limit = orders[i + 1][0] - BEFORE if i + 1 < len(orders) else float("inf")
        shifts.append(Shift(t, before, after, max(min(t + AFTER, limit), t + BEFORE), box))
    return shifts


def with_room(window: tuple[float, float]) -> tuple[float, float]:
    """Return the window [s] with which plots open, extended so that their legends lie behind the relevant part."""
    start, end = window
    return start, end + LEGEND * (end - start)


def choose(shifts: list[Shift]) -> list[Shift]:
    """Return at most two shifts in order of time: the first upshift and the first downshift under way.

    An engagement from neutral is chosen only when there is no other shift.
    """
    under_way = [s for s in shifts if s.box.changes(s.before, s.after)] or shifts
    first = {}
    for shift in under_way:
        first.setdefault(shift.after > shift.before, shift)
    return sorted(first.values(), key=lambda s: s.order)


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
    shifts: list[Shift],
    window: tuple[float, float] | None,
    only: str | None = None,
    own: tuple[str, ...] = (),
) -> rrb.Blueprint:
    """Return the layout of a recorded run as a Rerun blueprint.

    Parameters
    ----------
    pages : Pages
        The pages of the rig.
    present : set of str
        Names of the signals that the file holds; plots without any of them are left out.
    shifts : list of Shift
        Shifts shown side by side in the first tab.
    window : (float, float) or None
        Start and end with which the linked plots open [s]; their tab is then the visible one. Without it they open with the
        time of the shifts, or with the whole run when there are no shifts.
    only : str, optional
        One of TABS, or of the rig's pages, which is shown alone and without the viewer's own bars, for a picture; a tab
        that the run does not have is replaced by the run's.
    own : tuple of str
        Names of the controller's own signals; each has a plot in a separate tab.

    Returns
    -------
    Blueprint
        The layout.
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
    """Return the layout of a running rig: the run's plots of all signals, over the newest ``seconds``."""
    import rerun as rr
    import rerun.blueprint as rrb

    newest = rr.TimeRangeBoundary.cursor_relative
    # linked axes have no moving window, so each plot has its own
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
    """Return columns of plots with the texts at their right."""
    import rerun.blueprint as rrb

    parts = []
    for views in columns:
        if views:
            # a lane of states needs a fifth of the height of a plot
            shares = [0.25 + 0.2 * len(view.contents) if isinstance(view, rrb.StateTimelineView) else 1.0 for view in views]
            parts.append(rrb.Vertical(*views, row_shares=shares))
    # the text contains the time, because the viewer's own time column is too narrow
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
    """Return the plots of one shift; ``legend`` is True for the first column only, because the second has the same colours."""
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
