# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws a figure that view.figure describes, on matplotlib: as PNG or SVG, on a light or a dark ground, wide or for a phone.

The Python API, `rig report` and the pages use it; matplotlib is imported when something is drawn.
"""

from __future__ import annotations

import io
import itertools
import re
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedFormatter, FixedLocator, Locator, LogLocator, MaxNLocator, StrMethodFormatter

from ..analysis import INTERRUPTED
from ..base import MAKER, atomic_write
from .figure import DASHED, DOTTED, POINTS, SOLID
from .labels import CURVE, NEARBY, NEXT_TO, Labels, along, anywhere, around, beside
from .palette import DARK, GRID, GROUND, INK, LIGHT, LIMIT, MET, NOTE, ON_GRADE, RULE, with_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.text import Text

    from .figure import Column, Curve, Description, Panel, Stretch

    Wishes = Callable[[tuple[float, float]], np.ndarray]

DPI = 100
WIDTH, PHONE = 1100, 370  # pixels of a figure, and of one whose columns stand one below the other
STACKED = 700  # pixels below which they do
GUTTER, BETWEEN, TITLE = 26, 14, 20  # pixels between columns and between plots, and of a title above a plot
AXIS = 48  # height of the time axis below the plots
STRIP, LANE = 28, 14  # height of the strip of phases, and of each phase where two overlap
LINE = 19  # height of a line of text
LETTER = 0.565 * DPI / 72.0  # width of an average letter by the size of its font
SIGN, HEAD = 8, 12  # width of a sign of an axis' numbers, and where the words of a narrow figure begin [px]
DASHES = {SOLID: "-", DASHED: (0, (4, 2)), DOTTED: (0, (1, 1.6)), POINTS: "none"}
WIDTHS = {SOLID: 1.7, DASHED: 1.0, DOTTED: 1.1, POINTS: 0.0}
RIM = 1.6  # width of the ground around a dashed or dotted line, which shows it on a solid one of its colour
BEYOND = 1.35  # of the other curves' range, up to which a curve that does not scale the axis is shown
MARGIN = 0.2  # of the range of a plot, above and below its curves
NEXT = 3  # pixels between two signs in the strip
WIDE = "\u00a0 \u00a0 "  # between two texts of a line, where it may be broken; a page shows several spaces as one
COARSE = 0.4  # pixels by which a curve of a page may be moved to need fewer points
NUMBER, RESULT = 125, 56  # width and height of a number at the foot


# steps of the numbers of a log axis, by the ratio of its ends below which they are used
LOG_SUBS = ((10.0, tuple(map(float, range(1, 10)))), (30.0, (1.0, 2.0, 3.0, 5.0, 7.0)), (1e3, (1.0, 2.0, 5.0)), (1e5, (1.0, 3.0)))


class Picture(Figure):
    """A figure that a notebook shows without pyplot, which would keep every figure until it is closed."""

    def _repr_png_(self) -> bytes:
        return _bytes(self, "png")


def _bytes(figure: Figure, kind: str, name: str = MAKER, **how: str | float) -> bytes:
    file = io.BytesIO()
    made = {"Software": MAKER} if kind == "png" else {"Creator": MAKER, "Date": None}
    with mpl.rc_context({"svg.hashsalt": name, **how}):
        figure.savefig(file, format=kind, dpi=DPI, metadata=made)
    return file.getvalue()


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG or SVG, by the ending of the file's name."""
    atomic_write(path, _bytes(figure, path.suffix[1:].lower()))


def inline(description: Description, name: str, width: int = WIDTH) -> str:
    """Return a figure as SVG for a page, whose colours are variables of the page.

    Parameters
    ----------
    description : Description
        What it shows.
    name : str
        A name that no other figure of the page has.
    width : int
        Its width [px].
    """
    how = {"svg.fonttype": "none", "path.simplify_threshold": COARSE}
    svg = _bytes(draw_figure(description, width=width), "svg", name, **how).decode()
    svg = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    head, rest = svg.split(">", 1)  # a page knows SVG without its namespaces, and gives the drawing its size
    svg = re.sub(r' (xmlns(:xlink)?|width|height)="[^"]*"', "", head) + ">" + rest.replace("xlink:href", "href")
    short = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d)\d+|\n(?=L)", r"\1", path[0]), svg)
    return with_variables(short)


def draw_figure(description: Description, dark: bool = False, width: int = WIDTH) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    description : Description
        What it shows.
    dark : bool
        True for a dark ground.
    width : int
        Its width [px]; below STACKED its columns stand one below the other.

    Returns
    -------
    Figure
        The figure.
    """
    return _Drawing(description, DARK if dark else LIGHT, width).figure


class _Drawing:
    """A figure while it is drawn; ``x`` is in pixels from the left, ``y`` from the top."""

    def __init__(self, description: Description, palette: dict[str, str], width: int) -> None:
        self.of, self.palette, self.width = description, palette, width
        self.stacked = width < STACKED
        self.left, self.right, signs = (62, 8, 4) if self.stacked else (78, 18, 5)
        ends = [end for one in description.panels if not one.log for end in _range_of(one)]
        self.left += SIGN * max(0, max((len(f"{end:.0f}") for end in ends), default=0) - signs)  # longer numbers take more room
        self.noted: set[int] = set()  # panels whose note is written, by id
        self.texts: list[tuple[float, float, str, float, dict]] = []  # of the head, as its height decides that of the figure
        head = self._head()
        strip = (32 if description.moments else 8) + (STRIP + 6 if any(one.texts for one in description.stretches) else 8)
        panels = max(1, len(description.panels))
        self.titled = any(LETTER * 9 * len(_name(one)) > description.high for one in description.panels)
        own = AXIS * any(one.across is not None for one in description.panels)
        self.pitch = description.high + BETWEEN + TITLE * self.titled + own
        strip += TITLE * self.titled
        each = strip + panels * self.pitch - BETWEEN - TITLE * self.titled + AXIS - own
        places = range(len(description.columns))
        blocks = [[place] for place in places] if self.stacked else [list(places)]
        keys = [f"{one.sign} {one.text}" for one in description.moments if one.sign and one.text]
        keys += [
            f"▨ {one.texts[0]}" for one in description.stretches if one.kind == INTERRUPTED and one.texts
        ]  # short in the strip
        known = WIDE.join(map(_kept, keys))
        signs = self._wrapped(known, 8)
        rows = -(-len(description.numbers) // self._abreast)
        self.height = head + len(blocks) * each + RESULT * rows + (16 * len(signs) + 8 if signs else 0)
        size = width / DPI, self.height / DPI
        self.figure = Picture(figsize=size, dpi=DPI, facecolor=palette[GROUND])
        self.renderer = FigureCanvasAgg(self.figure).get_renderer()
        for x, y, text, points, how in self.texts:
            self.text(x, y, text, points, **how)
        for number, block in enumerate(blocks):
            self._block(block, head + number * each + strip)
        self._foot(head + len(blocks) * each, signs)

    @property
    def _abreast(self) -> int:
        return max(1, (self.width - self.left - self.right) // NUMBER)

    # ---- words

    def _wrapped(self, text: str, size: float) -> list[str]:
        return textwrap.wrap(
            text, int((self.width - self.left - self.right) / (LETTER * size)), break_long_words=False, break_on_hyphens=False
        )

    def text(self, x: float, y: float, text: str, size: float = 9, colour: str = INK, **how: object) -> Text:
        """Write a text whose baseline begins at a pixel of the figure."""
        shade = self.palette.get(colour, colour)
        return self.figure.text(x / self.width, 1.0 - y / self.height, text, fontsize=size, color=shade, **how)

    def size(self, text: Text) -> tuple[float, float]:
        box = text.get_window_extent(self.renderer)
        return box.width, box.height

    def _head(self) -> int:
        """Lay out the words above the plots and return their height."""
        of, left, y = self.of, self.left if not self.stacked else HEAD, 30
        for line in self._wrapped(of.title, 15 if not self.stacked else 12):
            self.texts.append((left, y + 4, line, 15 if not self.stacked else 12, {"weight": "bold"}))
            y += 25
        if of.grade:
            badge = {"boxstyle": "square,pad=0.4", "facecolor": self.palette[of.grade], "edgecolor": "none"}
            how = {"weight": "bold", "colour": ON_GRADE, "bbox": badge}
            if self.stacked:
                self.texts.append((left + 6, y + 4, of.grade.upper(), 10, how))
                y += 30
            else:
                self.texts.append((self.width - self.right - 8, 32, of.grade.upper(), 12, {**how, "ha": "right"}))
        conditions = re.sub(r"(?<![,·]) (?!·)", "\u00a0", of.conditions)  # a line is broken behind a comma or around a dot
        for text, size, colour, gap in ((conditions, 8.5, NOTE, 0), (of.sentence, 10, INK, 8)):
            lines = self._wrapped(text, size)
            y += gap if lines else 0
            for line in lines:
                self.texts.append((left, y, line, size, {"colour": colour}))
                y += LINE
        return y - 18

    def _foot(self, top: float, signs: Sequence[str]) -> None:
        for place, one in enumerate(self.of.numbers):
            x, y = self.left + NUMBER * (place % self._abreast), top + 16 + RESULT * (place // self._abreast)
            self.text(x, y, one.name, 7.5, NOTE)
            self.text(x, y + 18, one.value, 11, weight="bold")
            sign = {True: "  ✓", False: "  ✗", None: ""}[one.met]
            self.text(x, y + 34, one.limit + sign, 8.5, {True: MET, False: LIMIT, None: NOTE}[one.met])
        for number, line in enumerate(signs):
            self.text(self.left, self.height - 12 - 16 * (len(signs) - 1 - number), line, 8, NOTE)

    # ---- phases

    def _strip(self, column: Column, left: float, width: float, bottom: float) -> None:
        """Draw the phases of a column with their names, and the signs of its moments above them."""
        parts = [one for one in self.of.stretches if one.end > column.first and one.start < column.last and one.texts]
        split = any(b.start < a.end - 1e-6 for a, b in itertools.pairwise(parts))
        scale = width / (column.last - column.first)
        for number, one in enumerate(parts):
            lane = split and number > 0 and one.start < parts[number - 1].end - 1e-6
            high = STRIP / 2 if split else STRIP
            under = bottom - (0 if lane or not split else high)
            first, last = (left + (min(max(t, column.first), column.last) - column.first) * scale for t in (one.start, one.end))
            self._phase(one, first, last, under, high)
        free, end, y = 0.0, left + width + self.right, bottom - (STRIP if parts else 0) - 5
        for one in sorted((one for one in self.of.moments if one.sign), key=lambda one: one.t):
            if column.first <= one.t <= column.last:
                drawn = self.text(0.0, y, one.sign, 11 if one.text else 9)
                wide = self.size(drawn)[0]
                start = min(left + (one.t - column.first) * scale - 0.5 * wide * bool(one.text), end - wide)
                if start < free:
                    drawn.remove()
                else:
                    drawn.set_x(start / self.width)
                    free = start + wide + NEXT

    def _phase(self, one: Stretch, first: float, last: float, under: float, high: float) -> None:
        place = (first / self.width, 1.0 - under / self.height), (last - first) / self.width, high / self.height
        look = {"facecolor": self.palette[one.kind], "edgecolor": self.palette[RULE], "linewidth": 0.6, "hatch_linewidth": 0.5}
        hatch = "////" if one.kind == INTERRUPTED else None
        self.figure.add_artist(Rectangle(*place, hatch=hatch, **look))
        for text in one.texts:
            if high <= LANE and "\n" in text:
                continue
            size = 7.5 if high <= LANE or "\n" in text else 8.5
            middle = (first + last) / 2, under - high / 2
            drawn = self.text(*middle, text, size, ha="center", va="center_baseline", linespacing=1.05)
            if self.size(drawn)[0] <= last - first - 4:
                if hatch:
                    drawn.set_bbox({"facecolor": self.palette[one.kind], "edgecolor": "none", "pad": 0.6})
                return
            drawn.remove()

    # ---- plots

    def _block(self, places: Sequence[int], top: float) -> None:
        """Draw some columns side by side, their first plots at a height of the figure."""
        columns = [self.of.columns[place] for place in places]
        room = self.width - self.left - self.right - GUTTER * (len(columns) - 1)
        whole, left = sum(one.share for one in columns), float(self.left)
        for place, column in zip(places, columns):
            width = room * column.share / whole
            self._strip(column, left, width, top - 6 - TITLE * self.titled)
            for row, panel in enumerate(self.of.panels):
                y = top + row * self.pitch
                at = left / self.width, 1.0 - (y + self.of.high) / self.height, width / self.width, self.of.high / self.height
                axes = self.figure.add_axes(at, facecolor="none")
                axis = panel.across or column
                _scale(axes, panel, axis, width)
                last = panel is self.of.panels[-1] or panel.across is not None
                self._frame(axes, panel, place == places[0], last, axis)
                self._shade(axes)
                shown = [_within(one, axis) for one in panel.curves if one.column in (None, place)]
                self._curves(axes, panel, shown)
                labels = self._words(axes, panel, shown, (width, self.of.high), place)
                self._rules(axes, labels)
            left += width + GUTTER

    def _frame(self, axes: Axes, panel: Panel, first: bool, last: bool, column: Column) -> None:
        colours = self.palette
        axes.tick_params(labelsize=9, color=colours[RULE], labelcolor=colours[INK], labelleft=first, labelbottom=last)
        axes.grid(axis="y", color=colours[GRID], linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(colours[RULE])
        if first:
            axes.set_ylabel(panel.unit if self.titled else _name(panel), fontsize=9, color=colours[INK])
            if self.titled:
                over = LETTER * 9 * len(panel.title) - axes.bbox.width  # a long title begins further left
                begin = -min(max(0.0, over), self.left - HEAD) / (axes.bbox.width or 1.0)
                axes.set_title(panel.title, fontsize=9, color=colours[INK], loc="left", x=begin, pad=4)
            axes.yaxis.set_label_coords(((14 if self.stacked else 20) - self.left) / (axes.bbox.width or 1.0), 0.5)
        if last:
            axes.set_xlabel(column.title, fontsize=9, color=colours[INK])

    def _shade(self, axes: Axes) -> None:
        colours = self.palette
        for one in self.of.stretches:
            hatch = "////" if one.kind == INTERRUPTED else None
            look = {"facecolor": colours[one.kind], "edgecolor": colours[GROUND] if hatch else "none", "linewidth": 0}
            axes.axvspan(one.start, one.end, hatch=hatch, hatch_linewidth=1.2, zorder=0.5, **look)

    def _rules(self, axes: Axes, labels: Labels) -> None:
        """Draw the lines between the phases and that of zero, but not behind labels."""
        colours, still = self.palette, {"scalex": False, "scaley": False}
        foot, zero = axes.get_ylim()[0], axes.transData.transform((axes.get_xlim()[0], 0.0))[1] - axes.bbox.y0
        if 0.0 < zero < labels.height:
            x, look = labels.gaps(zero, upright=False), {"color": colours[RULE], "linewidth": 0.6, "zorder": 0.9}
            axes.plot(x, [0.0] * len(x), transform=axes.get_yaxis_transform(), **still, **look)
        for one in self.of.moments:
            y = labels.gaps(axes.transData.transform((one.t, foot))[0] - axes.bbox.x0, upright=True)
            look = {"color": colours[LIMIT], "linewidth": 1.0} if one.limit else {"color": colours[RULE], "linewidth": 0.7}
            look |= {"linestyle": (0, (4, 3)), "zorder": 0.8}
            axes.plot([one.t] * len(y), y, transform=axes.get_xaxis_transform(), **still, **look)

    def _curves(self, axes: Axes, panel: Panel, shown: Sequence[Curve]) -> None:
        colours = self.palette
        for one in panel.hatches:
            look = {"facecolor": "none", "edgecolor": colours[NOTE], "hatch": "////", "linewidth": 0}
            axes.fill_between(one.t, one.y, 0.0, zorder=1.5, **look)
        for one in panel.levels:
            style = DASHES[DASHED if one.limit else DOTTED]
            axes.axhline(one.y, color=colours[LIMIT if one.limit else INK], linewidth=1.0, linestyle=style)
        solid = {one.colour for one in shown if one.style == SOLID}
        for one in sorted(shown, key=lambda one: list(DASHES).index(one.style)):  # an order lies over what came of it
            colour = colours[one.colour]
            if one.band is not None:
                axes.fill_between(one.t, *one.band, color=colour, alpha=0.3, linewidth=0)
            look = {"color": colour, "linestyle": DASHES[one.style], "linewidth": WIDTHS[one.style]}
            if one.style in (DASHED, DOTTED) and one.colour in solid:
                look["path_effects"] = [withStroke(linewidth=WIDTHS[one.style] + RIM, foreground=colours[GROUND])]
            axes.plot(one.t, one.y, label=one.signal, marker="o" if one.style == POINTS else None, markersize=4, **look)
        for one in panel.rings:
            look = {"markerfacecolor": "none", "markeredgecolor": colours[one.colour], "markeredgewidth": 1.6}
            axes.plot([one.t], [one.y], "o", markersize=7, **look)

    # ---- labels

    def _words(self, axes: Axes, panel: Panel, shown: Sequence[Curve], room: tuple[float, int], place: int) -> Labels:
        """Write the labels of a plot, those with a point first, and return where they are."""
        labels = Labels(*room)
        wide, column = place == len(self.of.columns) - 1, panel.across or self.of.columns[place]
        corner = axes.bbox.x0, axes.bbox.y0

        def pixels(x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
            return (axes.transData.transform(np.column_stack([x, y])) - corner).T

        drawn = {id(one): pixels(one.t, one.y) for one in shown}
        for x, y in drawn.values():
            labels.curve(x, y)
        for one in shown:
            for edge in one.band or ():
                labels.curve(*pixels(one.t, edge))
        heights = {id(one): float(pixels(column.first, one.y)[1, 0]) for one in panel.levels}
        for y in heights.values():
            labels.level(y)
        if not panel.log:
            labels.thin(float(pixels(column.first, 0.0)[1, 0]), upright=False)
        for one in self.of.moments:
            x = float(pixels(one.t, panel.rings[0].y if panel.rings else axes.get_ylim()[0])[0, 0])
            labels.thin(x)
            if one.limit and panel is self.of.panels[-1] and self._shows(one.t, place):
                self._label(axes, labels, (one.text,), LIMIT, lambda size, x=x: beside(x, size, labels.height))
        for one in panel.hatches:
            x, y = pixels(one.t, one.y)
            labels.area(x, y, float(pixels(one.t[0], 0.0)[1, 0]))
        points = {id(one): pixels(one.t, one.y)[:, 0] for one in panel.rings}
        for x, y in points.values():
            labels.keep_free(x - 6, y - 6, x + 6, y + 6)
        for one in panel.rings:
            if panel.across is not None or self._shows(one.t, place):
                at, texts = points[id(one)], (one.text, re.split(" = |, ", one.text)[0])
                self._label(axes, labels, texts, one.colour, lambda size, at=at: around(at, size), point=at, weight="bold")
        for one in panel.hatches:
            worst = int(np.abs(one.y).argmax())
            if self._shows(float(one.t[worst]), place):
                at = pixels(one.t[worst], 0.5 * one.y[worst])[:, 0]
                self._label(axes, labels, (one.text, one.short), NOTE, lambda size, at=at: around(at, size), point=at)
        whole = labels.width, labels.height
        if panel.note and id(panel) not in self.noted:

            def free(size: tuple[float, float]) -> np.ndarray:
                wishes = anywhere(size, whole)
                best = labels.best(*size, wishes)
                return wishes[: 0 if best is None or best[0] >= CURVE else None]

            if self._label(axes, labels, (panel.note,), NOTE, free):
                self.noted.add(id(panel))
            elif wide:  # no column has room for the whole of it
                for line in panel.note.splitlines():
                    self._label(axes, labels, (line,), NOTE, lambda size: anywhere(size, whole))
        for one in panel.levels if wide else ():
            x, y = np.array([0.0, labels.width]), np.full(2, heights[id(one)])
            colour, gaps = (LIMIT, NEXT_TO) if one.limit else (INK, NEARBY)
            texts = tuple(filter(None, (one.text, one.short)))
            self._label(axes, labels, texts, colour, lambda size, x=x, y=y, gaps=gaps: along(x, y, size, whole, 0.9, gaps))
        for one in shown:
            if one.text:
                x, y = drawn[id(one)]
                best = 0.9 if wide else 0.15
                texts = (one.text, one.short) if wide else (one.short,)
                self._label(axes, labels, texts, one.colour, lambda size, x=x, y=y, best=best: along(x, y, size, whole, best))
        return labels

    def _shows(self, t: float, place: int) -> bool:
        """Return whether a column is the last one that holds a time, which is where a point of that time is named."""
        holding = [number for number, one in enumerate(self.of.columns) if one.first <= t <= one.last]
        return bool(holding) and holding[-1] == place

    def _label(
        self,
        axes: Axes,
        labels: Labels,
        texts: Sequence[str],
        colour: str,
        wishes: Wishes,
        point: np.ndarray | None = None,
        weight: str = "normal",
    ) -> bool:
        """Write the first of some texts that has a free place, whole or in two lines, or the one that lies over least.

        Where none has a place there is no label, and the answer is False.
        """
        shade, at = self.palette[colour], {"transform": axes.transAxes, "va": "bottom", "weight": weight}
        best: tuple[float, float, float, Text] | None = None
        for text in itertools.chain.from_iterable((one, _halved(one)) for one in texts):
            drawn = axes.text(0.0, 0.0, text, fontsize=8.5, color=shade, **at)
            size = self.size(drawn)
            found = labels.best(*size, wishes(size))
            if found is not None and (best is None or found[0] < best[0]):
                if best is not None:
                    best[-1].remove()
                best = *found, drawn
            else:
                drawn.remove()
            if best is not None and best[0] < CURVE:
                break
        if best is None:
            return False
        _, *found, drawn = best
        size = self.size(drawn)
        labels.take(found[0], found[1], *size)
        drawn.set_position((found[0] / labels.width, found[1] / labels.height))
        if point is not None:
            x = min(max(point[0], found[0] - 2), found[0] + size[0] + 2)
            beside = not found[0] <= x <= found[0] + size[0]
            y = found[1] + 0.45 * size[1] if beside else min(max(point[1], found[1] - 1), found[1] + size[1] + 1)
            if np.hypot(x - point[0], y - point[1]) > 14:
                ends = [point[0] / labels.width, x / labels.width], [point[1] / labels.height, y / labels.height]
                labels.leader(point, (x, y))
                axes.add_line(Line2D(*ends, color=shade, linewidth=0.8, transform=axes.transAxes))
        return True


def _name(panel: Panel) -> str:
    """Return the title of a plot's axis with its unit."""
    return f"{panel.title} [{panel.unit}]" if panel.unit else panel.title


def _halved(text: str) -> str:
    """Return a text in two lines of much the same length; one that has lines, or a single word, as it is."""
    spaces = [at for at, sign in enumerate(text) if sign == " "]
    if "\n" in text or not spaces:
        return text
    middle = min(spaces, key=lambda at: abs(2 * at - len(text)))
    return f"{text[:middle]}\n{text[middle + 1 :]}"


def _kept(text: str) -> str:
    """Return a text whose lines are not broken within it."""
    return text.replace(" ", "\u00a0")


def _within(curve: Curve, column: Column) -> Curve:
    """Return what a column shows of a curve over time, and a point more at both ends; other curves stay as they are."""
    if len(curve.t) < 2 or (np.diff(curve.t) < 0.0).any():
        return curve
    first, last = np.searchsorted(curve.t, (column.first, column.last))
    part = slice(max(0, first - 1), last + 1)
    band = curve.band and (curve.band[0][part], curve.band[1][part])
    return replace(curve, t=curve.t[part], y=curve.y[part], band=band)


def _scale(axes: Axes, panel: Panel, column: Column, width: float) -> None:
    """Give a plot the scales of its panel and its column, each with at least four numbers."""
    whole = int(min(max(width // 60, 4), 8))
    for log, axis, ends, most, scale, limits in (
        (column.log, axes.xaxis, (column.first, column.last), whole, axes.set_xscale, axes.set_xlim),
        (panel.log, axes.yaxis, _range_of(panel), 5, axes.set_yscale, axes.set_ylim),
    ):
        if axis is axes.xaxis and column.names:
            axis.set_major_locator(FixedLocator(range(len(column.names))))
            axis.set_major_formatter(FixedFormatter(column.names))
        elif log:
            scale("log")
            axis.set_major_locator(_log_locator(ends[1] / ends[0]))
            axis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axis.minorticks_off()
        else:
            axis.set_major_locator(MaxNLocator(nbins=most, min_n_ticks=4, steps=[1, 2, 2.5, 5, 10]))
        limits(*ends)


def _log_locator(ratio: float) -> Locator:
    """Return where the numbers of a log axis stand whose ends have this ratio: at least four of them."""
    if ratio < 5.0:
        return MaxNLocator(nbins=6, min_n_ticks=4, steps=[1, 2, 2.5, 5, 10])
    subs = next((subs for most, subs in LOG_SUBS if ratio < most), (1.0,))
    return LogLocator(subs=subs, numticks=12)


def _range_of(panel: Panel) -> tuple[float, float]:
    """Return the ends of a plot's axis, so that it holds its curves, levels and marks with room for labels."""
    parts = [values for one in panel.curves if one.scales for values in (one.y, *(one.band or ()))]
    values = np.concatenate([*parts, [one.y for one in (*panel.levels, *panel.rings)]])
    values = values[np.isfinite(values) & ((values > 0.0) | (not panel.log))]
    if panel.log:
        values = np.log10(values)
    if not len(values):  # nothing was recorded where the figure looks
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    for one in panel.curves:
        if not one.scales and np.isfinite(one.y).any():
            high = max(high, min(float(np.nanmax(one.y)), BEYOND * high))
            low = min(low, max(float(np.nanmin(one.y)), BEYOND * low))
    room = MARGIN * (high - low) or 0.5 * abs(high) or 1.0
    ends = low - room, high + room
    return (10.0 ** ends[0], 10.0 ** ends[1]) if panel.log else ends
