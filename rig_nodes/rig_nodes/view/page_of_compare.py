# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as one self-contained HTML page with its curves as SVG; `rig compare --html` writes it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np

from ..analysis import Comparison, Curve, clock_lines, metric_tables, reasons, short_names, signal_tables
from ..rig import Signal, Transmission
from .html_page import COLOURS, Axis, Envelope, captioned, legend, page, table
from .html_page import Curve as Drawn


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
    names = short_names(found.names)
    parts = [table(["recording", "offset ms", "drift ppm", "aligned by"], _clock_rows(found))]
    parts += [f"<p>{escape(line.strip())}</p>" for line in clock_lines(found) if line.startswith("  ")]
    parts += ["<h2>Metrics of shifts</h2>", *(table(head, rows) for head, rows in metric_tables(found, box) if rows)]
    parts += ["<h2>Signals</h2>", *(table(head, rows) for head, rows in signal_tables(found, signals))]
    parts += [f'<p class="note">-: {escape(line)}</p>' for line in reasons(found, box)]
    parts += [_figure(curve, names, signals[curve.name]) for curve in found.curves if curve.name in signals]
    return page("Comparison", parts)


def _clock_rows(found: Comparison) -> list[list[str]]:
    return [
        [name, f"{clock.offset * 1e3:z.2f}", f"{clock.drift * 1e6:z.1f}", clock.by if n else "the first clock"]
        for n, (name, clock) in enumerate(zip(found.names, found.clocks))
    ]


def _figure(curve: Curve, names: list[str], signal: Signal) -> str:
    shown = [np.asarray(signal.shown(values), float) for values in curve.values]
    axis = Axis(float(curve.time[0]), float(curve.time[-1]) if len(curve.time) > 1 else float(curve.time[0]) + 1.0)

    def drawn(values: list[np.ndarray], first: int, label: str) -> str:
        curves = []
        for n, one in enumerate(values, first):
            envelope = Envelope(axis.start, axis.end)
            envelope.add(curve.time, one)
            curves.append(Drawn(names[n], _colour(n), envelope))
        return axis.plot(curves, label)

    above = legend(((name, _colour(n)) for n, name in enumerate(names)), f"{signal.name} [{signal.display_unit}]")
    rest = drawn([values - shown[0] for values in shown[1:]], 1, f"{signal.name}, difference from the first")
    below = captioned(legend((), "difference from the first"), rest)
    return f"<figure>{captioned(above, drawn(shown, 0, signal.name))}{below}</figure>"


def _colour(n: int) -> str:
    return COLOURS[n % len(COLOURS)]
