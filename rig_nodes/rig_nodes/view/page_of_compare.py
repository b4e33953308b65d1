# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as one self-contained HTML page with its curves; `rig compare --html` writes it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..analysis import Comparison, Curve, clock_lines, metric_tables, reasons, short_names, signal_tables
from ..rig import Signal, Transmission
from .figure import DASHED, SOLID, Column, Description, Panel
from .figure import Curve as Drawn
from .page import figures, page, table, words
from .palette import CURVES


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
    clocks = table(["recording", "offset ms", "drift ppm", "aligned by"], _clock_rows(found))
    said = words(line.strip() for line in clock_lines(found) if line.startswith("  "))
    metrics = [part for head, rows in metric_tables(found, box) for part in table(head, rows)]
    compared = [part for head, rows in signal_tables(found, signals) for part in table(head, rows)]
    notes = words([f"-: {line}" for line in reasons(found, box)], "note")
    drawn = [_figure(curve, names, signals[curve.name]) for curve in found.curves if curve.name in signals]
    parts = [*compared, *notes, *figures(drawn, "signal")]
    return page("Comparison", [("", [*clocks, *said]), ("Metrics of shifts", metrics), ("Signals", parts)])


def _clock_rows(found: Comparison) -> list[list[str]]:
    return [
        [name, f"{clock.offset * 1e3:z.2f}", f"{clock.drift * 1e6:z.1f}", clock.by if n else "the first clock"]
        for n, (name, clock) in enumerate(zip(found.names, found.clocks))
    ]


def _figure(curve: Curve, names: list[str], signal: Signal) -> Description:
    shown = [np.asarray(signal.shown(values), float) for values in curve.values]
    drawn = [
        Drawn(name, name, name, CURVES[n % len(CURVES)], DASHED if n else SOLID, curve.time, values)
        for n, (name, values) in enumerate(zip(names, shown))
    ]
    rest = [
        Drawn(name, name, name, CURVES[n % len(CURVES)], SOLID, curve.time, values - shown[0])
        for n, (name, values) in enumerate(zip(names, shown))
        if n
    ]
    unit, last = signal.display_unit, float(curve.time[-1]) if len(curve.time) > 1 else float(curve.time[0]) + 1.0
    panels = Panel(signal.quantity, unit, tuple(drawn)), Panel("difference", unit, tuple(rest))
    return Description(signal.name, "", "", "", (Column(float(curve.time[0]), last, "time [s]"),), panels)
