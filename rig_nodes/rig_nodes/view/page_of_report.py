# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run, or of a folder of runs, as one self-contained HTML page; `rig report --html` writes it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

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
    shown,
    shown_transmission,
    spread_cells,
    undefined_lines,
    verdicts_in,
    without_trips,
)
from ..rig import Transmission
from .html_page import Cell, page, table
from .report_plots import MOST_SHIFTS, Plots, heading_of

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


def report_page(report: Mapping, facts: Facts, plots: Plots | None) -> str:
    """Return the page of a run; a section for which the run has no content is left out.

    Parameters
    ----------
    report : mapping
        Report of build_report or report_of_recording; ``limits`` in it are the verdicts of analysis.limits.
    facts : Facts
        Facts that are not in the report.
    plots : Plots or None
        The plots of the run.
    """
    run = report["run"]
    rig = (run.get("configuration") or {}).get("name") or (report.get("basis") or {}).get("rig")
    title = ": ".join(str(one) for one in (rig, run.get("sequence")) if one) or "Report"
    box = shown_transmission(dict(report)) if "bench" not in report else None
    parts = [f"<p>{escape(str(run['description']))}</p>"] if run.get("description") else []
    parts += [_summary(report), *_warnings(report, facts, box)]
    parts += [*_what_was_run(run), *_limits(report.get("limits") or [])]
    if box is not None:
        parts += [*_shifts(report, box), *_measured(report, box)]
    else:
        parts += _bench(report)
    if plots is not None:
        parts += _plots(plots)
    return page(title, [*parts, *_energy(report, box), *_settings(facts), *_provenance(report, facts, box)])


def _section(title: str, parts: Iterable[str]) -> list[str]:
    """Return a section with its heading; nothing when it has no part."""
    found = [one for one in parts if one]
    return [f"<h2>{escape(title)}</h2>", *found] if found else []


def _words(texts: Iterable[str], kind: str = "") -> str:
    css = f' class="{kind}"' if kind else ""
    return "".join(f"<p{css}>{escape(text)}</p>" for text in texts)


def _lines(lines: Sequence[str]) -> str:
    return f'<div class="wide"><pre>{escape(chr(10).join(lines))}</pre></div>' if lines else ""


# ---- the head of the page


def _summary(report: Mapping) -> str:
    """Return one or two lines with the verdict on the run."""
    sentences = []
    grades = [one["grade"] for one in verdicts_in(report) if one and one["grade"]] if report["shifts"] else []
    if grades:
        counts = ", ".join(f"{grades.count(grade)} {grade}" for grade in GRADES if grade in grades)
        worst = max(grades, key=GRADES.index)
        sentences.append(f'Quality of {len(grades)} shift{"s" * (len(grades) > 1)}: <b class="{worst}">{counts}</b>.')
    if limits := report.get("limits"):
        counts = counted(limits)
        css = "missed" if MISSED in counts or NOT_FOUND in counts else "undecided" if UNDECIDED in counts else "met"
        text = ", ".join(f"{count} {word}" for word, count in counts.items())
        sentences.append(f'Limits: <b class="{css}">{text}</b>.')
    return f"<p>{' '.join(sentences)}</p>" if sentences else ""


def _warnings(report: Mapping, facts: Facts, box: Transmission | None) -> list[str]:
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
    return _section("Warnings", [_words(dict.fromkeys(sentences), "warn")])


def _bad(verdict: Mapping | None) -> bool:
    return verdict is not None and verdict["grade"] in (POOR, FAILED)


def _what_was_run(run: Mapping) -> list[str]:
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
    shown = [(name, str(value)) for name, value in rows if value]
    return _section("What was run", [table((), shown, "text")] if shown else [])


def _controller(controller: Mapping) -> str:
    if not controller:
        return ""
    delay = controller.get("delay")
    late = "" if delay in (None, 1) else f", answers act {delay} samples later"
    return f"{controller.get('name')} at level {controller.get('level')}{late}"


def _limits(verdicts: Sequence[Mapping]) -> list[str]:
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
    return _section(
        "Limits",
        [table(["result", "value", "limit", "unit", "verdict"], rows) if rows else "", _words([note], "note") if note else ""],
    )


# ---- results


def _shifts(report: Mapping, box: Transmission) -> list[str]:
    rows, verdicts, parts = report["shifts"], verdicts_in(report), []
    metrics = named_metrics()
    by_place = _by_shift(results_of(report), len(rows), len(metrics))
    judged = {(one["place"], one["key"]): one["verdict"] for one in report.get("limits") or []}
    for first in range(0, min(len(rows), MOST_IN_TABLES), ABREAST):
        part = range(first, min(first + ABREAST, len(rows), MOST_IN_TABLES))
        lines: list[list[Cell]] = []
        for column, metric in enumerate(metrics):
            cells = [_cell(by_place[i][column], judged) for i in part]
            if any(by_place[i][column].value is not None for i in part):
                lines.append([f"{metric.named(box)}{'' if metric.unit == '-' else f' [{metric.shown_unit}]'}", *cells])
        lines.append(["valid", *(("yes", "") if rows[i]["valid"] else ("no", "failed") for i in part)])
        grades = [(verdicts[i] or {}).get("grade") or "-" for i in part]
        lines.append(["quality", *((grade, grade if grade in GRADES else "") for grade in grades)])
        parts.append(table(["metric", *(heading_of(i + 1, rows[i], box) for i in part)], lines))
    names = [heading_of(i + 1, row, box) for i, row in enumerate(rows)]
    parts += [_words([f"{line}."], "note") for line in undefined_lines(names, rows, metrics, box)]
    parts += [_words([f"{line}."], "note") for line in begun_lines(names, rows, report.get("uncertainty") or [], box)]
    if len(rows) > MOST_IN_TABLES:
        parts.append(_words([f"The other {len(rows) - MOST_IN_TABLES} of {len(rows)} shifts are in report.json."], "note"))
    notes = [
        f"{heading_of(place, row, box)}, is {sentence}."
        for place, (row, one) in enumerate(zip(rows, verdicts), 1)
        if not _bad(one) and (sentence := sentence_of(one))
    ]
    if rows:
        notes.append("Beside each value: its largest measuring error, where it is known, and the verdict on a limit.")
    return _section("Shifts", [*parts, _words(notes, "note")])


def _by_shift(results: Sequence[Result], shifts: int, columns: int) -> list[Sequence[Result]]:
    return [results[i * columns : (i + 1) * columns] for i in range(shifts)]


def _cell(result: Result, judged: Mapping[tuple[str, str], str]) -> Cell:
    value, _, error = result.text.partition(" ± ")
    verdict = judged.get((result.place, result.key), "")
    small = ", ".join(one for one in (f"± {error}" if error else "", verdict) if one)
    return (f"{value}\n{small}" if small else value, verdict if verdict in (MISSED, UNDECIDED) else "")


def _measured(report: Mapping, box: Transmission) -> list[str]:
    if "measured" not in report:
        return []
    results = results_of(report)[len(report["shifts"]) * len(named_metrics()) :]
    rows = [[f"{one.name}\n{one.place}", one.text, "" if one.unit == "-" else one.unit] for one in results if one.value is not None]
    lines = measured_lines(report["measured"], box)
    return _section("What was measured", [table(["result", "value", "unit"], rows) if rows else "", _words(lines, "note")])


def _bench(report: Mapping) -> list[str]:
    results = [one for one in results_of(report) if one.kind not in ENDS]
    rows = [
        [one.name if one.place == OF_A_RUN else f"{one.name}\n{one.place}", one.text, "" if one.unit == "-" else one.unit]
        for one in results
    ]
    tests = report["bench"].get("slip_tests")
    parts = [table(["result", "value", "unit"], rows) if rows else "", _lines(bench_lines(report["bench"])) if tests else ""]
    numbers = [
        [row["signal"], *(f"{row[key]:z.4g}" for key in ("lowest", "mean", "highest")), row["unit"]]
        for row in report.get("signals", [])
    ]
    ranges = table(["signal", "lowest", "mean", "highest", "unit"], numbers) if numbers else ""
    return [*_section("Results", parts), *_section("Signals", [ranges])]


def _plots(plots: Plots) -> list[str]:
    figures = plots.shift_figures()
    note = f"Plots of the first {MOST_SHIFTS} shifts; {plots.left_out} more are in the bag." if plots.left_out else ""
    legend = (
        "Shaded: the phases, as the bars name them. Dashed lines: order, kiss point, departure of the output, lock-up."
        if figures
        else ""
    )
    return [
        *_section(
            "Plots of the shifts", [_words([legend], "note") if legend else "", *figures, _words([note], "note") if note else ""]
        ),
        *_section("Plots of the run", [plots.run_figure()]),
    ]


# ---- the rest


def _energy(report: Mapping, box: Transmission | None) -> list[str]:
    if box is None:
        rows = [
            [row["signal"], f"{row['last']:z.6g}", row["unit"]] for row in report.get("signals", []) if row["quantity"] == "energy"
        ]
        return _section("Energy", [table(["at the end of the run", "value", "unit"], rows) if rows else ""])
    accounts = [("run", report["energy"]["run"])]
    shifts = zip(report["shifts"][:MOST_IN_TABLES], report["energy"]["shifts"])
    accounts += [(heading_of(place, row, box), account) for place, (row, account) in enumerate(shifts, 1)]
    accounts = [(name, account) for name, account in accounts if account]
    parts = []
    for first in range(0, len(accounts), ABREAST):
        part = accounts[first : first + ABREAST]
        rows = [
            [f"{text} [J]", *("-" if one[f"{name}_j"] is None else f"{one[f'{name}_j']:z.0f}" for _, one in part)]
            for name, text in energy_names(box).items()
            if any(one.get(f"{name}_j") is not None for _, one in part)
        ]
        rows.append(["unaccounted [J]", *(f"{one['residual_j']:z.2f}" for _, one in part)])
        parts.append(table(["energy", *(name for name, _ in part)], rows))
    return _section("Energy", parts)


def _settings(facts: Facts) -> list[str]:
    rows = [list(row) for row in facts.settings[:MOST_SETTINGS]]
    more = len(facts.settings) - len(rows)
    parts = [table(["setting", "the rig's own", "in this run"], rows, "text") if rows else ""]
    notes = [facts.settings_note] if facts.settings_note else []
    notes += [f"{more} more settings differ; the bag holds all of them."] if more > 0 else []
    if not rows and not notes and facts.compared:
        notes = ["All settings are the rig's own."]
    changes = [[f"{t:.3f} s", text] for t, text in facts.changes]
    parts += [_words(notes, "note"), table(["changed at", "to"], changes, "text") if changes else ""]
    return _section("Settings", parts)


def _provenance(report: Mapping, facts: Facts, box: Transmission | None) -> list[str]:
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
    return _section("Provenance", [table((), rows, "text") if rows else ""])


# ---- a folder of runs


def campaign_page(
    title: str,
    about: Sequence[str],
    runs: tuple[Sequence[str], Sequence[Sequence[Cell]]],
    spread: Sequence[Mapping],
    warnings: Sequence[str],
    limits: tuple[Sequence[Mapping], Sequence[Mapping]],
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
            _words(about),
            _summary({"shifts": [], "limits": verdicts}),
            *_section("Warnings", [_words(warnings, "warn")]),
            *_limits(listed),
            *_section("Runs", [table(head, rows) if rows else ""]),
            *_section("Spread over all runs", [table(["of", "result", "unit", "values", *ends], numbers) if numbers else ""]),
        ],
    )
