# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run or of a folder of runs, or a comparison, as one self-contained HTML page.

`rig report --html` and `rig compare --html` write it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..analysis import (
    ENDS,
    FAILED,
    GRADES,
    MISSED,
    NO_SEQUENCE,
    NOT_FOUND,
    OF_A_RUN,
    POOR,
    UNDECIDED,
    Result,
    begun_lines,
    bench_lines,
    clock_lines,
    counted,
    measured_lines,
    metric_tables,
    named_metrics,
    not_accounted,
    number,
    range_text,
    reasons,
    results_of,
    results_of_shift,
    sentence_of,
    shift_name,
    short_names,
    shown,
    shown_transmission,
    signal_tables,
    spread_cells,
    trip_lines,
    undefined_lines,
    verdicts_in,
)
from ..base import number_text
from ..rig import Transmission
from .facts import MADE, energy_rows, facts_of, problems_of
from .figure_of_compare import figures_of_compare
from .figure_of_shift import MOST
from .page import Part, figures, lines, page, table, words
from .pages import Pages

if TYPE_CHECKING:
    from ..analysis import Comparison
    from .figure import Description
    from .page import Cell

ABREAST = 4  # shifts side by side in a table
MOST_IN_TABLES = 24  # largest number of shifts whose metrics are on the page
MOST_SETTINGS = 60


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
    named = "ordered by hand" if run.get("sequence") == NO_SEQUENCE else run.get("sequence")
    title = ": ".join(str(one) for one in (rig, named) if one) or "Report"
    box = shown_transmission(dict(report)) if "bench" not in report else None
    about = [str(run["description"])] if run.get("description") else []
    drawn = [("The run", figures(runs, "run"))]  # of a rig without gears it has the results
    return page(
        title,
        [
            ("", [*words(about), *_summary(report)]),
            ("Warnings", _warnings(report, facts, box)),
            ("Shifts", figures(shifts, "shift", len(report["shifts"]) if shifts else 0)),
            *([] if box else drawn),
            ("What was run", table((), [one for one in facts_of(report).items() if one[0] in MADE], "text")),
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
    sentences = [*problems_of(report, facts.warnings), *trip_lines(report["run"])]
    for place, (row, verdict) in enumerate(zip(report["shifts"], verdicts_in(report)), 1):
        name = heading_of(place, row, box) if box else ""
        sentences += [f"{name}, is {sentence_of(verdict)}."] if _bad(verdict) else []
        sentences += [f"{name}, is not valid: {reason}." for reason in row["why"]]
    return words(dict.fromkeys(sentences), "warn")


def _bad(verdict: Mapping | None) -> bool:
    return verdict is not None and verdict["grade"] in (POOR, FAILED)


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
    by_place = [results_of_shift(report, number, box) for number in range(1, min(len(rows), MOST_IN_TABLES) + 1)]
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
        limits = ", and the verdict on a limit" if judged else ""
        notes.append(f"Beside each value: its largest measuring error, where it is known{limits}.")
    known = [metric for metric in metrics if any(row.get(metric.key) is not None for row in rows[:MOST_IN_TABLES])]
    meanings = table((), [[metric.named(box), metric.text] for metric in known], "text note")  # some differ in their time only
    return [*parts, *words(notes, "note"), *meanings]


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
    words_of = _words_of(report)
    numbers = [
        [_named(words_of, row["signal"]), *(number_text(row[key] + 0.0) for key in ("lowest", "mean", "highest")), row["unit"]]
        for row in report.get("signals", [])
    ]
    return [("Results", parts), ("Signals", table(["signal", "lowest", "mean", "highest", "unit"], numbers))]


def _words_of(report: Mapping) -> Callable[[str], str]:
    """Return what gives a signal its words; without a record of the rig it keeps its name."""
    record = report["run"].get("configuration")
    return Pages(record).words if record else str


def _named(words_of: Callable[[str], str], name: str) -> str:
    """Return the words of a signal with its name in small letters, by which it is found in a file."""
    return name if words_of(name) == name else f"{words_of(name)}\n{name}"


# ---- the rest


def _energy(report: Mapping, box: Transmission | None) -> list[Part]:
    if box is None:
        words_of = _words_of(report)
        rows = [
            [words_of(row["signal"]), f"{row['last']:z.6g}", row["unit"]]
            for row in report.get("signals", [])
            if row["quantity"] == "energy"
        ]
        return table(["at the end of the run", "value", "unit"], rows)
    accounts = [("run", report["energy"]["run"])]
    shifts = zip(report["shifts"][:MOST_IN_TABLES], report["energy"]["shifts"])
    accounts += [(heading_of(place, row, box), account) for place, (row, account) in enumerate(shifts, 1)]
    accounts = [(name, account) for name, account in accounts if account]
    parts: list[Part] = []
    for first in range(0, len(accounts), ABREAST):
        part = accounts[first : first + ABREAST]
        parts += table(["energy [J]", *(name for name, _ in part)], energy_rows([one for _, one in part], box))
    return [*parts, *words([f"{note}." for note in [not_accounted(report["run"])] if note], "note")]


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
    rows = [*facts.source, *((name, value) for name, value in facts_of(report).items() if name not in MADE)]
    if record := report["run"].get("configuration"):
        digest = hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
        rows.append(("configuration", f"rig {record.get('name')}, SHA-256 of its record {digest[:16]}"))
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


# ---- a comparison


def compare_page(found: Comparison, pages: Pages) -> str:
    """Return the page of a comparison: each shift of all recordings over each other, clocks, metrics and signals.

    Parameters
    ----------
    found : Comparison
        The comparison.
    pages : Pages
        The pages of the first recording's rig.
    """
    assert pages.box is not None  # runs with shifts are compared
    clocks = [
        [name, f"{clock.offset * 1e3:z.2f}", f"{clock.drift * 1e6:z.1f}", clock.by if n else "the first clock"]
        for n, (name, clock) in enumerate(zip(short_names(found.names), found.clocks))
    ]
    drawn = figures_of_compare(found, pages)
    about = table(["recording", "offset ms", "drift ppm", "aligned by"], clocks)
    about += words(line.strip() for line in clock_lines(found) if line.startswith("  "))
    metrics = [part for head, rows in metric_tables(found, pages.box) for part in table(head, rows)]
    signals = [part for head, rows in signal_tables(found, pages.known.signals) for part in table(head, rows)]
    signals += words([f"-: {line}" for line in reasons(found, pages.box)], "note")
    about += figures(drawn[:MOST], "shift", len(drawn))
    return page("Comparison", [("", about), ("Metrics of shifts", metrics), ("Signals", signals)])
