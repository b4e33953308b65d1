# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as tables and sentences for people; `rig compare` prints them, and its page has the same.

Numbers have one digit more than a report prints, and those of signals end at a tenth of their measuring error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..rig import Signal, Transmission
from .display import fixed, in_unit, shown
from .metrics import named_metrics
from .side_by_side import Comparison, short_names

Table = tuple[list[str], list[list[str]]]  # heads and rows
DIGITS = 4  # significant ones of a difference without a known error


def clock_lines(found: Comparison) -> list[str]:
    """Return offset and drift of each recording after the first, what does not fit, and which shifts began differently."""
    lines = []
    for name, clock in list(zip(short_names(found.names), found.clocks))[1:]:
        lines.append(f"{name}: offset {clock.offset * 1e3:+z.2f} ms, drift {clock.drift * 1e6:+z.1f} ppm, by {clock.by}")
        if clock.pieces:
            apart = f"the times between orders differ by up to {clock.rest * 1e3:.1f} ms"
            lines.append(f"  {apart}; each shift is compared from its own order on")
        lines += [f"  {note}" for note in clock.notes]
    return lines + [f"  {line}" for line in found.starts]


def metric_tables(found: Comparison, box: Transmission) -> list[Table]:
    """Return a table of the metrics for each recording after the first, with the recordings' names as heads."""
    metrics = {one.key: one for one in named_metrics()}
    names, tables = short_names(found.names), []
    for run in range(1, len(names)):
        rows = []
        for row in (row for row in found.metrics if row["run"] == run and row["metric"] in metrics):
            one = metrics[row["metric"]]
            values = [
                shown(*in_unit(row[key], row["error"], one.factor), one.digits + 1) for key in ("first", "other", "difference")
            ]
            ends = [fixed(row["error"], one.factor, one.digits + 1), fixed(row["in_errors"], 1.0, 2)]
            rows.append([str(row["shift"]), one.heading(box), *values, *ends])
        tables.append((["shift", "metric", names[0], names[run], "difference", "+-", "in errors"], rows))
    return tables


def signal_tables(found: Comparison, signals: Mapping[str, Signal]) -> list[Table]:
    """Return a table of the signals' differences for each recording after the first."""
    tables = []
    for run in range(1, len(found.names)):
        rows = []
        for row in found.signals:
            if row["run"] == run and (one := signals.get(row["signal"])):
                digits = _digits(row["error"] or 0.0, row["largest"] or 0.0, one.scale)
                values = [fixed(row[key], one.scale, digits) for key in ("mean", "rms", "largest", "error")]
                rows.append([f"{one.name} {one.display_unit}", *values, fixed(row["in_errors"], 1.0, 2)])
        tables.append((["signal", "mean difference", "rms", "largest", "+-", "rms in errors"], rows))
    return tables


def reasons(found: Comparison, box: Transmission) -> list[str]:
    """Return a sentence for each reason why cells of the tables are empty."""
    headings = {one.key: one.named(box) for one in named_metrics()}
    names, by_reason = short_names(found.names), {}
    for row in found.metrics:
        if row["reason"] and row["metric"] in headings:
            reason = row["reason"].replace("first: ", f"{names[0]}: ").replace("other: ", f"{names[row['run']]}: ")
            by_reason.setdefault((f"shift {row['shift']}", reason), []).append(headings[row["metric"]])
    lines = [f"{place}: no {', '.join(what)}: {reason}" for (place, reason), what in by_reason.items()]
    of_signals: dict[str, list[str]] = {}
    for row in found.signals:
        if row["reason"]:
            of_signals.setdefault(row["reason"], []).append(row["signal"])
    return lines + [f"{', '.join(dict.fromkeys(what))}: {reason}" for reason, what in of_signals.items()]


def _digits(error: float, largest: float, scale: float) -> int:
    """Return the digits behind the point with which the last one is a tenth of an error, or the last of DIGITS."""
    size, least = (error * scale, 1) if error else (largest * scale, DIGITS - 1)
    return max(0, least - math.floor(math.log10(abs(size)))) if size else 1
