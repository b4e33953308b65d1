# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figure of a whole run: its plots over the time of the run, with the phases of its shifts. ``Run.plot`` shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..analysis import phases_of
from .figure import DASHED, SOLID, Column, Curve, Description, Moment, Panel, Series, Stretch, cut

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .pages import Pages


def figure_of_run(report: Mapping, pages: Pages, signals: Mapping[str, Series], span: tuple[float, float]) -> Description:
    """Return the figure of a run.

    Parameters
    ----------
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    signals : mapping of str to Series
        Its signals.
    span : (float, float)
        Its first and last time [s].

    Returns
    -------
    Description
        The figure; plots of which nothing was recorded are left out.
    """
    run = report["run"]
    panels = []
    for title, names in pages.shift_plots or (*pages.run_left, *pages.run_right):
        curves = []
        for name in names:
            if (found := cut(signals, name, pages, span)) is not None:
                look = pages.look(name)
                curves.append(Curve(name, name, name, look.colour, DASHED if look.demanded else SOLID, *found))
        if curves:
            panels.append(Panel(title, pages.signal(curves[0].signal).display_unit, tuple(curves)))
    rows = report["shifts"]
    way = pages.box.way if pages.box else None
    return Description(
        ", ".join(str(one) for one in (run.get("sequence"), run.get("description")) if one),
        "",
        "",
        "",
        (Column(*span, "time [s]"),),
        tuple(panels),
        tuple(Stretch(one.name, (), one.start, one.end) for row in rows for one in phases_of(row)),
        tuple(Moment(row["t_order_s"], way(row["from_gear"], row["to_gear"], " → "), "") for row in rows if way),
    )
