# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as one self-contained HTML page with its curves as SVG; `rig compare --html` writes it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..analysis.report import columns_of
from ..analysis.side_by_side import Comparison, Curve
from ..catalogue import Signal
from ..transmission import Transmission
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
    parts = [table(["recording", "offset ms", "drift ppm", "aligned by"], _clock_rows(found))]
    parts += ["<h2>Metrics of shifts</h2>", table(METRICS, _metric_rows(found, box))]
    parts += ["<h2>Signals</h2>", table(SIGNALS, _signal_rows(found, signals))]
    parts += [_figure(curve, found.names, signals[curve.name]) for curve in found.curves if curve.name in signals]
    return page("Comparison", parts)


METRICS = ["shift", "metric", "first", "other", "difference", "error", "in errors", "recording"]
SIGNALS = ["signal", "mean difference", "rms", "largest", "error", "rms in errors", "recording"]


def _clock_rows(found: Comparison) -> list[list[str]]:
    return [
        [name, f"{clock.offset * 1e3:z.2f}", f"{clock.drift * 1e6:z.1f}", clock.by if n else "the first clock"]
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
    return "-" if value is None else f"{value * factor:z.4g}"


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
