# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The results of many runs side by side, a row for each series of a procedure or each member of a sweep, and their spread.

`rig procedure` prints it, and `rig report` of a folder of runs prints it and makes a page of it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..base import RigError, atomic_write
from ..rig import Transmission
from .display import shown
from .limits import Limit, Verdict, judged
from .metrics import SHORT, metric_keys, named_metrics
from .quality import GRADES
from .results import ENDS, Result, results_of, spread
from .run_report import REPORT_FILE, plain, read_report, shown_transmission, verdicts_in
from .state_at_order import unlike
from .trips import without_trips

PROCEDURE_FILE = "procedure.json"
MOST_NAMED = 12  # runs that are named in a warning
_REPEAT = re.compile(r"-\d+$")


@dataclass
class Member:
    """One run.

    It has the label of its series, its name, its results, the grades of its shifts, why it did not end as planned, for the states
    at the orders the name, metrics and errors of each shift with their transmission, and whether its trips were off.
    """

    label: str
    name: str
    results: list[Result]
    grades: list[str] = field(default_factory=list)
    failed: str = ""
    shifts: list[tuple[str, Mapping, Mapping]] = field(default_factory=list)
    box: Transmission | None = None
    trips_off: bool = False


def member_of(label: str, name: str, report: Mapping) -> Member:
    """Return a run from its report."""
    end = report["run"].get("end")
    bad = isinstance(end, Mapping) and end.get("state") not in (None, "ended")
    grades = [one["grade"] for one in verdicts_in(report) if one and one["grade"]]
    box = shown_transmission(report) if report["shifts"] else None
    named, off = named_shifts(name, report), bool(without_trips(report["run"]))
    return Member(label, name, results_of(report), grades, str(end.get("reason")) if bad else "", named, box, off)


def named_shifts(name: str, report: Mapping) -> list[tuple[str, Mapping, Mapping]]:
    """Return each shift of a run with a name that tells it from those of other runs, its metrics and their errors."""
    rows, errors = report["shifts"], report.get("uncertainty", [])
    names = [f"{name} shift {k}" if len(rows) > 1 else name for k in range(1, len(rows) + 1)]
    return [(one, row, errors[k] if k < len(errors) else {}) for k, (one, row) in enumerate(zip(names, rows))]


def members_in(folder: Path) -> list[Member]:
    """Return the runs in the folders below a folder that have a report, in the order of the procedure, else of their names.

    Raises
    ------
    RigError
        When there is no run, or a report cannot be read.
    """
    labels = {run: one["label"] for one in read_procedure(folder).get("series", ()) for run in one["runs"]}
    names = [path.parent.name for path in folder.glob(f"*/{REPORT_FILE}")]
    order = {name: place for place, name in enumerate(labels)}
    names.sort(key=lambda name: (order.get(name, len(order)), _natural(name)))
    found = []
    for name in names:
        report = read_report(folder / name)
        if report is not None and "shifts" in report:
            try:
                found.append(member_of(labels.get(name, _REPEAT.sub("", name)), name, report))
            except RigError as error:
                raise RigError(f"{folder / name / REPORT_FILE}: {error}") from None
    if not found:
        raise RigError(
            f"{folder}: holds no run, and no folder in it has a {REPORT_FILE}; name the folder of a run or of several runs"
        )
    return found


def _natural(name: str) -> list:
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name)]


def read_procedure(folder: Path) -> dict:
    """Return what `rig procedure` wrote about a folder of runs; empty when it wrote nothing there."""
    path = folder / PROCEDURE_FILE
    if not path.exists():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not all(isinstance(one["label"], str) and isinstance(one["runs"], list) for one in content["series"]):
            raise TypeError("its series are no list of labels and runs")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RigError(
            f"{path}: is not what `rig procedure` writes ({error}); delete it, the reports beside it are enough"
        ) from None
    return content


def write_procedure(folder: Path, about: Mapping, series: Iterable[Mapping], members: Sequence[Member]) -> None:
    """Write ``procedure.json`` into the folder of a procedure: what was run, and what each series and all of them found.

    Parameters
    ----------
    folder : Path
        The folder.
    about : mapping
        Name, description and source of the procedure.
    series : iterable of mapping
        ``label`` and ``conditions`` of each series that was run.
    members : sequence of Member
        The runs.
    """
    rows = []
    for one in series:
        own = [member for member in members if member.label == one["label"]]
        rows.append({**one, "runs": [member.name for member in own], "found": spread(member.results for member in own)})
    content = {**about, "series": rows, "found": spread(member.results for member in members)}
    atomic_write(folder / PROCEDURE_FILE, json.dumps(plain(content), indent=2, ensure_ascii=False) + "\n")


def table_of(members: Sequence[Member]) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows: a row for each label with the mean of its runs.

    Of the metrics of shifts the table has those of the place SHORT, for shifts under load; results that only one kind of run has,
    such as an inertia, are there in full.
    """
    columns: dict[tuple[str, str], Result] = {}
    of_shifts, short = metric_keys(), [metric.key for metric in named_metrics(SHORT)]
    for one in (one for member in members for one in member.results):
        if one.value is None or one.kind in ENDS:
            continue
        if one.key not in of_shifts or (one.key in short and not one.kind.startswith("0-")):
            columns.setdefault((one.kind, one.key), one)
    several = len({one.kind for one in columns.values()}) > 1
    head = ["series", "runs", *(_heading(one, several) for one in columns.values())]
    graded = any(member.grades for member in members)
    labels = dict.fromkeys(member.label for member in members)
    rows = []
    for label in labels:
        own = [member for member in members if member.label == label]
        cells = [f"{label}, trips off" if any(member.trips_off for member in own) else label, str(len(own))]
        for key, column in columns.items():
            those = [one for member in own for one in member.results if (one.kind, one.key) == key and one.value is not None]
            error = max((one.error for one in those if one.error is not None), default=None)
            cells.append(shown(sum(one.value for one in those) / len(those) if those else None, error, column.digits))
        grades = [grade for member in own for grade in member.grades]
        rows.append([*cells, *([max(grades, key=GRADES.index) if grades else "-"] if graded else [])])
    return [*head, *(["worst quality"] if graded else [])], rows


def _heading(one: Result, several: bool) -> str:
    unit = "" if one.unit == "-" else f" {one.unit}"
    return f"{one.kind} {one.name}{unit}" if several else f"{one.name}{unit}"


def warnings_of(members: Sequence[Member]) -> list[str]:
    """Return sentences on the runs that did not end as planned, and on shifts of one way that began in different states."""
    bad = [member for member in members if member.failed]
    sentences = [f"{member.name} did not end as planned: {member.failed}" for member in bad[:MOST_NAMED]]
    sentences += [f"{len(bad) - MOST_NAMED} more runs did not end as planned"] if len(bad) > MOST_NAMED else []
    box = next((member.box for member in members if member.box), None)
    return sentences + (unlike([one for member in members for one in member.shifts], box) if box else [])


def judged_members(members: Sequence[Member], limits: Sequence[Limit]) -> list[Verdict]:
    """Return the verdicts on the results of all runs; the place of each begins with the name of its run."""
    named = [replace(one, place=f"{member.name}, {one.place}") for member in members for one in member.results]
    return judged(named, limits) if limits else []
