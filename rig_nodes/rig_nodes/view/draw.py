# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws a figure that view.figure describes, on matplotlib, and writes it as PNG or SVG.

The Python API and `rig report --picture` use it; matplotlib is imported when something is drawn.
"""

from __future__ import annotations

import io
import itertools
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from ..analysis import FILL, INERTIA, INTERRUPTED, TORQUE
from ..base import MAKER, atomic_write
from .figure import DASHED, DOTTED, SOLID
from .labels import Labels, along, anywhere, around

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.text import Text

    Wishes = Callable[[tuple[float, float]], list[tuple[float, float, float]]]
    from .figure import Column, Description, Level, Panel, Ring, Stretch

DPI = 100
WIDTH, LEFT, RIGHT = 1100, 78, 18  # pixels: of the figure, and of its margins
GUTTER, PLOT, BETWEEN = 26, 136, 14  # between columns, height of a plot, between plots
STRIP, LANE = 28, 14  # height of the strip of phases, and of each phase where two overlap
LINE = 19  # height of a line of text
WRAP = 128  # letters in a line of the sentence
INK, GREY, RULE, GRID, RED = "#1a1a1a", "#555555", "#999999", "#e4e4e4", "#b00020"
GREEN = "#1e6b3a"
GRADES = {"good": "#2c6e2f", "fair": "#8a5a14", "poor": "#b0450f", "failed": "#a01020"}
PHASES = {FILL: "#efefef", TORQUE: "#fdeec0", INERTIA: "#f6d0c9", INTERRUPTED: "#fbe3e1", "settling": "#edf3e4"}
DASHES = {SOLID: "-", DASHED: (0, (4, 2)), DOTTED: (0, (1, 1.6))}
WIDTHS = {SOLID: 1.7, DASHED: 1.2, DOTTED: 1.2}
BEYOND = 1.35  # of the other curves' range, up to which a curve that does not scale the axis is shown
MARGIN = 0.2  # of the range of a plot, above and below its curves
NEXT = 17  # pixels between two signs in the strip
NUMBER = 126  # pixels of a number at the foot


class Picture(Figure):
    """A figure that a notebook shows without pyplot, which would keep every figure until it is closed."""

    def _repr_png_(self) -> bytes:
        return _bytes(self, "png")


def _bytes(figure: Figure, kind: str) -> bytes:
    file = io.BytesIO()
    made = {"Software": MAKER} if kind == "png" else {"Creator": MAKER, "Date": None}
    with mpl.rc_context({"svg.hashsalt": MAKER}):
        figure.savefig(file, format=kind, dpi=DPI, metadata=made)
    return file.getvalue()


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG or SVG, by the ending of the file's name."""
    atomic_write(path, _bytes(figure, path.suffix[1:].lower()))


def draw_figure(description: Description) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    description : Description
        What it shows.

    Returns
    -------
    Figure
        The figure, 1100 pixels wide.
    """
    return _Drawing(description).figure


class _Drawing:
    """A figure while it is drawn; ``x`` is in pixels from the left, ``y`` from the top."""

    def __init__(self, description: Description) -> None:
        self.of = description
        self.sentence = textwrap.wrap(description.sentence, WRAP)
        head = 30 + (LINE if description.conditions else 0) + (12 + LINE * len(self.sentence) if self.sentence else 0)
        self.top = head + (32 if description.moments else 8) + (STRIP + 6 if any(one.texts for one in description.stretches) else 8)
        panels = max(1, len(description.panels))
        self.bottom = self.top + panels * (PLOT + BETWEEN) - BETWEEN
        known = [one for one in description.moments if one.text]
        self.height = self.bottom + 48 + (72 if description.numbers else 0) + (LINE + 2 if known else 0)
        self.figure = Picture(figsize=(WIDTH / DPI, self.height / DPI), dpi=DPI, facecolor="white")
        self.renderer = FigureCanvasAgg(self.figure).get_renderer()
        self._head()
        room = WIDTH - LEFT - RIGHT - GUTTER * (len(description.columns) - 1)
        x = LEFT
        self.spans = []
        for column in description.columns:
            self.spans.append((x, room * column.share))
            x += room * column.share + GUTTER
        for row, panel in enumerate(description.panels):
            self._panel(row, panel)
        for column, (left, width) in zip(description.columns, self.spans):
            self._strip(column, left, width)
        self._foot(known)

    # ---- words

    def text(self, x: float, y: float, text: str, size: float = 9, **how: object) -> Text:
        """Write a text whose baseline begins at a pixel of the figure."""
        return self.figure.text(x / WIDTH, 1.0 - y / self.height, text, fontsize=size, **{"color": INK, **how})

    def size(self, text: Text) -> tuple[float, float]:
        box = text.get_window_extent(self.renderer)
        return box.width, box.height

    def _head(self) -> None:
        of = self.of
        self.text(LEFT, 34, of.title, 15, weight="bold")
        if of.grade:
            badge = {"boxstyle": "square,pad=0.4", "facecolor": GRADES[of.grade], "edgecolor": "none"}
            self.text(WIDTH - RIGHT - 8, 32, of.grade.upper(), 12, weight="bold", color="white", ha="right", bbox=badge)
        self.text(LEFT, 55, of.conditions, 8.5, color=GREY)
        for number, line in enumerate(self.sentence):
            self.text(LEFT, 82 + LINE * number, line, 10)

    def _foot(self, known: Sequence) -> None:
        y = self.bottom + 66
        for place, one in enumerate(self.of.numbers):
            x = LEFT + NUMBER * (place % 8)
            self.text(x, y, one.name, 7.5, color=GREY)
            self.text(x, y + 19, one.value, 11, weight="bold")
            sign = {True: "  ✓", False: "  ✗", None: ""}[one.met]
            self.text(x, y + 36, one.limit + sign, 8.5, color={True: GREEN, False: RED, None: GREY}[one.met])
        if known:
            words = "    ".join(f"{one.sign} {one.text}" for one in known)
            self.text(LEFT, self.height - 12, words, 8, color=GREY)

    def _strip(self, column: Column, left: float, width: float) -> None:
        """Draw the phases of a column with their names, and the signs of its moments above them."""
        y = self.top - 6
        parts = [one for one in self.of.stretches if one.end > column.first and one.start < column.last and one.texts]
        split = any(b.start < a.end - 1e-6 for a, b in itertools.pairwise(parts))
        scale = width / (column.last - column.first)
        for number, one in enumerate(parts):
            lane = split and number > 0 and one.start < parts[number - 1].end - 1e-6
            high = STRIP / 2 if split else STRIP
            under = y - (0 if lane or not split else high)
            first, last = (left + (min(max(t, column.first), column.last) - column.first) * scale for t in (one.start, one.end))
            self._phase(one, first, last, under, high)
        room = -1e9
        for one in self.of.moments:
            x = left + (one.t - column.first) * scale
            if column.first <= one.t <= column.last and x - room >= NEXT:
                self.text(x, y - (STRIP if parts else 0) - 5, one.sign, 11 if one.text else 9, ha="center" if one.text else "left")
                room = x

    def _phase(self, one: Stretch, first: float, last: float, under: float, high: float) -> None:
        place = (first / WIDTH, 1.0 - under / self.height), (last - first) / WIDTH, high / self.height
        hatch = "////" if one.kind == INTERRUPTED else None
        self.figure.add_artist(
            Rectangle(*place, facecolor=PHASES[one.kind], edgecolor=GREY, linewidth=0.6, hatch=hatch, hatch_linewidth=0.5)
        )
        for text in one.texts:
            if high <= LANE and "\n" in text:
                continue
            size = 7.5 if high <= LANE or "\n" in text else 8.5
            drawn = self.text((first + last) / 2, under - high / 2, text, size, ha="center", va="center_baseline", linespacing=1.05)
            if self.size(drawn)[0] <= last - first - 4:
                if hatch:
                    drawn.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6})
                return
            drawn.remove()

    # ---- plots

    def _panel(self, row: int, panel: Panel) -> None:
        y = self.top + row * (PLOT + BETWEEN)
        last = row == len(self.of.panels) - 1
        limits = _range_of(panel)
        for place, (column, (left, width)) in enumerate(zip(self.of.columns, self.spans)):
            at = (left / WIDTH, 1.0 - (y + PLOT) / self.height, width / WIDTH, PLOT / self.height)
            axes = self.figure.add_axes(at)
            axes.set_xlim(column.first, column.last)
            axes.set_ylim(*limits)
            self._frame(axes, panel, place == 0, last, column)
            self._shade(axes)
            self._curves(axes, panel)
            self._words(axes, panel, (width, PLOT), place)

    def _frame(self, axes: Axes, panel: Panel, first: bool, last: bool, column: Column) -> None:
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5, min_n_ticks=4, steps=[1, 2, 2.5, 5, 10]))
        axes.xaxis.set_major_locator(MaxNLocator(nbins=8, min_n_ticks=4, steps=[1, 2, 2.5, 5, 10]))
        axes.tick_params(labelsize=9, color=RULE, labelleft=first, labelbottom=last)
        axes.grid(axis="y", color=GRID, linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(RULE)
        if first:
            axes.set_ylabel(f"{panel.title} [{panel.unit}]", fontsize=9, color=INK)
            axes.yaxis.set_label_coords(-58 / (axes.bbox.width or 1.0), 0.5)
        if last:
            axes.set_xlabel(column.title, fontsize=9)

    def _shade(self, axes: Axes) -> None:
        for one in self.of.stretches:
            hatch = "////" if one.kind == INTERRUPTED else None
            axes.axvspan(
                one.start,
                one.end,
                facecolor=PHASES[one.kind],
                edgecolor="#e0a8a3" if hatch else "none",
                hatch=hatch,
                hatch_linewidth=0.5,
                linewidth=0,
                zorder=0.5,
            )
        for one in self.of.moments:
            axes.axvline(one.t, color="#777777", linewidth=0.7, linestyle=(0, (4, 3)), zorder=0.8)

    def _curves(self, axes: Axes, panel: Panel) -> None:
        for one in panel.hatches:
            axes.fill_between(one.t, one.y, 0.0, facecolor="#00000018", edgecolor=GREY, hatch="////", linewidth=0, zorder=1.5)
        if axes.get_ylim()[0] < 0.0 < axes.get_ylim()[1]:
            axes.axhline(0.0, color="#bbbbbb", linewidth=0.8, zorder=0.9)
        for one in panel.levels:
            axes.axhline(one.y, color=RED if one.limit else INK, linewidth=1.0, linestyle=DASHES[DASHED if one.limit else DOTTED])
        for one in sorted(panel.curves, key=lambda one: one.style == SOLID):
            axes.plot(one.t, one.y, color=one.colour, linestyle=DASHES[one.style], linewidth=WIDTHS[one.style], label=one.signal)
        for one in panel.rings:
            axes.plot([one.t], [one.y], "o", markersize=7, markerfacecolor="none", markeredgecolor=one.colour, markeredgewidth=1.6)

    # ---- labels

    def _words(self, axes: Axes, panel: Panel, room: tuple[float, int], place: int) -> None:
        """Write the labels of a plot, those with a point first."""
        labels = Labels(*room)
        wide = place == len(self.of.columns) - 1
        to_pixels = axes.transData
        corner = axes.bbox.x0, axes.bbox.y0
        drawn = {}
        for one in panel.curves:
            x, y = (to_pixels.transform(np.column_stack([one.t, one.y])) - corner).T
            drawn[id(one)] = x, y
            labels.curve(x, y)
        heights = {id(one): float(to_pixels.transform((0.0, one.y))[1] - corner[1]) for one in panel.levels}
        for y in heights.values():
            labels.line(0, y, labels.width, y)
        for one in self.of.moments:
            x = float(to_pixels.transform((one.t, 0.0))[0] - corner[0])
            labels.line(x, 0, x, labels.height)
        for one in panel.hatches:
            x, y = (to_pixels.transform(np.column_stack([one.t, one.y])) - corner).T
            labels.area(x, y, float(to_pixels.transform((0.0, 0.0))[1] - corner[1]))
        rings = [one for one in panel.rings if self._shows(one.t, place)]
        points = {id(one): to_pixels.transform((one.t, one.y)) - corner for one in panel.rings}
        for x, y in points.values():
            labels.keep_free(x - 6, y - 6, x + 6, y + 6)
        for one in rings:
            self._at_point(axes, labels, one, points[id(one)])
        for one in panel.hatches:
            worst = int(np.abs(one.y).argmax())
            if self._shows(float(one.t[worst]), place):
                at = to_pixels.transform((one.t[worst], 0.5 * one.y[worst])) - corner
                self._label(axes, labels, one.text, GREY, lambda size, at=at: around(at, size), point=at)
        if panel.note and place == 0:
            self._label(axes, labels, panel.note, GREY, lambda size: anywhere(size, (labels.width, labels.height)))
        for one in panel.curves:
            if text := one.text if wide else one.short:
                x, y = drawn[id(one)]
                best = 0.9 if wide else 0.15
                self._label(
                    axes,
                    labels,
                    text,
                    one.colour,
                    lambda size, x=x, y=y, best=best: along(x, y, size, (labels.width, labels.height), best),
                )
        for one in panel.levels if wide else ():
            self._level(axes, labels, one, heights[id(one)])

    def _shows(self, t: float, place: int) -> bool:
        """Return whether a column is the last one that holds a time, which is where a point of that time is named."""
        holding = [number for number, one in enumerate(self.of.columns) if one.first <= t <= one.last]
        return bool(holding) and holding[-1] == place

    def _at_point(self, axes: Axes, labels: Labels, ring: Ring, at: np.ndarray) -> None:
        self._label(axes, labels, ring.text, ring.colour, lambda size: around(at, size), point=at, weight="bold")

    def _level(self, axes: Axes, labels: Labels, level: Level, y: float) -> None:
        x, line = np.array([0.0, labels.width]), np.array([y, y])
        self._label(
            axes,
            labels,
            level.text,
            RED if level.limit else INK,
            lambda size: along(x, line, size, (labels.width, labels.height), 0.9),
        )

    def _label(
        self,
        axes: Axes,
        labels: Labels,
        text: str,
        colour: str,
        wishes: Wishes,
        point: np.ndarray | None = None,
        weight: str = "normal",
    ) -> None:
        """Write a label at the best of its wishes; without a place it is left out."""
        drawn = axes.text(0.0, 0.0, text, fontsize=8.5, color=colour, weight=weight, transform=None, va="bottom")
        size = self.size(drawn)
        found = labels.place(*size, wishes(size))
        if found is None:
            drawn.remove()
            return
        drawn.set_transform(axes.transAxes)
        drawn.set_position((found[0] / labels.width, found[1] / labels.height))
        if point is not None:
            x = min(max(point[0], found[0] - 2), found[0] + size[0] + 2)
            beside = not found[0] <= x <= found[0] + size[0]
            y = found[1] + 0.45 * size[1] if beside else min(max(point[1], found[1] - 1), found[1] + size[1] + 1)
            if np.hypot(x - point[0], y - point[1]) > 14:
                ends = [point[0] / labels.width, x / labels.width], [point[1] / labels.height, y / labels.height]
                labels.leader(point, (x, y))
                axes.add_line(Line2D(*ends, color=colour, linewidth=0.8, transform=axes.transAxes))


def _range_of(panel: Panel) -> tuple[float, float]:
    """Return the ends of a plot's axis, so that it holds its curves, levels and marks with room for labels."""
    values = [one.y[np.isfinite(one.y)] for one in panel.curves if one.scales]
    marked = [*(one.y for one in panel.levels), *(one.y for one in panel.rings)]
    values = np.concatenate([*values, marked])
    low, high = float(values.min()), float(values.max())
    for one in panel.curves:
        if not one.scales and np.isfinite(one.y).any():
            high = max(high, min(float(np.nanmax(one.y)), BEYOND * high))
            low = min(low, max(float(np.nanmin(one.y)), BEYOND * low))
    room = MARGIN * (high - low) or 0.5 * abs(high) or 1.0
    return low - room, high + room
