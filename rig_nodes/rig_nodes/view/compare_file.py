# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as a Rerun file to look around in: a tab for each figure of view.figure_of_compare; of `rig compare --rrd`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import Comparison, short_names
from . import layout
from .convert import import_rerun, recording, whole_file
from .curves import times
from .figure import DOTTED, SOLID, STYLES
from .figure_of_compare import LESS, MS, figure_of_runs, figures_of_compare
from .moments import lanes_of, send_lane, send_marks
from .pages import Pages
from .palette import rgb

if TYPE_CHECKING:
    from collections.abc import Sequence

    import rerun.blueprint as rrb

    from .figure import Curve, Description

ABREAST = 2  # plots side by side


def write_compare_file(found: Comparison, pages: Pages, path: Path) -> None:
    """Write the file with its layout, whole or not at all.

    Parameters
    ----------
    found : Comparison
        The comparison.
    pages : Pages
        The pages of the first recording's rig.
    path : Path
        The file.

    Raises
    ------
    RigError
        When rerun-sdk is missing or the file cannot be written.
    """
    rrb, names = import_rerun().blueprint, short_names(found.names)
    shifts = [(one, 1.0 / MS) for one in figures_of_compare(found, pages) if found.shifts]
    drawn = [*shifts, (figure_of_runs(found, pages), 1.0)]  # with the unit of its time in s
    tabs = [_tab(figure, f"figure_{n}", names, second) for n, (figure, second) in enumerate(drawn)]
    shown = layout.whole(rrb.Tabs(*tabs), "collapsed", "expanded", "paused")
    with whole_file(path, "choose another place") as part, recording(part, "comparison", lambda: shown) as (rr, rec):
        for n, (figure, second) in enumerate(drawn):
            start, end = (second * at for at in (figure.columns[0].first, figure.columns[0].last))
            for row, panel in enumerate(figure.panels):
                place = f"figure_{n}/{row}"
                for k, one in enumerate(panel.curves):
                    thin, paler = one.style == DOTTED, one.style != SOLID  # the viewer has no styles of lines
                    looks = {"colors": rgb(one.colour, paler), "widths": 1.0 if thin else 2.0, "aggregation_policy": "MinMax"}
                    rec.log(f"{place}/{k}", rr.SeriesLines(names=_label(one, names), **looks), static=True)
                    known = np.isfinite(one.y)
                    rec.send_columns(f"{place}/{k}", [times(rr, second * one.t[known])], rr.Scalars.columns(scalars=one.y[known]))
                values = np.concatenate([one.y for one in panel.curves])
                height = layout.height(float(np.nanmin(values)), float(np.nanmax(values)))
                send_marks(rr, rec, f"{place}/marks", start, [second * one.t for one in figure.moments], height)
            for lane, bars in lanes_of(figure.stretches).items():
                send_lane(rr, rec, f"figure_{n}/{lane}", bars, end, layout.WIDTH / (end - start))


def _tab(figure: Description, root: str, names: Sequence[str], second: float) -> rrb.Vertical:
    """Return the layout of a figure: its phases, and its plots with their differences below them."""
    import rerun.blueprint as rrb

    labels = [_label(one, names) for panel in figure.panels for one in panel.curves]
    column, name = figure.columns[0], figure.title.partition(":")[0]
    window = layout.with_room((second * column.first, second * column.last), layout.room_for(labels, ABREAST, 0.0))
    axis = rrb.TimeAxis(link="Independent", view_range=layout.time_range(window))
    plots: list[list[rrb.TimeSeriesView]] = []
    for row, panel in enumerate(figure.panels):
        look = rrb.PlotLegend("RightTop", visible=panel.title != LESS)
        view = rrb.TimeSeriesView(name=f"{panel.title} [{panel.unit}]", origin=f"{root}/{row}", axis_x=axis, plot_legend=look)
        if panel.title != LESS:
            plots.append([])
        plots[-1].append(view)
    grid = rrb.Grid(*(rrb.Vertical(*both, row_shares=[2, 1][: len(both)]) for both in plots), grid_columns=ABREAST)
    lanes = [f"/{root}/{lane}" for lane in lanes_of(figure.stretches)]
    if not lanes:
        return rrb.Vertical(grid, name=name)
    bars = rrb.StateTimelineView(name=figure.conditions, origin="/", contents=lanes, time_view=axis)
    return rrb.Vertical(bars, grid, row_shares=[1, 10], name=name)


def _label(curve: Curve, names: Sequence[str]) -> str:
    """Return the name of a curve in a legend: its signal and its recording."""
    return f"{curve.signal}, {names[STYLES.index(curve.style)] if len(names) <= len(STYLES) else curve.text}"
