# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Self-contained HTML pages: their frame, tables, and plots as SVG that keep the extremes of what they thin out.

view.page_of_compare and view.page_of_report use it. A page is light, prints on A4, and can be read at the width of a phone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from ..base import MAKER

WIDTH, LEFT, RIGHT = 560, 56, 10  # width of a plot's drawing, and of the margins for its numbers
LETTER = 9.3  # width of an average letter at the width of a phone, in the same units
BINS = 400  # stretches of time of a plot, of each of which the lowest and highest value are drawn
COLOURS = ("#1f5fa8", "#c0501a", "#3a8a3f", "#7a4aa0", "#8a6d1d", "#a8325a", "#2b8a8a", "#5a5f66")
# A phone is some 360 px wide, and a drawing of 560 units shrinks to this width, so its text is larger there.
STYLE = """:root{color-scheme:light}*{box-sizing:border-box}
body{font:14px/1.4 sans-serif;max-width:820px;margin:0 auto;padding:12px;color:#222;background:#fff;overflow-wrap:break-word}
h1{font-size:22px;margin:.2em 0}h2{font-size:17px;margin:1.4em 0 .4em;border-bottom:1px solid #bbb;break-after:avoid}
h3{font-size:15px;margin:1em 0 .3em;break-after:avoid}p{margin:.4em 0}.wide{overflow-x:auto}
table{border-collapse:collapse;margin:.4em 0;font-variant-numeric:tabular-nums}
td,th{padding:2px 8px;text-align:right;border-bottom:1px solid #ddd;vertical-align:top}tr{break-inside:avoid}
th{font-weight:600;background:#f4f4f4}td:first-child,th:first-child,.text td,.text th{text-align:left}
.text td:first-child{white-space:nowrap}small{color:#555;white-space:nowrap;margin-left:.4em}td br{display:none}
figure{margin:.8em 0;break-inside:avoid}.plot{break-inside:avoid}
svg{display:block;width:100%;height:auto}svg text{font:11px sans-serif;fill:#333}
.on text{paint-order:stroke;stroke:#fff;stroke-width:3px}
.legend{font-size:12px;margin:.5em 0 0}
.legend span{margin-right:.8em;white-space:nowrap}.key{display:inline-block;width:11px;height:11px}
.good,.met{color:#176b2c;font-weight:600}.fair,.undecided{color:#8a5a00;font-weight:600}
.poor,.failed,.missed,.far{color:#a01010;font-weight:700}
.note{color:#555;font-size:12px}h2+.note{break-after:avoid}
.warn{border-left:4px solid #c0501a;padding-left:8px}
@media (max-width:600px){body{padding:8px;font-size:15px}td,th{padding:2px 5px}svg text{font-size:17px}
.text td:first-child{white-space:normal}td br{display:inline}small{margin-left:0}}
@media print{body{max-width:none;padding:0;font-size:10pt}h1{font-size:16pt}h2{font-size:12pt}h3{font-size:11pt}a{color:inherit}
.wide{overflow:visible}svg text{font-size:9px}th{background:none}*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
@page{size:A4;margin:15mm}"""

Cell = str | tuple[str, str]  # the text of a cell, or its text and its class


def page(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of HTML around its parts; the title is plain text."""
    head = (
        f'<meta charset="utf-8"><meta name="generator" content="{MAKER}">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(title)}</title>'
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head><body>\n<h1>{escape(title)}</h1>\n'
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], kind: str = "") -> str:
    """Return a table of plain texts; the text after a line break in a cell is written small.

    Parameters
    ----------
    head : sequence of str
        The headings; none for a table without.
    rows : iterable of sequence of Cell
        The rows.
    kind : str
        "text" for a table of words instead of numbers.
    """
    lines = ["".join(f"<th>{_cell(cell)}</th>" for cell in head)] if head else []
    for row in rows:
        cells = [(cell, "") if isinstance(cell, str) else cell for cell in row]
        lines.append(
            "".join(f'<td class="{escape(css)}">{_cell(text)}</td>' if css else f"<td>{_cell(text)}</td>" for text, css in cells)
        )
    return f'<div class="wide"><table class="{kind}">{"".join(f"<tr>{line}</tr>" for line in lines)}</table></div>'


def _cell(text: str) -> str:
    first, _, rest = text.partition("\n")
    return escape(first) + (f"<br><small>{escape(rest)}</small>" if rest else "")


def captioned(caption: str, drawing: str) -> str:
    """Return a drawing under its legend; no page break separates the two."""
    return f'<div class="plot">{caption}{drawing}</div>'


def legend(names: Iterable[tuple[str, str]], title: str = "") -> str:
    """Return the line above a plot: its title, and each (name, colour) with a square of its colour."""
    keys = "".join(f'<span><i class="key" style="background:{colour}"></i> {escape(name)}</span>' for name, colour in names)
    return f'<p class="legend">{f"<b>{escape(title)}</b> " if title else ""}{keys}</p>'


def ticks(low: float, high: float, about: int) -> list[float]:
    """Return some round numbers, ``about`` so many, that enclose the range from low to high."""
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-12):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= rough * (1.0 - 1e-9))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(i * step, 12) for i in range(first, last + 1)]


class Envelope:
    """The lowest and the highest value of a signal in each of some equal stretches of time.

    Its size does not depend on how many samples it has taken, and no peak is lost.
    """

    def __init__(self, start: float, end: float, bins: int = BINS) -> None:
        """Prepare an envelope of the samples between two times [s]."""
        self.start, self.end = start, end
        self.low, self.high = np.full(bins, np.inf), np.full(bins, -np.inf)

    def add(self, t: np.ndarray, values: np.ndarray) -> None:
        """Add samples at growing times [s]; those outside the window and those that are NaN are left out."""
        first, last = np.searchsorted(t, (self.start, self.end))
        last = max(last, int(np.searchsorted(t, self.end, "right")))
        t, values = t[first:last], values[first:last]
        good = np.isfinite(values)
        if not good.any():
            return
        t, values = t[good], values[good]
        bins = np.minimum(((t - self.start) / (self.end - self.start) * len(self.low)).astype(int), len(self.low) - 1)
        heads = np.flatnonzero(np.diff(bins, prepend=-1))
        where = bins[heads]
        self.low[where] = np.minimum(self.low[where], np.minimum.reduceat(values, heads))
        self.high[where] = np.maximum(self.high[where], np.maximum.reduceat(values, heads))

    @property
    def filled(self) -> np.ndarray:
        """Indices of the stretches that have a sample."""
        return np.flatnonzero(self.low <= self.high)

    def runs(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield time [s], lowest and highest value of each part without a gap.

        A gap is a missing stretch that is more than three times as long as the usual distance between samples.
        """
        at = self.filled
        if not len(at):
            return
        steps = np.diff(at)
        gaps = np.flatnonzero(steps > 3 * max(1.0, float(np.median(steps)) if len(steps) else 1.0)) + 1
        width = (self.end - self.start) / len(self.low)
        for part in np.split(at, gaps):
            yield self.start + (part + 0.5) * width, self.low[part], self.high[part]


@dataclass
class Curve:
    """A curve of a plot: its name and colour, whether it is dashed, and its values in the displayed unit."""

    name: str
    colour: str
    envelope: Envelope
    dashed: bool = False


@dataclass
class Stretch:
    """A stretch of time with a name: a shaded phase or a time between two ends [s]; ``text`` is written beside it."""

    name: str
    start: float
    end: float
    colour: str
    text: str = ""


@dataclass
class Axis:
    """The common time axis of plots above each other, with the marks on it.

    Attributes
    ----------
    start, end : float
        The window [s].
    phases : list of Stretch
        Stretches that are shaded behind the curves.
    moments : list of float
        Times of vertical lines [s].
    """

    start: float
    end: float
    phases: list[Stretch] = field(default_factory=list)
    moments: list[float] = field(default_factory=list)

    def x(self, t: float) -> float:
        """Return the horizontal place of a time, limited to the edges of the plot."""
        share = (t - self.start) / (self.end - self.start)
        return LEFT + min(max(share, 0.0), 1.0) * (WIDTH - LEFT - RIGHT)

    def _behind(self, height: float) -> str:
        parts = []
        for one in self.phases:
            left, width = self.x(one.start), max(self.x(one.end) - self.x(one.start), 0.5)
            box = f'x="{left:.1f}" y="0" width="{width:.1f}" height="{height}"'
            parts.append(f'<rect {box} fill="{one.colour}" fill-opacity="1"><title>{escape(one.name)}</title></rect>')
        for x in map(self.x, self.moments):
            ends = f'x1="{x:.1f}" y1="0" x2="{x:.1f}" y2="{height}"'
            parts.append(f'<line {ends} stroke="#555" stroke-width="0.8" stroke-dasharray="3 3"/>')
        return "".join(parts)

    def bars(self, rows: Sequence[Stretch]) -> str:
        """Return a drawing with a bar for each stretch, one under the other, each with its text beside it."""
        step, parts = 17, []
        for number, one in enumerate(rows):
            y, left, right = 3 + step * number, self.x(one.start), self.x(one.end)
            parts.append(f'<rect x="{left:.1f}" y="{y + 3}" width="{max(right - left, 1.0):.1f}" height="8" fill="{one.colour}"/>')
            text = one.text or one.name
            room = LETTER * len(text)
            if right + 5 + room <= WIDTH:
                x, anchor = right + 5, "start"
            else:  # where there is no room on the left either, the text begins at the edge and lies over its bar
                x, anchor = (left - 5, "end") if room <= left - 5 else (0.0, "start")
            parts.append(f'<text x="{x:.1f}" y="{y + 11}" text-anchor="{anchor}">{escape(text)}</text>')
        height = step * len(rows) + 4
        inside = f'{self._behind(height)}<g class="on">{"".join(parts)}</g>'
        return _svg(height, inside, "phases and times of the shift")

    def plot(self, curves: Sequence[Curve], label: str, height: int = 104, times: bool = True) -> str:
        """Return curves over time as a drawing; ``times`` adds the numbers of the time axis under it."""
        lows = [float(one.envelope.low[at].min()) for one in curves if len(at := one.envelope.filled)]
        highs = [float(one.envelope.high[at].max()) for one in curves if len(at := one.envelope.filled)]
        marks = ticks(min(lows, default=0.0), max(highs, default=1.0), 4)
        least = 0.5 * (marks[1] - marks[0])
        # some room at both ends; a nearly constant curve lies between two numbers
        bottom, top = min(min(lows, default=0.0), marks[1] - least), max(max(highs, default=1.0), marks[-2] + least)
        bottom, top = bottom - 0.04 * (top - bottom), top + 0.04 * (top - bottom)
        foot = 20 if times else 4

        def y(value: float) -> float:
            return 5 + (top - value) / (top - bottom) * (height - 9)

        parts = [self._behind(height)]
        for value in (one for one in marks if bottom <= one <= top):
            parts.append(f'<line x1="{LEFT}" y1="{y(value):.1f}" x2="{WIDTH - RIGHT}" y2="{y(value):.1f}" stroke="#ddd"/>')
            parts.append(f'<text x="{LEFT - 5}" y="{min(y(value) + 4, height):.1f}" text-anchor="end">{value:g}</text>')
        for value in (one for one in ticks(self.start, self.end, 4) if self.start <= one <= self.end):
            x = self.x(value)
            parts.append(f'<line x1="{x:.1f}" y1="5" x2="{x:.1f}" y2="{height - 4}" stroke="#eee"/>')
            if times:
                anchor = "end" if x > WIDTH - 40 else "middle"
                parts.append(f'<text x="{x:.1f}" y="{height + 14}" text-anchor="{anchor}">{value:g} s</text>')
        parts += [_drawn(one, self.x, y) for one in curves]
        return _svg(height + foot, "".join(parts), label)


def _svg(height: float, inside: str, label: str) -> str:
    return f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(label)}">{inside}</svg>'


def _drawn(curve: Curve, x: Callable[[float], float], y: Callable[[float], float]) -> str:
    paths = []
    for t, low, high in curve.envelope.runs():
        points: list[str] = []
        upwards = True  # the line goes up and down in turn, so that it fills the band of a noisy signal
        for place, down, up in zip(map(x, t), map(y, low), map(y, high)):
            ends = [down] if down - up < 0.4 else [down, up] if upwards else [up, down]
            points += [f"{place:.1f} {end:.1f}" for end in ends]
            upwards ^= len(ends) > 1
        if len(points) == 1:
            points *= 2  # a single sample is drawn as a dot
        paths.append("M" + "L".join(points))
    dash = ' stroke-dasharray="5 3"' if curve.dashed else ""
    return (
        f'<path d="{"".join(paths)}" fill="none" stroke="{curve.colour}" stroke-width="1.4" stroke-linejoin="round" '
        f'stroke-linecap="round"{dash}><title>{escape(curve.name)}</title></path>'
        if paths
        else ""
    )
