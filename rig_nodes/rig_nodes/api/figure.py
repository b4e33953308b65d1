# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run or one of its shifts as a figure of matplotlib: the plots, colours and phases of the report's page.

``Run.plot`` imports it when it is called, because it needs matplotlib.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..analysis import moments_of, phases_of, times_of
from ..view import PHASES, Pages, heading_of, styles_of, window_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from .run import Run

WIDTH, HEIGHT, HEAD = 9.0, 1.55, 0.9  # inches: of the figure, of a plot, of title and time axis
GREY, RULE = "#555555", "#888888"
SHADE = 0.14  # opacity of a phase
ROOM = 0.06  # share of the width that the name of a phase needs


class Picture(Figure):
    """A figure that a notebook shows without pyplot, which would keep every figure until it is closed."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=90)
        return file.getvalue()


def figure_of(run: Run, number: int | None = None) -> Figure:
    """Return the figure of a run, or of a shift by its number from 1 on.

    Parameters
    ----------
    run : Run
        The run, whose report has the shift.
    number : int, optional
        The shift; the whole run by default.

    Returns
    -------
    Figure
        One plot below the other, over the time of the run [s].
    """
    report, pages = run.report, Pages(run.record)
    rows = report["shifts"] if number is None else [report["shifts"][number - 1]]
    plots = [(title, there) for title, names in _plots(pages) if (there := [name for name in names if name in run.signals])]
    picture = Picture(figsize=(WIDTH, HEAD + HEIGHT * max(1, len(plots))), layout="constrained")
    axes = picture.subplots(max(1, len(plots)), 1, sharex=True, squeeze=False)[:, 0]
    heading, window = _heading(run, pages, number)
    for ax, (title, names) in zip(axes, plots):
        _draw(ax, run, pages, title, names, window)
        for row in rows:
            _shade(ax, row)
    axes[0].set_xlim(*window)
    _name_parts(axes[0], rows, pages, number is None)
    axes[-1].set_xlabel("time [s]")
    picture.suptitle(heading, x=0.012, ha="left", fontsize=12, fontweight="bold")
    return picture


def _plots(pages: Pages) -> Sequence[tuple[str, Sequence[str]]]:
    return pages.shift_plots or (*pages.run_left, *pages.run_right)


def _heading(run: Run, pages: Pages, number: int | None) -> tuple[str, tuple[float, float]]:
    """Return the title, and the times between which the run or the shift is shown [s]."""
    about, shifts, ends = run.report["run"], run.report["shifts"], run.signals.span
    if number is None:
        return ", ".join(str(one) for one in (about.get("sequence"), about.get("description")) if one), ends
    row, later = shifts[number - 1], [one["t_order_s"] for one in shifts[number:]]
    return heading_of(number, row, pages.box), window_of(row, ends, min(later, default=ends[1]))


def _draw(ax: Axes, run: Run, pages: Pages, title: str, names: Sequence[str], window: tuple[float, float]) -> None:
    """Draw the curves of a plot between two times [s], in the unit that people read, with their names at the right."""
    styles = styles_of(pages, names)
    for name in sorted(names, key=lambda one: not styles[one][1]):
        whole, (colour, dashed) = run.signals[name], styles[name]
        first, last = np.searchsorted(whole.time, window)
        signal = whole[max(0, first - 1) : last + 1]
        values = pages.signal(name).shown(signal)
        wide = 1.0 if dashed else 1.3
        ax.plot(signal.time, values, color=colour, linestyle=(0, (3, 1.5)) if dashed else "-", linewidth=wide, label=name)
    unit = pages.signal(names[0]).display_unit
    ax.set_ylabel(f"[{unit}]", fontsize=8, color=GREY)
    ax.set_title(title, loc="left", fontsize=9, color=GREY, pad=3)
    ax.legend(loc="upper left", bbox_to_anchor=(1.005, 1.04), frameon=False, fontsize=8, handlelength=1.4, borderaxespad=0.0)
    ax.tick_params(labelsize=8, color=RULE)
    ax.grid(axis="y", color="#dddddd", linewidth=0.6)
    ax.margins(x=0.0)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(RULE)


def _shade(ax: Axes, row: Mapping) -> None:
    """Shade the phases of a shift and mark its moments."""
    for one in phases_of(row):
        ax.axvspan(one.start, one.end, color=PHASES[one.name], alpha=SHADE, linewidth=0)
    for t in moments_of(row).values():
        ax.axvline(t, color=RULE, linewidth=0.6, linestyle=(0, (4, 3)))
    for one in times_of(row):
        ax.axvline(one.end, color=RULE, linewidth=0.6, linestyle=(0, (4, 3)))


def _name_parts(ax: Axes, rows: Sequence[Mapping], pages: Pages, whole: bool) -> None:
    """Write over the first plot which shift it is or, of one shift, which phase."""
    style = {"fontsize": 8, "color": GREY, "va": "bottom", "transform": ax.get_xaxis_transform()}
    low, high = ax.get_xlim()
    for row in rows:
        if whole:
            ax.text(row["t_order_s"], 1.02, pages.box.way(row["from_gear"], row["to_gear"], " \u2192 "), ha="left", **style)
            continue
        for one in phases_of(row):
            if one.end - one.start > ROOM * (high - low):
                ax.text((one.start + one.end) / 2, 1.02, one.name, ha="center", **style)
