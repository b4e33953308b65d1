# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markdown of the view's text panels: the report of a run, and the page of the run with its steps, warnings, energy and settings.

view.convert uses it; keys, headings and units are those of the report (analysis.run_report).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..analysis import (
    begun_lines,
    bench_lines,
    clutch_heat,
    fixed,
    measured_lines,
    named_metrics,
    no_shift,
    numbered_way,
    range_cells,
    sentence_of,
    settings_of_run,
    shift_name,
    shown_transmission,
    undefined_lines,
    verdicts_in,
)
from ..rig import Transmission, changed_settings
from .facts import energy_rows, facts_of, problems_of

LEVELS = (
    ("tripped", "ERROR"),
    ("failed", "ERROR"),
    ("e_stop", "ERROR"),
    ("refused", "WARN"),
    ("fault_on", "WARN"),
    ("aborted", "WARN"),
)
ARROW = " → "
WIDEST = 4  # largest number of shifts side by side; with more, the table is transposed
SEQUENCER = "sequencer"


def report_document(report: dict, problems: list[str]) -> str:
    """Return tables of the shifts, or the results of the clutch bench, and of the run.

    Parameters
    ----------
    report : dict
        The report of analysis.run_report.
    problems : list of str
        Sentences on problems of the bag; they come first.
    """
    box, told = shown_transmission(report), facts_of(report)
    parts = [*_head(report), *(f"**{problem}**" for problem in problems_of(report, problems))]
    if "bench" in report:
        if lines := bench_lines(report["bench"]):
            parts += ["## Results", "```\n" + "\n".join(lines) + "\n```"]
        elif ranges := range_cells(report.get("signals", [])):  # a table, because the viewer wraps long lines
            parts += ["## Results", markdown_table(ranges)]
    else:
        parts += ["## Shifts", _shift_table(report, box) if report["shifts"] else no_shift(report)]
        parts += measured_lines(report["measured"], box) if "measured" in report else []
    names = [shift_name(number, row, box, ARROW) for number, row in enumerate(report["shifts"], 1)]
    for name, row, verdict in zip(names, report["shifts"], verdicts_in(report)):
        parts += [f"{name}, is {sentence}"] if (sentence := sentence_of(verdict)) else []
        parts += [f"{name}, is not valid: {reason}" for reason in row.get("why", [])]
    parts += undefined_lines(names, report["shifts"], named_metrics(), box)
    parts += begun_lines(names, report["shifts"], report.get("uncertainty") or [], box)
    end = told.pop("end", "unknown")
    for number, (row, account) in enumerate(zip(report["shifts"], report.get("energy", {}).get("shifts", [])), 1):
        if account:
            told[f"heat {numbered_way(number, row, box, ARROW)}"] = f"{fixed(clutch_heat(account, box), 1.0, 0)} J"
    return "\n\n".join([*parts, "## Run", f"End: {end}", *_facts(told)]) + "\n"


def run_document(
    report: Mapping, record: Mapping, events: Sequence[tuple[float, str, str, str, float]], warnings: Sequence[str]
) -> str:
    """Return the page of a run.

    Parameters
    ----------
    report : mapping
        The report of the run (analysis.run_report).
    record : mapping
        The rig's record in the bag.
    events : sequence of (float, str, str, str, float)
        Time [s], topic, name, text and value of each event.
    warnings : sequence of str
        Sentences on problems of the bag.

    Returns
    -------
    str
        Markdown.
    """
    rows = [event_row(t, topic, name, text) for t, topic, name, text, _ in events]
    bad = [*problems_of(report, warnings), *(text for text, level in rows if level != "INFO")]
    parts = [*_head(report), "## Run", *_facts(facts_of(report))]
    parts += ["## Warnings", "\n".join(f"- {line}" for line in bad) or "none"]
    if steps := [[f"{t:.3f}", text or name] for t, topic, name, text, _ in events if topic.strip("/").startswith(SEQUENCER)]:
        parts += ["## Steps", markdown_table([["s", "step"], *steps])]
    if energy := energy_rows([(report.get("energy") or {}).get("run") or {}], shown_transmission(report)):
        parts += ["## Energy of the run", markdown_table([["", "J"], *energy])]
    changed, note = changed_settings(record)
    parts += ["## Settings that differ from the installed rig", *([note] if note else [] if changed else ["none"])]
    parts += [markdown_table([["setting", "rig", "run"], *changed])] if changed else []
    parts += ["## Settings", markdown_table([["setting", "value"], *settings_of_run(record)])]
    return "\n\n".join(parts) + "\n"


def _facts(told: dict[str, str]) -> list[str]:
    """Return facts as a table of two columns; parameters, which may be long, above it, because the viewer wraps no table."""
    parameters = told.pop("parameters", "")
    return [*([f"Parameters: {parameters}"] if parameters else []), markdown_table([["", "value"], *told.items()])]


def _head(report: Mapping) -> list[str]:
    run = report["run"]
    return [f"# {run.get('sequence') or 'Run'}", *([str(run["description"])] if run.get("description") else [])]


def _shift_table(report: dict, box: Transmission) -> str:
    metrics, rows, errors = named_metrics(), report["shifts"], report.get("uncertainty") or []
    table = [["shift", *(one.heading(box) for one in metrics), "valid", "quality"]]
    for number, (row, verdict) in enumerate(zip(rows, verdicts_in(report)), 1):
        own = errors[number - 1] if number <= len(errors) else {}
        cells = [one.cell(row, own) for one in metrics]
        title = numbered_way(number, row, box, ARROW)
        table.append([title, *cells, "yes" if row.get("valid") else "**no**", (verdict or {}).get("grade") or "-"])
    if len(rows) <= WIDEST:
        table = [list(line) for line in zip(*table)]
    return markdown_table(table)


def event_row(t: float, topic: str, name: str, text: str) -> tuple[str, str]:
    """Return the text that the list of events shows for an event, and its level; ``t`` is its time [s]."""
    level = next((level for part, level in LEVELS if part in name), "INFO")
    return f"{t:.3f} s  {topic.strip('/').split('/')[0]}: {text or name}", level


def markdown_table(rows: Iterable[Iterable[str]]) -> str:
    """Return rows as a markdown table, the first as its head."""
    head, *body = map(list, rows)
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *body]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
