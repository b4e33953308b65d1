# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which metrics of the shifts of a run moved from one report to another, in units of the measuring error.

`rig rerun` and `rig compare` use it.
"""

from __future__ import annotations

from collections.abc import Mapping

from .definitions import reasons_in
from .display import in_unit, shown_shortly
from .metrics import every_metric, named_metrics
from .report_text import shift_name
from .run_report import shown_transmission

REST = 1e-9  # share of two numbers below which their difference is one of rounding


def differences(first: Mapping, other: Mapping) -> list[dict]:
    """Return the metrics of both reports side by side, shift by shift in their order.

    Parameters
    ----------
    first, other : mapping
        Reports of build_report or report_of_recording.

    Returns
    -------
    list of dict
        For each metric of each shift of both: ``shift`` (number from 1), ``metric``, ``first``, ``other``, ``difference``, the
        larger ``error`` of both, and ``in_errors``, the difference over that error; None for what is not known. ``reason`` is why
        ``first``, ``other`` or both are None, empty when both are numbers.
    """
    rows = []
    errors = first.get("uncertainty", []), other.get("uncertainty", [])
    for i, (a, b) in enumerate(zip(first["shifts"], other["shifts"])):
        if (a["from_gear"], a["to_gear"]) != (b["from_gear"], b["to_gear"]):
            continue
        for key in (metric.key for metric in every_metric()):
            known = [side[i][key] for side in errors if i < len(side) and side[i].get(key) is not None]
            error = max(known, default=None)
            difference = None if a.get(key) is None or b.get(key) is None else without_rest(b[key] - a[key], a[key], b[key])
            in_errors = None if difference is None or not error else difference / error
            rows.append(
                {
                    "shift": i + 1,
                    "metric": key,
                    "first": a.get(key),
                    "other": b.get(key),
                    "difference": difference,
                    "error": error,
                    "in_errors": in_errors,
                    "reason": _reason(a, b, key),
                }
            )
    return rows


def without_rest(difference: float, *of: float) -> float:
    """Return a difference of numbers; 0 when it is what rounding leaves of equal ones."""
    return 0.0 if abs(difference) <= REST * max(map(abs, of), default=0.0) else difference


def _no_extreme(row: Mapping, key: str) -> str:
    """Return why an extreme of the input torque has no time: a torque that only goes from one level to the other has none."""
    torque = {"t_high_s": "input_torque_high_nm", "t_low_s": "input_torque_low_nm"}.get(key, "")
    return "" if row.get(torque) is None else "the torque did not go beyond those before and after the shift"


def _reason(a: Mapping, b: Mapping, key: str) -> str:
    """Return why a metric is missing in one row or both; empty when it is in both."""
    reasons = {
        name: reasons_in(row).get(key) or _no_extreme(row, key) or "; ".join(row["why"]) or "it does not belong to such a shift"
        for name, row in (("first", a), ("other", b))
        if row[key] is None
    }
    if len(reasons) == 2 and reasons["first"] == reasons["other"]:
        return f"both: {reasons['first']}"
    return "; ".join(f"{name}: {text}" for name, text in reasons.items())


def moved_lines(first: Mapping, other: Mapping) -> list[str]:
    """Return a line for each metric that moved between two reports, the largest difference in errors first.

    A metric that differs by no more than its largest measuring error is only counted, in a line of its own, because a measurement
    could not distinguish its two values. One without a known error moved when the texts of its two values differ.
    """
    box = shown_transmission(dict(first))
    named = {one.key: one for one in named_metrics()}
    rows = [row for row in differences(first, other) if row["metric"] in named and row["first"] != row["other"]]
    rows.sort(key=lambda row: -abs(row["in_errors"] or 0.0))
    lines, within = [], []
    for row in rows:
        metric, times = named[row["metric"]], row["in_errors"]
        values = [shown_shortly(*in_unit(row[side], row["error"], metric.factor)) for side in ("first", "other")]
        if values[0] == values[1] if times is None else abs(times) <= 1.0:
            within.append(abs(times or 0.0))
            continue
        error = "" if times is None else f" ({times:+.2f} times the largest error)"
        shift = shift_name(row["shift"], first["shifts"][row["shift"] - 1], box)
        lines.append(f"moved: {shift}, {metric.heading(box)}: {values[0]} -> {values[1]}{error}")
    if within:
        more = f", by at most {max(within):.2f} of it" if max(within) else ""
        lines.append(f"{len(within)} metrics of shifts differ by less than their largest measuring error{more}")
    return lines or ["no metric of a shift moved"]
