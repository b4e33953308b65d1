# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Line and scatter plots as SVG text, with nothing but axes with ticks and a legend.

Used by all modules that draw results; the rig has no plotting library, and these few charts need none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from ...base import atomic_write

WIDTH, HEIGHT = 760, 440
LEFT, RIGHT, TOP, BOTTOM = 74, 190, 44, 56  # margins [px]; the legend stands on the right
COLOURS = ("#1b6ca8", "#c0392b", "#2e8b57", "#8e44ad", "#d68910", "#34495e", "#16a2b8", "#7f8c8d")
TICKS = 6  # approximate number of ticks on an axis


@dataclass(frozen=True)
class Series:
    """One set of points, drawn as marks, as a line or as both.

    Parameters
    ----------
    name : str
        Name in the legend.
    x, y : list
        Places of equal number; None in y leaves a gap.
    line, marks : bool
        Whether a line and marks are drawn.
    dashed : bool
        Whether the line is dashed.
    """

    name: str
    x: list[float]
    y: list[float | None]
    line: bool = True
    marks: bool = True
    dashed: bool = False


@dataclass(frozen=True)
class Band:
    """A shaded stretch of y, for instance what is accepted; an end that is None is open."""

    name: str
    low: float | None
    high: float | None


@dataclass
class Figure:
    """A chart: title, names of the axes with their units, and what is drawn in it."""

    title: str
    x_name: str
    y_name: str
    series: list[Series] = field(default_factory=list)
    bands: list[Band] = field(default_factory=list)

    def svg(self) -> str:
        """Return the chart as SVG text.

        Raises
        ------
        ValueError
            When there is no point to draw.
        """
        points = [(x, y) for s in self.series for x, y in zip(s.x, s.y) if y is not None]
        if not points:
            raise ValueError(f"the figure '{self.title}' has no point to draw")
        ends = [end for band in self.bands for end in (band.low, band.high) if end is not None]
        x_ticks = ticks(min(x for x, _ in points), max(x for x, _ in points))
        y_ticks = ticks(min([y for _, y in points] + ends), max([y for _, y in points] + ends))
        scale = _Scale(x_ticks, y_ticks)
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
            f'height="{HEIGHT}" font-family="sans-serif" font-size="12">',
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
            f'<text x="{LEFT}" y="24" font-size="15">{escape(self.title)}</text>',
        ]
        parts += [scale.band(band) for band in self.bands]
        parts += scale.axes(self.x_name, self.y_name)
        for number, series in enumerate(self.series):
            parts += scale.draw(series, COLOURS[number % len(COLOURS)])
        parts += self._legend()
        return "\n".join([*parts, "</svg>", ""])

    def _legend(self) -> list[str]:
        out, x = [], WIDTH - RIGHT + 16
        entries = [(s.name, COLOURS[n % len(COLOURS)]) for n, s in enumerate(self.series)]
        entries += [(band.name, "#d9ead3") for band in self.bands]
        for number, (name, colour) in enumerate(entries):
            y = TOP + 10 + 18 * number
            out.append(f'<rect x="{x}" y="{y - 9}" width="14" height="10" fill="{colour}"/>')
            out.append(f'<text x="{x + 20}" y="{y}">{escape(name)}</text>')
        return out


def ticks(low: float, high: float, about: int = TICKS) -> list[float]:
    """Return some round numbers, ``about`` so many, that enclose the range from low to high."""
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-12):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= rough * (1.0 - 1e-9))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(i * step, 12) for i in range(first, last + 1)]


class _Scale:
    """The scale from values to places on the sheet."""

    def __init__(self, x_ticks: list[float], y_ticks: list[float]) -> None:
        self.x_ticks, self.y_ticks = x_ticks, y_ticks

    def x(self, value: float) -> float:
        """Return the place of a value across the sheet [px]."""
        share = (value - self.x_ticks[0]) / (self.x_ticks[-1] - self.x_ticks[0])
        return round(LEFT + share * (WIDTH - LEFT - RIGHT), 1)

    def y(self, value: float) -> float:
        """Return the place of a value down the sheet [px]."""
        share = (value - self.y_ticks[0]) / (self.y_ticks[-1] - self.y_ticks[0])
        return round(HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM), 1)

    def axes(self, x_name: str, y_name: str) -> list[str]:
        """Return grid, numbers and names of both axes as SVG."""
        out = []
        bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
        for value in self.x_ticks:
            x = self.x(value)
            out.append(f'<line x1="{x}" y1="{TOP}" x2="{x}" y2="{bottom}" stroke="#e5e5e5"/>')
            out.append(f'<text x="{x}" y="{bottom + 18}" text-anchor="middle">{value:g}</text>')
        for value in self.y_ticks:
            y = self.y(value)
            out.append(f'<line x1="{LEFT}" y1="{y}" x2="{right}" y2="{y}" stroke="#e5e5e5"/>')
            out.append(f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end">{value:g}</text>')
        out.append(f'<path d="M{LEFT} {TOP}V{bottom}H{right}" fill="none" stroke="#555"/>')
        out.append(f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 14}" text-anchor="middle">{escape(x_name)}</text>')
        middle = (TOP + bottom) / 2
        out.append(f'<text x="18" y="{middle}" text-anchor="middle" transform="rotate(-90 18 {middle})">{escape(y_name)}</text>')
        return out

    def band(self, band: Band) -> str:
        """Return a shaded stretch as SVG."""
        high = self.y(self.y_ticks[-1] if band.high is None else band.high)
        low = self.y(self.y_ticks[0] if band.low is None else band.low)
        return (
            f'<rect x="{LEFT}" y="{high}" width="{WIDTH - LEFT - RIGHT}" height="{max(round(low - high, 1), 1)}" fill="#d9ead3"/>'
        )

    def draw(self, series: Series, colour: str) -> list[str]:
        """Return a series in its colour as SVG."""
        out, run = [], []
        places = [None if y is None else (self.x(x), self.y(y)) for x, y in zip(series.x, series.y)]
        dash = ' stroke-dasharray="6 4"' if series.dashed else ""
        for place in [*places, None]:
            if place is not None:
                run.append(f"{place[0]},{place[1]}")
                continue
            if series.line and len(run) > 1:
                out.append(f'<polyline points="{" ".join(run)}" fill="none" stroke="{colour}" stroke-width="1.6"{dash}/>')
            run = []
        if series.marks:
            out += [f'<circle cx="{p[0]}" cy="{p[1]}" r="3" fill="{colour}"/>' for p in places if p is not None]
        return out


def write_pictures(found: Iterable[tuple[str, Figure]], folder: str | Path) -> list[Path]:
    """Write figures as SVG files.

    Parameters
    ----------
    found : iterable of (str, Figure)
        Names of the files without ending, and figures.
    folder : str or Path
        Folder of the files; it is made when it does not exist.

    Returns
    -------
    list of Path
        The files.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in found:
        paths.append(folder / f"{name}.svg")
        atomic_write(paths[-1], figure.svg())
    return paths
