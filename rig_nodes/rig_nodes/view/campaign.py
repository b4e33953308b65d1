# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of many runs: metrics of their shifts over what was varied, a line for each further condition, with the spread.

`rig report FOLDER` shows them for the folder of a measuring procedure and of a sweep, and the table of a sweep in Python.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis import PLOTS, REPORT_FILE, RPM, named_metrics, read_procedure, read_report, shown_transmission
from ..base import RigError
from ..rig import load_rig
from ..studies import SWEEP, SWEEP_JOURNAL, decode, plan_of, read_manifest, rows_of
from .figure import POINTS, SOLID, Column, Curve, Description, Panel
from .palette import CURVES

if TYPE_CHECKING:
    from ..analysis import Metric
    from ..rig import Transmission
    from ..studies import Plan

MOST = 3  # conditions that are columns
ROOM = 0.06  # share of an axis left free at both ends
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")
_SHOWN = {"rad/s": ("rpm", RPM), "Pa": ("MPa", 1e-6)}


@dataclass(frozen=True)
class Campaign:
    """The shifts of many runs with their varied conditions.

    Parameters
    ----------
    title : str
        Name of the campaign.
    conditions : dict of str to (str, list of float)
        Unit and value of each condition, row by row; NaN for a run without this condition.
    rows : list of mapping
        Metrics of one shift each (analysis.metrics).
    box : Transmission
        The transmission that was shifted.
    """

    title: str
    conditions: dict[str, tuple[str, list[float]]]
    rows: list[Mapping[str, Any]]
    box: Transmission


def read_campaign(path: str | Path) -> Campaign:
    """Return the campaign of a folder of runs or of a sweep; RigError when no run of it has a shift."""
    folder = Path(path)
    found = _of_sweep(folder) if (folder / SWEEP).exists() else _of_reports(folder)
    if found is None:
        raise RigError(f"{folder}: no run of it has a shift, whose metrics could be drawn")
    return found


def _reports(folder: Path) -> list[Path]:
    return sorted(one.parent for one in folder.glob(f"*/{REPORT_FILE}"))


def _of_reports(folder: Path) -> Campaign | None:
    rows, given, box = [], [], None
    of_series = {
        name: {
            key: f"{value} {(one.get('units') or {}).get(key, '')}".strip()
            for key, value in (one.get("conditions") or {}).items()
            if key != "series"
        }
        for one in read_procedure(folder).get("series", ())
        for name in one["runs"]
    }
    for run in _reports(folder):
        report = read_report(run) or {}
        if box is None and report.get("shifts"):
            try:
                box = shown_transmission(report)
            except RigError as error:
                raise RigError(f"{run / REPORT_FILE}: {error}") from None
        for row in report.get("shifts", []):
            rows.append(row)
            given.append(of_series.get(run.name) or report["run"].get("parameters") or {})
    return None if box is None else Campaign(folder.name, conditions_of(given), rows, box)


def _of_sweep(folder: Path) -> Campaign | None:
    plan, journal = plan_of(read_manifest(folder)["plan"]), folder / SWEEP_JOURNAL
    config = load_rig(plan.rig, plan.fixed)
    lines = journal.read_bytes().splitlines(keepends=True) if journal.exists() else []
    entries = sorted((entry for line in lines if (entry := decode(line)) is not None), key=lambda entry: entry["member"])
    rows = [row for entry in entries for row in rows_of(plan, entry)]
    return campaign_of_sweep(plan, rows, config.transmission) if config.structure.gears else None


def campaign_of_sweep(plan: Plan, rows: Sequence[Mapping], box: Transmission) -> Campaign | None:
    """Return the campaign of a sweep's rows (studies.rows_of); None where there is no shift among them."""
    shifts = [row for row in rows if row.get("from_gear") is not None]
    given = [{one.name: f"{row[one.name]} {one.unit}".strip() for one in plan.varied} for row in shifts]
    return Campaign(f"Sweep {plan.name}", conditions_of(given), shifts, box) if shifts else None


def conditions_of(given: Sequence[Mapping[str, object]]) -> dict[str, tuple[str, list[float]]]:
    """Return unit and values of the numbers among the conditions that differ between rows; two that are always alike are one."""
    out = {}
    for name in dict.fromkeys(name for one in given for name in one):
        read = [_NUMBER.fullmatch(str(one.get(name, ""))) for one in given]
        units = {match[2] for match in read if match}
        values = [float(match[1]) if match else np.nan for match in read]
        if len(units) == 1 and len({value for value in values if np.isfinite(value)}) > 1:
            unit, factor = _SHOWN.get(written := units.pop(), (written, 1.0))
            out[name] = unit, [value * factor for value in values]
    same: dict[tuple, str] = {}
    for name, (unit, values) in out.items():
        same.setdefault((unit, tuple(values)), name)
    return {name: out[name] for name in same.values()}


def figures_of_campaign(found: Campaign) -> list[Description]:
    """Return a figure for each change of gears, with a column for each condition and a plot for each metric."""
    ways = [found.box.way(row["from_gear"], row["to_gear"], " → ") for row in found.rows]
    varied = dict(list(found.conditions.items())[:MOST]) or {"row": ("", [float(n + 1) for n in range(len(found.rows))])}
    columns = tuple(_column(name, unit, np.array(values)) for name, (unit, values) in varied.items())
    drawn = []
    for way in dict.fromkeys(ways):
        rows = [n for n, one in enumerate(ways) if one == way]
        panels = []
        for metric in named_metrics(PLOTS):
            curves = [curve for place in range(len(varied)) for curve in _curves(found, metric, varied, place, rows)]
            if curves:
                panels.append(Panel(metric.named(found.box), "" if metric.unit == "-" else metric.shown_unit, tuple(curves)))
        said = f"{len(rows)} shifts; points are runs, lines their means, and the bands their spread."
        if panels:
            drawn.append(Description(f"{found.title}: {way}", said, "", "", columns, tuple(panels)))
    return drawn


def _column(name: str, unit: str, values: np.ndarray) -> Column:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = ROOM * (high - low) or 1.0
    return Column(low - room, high + room, f"{name} [{unit}]" if unit else name)


def _curves(
    found: Campaign, metric: Metric, varied: Mapping[str, tuple[str, list[float]]], place: int, rows: Sequence[int]
) -> list[Curve]:
    """Return the points of a metric over a condition, and a line of means for each set of the others, if these are few."""
    name = list(varied)[place]
    others = {other: one for other, one in varied.items() if other != name}
    groups: dict[tuple[float, ...], list[tuple[float, float]]] = {}
    for n in rows:
        x, value = varied[name][1][n], found.rows[n].get(metric.key)
        if value is not None and np.isfinite(x):
            groups.setdefault(tuple(values[n] for _, values in others.values()), []).append((x, value * metric.factor))
    lined = len(groups) <= len(CURVES) and any(len({x for x, _ in points}) > 1 for points in groups.values())
    curves = []
    if not lined and groups:
        x, y = np.array(sorted(point for points in groups.values() for point in points)).T
        return [Curve(metric.key, "", "", CURVES[0], POINTS, x, y, column=place)]
    for (key, points), colour in zip(sorted(groups.items()), CURVES):
        x, y = np.array(sorted(points)).T
        at = np.unique(x)
        parts = [y[x == one] for one in at]
        mean, low, high = (np.array([function(part) for part in parts]) for function in (np.mean, np.min, np.max))
        text = ", ".join(f"{value:g} {unit}".strip() for (unit, _), value in zip(others.values(), key))
        curves.append(Curve(metric.key, text, text, colour, SOLID, at, mean, band=(low, high), column=place))
        curves.append(Curve(metric.key, "", "", colour, POINTS, x, y, column=place))
    return curves
