# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of many runs: metrics of their shifts over what was varied, a line with its spread for each set of the others.

`rig report FOLDER` shows them for the folder of a measuring procedure and of a sweep, and the table of a sweep in Python.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..analysis import PLOTS, REPORT_FILE, RPM, faults_at, named_metrics, read_procedure, read_report, shown_transmission
from ..base import RigError
from ..rig import load_rig
from ..studies import SWEEP, SWEEP_JOURNAL, decode, plan_of, read_manifest, rows_of
from .figure import POINTS, SOLID, Column, Curve, Description, Panel, column_of
from .palette import CURVES

if TYPE_CHECKING:
    from ..analysis import Metric
    from ..rig import Transmission
    from ..studies import Plan

MOST = 3  # conditions that are columns
ROW = "row"  # what the columns show where nothing was varied
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")
_SHOWN = {"rad/s": ("rpm", RPM), "Pa": ("MPa", 1e-6)}


class Condition(NamedTuple):
    """What was varied: its unit, its value in each row, NaN for a run without it, and its words, of which the values are places."""

    unit: str
    values: list[float]
    words: tuple[str, ...] = ()

    def text(self, value: float) -> str:
        """Return a value as people read it."""
        if not np.isfinite(value):
            return "not set"
        return self.words[int(value)] if self.words else f"{value:g} {self.unit}".strip()

    def column(self, name: str) -> Column:
        """Return the column of the metrics over it."""
        if self.words:
            return Column(-0.5, len(self.words) - 0.5, name, names=self.words)
        return column_of(np.array(self.values), f"{name} [{self.unit}]" if self.unit else name)


@dataclass(frozen=True)
class Campaign:
    """The shifts of many runs with their varied conditions.

    Parameters
    ----------
    title : str
        Name of the campaign.
    conditions : dict of str to Condition
        What was varied.
    rows : list of mapping
        Metrics of one shift each (analysis.metrics).
    box : Transmission
        The transmission that was shifted.
    """

    title: str
    conditions: dict[str, Condition]
    rows: list[Mapping[str, Any]]
    box: Transmission


def read_campaign(path: str | Path) -> Campaign:
    """Return the campaign of a folder of runs or of a sweep; RigError when no run of it has a shift."""
    folder = Path(path)
    found = _of_sweep(folder) if (folder / SWEEP).exists() else _of_reports(folder)
    if found is None:
        raise RigError(f"{folder}: no run of it has a shift, whose metrics could be drawn")
    return found


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
    for run in sorted(one.parent for one in folder.glob(f"*/{REPORT_FILE}")):
        report = read_report(run) or {}
        if box is None and report.get("shifts"):
            try:
                box = shown_transmission(report)
            except RigError as error:
                raise RigError(f"{run / REPORT_FILE}: {error}") from None
        for row in report.get("shifts", []):
            rows.append(row)
            start, about = row.get("t_order_s") or 0.0, report["run"]
            ill = faults_at(about.get("faults") or (), start, start + (row.get("course_s") or 0.0))
            given.append({**(of_series.get(run.name) or about.get("parameters") or {}), "faults": ", ".join(ill) or "no fault"})
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
    varied = [one for one in plan.varied if one.of != "seed"]  # runs that differ in the seed alone are the spread
    given = [{one.name: f"{row[one.name]} {one.unit or ''}".strip() for one in varied} for row in shifts]
    return Campaign(f"Sweep {plan.name}", conditions_of(given), shifts, box) if shifts else None


def conditions_of(given: Sequence[Mapping[str, object]]) -> dict[str, Condition]:
    """Return the conditions that differ between rows; two that are always alike are one. Numbers of several units are words."""
    found: dict[str, Condition] = {}
    for name in dict.fromkeys(name for one in given for name in one):
        texts = [str(one.get(name, "")) for one in given]
        read = [_NUMBER.fullmatch(text) for text in texts]
        units = {match[2] if match else None for match, text in zip(read, texts) if text}
        words = tuple(dict.fromkeys(filter(None, texts))) if len(units) > 1 or None in units else ()
        unit, factor = ("", 1.0) if words else _SHOWN.get(written := next(iter(units), ""), (written, 1.0))
        numbers = [factor * float(match[1]) if match else np.nan for match in read]
        if words:
            numbers = [words.index(text) if text else np.nan for text in texts]
        one = Condition(unit, numbers, words)
        if len({value for value in numbers if np.isfinite(value)}) > 1 and str(one) not in map(str, found.values()):
            found[name] = one
    return found


def figures_of_campaign(found: Campaign) -> list[Description]:
    """Return a figure for each change of gears, with a column for each condition and a plot for each metric."""
    ways = [found.box.way(row["from_gear"], row["to_gear"], " → ") for row in found.rows]
    varied = found.conditions or {ROW: Condition("", [float(n + 1) for n in range(len(found.rows))])}
    shown = list(varied)[:MOST]
    columns = tuple(varied[name].column(name) for name in shown)
    drawn = []
    for way in dict.fromkeys(ways):
        rows = [n for n, one in enumerate(ways) if one == way]
        panels = []
        for metric in named_metrics(PLOTS):
            curves = [curve for place, name in enumerate(shown) for curve in _curves(found.rows, metric, varied, name, place, rows)]
            if curves:
                panels.append(Panel(metric.named(found.box), "" if metric.unit == "-" else metric.shown_unit, tuple(curves)))
        lines = any(one.style == SOLID for panel in panels for one in panel.curves)
        said = f"{len(rows)} shifts; points are runs{', lines their means, and the bands their spread' * lines}."
        said += f" Varied too: {', '.join(list(varied)[MOST:])}." if len(varied) > MOST else ""
        if panels:
            drawn.append(Description(f"{found.title}: {way}", said, "", "", columns, tuple(panels)))
    return drawn


def _curves(
    all_rows: Sequence[Mapping], metric: Metric, varied: Mapping[str, Condition], name: str, place: int, rows: Sequence[int]
) -> list[Curve]:
    """Return the points of a metric over a condition, and a line of means for each set of all others, if these are few."""
    others = [one for other, one in varied.items() if other != name]
    groups: dict[tuple[float, ...], list[tuple[float, float]]] = {}
    for n in rows:
        x, value = varied[name].values[n], all_rows[n].get(metric.key)
        if value is not None and np.isfinite(x):
            groups.setdefault(tuple(one.values[n] for one in others), []).append((x, value * metric.factor))
    lined = name != ROW and len(groups) <= len(CURVES) and any(len({x for x, _ in points}) > 1 for points in groups.values())
    curves = []
    if not lined and groups:
        x, y = np.array(sorted(point for points in groups.values() for point in points)).T
        return [Curve(metric.key, "", "", CURVES[0], POINTS, x, y, column=place)]
    for (key, points), colour in zip(sorted(groups.items()), CURVES):
        x, y = np.array(sorted(points)).T
        at = np.unique(x)
        parts = [y[x == one] for one in at]
        mean, low, high = (np.array([function(part) for part in parts]) for function in (np.mean, np.min, np.max))
        text = ", ".join(one.text(value) for one, value in zip(others, key))
        curves.append(Curve(metric.key, text, text, colour, SOLID, at, mean, band=(low, high), column=place))
        curves.append(Curve(metric.key, "", "", colour, POINTS, x, y, column=place))
    return curves
