# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes a campaign as a Rerun file: metrics of the shifts over the conditions that were varied, and a table of all runs.

`rig view FOLDER` writes it for the folder of a measuring procedure, in which each run has its report, and for that of a sweep.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis import (
    PLOTS,
    REPORT_FILE,
    RPM,
    Metric,
    instruments_of,
    named_metrics,
    read_procedure,
    read_report,
    shown_transmission,
    uncertainty,
)
from ..bags import BAG_SUFFIXES, PACKED, UNREADABLE, rig_record
from ..base import RigError, quoted
from ..rig import Transmission, transmission_of
from . import layout
from .convert import APPLICATION, VIEW_FILE, import_rerun
from .document import markdown_table
from .palette import clutch_colour, rgb

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint

SWEEP = "sweep.json"  # of a sweep that has begun
RESULTS, MANIFEST = "results.parquet", b"rig_nodes.sweep"  # results of a sweep, and the key of its metadata on how it was made
AXIS = "condition"  # timeline on which the values of conditions are shown
MOST_CONDITIONS, MOST_ROWS = 3, 200
ROOM = 0.3  # share of an axis left free behind the points, for the legend
DOT = 0.01  # size of a point, as a share of the axis
COLUMN, MOST_TEXT = 0.037, 0.5  # share of the width for a column of the table, and the largest share for the whole table
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")
_PREFIXES = {0: "", 3: "m", 6: "µ"}
_WITH_PREFIX = ("s", "A", "m", "V", "N", "W")


@dataclass(frozen=True)
class Campaign:
    """Runs of a campaign: the name of each row's run, its varied conditions, and its metrics.

    Parameters
    ----------
    title : str
        Name of the campaign.
    names : list of str
        Name of the run of each row.
    conditions : dict of str to (str, list of float)
        Unit and value of each condition, row by row; NaN for a run without this condition.
    rows : list of mapping
        Metrics of one shift each (analysis.metrics).
    errors : list of mapping
        Largest errors of each row's metrics (analysis.measured_error).
    box : Transmission
        The transmission that was shifted.
    """

    title: str
    names: list[str]
    conditions: dict[str, tuple[str, list[float]]]
    rows: list[Mapping[str, Any]]
    errors: list[Mapping[str, float]]
    box: Transmission


def is_campaign(path: str | Path) -> bool:
    """Return True for a folder that holds no bag itself, but the reports of several runs or a sweep's results."""
    folder = Path(path)
    if not folder.is_dir() or any(one.name.removesuffix(PACKED).endswith(BAG_SUFFIXES) for one in folder.iterdir()):
        return False
    return (folder / SWEEP).exists() or (folder / RESULTS).exists() or bool(_reports(folder))


def read_campaign(path: str | Path) -> Campaign:
    """Return the campaign of a folder; RigError when no run of it has a shift."""
    folder = Path(path)
    if (folder / SWEEP).exists() and not (folder / RESULTS).exists():
        raise RigError(f"{folder}: the sweep is not finished; go on with it by: ./rig sweep {quoted(folder)}")
    found = _of_sweep(folder) if (folder / RESULTS).exists() else _of_reports(folder)
    if found is None:
        raise RigError(
            f"{folder}: no run of this campaign has a shift to show; look at one of its runs with: rig view {folder}/RUN"
        )
    return found


def _reports(folder: Path) -> list[Path]:
    return sorted(one.parent for one in folder.glob(f"*/{REPORT_FILE}"))


def _of_reports(folder: Path) -> Campaign | None:
    names, rows, errors, given, box = [], [], [], [], None
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
        own = report.get("uncertainty") or []
        for n, row in enumerate(report.get("shifts", [])):
            names.append(run.name)
            rows.append(row)
            errors.append(own[n] if n < len(own) else {})
            given.append(of_series.get(run.name) or report["run"].get("parameters") or {})
    return None if box is None else Campaign(folder.name, names, _conditions(given), rows, errors, box)


def _of_sweep(folder: Path) -> Campaign | None:
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(folder / RESULTS)
    except (OSError, ValueError) as error:
        raise RigError(f"{folder / RESULTS}: cannot be read ({' '.join(str(error).split())}); finish the sweep again") from None
    first = table.schema.names.index("from_gear") if "from_gear" in table.schema.names else 0
    varied = [name for name in table.schema.names[:first] if name not in ("member", "seed", "shift")]
    units = {name: (table.schema.field(name).metadata or {}).get(b"unit", b"").decode() for name in varied}
    rows = [row for row in table.to_pylist() if row.get("from_gear") is not None]
    if not rows:
        return None
    given = [{name: f"{row[name]} {units[name]}" if row[name] is not None else "" for name in varied} for row in rows]
    try:
        record = rig_record(json.loads((table.schema.metadata or {})[MANIFEST])["configuration"])
        box, instruments = transmission_of(record), instruments_of(record)
    except UNREADABLE as error:
        raise RigError(
            f"{folder / RESULTS}: does not name its rig ({type(error).__name__}: {error}); make the sweep anew"
        ) from None
    errors = [uncertainty(row, instruments, box) for row in rows]
    return Campaign(folder.name, [str(row["member"]) for row in rows], _conditions(given), rows, errors, box)


def _conditions(given: Sequence[Mapping[str, object]]) -> dict[str, tuple[str, list[float]]]:
    """Return the numbers among the conditions that differ between rows."""
    out = {}
    for name in dict.fromkeys(name for one in given for name in one):
        read = [_NUMBER.fullmatch(str(one.get(name, ""))) for one in given]
        units = {match[2] for match in read if match}
        values = [float(match[1]) if match else np.nan for match in read]
        if len(units) == 1 and len({value for value in values if np.isfinite(value)}) > 1:
            out[name] = _shown(units.pop(), values)
    same: dict[tuple, str] = {}  # two parameters that always have the same value are one condition
    for name, (unit, values) in out.items():
        same.setdefault((unit, tuple(values)), name)
    return {name: out[name] for name in same.values()}


def _shown(unit: str, values: list[float]) -> tuple[str, list[float]]:
    """Return a unit to show and the values in it, so large that the axis, which has whole numbers only, is finer than a dot."""
    if unit == "rad/s":
        unit, values = "rpm", [value * RPM for value in values]
    if unit == "Pa":
        unit, values = "kPa", [1e-3 * value for value in values]
    for power in _PREFIXES:
        scaled = [value * 10.0**power for value in values]
        finite = [one for one in scaled if np.isfinite(one)]
        if power == max(_PREFIXES) or all(abs(one - round(one)) <= DOT * (max(finite) - min(finite)) for one in finite):
            break
    if power and unit in _WITH_PREFIX:
        return _PREFIXES[power] + unit, scaled
    return (f"{10.0**-power:g} {unit}".strip() if power else unit), scaled


def write_campaign(path: str | Path, only: bool = False, picture: Path | None = None) -> Path:
    """Write the file of a campaign, whole or not at all, and return its path.

    Parameters
    ----------
    path : str or Path
        The folder.
    only : bool
        True to hide the viewer's own bars.
    picture : Path, optional
        File to write in place of the one in the folder.

    Raises
    ------
    RigError
        When no run has a shift or the file cannot be written.
    """
    rr = import_rerun()
    found, target = read_campaign(path), picture or Path(path, VIEW_FILE)
    shown = dict(list(found.conditions.items())[:MOST_CONDITIONS]) or {"row": ("", [float(n + 1) for n in range(len(found.rows))])}
    ways = list(dict.fromkeys(_way(found, row) for row in found.rows))
    metrics = [one for one in named_metrics(PLOTS) if any(row.get(one.key) is not None for row in found.rows)]
    rec = rr.RecordingStream(APPLICATION, recording_id="campaign", send_properties=False)
    try:
        handle, name = tempfile.mkstemp(prefix=".view-", suffix=".rrd", dir=target.parent)
    except OSError as error:
        raise RigError(f"{target}: cannot be written ({error.strerror}); copy the campaign to a writable folder") from None
    os.close(handle)
    try:
        document, width = _document(found, shown)
        plots = {one.key: (one.heading(found.box), _height(found, one)) for one in metrics}
        rec.save(name, default_blueprint=_blueprint(shown, plots, min(COLUMN * width, MOST_TEXT), only))
        # the viewer draws the line of its present time at the very first row
        left = min(_ends(values)[0] for _, values in shown.values())
        for condition, (_, values) in shown.items():
            for one in metrics:
                for n, way in enumerate(ways):
                    points = [
                        (round(x), row[one.key] * one.factor)
                        for x, row in zip(values, found.rows)
                        if _way(found, row) == way and row.get(one.key) is not None and np.isfinite(x)
                    ]
                    if points:
                        at, y = zip((left, np.nan), *sorted(points))
                        place = f"{one.key}/{condition.replace('.', '_')}/{n}"
                        look = rr.SeriesPoints(names=way, colors=rgb(clutch_colour(n)), markers="circle", marker_sizes=3.5)
                        rec.log(place, look, static=True)
                        rec.send_columns(place, [rr.TimeColumn(AXIS, sequence=at)], rr.Scalars.columns(scalars=y))
        rec.log("report", rr.TextDocument(document, media_type="text/markdown"), static=True)
        rec.flush()
        rec.disconnect()
        os.chmod(name, 0o644)  # mkstemp makes the file private
        os.replace(name, target)
    finally:
        Path(name).unlink(missing_ok=True)
    return target


def _way(found: Campaign, row: Mapping) -> str:
    names = found.box.names
    return " → ".join(names.get(row[key], str(row[key])) for key in ("from_gear", "to_gear"))


def _ends(values: Sequence[float]) -> tuple[int, int]:
    """Return the ends of the axis of a condition."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = max(0.05 * (high - low), 1.0)
    return round(low - room), round(high + room + ROOM * (high - low))


def _height(found: Campaign, metric: Metric) -> tuple[float, float]:
    values = [row[metric.key] * metric.factor for row in found.rows if row.get(metric.key) is not None]
    return layout.height(min(values), max(values))


def _blueprint(
    conditions: Mapping[str, tuple[str, list[float]]], plots: Mapping[str, tuple[str, tuple[float, float]]], text: float, only: bool
) -> Blueprint:
    """Return a grid: a row for each metric with its heading and range, a column for each condition; ``text``: the table's share."""
    import rerun as rr
    import rerun.blueprint as rrb

    columns = []
    for n, (condition, (unit, values)) in enumerate(conditions.items()):
        start, end = (rr.TimeRangeBoundary.absolute(seq=at) for at in _ends(values))
        axis = rrb.TimeAxis(link="Independent", view_range=rr.TimeRange(start=start, end=end))
        name = f"{condition} [{unit}]" if unit else condition
        views = [
            rrb.TimeSeriesView(
                name=f"{heading} over {name}",
                origin=f"/{key}/{condition.replace('.', '_')}",
                axis_x=axis,
                axis_y=rrb.ScalarAxis(range=height),
                plot_legend=rrb.PlotLegend("RightTop", visible=not n),
                interaction=rrb.PlotInteraction(points_display="Always"),
            )
            for key, (heading, height) in plots.items()
        ]
        columns.append(rrb.Vertical(*views))
    shares = [(1.0 - text) / len(columns)] * len(columns) + [text]
    content = rrb.Horizontal(*columns, rrb.TextDocumentView(name="Campaign", origin="/report"), column_shares=shares)
    return layout.whole(content, *(("hidden", "hidden") if only else ("collapsed", "expanded")), "paused", AXIS)


def _document(found: Campaign, conditions: Mapping[str, tuple[str, list[float]]]) -> tuple[str, int]:
    """Return the table of all shifts as a document, and its number of columns."""
    columns = named_metrics(PLOTS)
    head = ["run", *(f"{name} {unit}".strip() for name, (unit, _) in conditions.items() if name != "row"), "shift"]
    rows = [[*head, *(one.heading(found.box) for one in columns), "valid"]]
    for n, (name, row, own) in enumerate(zip(found.names, found.rows, found.errors)):
        held = [f"{values[n]:g}" for condition, (_, values) in conditions.items() if condition != "row"]
        rows.append(
            [name, *held, _way(found, row), *(one.cell(row, own) for one in columns), "yes" if row.get("valid") else "**no**"]
        )
    more = len(rows) - 1 - MOST_ROWS
    parts = [f"# {found.title}", f"{len(set(found.names))} runs, {len(found.rows)} shifts", markdown_table(rows[: MOST_ROWS + 1])]
    return "\n\n".join(parts + ([f"and {more} more"] if more > 0 else [])) + "\n", len(rows[0])
