# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The results of a report as one list of named numbers: metrics of shifts, what a procedure found, ranges of signals.

analysis.limits judges them, `rig procedure` summarises them, and the page of `rig report --html` shows them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..base import UNITS
from ..rig import Transmission
from .display import aligned, shown
from .metrics import named_metrics
from .press_bench import bench_numbers
from .report_text import shift_name
from .run_report import shown_transmission

TIMES, CURVES = 1e3, 1e-6  # factors to ms and MPa
ENDS = ("lowest", "highest")  # the kinds of results that are the range of a signal
# key in the report -> name, unit, factor from the report's unit, digits
ENGAGEMENT = {
    "engagement_s": ("engagement time", "ms", TIMES, 0),
    "engagement_peak_nm": ("engagement peak", "Nm", 1.0, 1),
    "p_kiss": ("kiss pressure", "MPa", CURVES, 3),
    "hold_s": ("hold phase", "ms", TIMES, 0),
    "input_torque_mean_nm": ("closed torque", "Nm", 1.0, 1),
}
COAST_DOWN = {
    "inertia": ("inertia", "kg m2", 1.0, 4),
    "inertia_half": ("inertia upper half", "kg m2", 1.0, 4),
    "coast_down_torque_nm": ("torque before", "Nm", 1.0, 2),
    "coast_down_tangent_s": ("tangent time", "s", 1.0, 3),
}


@dataclass(frozen=True)
class Result:
    """One number of a report.

    Attributes
    ----------
    key : str
        Its key in the report, or the name of a signal.
    name : str
        Its name for people.
    place : str
        To what it belongs: a shift with its time, a valve, a friction model, or the run.
    kind : str
        What results of several runs have in common: the way of a shift, such as ``I-II``, else the place.
    unit : str
        The unit in which ``value`` and ``error`` are.
    digits : int
        Digits behind the decimal point that are shown; a limit and its verdict use the whole value.
    value : float or None
        The number; None when it was not found.
    error : float or None
        Its largest measuring error; None when it is not known.
    """

    key: str
    name: str
    place: str
    kind: str
    unit: str
    digits: int
    value: float | None
    error: float | None = None

    @property
    def dimension(self) -> str:
        """Dimension of the unit, as base.units names it; a signal may have a unit that cannot be written in a limit."""
        return UNITS[self.unit][0] if self.unit in UNITS else ""

    @property
    def text(self) -> str:
        """The value with its error, without the unit."""
        error = "" if self.error is None or self.value is None else f" ± {number(self.error, self.digits)}"
        return f"{shown(self.value, self.error, self.digits)}{error}"

    def as_dict(self) -> dict:
        """Return plain values for JSON."""
        names = ("key", "name", "place", "kind", "unit", "digits", "value", "error")
        return {name: getattr(self, name) for name in names}


def results_of(report: Mapping) -> list[Result]:
    """Return every result of a report, in the order in which it is printed; missing ones have the value None.

    Parameters
    ----------
    report : mapping
        Report of build_report or report_of_recording.

    Returns
    -------
    list of Result
        The results; those of a coast-down, engagement or valve only when the run has them.
    """
    if "bench" in report:
        found = [
            Result(key, name, place, place, unit, digits, value)
            for key, name, place, unit, digits, value in bench_numbers(report["bench"])
        ]
        return [*found, *signal_results(report.get("signals", ()))]
    box = shown_transmission(dict(report))
    found = [one for number in range(1, len(report["shifts"]) + 1) for one in results_of_shift(report, number, box)]
    measured = report.get("measured") or {}
    for row in measured.get("valve_responses", ()):
        valves = " and ".join(clutch.valve_name for clutch in box.engaged(row["gear"]))
        error = None  # the bag's rows do not resolve the pulses
        found.append(Result("valve_delay_s", "valve delay", valves, valves, "ms", 1, _times(row["valve_delay_s"], TIMES), error))
    for row in measured.get("engagements", ()):
        clutches = " and ".join(clutch.name for clutch in box.engaged(row["gear"]))
        found += _of_row(row, ENGAGEMENT, f"{clutches} at {row['t_order_s']:.2f} s", clutches)
    if (row := measured.get("coast_down")) and not row["why"]:
        found += _of_row(row, COAST_DOWN, "driving side", "driving side")
    return found


def results_of_shift(report: Mapping, number: int, box: Transmission) -> list[Result]:
    """Return a result for each metric with a name of a shift of a report, which counts from 1."""
    row, errors = report["shifts"][number - 1], report.get("uncertainty", ())
    place, kind = shift_name(number, row, box), box.way(row["from_gear"], row["to_gear"], "-")
    own = errors[number - 1] if number <= len(errors) else {}
    found = []
    for one in named_metrics():
        values = (_times(values.get(one.key), one.factor) for values in (row, own))
        found.append(Result(one.key, one.named(box), place, kind, one.shown_unit, one.digits, *values))
    return found


def _of_row(row: Mapping, known: Mapping[str, tuple[str, str, float, int]], place: str, kind: str) -> list[Result]:
    return [
        Result(key, name, place, kind, unit, digits, _times(row[key], factor), _times(row["errors"].get(key), factor))
        for key, (name, unit, factor, digits) in known.items()
        if row[key] is not None
    ]


def signal_results(rows: Iterable[Mapping]) -> list[Result]:
    """Return the lowest and the highest value of each signal of a run without shifts, from rows of analysis.ranges."""
    return [
        Result(row["signal"], row["signal"], end, end, row["unit"], 1 if abs(row["highest"]) >= 100.0 else 3, row[end])
        for row in rows
        for end in ENDS
    ]


def without_ranges(results: Iterable[Result]) -> list[Result]:
    """Return the results without the ranges of signals, or these when there is nothing else."""
    found = list(results)
    return [one for one in found if one.kind not in ENDS] or found


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def number(value: float | None, digits: int) -> str:
    """Return a number as text, without the sign of a zero; empty for None."""
    return "" if value is None else f"{value:z.{digits}f}"


def spread(results: Iterable[Iterable[Result]]) -> list[dict]:
    """Return lowest, mean and highest of like results of several runs.

    Parameters
    ----------
    results : iterable of iterable of Result
        The results of each run.

    Returns
    -------
    list of dict
        ``key, name, kind, unit, digits, runs`` (number of values), ``lowest, mean, highest`` and the largest ``error`` (None when
        no run has one), for each kind of each key in order of appearance. Ranges of signals are left out where a run has other
        results.
    """
    groups: dict[tuple[str, str], list[Result]] = {}
    for one in (one for run in results for one in without_ranges(run) if one.value is not None):
        groups.setdefault((one.kind, one.key), []).append(one)
    rows = []
    for (kind, key), group in groups.items():
        values = [one.value for one in group if one.value is not None]
        errors = [one.error for one in group if one.error is not None]
        rows.append(
            {
                "key": key,
                "name": group[0].name,
                "kind": kind,
                "unit": group[0].unit,
                "digits": group[0].digits,
                "runs": len(values),
                "lowest": min(values),
                "mean": sum(values) / len(values),
                "highest": max(values),
                "error": max(errors, default=None),
            }
        )
    return rows


def spread_cells(row: Mapping) -> list[str]:
    """Return lowest, mean and highest of a row of :func:`spread` as text."""
    return [shown(row[key], row["error"], row["digits"]) for key in ("lowest", "mean", "highest")]


def spread_lines(rows: Iterable[Mapping]) -> list[str]:
    """Return the table of :func:`spread` for the terminal."""
    table = [["of", "result", "unit", "values", "lowest", "mean", "highest", "+-"]]
    for row in rows:
        table.append(
            [row["kind"], row["name"], row["unit"], str(row["runs"]), *spread_cells(row), number(row["error"], row["digits"])]
        )
    return aligned(table, 3)
