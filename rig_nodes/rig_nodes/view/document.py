# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run as a markdown document, for the text panel of the view.

view.convert uses it; keys, headings and units are those of the report (analysis.run_report).
"""

from __future__ import annotations

from itertools import zip_longest

from ..analysis import (
    begun_lines,
    bench_lines,
    clutch_heat,
    fixed,
    measured_lines,
    named_metrics,
    no_shift,
    numbered_way,
    range_lines,
    sentence_of,
    shift_name,
    shown_transmission,
    undefined_lines,
    verdicts_in,
)
from ..rig import Transmission

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


def report_document(report: dict, problems: list[str]) -> str:
    """Return tables of the shifts, or the results of the clutch bench, and of the run.

    Parameters
    ----------
    report : dict
        The report of analysis.run_report.
    problems : list of str
        Sentences on problems of the bag; they come first.
    """
    run, box = report["run"], shown_transmission(report)
    parts = [f"# {run.get('sequence') or 'Run'}"]
    if run.get("description"):
        parts.append(str(run["description"]))
    parts += [f"**{problem}**" for problem in [*problems, *run.get("problems", [])]]
    if "bench" in report:
        lines = bench_lines(report["bench"]) or range_lines(report.get("signals", []))
        parts += ["## Results", "```\n" + "\n".join(lines) + "\n```"] if lines else []
    else:
        parts += ["## Shifts", _shift_table(report, box) if report["shifts"] else no_shift(report)]
        parts += measured_lines(report["measured"], box) if "measured" in report else []
    for number, (row, verdict) in enumerate(zip(report["shifts"], verdicts_in(report)), 1):
        name = shift_name(number, row, box, ARROW)
        parts += [f"{name}, is {sentence}"] if (sentence := sentence_of(verdict)) else []
        parts += [f"{name}, is not valid: {reason}" for reason in row.get("why", [])]
    names = [shift_name(number, row, box, ARROW) for number, row in enumerate(report["shifts"], 1)]
    parts += undefined_lines(names, report["shifts"], named_metrics(), box)
    parts += begun_lines(names, report["shifts"], report.get("uncertainty") or [], box)
    end = run.get("end")
    reason = (end.get("reason") if isinstance(end, dict) else end) or "unknown"
    rows = _run_rows(report, box)
    half = -(-len(rows) // 2)
    pairs = zip_longest(rows[:half], rows[half:], fillvalue=["", ""])  # two entries a line, so that a picture shows them all
    table = [["", "value", "", "value"], *(left + right for left, right in pairs)]
    parts += ["## Run", f"End: {reason}", markdown_table(table)]
    return "\n\n".join(parts) + "\n"


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


def _run_rows(report: dict, box: Transmission) -> list[list[str]]:
    run = report["run"]
    rows = [["messages lost", "unknown" if run.get("lost") is None else str(run["lost"])]]
    if run.get("recorded_from_s"):
        rows.append(["recorded from s", fixed(run["recorded_from_s"], 1.0, 3)])
    late = run.get("lateness_ms")
    if late:
        rows += [[f"lateness {key} ms", fixed(late.get(key), 1.0, 2)] for key in ("p50", "p99", "max")]
        rows.append(["overruns", f"{run.get('overruns')} of {run.get('ticks')} ticks"])
    for number, (row, account) in enumerate(zip(report["shifts"], report.get("energy", {}).get("shifts", [])), 1):
        if account:
            rows.append([f"heat {numbered_way(number, row, box, ARROW)} J", fixed(clutch_heat(account, box), 1.0, 0)])
    rig = (run.get("configuration") or {}).get("name", "unknown")
    rows += [["rig", str(rig)], ["seed", str(run.get("seed"))]]
    rows += [[name, str(version)] for name, version in (run.get("versions") or {}).items()]
    return rows


def event_row(t: float, topic: str, name: str, text: str) -> tuple[str, str]:
    """Return the text that the list of events shows for an event, and its level; ``t`` is its time [s]."""
    level = next((level for part, level in LEVELS if part in name), "INFO")
    return f"{t:.3f} s  {topic.strip('/').split('/')[0]}: {text or name}", level


def markdown_table(rows: list[list[str]]) -> str:
    """Return rows as a markdown table, the first as its head."""
    head, *body = rows
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *body]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
