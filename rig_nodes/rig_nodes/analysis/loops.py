# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The values of a sequence's loops (``repeat`` with ``each``) at each shift: columns of every table of shifts.

The record of a run says which steps are in which turn of its loops, and its events say when each step began.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

from ..base import SI, UNITS, dimension_of_text, quantity
from .metrics import metric_keys

STEP = "step"  # name of the event at the beginning of a step, whose value is the step's number from 1
TAKEN = ("member", "seed", "shift", "end", "reason", "quality")  # columns that tables of shifts have beside metrics


def put_loops(rows: Iterable[dict], loops: Sequence[Mapping] | None, steps: Iterable[tuple[float, float]]) -> None:
    """Put the values of the loops around its order into each row of metrics, under ``loops``; nothing for a run without loops.

    A name whose values have several dimensions is told apart by them: ``load.torque`` and ``load.pressure``, of one unit each.

    Parameters
    ----------
    rows : iterable of dict
        Rows of shift.shift_metrics.
    loops : sequence of mapping or None
        ``first`` and ``last`` number of steps, and ``values`` of their loops as written (Sequence.loops).
    steps : iterable of (float, float)
        Time [s] and number of each step that began, in order of time.
    """
    if not loops:
        return
    began = list(steps)
    times = [t for t, _ in began]
    with suppress(LookupError, TypeError, AttributeError):  # a bag may hold anything there
        dimensions: dict[str, set[str | None]] = {}
        for one in loops:
            for name, value in one["values"].items():
                dimensions.setdefault(name, set()).add(dimension_of_text(str(value)))
        for row in rows:
            at = bisect_right(times, row["t_order_s"] + 1e-9) - 1
            number = began[at][1] if at >= 0 else 0
            values = next((one["values"] for one in loops if one["first"] <= number <= one["last"]), {})
            if values:
                row["loops"] = {_told_apart(name, str(value), dimensions[name]): str(value) for name, value in values.items()}


def _told_apart(name: str, value: str, dimensions: set[str | None]) -> str:
    """Return the name of a loop's value, with its dimension behind it where the name has several."""
    dimension = dimension_of_text(value)
    return name if dimension is None or len(dimensions) == 1 else f"{name}.{dimension.replace(' ', '_')}"


def loop_columns(row: Mapping) -> dict[str, tuple[float | str, str]]:
    """Return the values of a row's loops by the name of their column: number and unit in SI, or a word and ""."""
    found: dict[str, tuple[float | str, str]] = {}
    for name, text in (row.get("loops") or {}).items():
        dimension = dimension_of_text(text)
        column = f"loop.{name}" if name in metric_keys() or name in TAKEN else name
        if dimension is None:
            found[column] = (text, "")
        else:
            unit = SI.get(dimension)  # a dimension without an SI unit that can be written keeps its own
            own = text.strip().lstrip("+-0123456789.eE ") if unit is None else unit
            found[column] = (quantity(text, dimension, name) / UNITS[own or "-"][1], (own or "-").strip("-"))
    return found


def loops_text(row: Mapping) -> str:
    """Return the values of a row's loops behind a comma, for the name of its shift; empty without loops."""
    return "".join(f", {name} {value}" for name, value in (row.get("loops") or {}).items())
