# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as one self-contained HTML page with its curves as SVG; `rig compare --html` writes it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np

from ..analysis.report import columns_of
from ..analysis.side_by_side import Comparison, Curve
from ..catalogue import Signal
from ..transmission import Transmission

WIDTH, HEIGHT, LEFT, FOOT = 760, 170, 70, 22  # px of a plot, and of the room for its numbers
COLOURS = ("#1f5fa8", "#c0501a", "#3a8a3f", "#7a4aa0", "#8a6d1d")
STYLE = """body{font:14px sans-serif;max-width:800px;margin:1em auto;padding:0 .5em;color:#222;background:#fff}
table{border-collapse:collapse;display:block;overflow-x:auto}td,th{padding:2px 8px;text-align:right;border-bottom:1px solid #ddd}
td:first-child,th:first-child{text-align:left}svg{width:100%;height:auto}figure{margin:1em 0;break-inside:avoid}
.far{font-weight:bold;color:#a01010}@page{size:A4;margin:15mm}"""


def compare_page(found: Comparison, signals: Mapping[str, Signal], box: Transmission) -> str:
    """Return the page: clocks, metrics, signals, and for each signal the curves above their differences.

    Parameters
    ----------
    found : Comparison
        The comparison.
    signals : mapping of str to Signal
        Signals of the first recording's rig, for units.
    box : Transmission
        Its transmission, for the names of metrics.
    """
    parts = ["<h1>Comparison</h1>", _table(["recording", "offset ms", "drift ppm", "aligned by"], _clock_rows(found))]
    parts += ["<h2>Metrics of shifts</h2>", _table(METRICS, _metric_rows(found, box))]
    parts += ["<h2>Signals</h2>", _table(SIGNALS, _signal_rows(found, signals))]
    parts += [_figure(curve, found.names, signals[curve.name]) for curve in found.curves if curve.name in signals]
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>Comparison</title>'
    return f'<!doctype html><html lang="en"><head>{head}<style>{STYLE}</style></head><body>{"".join(parts)}</body></html>\n'


METRICS = ["shift", "metric", "first", "other", "difference", "error", "in errors", "recording"]
SIGNALS = ["signal", "mean difference", "rms", "largest", "error", "rms in errors", "recording"]


def _clock_rows(found: Comparison) -> list[list[str]]:
    return [
        [name, f"{clock.offset * 1e3:.2f}", f"{clock.drift * 1e6:.1f}", clock.by if n else "the first clock"]
        for n, (name, clock) in enumerate(zip(found.names, found.clocks))
    ]


def _metric_rows(found: Comparison, box: Transmission) -> list[list[str]]:
    shown = {key: (heading, factor) for heading, key, factor, _ in columns_of(box)}
    rows = []
    for row in found.metrics:
        if row["metric"] in shown:
            heading, factor = shown[row["metric"]]
            values = [_number(row[key], factor) for key in ("first", "other", "difference", "error")]
            rows.append([str(row["shift"]), heading, *values, _number(row["in_errors"]), found.names[row["run"]]])
    return rows


def _signal_rows(found: Comparison, signals: Mapping[str, Signal]) -> list[list[str]]:
    rows = []
    for row in found.signals:
        if one := signals.get(row["signal"]):
            values = [_number(row[key], one.scale) for key in ("mean", "rms", "largest", "error")]
            rows.append([f"{one.name} {one.display_unit}", *values, _number(row["in_errors"]), found.names[row["run"]]])
    return rows


def _number(value: float | None, factor: float = 1.0) -> str:
    return "-" if value is None else f"{value * factor:.4g}"


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _figure(curve: Curve, names: list[str], signal: Signal) -> str:
    shown = [np.asarray(signal.shown(values), float) for values in curve.values]
    legend = " ".join(f'<span style="color:{_colour(n)}">&#9632; {escape(name)}</span>' for n, name in enumerate(names))
    title = f"{escape(signal.name)} [{escape(signal.display_unit)}]"
    rest = [values - shown[0] for values in shown[1:]]
    above, below = _plot(curve.time, shown, 0), _plot(curve.time, rest, 1)
    return f"<figure><figcaption><b>{title}</b> {legend}</figcaption>{above}<div>difference from the first</div>{below}</figure>"


def _colour(n: int) -> str:
    return COLOURS[n % len(COLOURS)]


def _plot(t: np.ndarray, values: list[np.ndarray], first: int) -> str:
    """Return curves over time as SVG, with the numbers at the ends of both axes."""
    finite = np.concatenate([one[np.isfinite(one)] for one in values] or [np.zeros(1)])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    high = high if high > low else low + 1.0
    x = LEFT + (t - t[0]) / max(t[-1] - t[0], 1e-9) * (WIDTH - LEFT - 10)
    lines = []
    for n, one in enumerate(values):
        y = 5 + (high - one) / (high - low) * (HEIGHT - FOOT - 10)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y) if np.isfinite(b))
        lines.append(f'<polyline fill="none" stroke="{_colour(n + first)}" points="{points}"/>')
    text = [(LEFT - 5, 14, "end", high), (LEFT - 5, HEIGHT - FOOT, "end", low), (LEFT, HEIGHT - 4, "start", float(t[0]))]

    marks = "".join(f'<text x="{a}" y="{b}" font-size="12" text-anchor="{c}">{v:.4g}</text>' for a, b, c, v in text)
    marks += f'<text x="{WIDTH - 10}" y="{HEIGHT - 4}" font-size="12" text-anchor="end">{t[-1]:.4g} s</text>'
    frame = f'<rect x="{LEFT}" y="5" width="{WIDTH - LEFT - 10}" height="{HEIGHT - FOOT - 10}" fill="none" stroke="#bbb"/>'
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{frame}{"".join(lines)}{marks}</svg>'
