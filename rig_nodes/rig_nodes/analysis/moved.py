# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which metrics of the shifts of a run moved from one report to another, in units of the measuring error.

`rig rerun` and `rig compare` use it.
"""

from __future__ import annotations

from collections.abc import Mapping

from .metrics import KEYS
from .report import columns_of, shown_transmission

NOT_MEASURED = ("from_gear", "to_gear", "valid", "t_order_s", "why")


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
        larger ``error`` of both, and ``in_errors``, the difference over that error; None for what is not known.
    """
    rows = []
    errors = first.get("uncertainty", []), other.get("uncertainty", [])
    for i, (a, b) in enumerate(zip(first["shifts"], other["shifts"])):
        if (a["from_gear"], a["to_gear"]) != (b["from_gear"], b["to_gear"]):
            continue
        for key in (key for key in KEYS if key not in NOT_MEASURED):
            known = [side[i][key] for side in errors if i < len(side) and side[i].get(key) is not None]
            error = max(known, default=None)
            difference = None if a[key] is None or b[key] is None else b[key] - a[key]
            in_errors = None if difference is None or not error else difference / error
            rows.append(
                {
                    "shift": i + 1,
                    "metric": key,
                    "first": a[key],
                    "other": b[key],
                    "difference": difference,
                    "error": error,
                    "in_errors": in_errors,
                }
            )
    return rows


def moved_lines(first: Mapping, other: Mapping) -> list[str]:
    """Return a line for each metric that differs between two reports, the largest difference in errors first."""
    box = shown_transmission(dict(first))
    names = {key: (heading, factor) for heading, key, factor, _ in columns_of(box)}
    rows = [row for row in differences(first, other) if row["metric"] in names and row["first"] != row["other"]]
    rows.sort(key=lambda row: -abs(row["in_errors"] or 0.0))
    lines = []
    for row in rows:
        (heading, factor), i = names[row["metric"]], row["shift"] - 1
        values = ["-" if row[side] is None else f"{row[side] * factor:.4g}" for side in ("first", "other")]
        times = "" if row["in_errors"] is None else f" ({row['in_errors']:+.2f} times the largest error)"
        shift = first["shifts"][i]
        way = box.way(shift["from_gear"], shift["to_gear"])
        lines.append(f"moved: {way} at {shift['t_order_s']:.2f} s, {heading}: {values[0]} -> {values[1]}{times}")
    return lines or ["no metric of a shift moved"]
