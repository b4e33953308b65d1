# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run, or of a folder of runs, as one self-contained HTML page; `rig report --html` writes it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..analysis import (
    ENDS,
    FAILED,
    GRADES,
    MISSED,
    NOT_FOUND,
    OF_A_RUN,
    POOR,
    UNDECIDED,
    Result,
    begun_lines,
    bench_lines,
    counted,
    energy_names,
    measured_lines,
    named_metrics,
    number,
    range_text,
    results_of,
    sentence_of,
    shift_name,
    shown,
    shown_transmission,
    spread_cells,
    undefined_lines,
    verdicts_in,
    without_trips,
)
from ..rig import Transmission
from .page import Part, figures, lines, page, table, words

if TYPE_CHECKING:
    from .figure import Description
    from .page import Cell

ABREAST = 4  # shifts side by side in a table
MOST_IN_TABLES = 24  # largest number of shifts whose metrics are on the page
MOST_SETTINGS = 60
HOW = {"simulate": "simulated without messages", "run": "run on the node graph"}


@dataclass
class Facts:
    """Facts that a page shows beside the report.

    Attributes
    ----------
    source : list of (str, str)
        Names and values of the provenance: the file and its identification.
    compared : bool
        True when the settings were compared with the rig's own.
    settings : list of (str, str, str)
        Settings that differ from the rig's own: name, the rig's value, that of the run.
    settings_note : str
        Reason why the settings are not complete, if they are not.
    changes : list of (float, str)
        Settings that changed during the run: time [s] and new value.
    warnings : list of str
        Sentences on problems.
    """

    source: list[tuple[str, str]] = field(default_factory=list)
    compared: bool = False
    settings: list[tuple[str, str, str]] = field(default_factory=list)
    settings_note: str = ""
    changes: list[tuple[float, str]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def report_page(report: Mapping, facts: Facts, shifts: Sequence[Description], runs: Sequence[Description]) -> str:
    """Return the page of a run; a section for which the run has no content is left out.

    Parameters
    ----------
    report : mapping
        Report of build_report or report_of_recording; ``limits`` in it are the verdicts of analysis.limits.
    facts : Facts
        Facts that are not in the report.
    shifts, runs : sequence of Description
        The figures of its shifts, of the first ones where there are many, and of the whole run.
    """
    run = report["run"]
    rig = (run.get("configuration") or {}).get("name") or (report.get("basis") or {}).get("rig")
    title = ": ".join(str(one) for one in (rig, run.get("sequence")) if one) or "Report"
    box = shown_transmission(dict(report)) if "bench" not in report else None
    about = [str(run["description"])] if run.get("description") else []
    more = len(report["shifts"]) - len(shifts)
    note = [f"Figures of the first {len(shifts)} shifts; {more} more are in the bag."] if shifts and more > 0 else []
    drawn = [("The run", figures(runs, "run"))]  # of a rig without gears it has the results
    return page(
        title,
        [
            ("", [*words(about), *_summary(report)]),
            ("Warnings", _warnings(report, facts, box)),
            ("Shifts", [*figures(shifts, "shift"), *words(note, "note")]),
            *([] if box else drawn),
            ("What was run", _what_was_run(run)),
            ("Limits", _limits(report.get("limits") or [])),
            *(_of_gears(report, box) if box else _of_bench(report)),
            *(drawn if box else []),
            ("Energy", _energy(report, box)),
            ("Settings", _settings(facts)),
            ("Provenance", _provenance(report, facts, box)),
        ],
    )


def heading_of(number: int, row: Mapping, box: Transmission) -> str:
    """Return the name of a shift as a heading, e.g. ``Shift 1, I → II at 3.85 s``."""
    name = shift_name(number, row, box, " → ")
    return name[0].upper() + name[1:]


# ---- the head of the page


def _summary(report: Mapping) -> list[Part]:
    """Return the verdicts on the run, each in its colour."""
    found: list[Part] = []
    grades = [one["grade"] for one in verdicts_in(report) if one and one["grade"]] if report["shifts"] else []
    if grades:
        counts = ", ".join(f"{grades.count(grade)} {grade}" for grade in GRADES if grade in grades)
        worst = max(grades, key=GRADES.index)
        found += words([f"Quality of {len(grades)} shift{'s' * (len(grades) > 1)}: {counts}."], worst)
    if limits := report.get("limits"):
        counts = counted(limits)
        css = "missed" if MISSED in counts or NOT_FOUND in counts else "undecided" if UNDECIDED in counts else "met"
        found += words([f"Limits: {', '.join(f'{count} {word}' for word, count in counts.items())}."], css)
    return found


def _warnings(report: Mapping, facts: Facts, box: Transmission | None) -> list[Part]:
    run, sentences = report["run"], list(facts.warnings)
    end = run.get("end")
    if isinstance(end, Mapping) and end.get("state") not in (None, "ended"):
        sentences.append(f"The run did not end as planned: {end.get('reason') or 'the reason is unknown'}.")
    if off := without_trips(run):
        sentences.append(f"{off[0].upper()}{off[1:]}.")
    sentences += run.get("problems", [])
    for place, (row, verdict) in enumerate(zip(report["shifts"], verdicts_in(report)), 1):
        name = heading_of(place, row, box) if box else ""
        sentences += [f"{name}, is {sentence_of(verdict)}."] if _bad(verdict) else []
        sentences += [f"{name}, is not valid: {reason}." for reason in row["why"]]
    return words(dict.fromkeys(sentences), "warn")


def _bad(verdict: Mapping | None) -> bool:
    return verdict is not None and verdict["grade"] in (POOR, FAILED)


def _what_was_run(run: Mapping) -> list[Part]:
    controller, parameters, end = run.get("controller") or {}, run.get("parameters") or {}, run.get("end")
    rows = [
        ("rig", (run.get("configuration") or {}).get("name")),
        ("sequence", run.get("sequence")),
        ("parameters", ", ".join(f"{name} = {value}" for name, value in parameters.items())),
        ("how", HOW.get(run.get("mode", ""), run.get("mode"))),
        ("controller", _controller(controller)),
        ("duration", None if run.get("duration_s") is None else f"{run['duration_s']:.2f} s"),
        ("end", end.get("reason") if isinstance(end, Mapping) else end),
    ]
    return table((), [(name, str(value)) for name, value in rows if value], "text")


def _controller(controller: Mapping) -> str:
    if not controller:
        return ""
    delay = controller.get("delay")
    late = "" if delay in (None, 1) else f", answers act {delay} samples later"
    return f"{controller.get('name')} at level {controller.get('level')}{late}"


def _limits(verdicts: Sequence[Mapping]) -> list[Part]:
    rows: list[list[Cell]] = []
    for one in verdicts:
        error = number(one["error"], one["digits"])
        value = shown(one["value"], one["error"], one["digits"]) + (f"\n± {error}" if error else "")
        unit = "" if one["unit"] == "-" else one["unit"]
        css = one["verdict"].replace(" ", "").replace("notfound", "missed")
        rows.append([f"{one['name']}\n{one['place']}", value, range_text(one), unit, (one["verdict"], css)])
    note = (
        "Undecided: the limit lies within the measuring error of the value."
        if any(one["verdict"] == UNDECIDED for one in verdicts)
        else ""
    )
    return [*table(["result", "value", "limit", "unit", "verdict"], rows), *words([note], "note")]


# ---- results


def _of_gears(report: Mapping, box: Transmission) -> list[tuple[str, list[Part]]]:
    return [("Results of the shifts", _shifts(report, box)), ("What was measured", _measured(report, box))]


def _shifts(report: Mapping, box: Transmission) -> list[Part]:
    rows, verdicts = report["shifts"], verdicts_in(report)
    parts: list[Part] = []
    metrics = named_metrics()
    by_place = _by_shift(results_of(report), len(rows), len(metrics))
    judged = {(one["place"], one["key"]): one["verdict"] for one in report.get("limits") or []}
    for first in range(0, min(len(rows), MOST_IN_TABLES), ABREAST):
        part = range(first, min(first + ABREAST, len(rows), MOST_IN_TABLES))
        cells_of: list[list[Cell]] = []
        for column, metric in enumerate(metrics):
            cells = [_cell(by_place[i][column], judged) for i in part]
            if any(by_place[i][column].value is not None for i in part):
                unit = "" if metric.unit == "-" else f" [{metric.shown_unit}]"
                cells_of.append([f"{metric.named(box)}{unit}", *cells])
        cells_of.append(["valid", *(("yes", "") if rows[i]["valid"] else ("no", "failed") for i in part)])
        grades = [(verdicts[i] or {}).get("grade") or "-" for i in part]
        cells_of.append(["quality", *((grade, grade if grade in GRADES else "") for grade in grades)])
        parts += table(["metric", *(heading_of(i + 1, rows[i], box) for i in part)], cells_of)
    names = [heading_of(i + 1, row, box) for i, row in enumerate(rows)]
    said = [*undefined_lines(names, rows, metrics, box), *begun_lines(names, rows, report.get("uncertainty") or [], box)]
    parts += words([f"{line}." for line in said], "note")
    if len(rows) > MOST_IN_TABLES:
        parts += words([f"The other {len(rows) - MOST_IN_TABLES} of {len(rows)} shifts are in report.json."], "note")
    notes = [
        f"{heading_of(place, row, box)}, is {sentence}."
        for place, (row, one) in enumerate(zip(rows, verdicts), 1)
        if not _bad(one) and (sentence := sentence_of(one))
    ]
    if rows:
        notes.append("Beside each value: its largest measuring error, where it is known, and the verdict on a limit.")
    return [*parts, *words(notes, "note")]


def _by_shift(results: Sequence[Result], shifts: int, columns: int) -> list[Sequence[Result]]:
    return [results[i * columns : (i + 1) * columns] for i in range(shifts)]


def _cell(result: Result, judged: Mapping[tuple[str, str], str]) -> Cell:
    value, _, error = result.text.partition(" ± ")
    verdict = judged.get((result.place, result.key), "")
    small = ", ".join(one for one in (f"± {error}" if error else "", verdict) if one)
    return (f"{value}\n{small}" if small else value, verdict if verdict in (MISSED, UNDECIDED) else "")


def _measured(report: Mapping, box: Transmission) -> list[Part]:
    if "measured" not in report:
        return []
    results = results_of(report)[len(report["shifts"]) * len(named_metrics()) :]
    rows = [[f"{one.name}\n{one.place}", one.text, "" if one.unit == "-" else one.unit] for one in results if one.value is not None]
    return [*table(["result", "value", "unit"], rows), *words(measured_lines(report["measured"], box), "note")]


def _of_bench(report: Mapping) -> list[tuple[str, list[Part]]]:
    results = [one for one in results_of(report) if one.kind not in ENDS]
    rows = [
        [one.name if one.place == OF_A_RUN else f"{one.name}\n{one.place}", one.text, "" if one.unit == "-" else one.unit]
        for one in results
    ]
    tests = report["bench"].get("slip_tests")
    parts = [*table(["result", "value", "unit"], rows), *(lines(bench_lines(report["bench"])) if tests else [])]
    numbers = [
        [row["signal"], *(f"{row[key]:z.4g}" for key in ("lowest", "mean", "highest")), row["unit"]]
        for row in report.get("signals", [])
    ]
    return [("Results", parts), ("Signals", table(["signal", "lowest", "mean", "highest", "unit"], numbers))]


# ---- the rest


def _energy(report: Mapping, box: Transmission | None) -> list[Part]:
    if box is None:
        rows = [
            [row["signal"], f"{row['last']:z.6g}", row["unit"]] for row in report.get("signals", []) if row["quantity"] == "energy"
        ]
        return table(["at the end of the run", "value", "unit"], rows)
    accounts = [("run", report["energy"]["run"])]
    shifts = zip(report["shifts"][:MOST_IN_TABLES], report["energy"]["shifts"])
    accounts += [(heading_of(place, row, box), account) for place, (row, account) in enumerate(shifts, 1)]
    accounts = [(name, account) for name, account in accounts if account]
    parts: list[Part] = []
    for first in range(0, len(accounts), ABREAST):
        part = accounts[first : first + ABREAST]
        rows = [
            [f"{text} [J]", *("-" if one[f"{name}_j"] is None else f"{one[f'{name}_j']:z.0f}" for _, one in part)]
            for name, text in energy_names(box).items()
            if any(one.get(f"{name}_j") is not None for _, one in part)
        ]
        rows.append(["unaccounted [J]", *(f"{one['residual_j']:z.2f}" for _, one in part)])
        parts += table(["energy", *(name for name, _ in part)], rows)
    return parts


def _settings(facts: Facts) -> list[Part]:
    rows = [list(row) for row in facts.settings[:MOST_SETTINGS]]
    more = len(facts.settings) - len(rows)
    notes = [facts.settings_note] if facts.settings_note else []
    notes += [f"{more} more settings differ; the bag holds all of them."] if more > 0 else []
    if not rows and not notes and facts.compared:
        notes = ["All settings are the rig's own."]
    changes = [[f"{t:.3f} s", text] for t, text in facts.changes]
    settings = table(["setting", "the rig's own", "in this run"], rows, "text")
    return [*settings, *words(notes, "note"), *table(["changed at", "to"], changes, "text")]


def _provenance(report: Mapping, facts: Facts, box: Transmission | None) -> list[Part]:
    run, rows = report["run"], list(facts.source)
    late = run.get("lateness_ms")
    parent = run.get("parent") or {}
    rows += [(f"version of {name}", str(version)) for name, version in (run.get("versions") or {}).items()]
    if record := run.get("configuration"):
        digest = hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
        rows.append(("configuration", f"rig {record.get('name')}, SHA-256 of its record {digest[:16]}"))
    rows += [("seed", str(run["seed"]))] if run.get("seed") is not None else []
    if any(value is not None for value in run.values()):
        rows.append(("messages lost", "unknown" if run.get("lost") is None else str(run["lost"])))
    rows += [("recorded from", f"{run['recorded_from_s']:.3f} s")] if run.get("recorded_from_s") else []
    if late:
        shown = ", ".join(
            f"{name} {late[key]:.2f}"
            for key, name in (("p50", "median"), ("p99", "p99"), ("max", "largest"))
            if late.get(key) is not None
        )
        rows.append(("lateness of ticks", f"{shown} ms; {run['overruns']} of {run['ticks']} ticks more than one tick late"))
    if parent:
        rows.append(("parent", f"{parent.get('bag')}, run again through {parent.get('through')}"))
        rows.append(("hash of the parent", str(parent.get("hash"))))
    if (basis := report.get("basis")) and box is not None and (report["shifts"] or any((report.get("measured") or {}).values())):
        taken = ", which were taken because the recording does not name its own" if basis.get("taken") else ""
        rows.append(
            ("inertias", f"{basis['inertia_driving']:g} and {basis['inertia_driven']:g} kg m2 of rig {basis['rig']}{taken}")
        )
        rows.append(("ratios", ", ".join(f"{gear} {ratio:.4f}" for gear, ratio in basis["ratios"].items())))
    return table((), rows, "text")


# ---- a folder of runs


def campaign_page(
    title: str,
    about: Sequence[str],
    runs: tuple[Sequence[str], Sequence[Sequence[Cell]]],
    spread: Sequence[Mapping],
    warnings: Sequence[str],
    limits: tuple[Sequence[Mapping], Sequence[Mapping]],
    drawn: Sequence[Description],
) -> str:
    """Return the page of a folder of runs.

    Parameters
    ----------
    title : str
        Title of the page.
    about : sequence of str
        Sentences that describe the runs.
    runs : (sequence of str, sequence of rows)
        Headings and rows of the table of the runs.
    spread : sequence of mapping
        Rows of results.spread over all runs.
    warnings : sequence of str
        Sentences on runs that did not end as planned.
    limits : (sequence of mapping, sequence of mapping)
        All verdicts on limits, and those that the page lists.
    drawn : sequence of Description
        Figures of the metrics over what was varied.
    """
    head, rows = runs
    verdicts, listed = limits
    known = any(row["error"] is not None for row in spread)
    ends = ["lowest", "mean", "highest", *(["error"] if known else [])]
    numbers = [
        [row["kind"], row["name"], "" if row["unit"] == "-" else row["unit"], str(row["runs"]), *spread_cells(row)]
        + ([number(row["error"], row["digits"])] if known else [])
        for row in spread
    ]
    return page(
        title,
        [
            ("", [*words(about), *_summary({"shifts": [], "limits": verdicts})]),
            ("Warnings", words(warnings, "warn")),
            ("Limits", _limits(listed)),
            ("Metrics over what was varied", figures(drawn, "way")),
            ("Runs", table(head, rows)),
            ("Spread over all runs", table(["of", "result", "unit", "values", *ends], numbers)),
        ],
    )
