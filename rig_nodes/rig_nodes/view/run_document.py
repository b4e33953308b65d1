# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a run as a markdown document: its sequence and its end, steps, warnings, energy, settings.

view.convert uses it for the text of the tab Run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..analysis import energy_names, settings_of_run, shown_transmission
from ..rig import changed_settings
from .document import event_row, markdown_table

SEQUENCER = "sequencer"


def run_document(
    report: Mapping, record: Mapping, events: Sequence[tuple[float, str, str, str, float]], warnings: Sequence[str]
) -> str:
    """Return the page.

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
    run = report["run"]
    parts = [f"# {run.get('sequence') or 'Run'}"]
    if run.get("description"):
        parts.append(str(run["description"]))
    parts += ["## Run", markdown_table([["", "value"], *_rows(run, record)])]
    parts += ["## Warnings", *(_warnings(run, events, warnings) or ["none"])]
    if steps := [[f"{t:.2f}", text or name] for t, topic, name, text, _ in events if topic.strip("/").startswith(SEQUENCER)]:
        parts += ["## Steps", markdown_table([["s", "step"], *steps])]
    if energy := _energy(report):
        parts += ["## Energy of the run", markdown_table([["", "kJ"], *energy])]
    changed, note = changed_settings(record)
    parts += ["## Settings that differ from the installed rig", *([note] if note else [] if changed else ["none"])]
    parts += [markdown_table([["setting", "rig", "run"], *map(list, changed)])] if changed else []
    parts += ["## Settings", markdown_table([["setting", "value"], *map(list, settings_of_run(record))])]
    return "\n\n".join(parts) + "\n"


def _rows(run: Mapping, record: Mapping) -> list[list[str]]:
    end, controller, late = run.get("end"), run.get("controller"), run.get("lateness_ms")
    rows = [["rig", str(record.get("name", "unknown"))]]
    if isinstance(controller, Mapping):
        rows.append(["controller", f"{controller.get('name')} at level {controller.get('level')}"])
    rows.append(["end", str((end.get("reason") if isinstance(end, Mapping) else end) or "unknown")])
    if run.get("duration_s") is not None:
        rows.append(["duration s", f"{run['duration_s']:.2f}"])
    rows.append(["made by", {"simulate": "rig simulate"}.get(str(run.get("mode")), str(run.get("mode") or "unknown"))])
    rows.append(["seed", str(run.get("seed"))])
    rows.append(["messages lost", "unknown" if run.get("lost") is None else str(run["lost"])])
    if isinstance(late, Mapping):
        rows.append(
            ["lateness ms: median, p99, max", ", ".join(f"{late.get(key, 0.0) or 0.0:.2f}" for key in ("p50", "p99", "max"))]
        )
    return rows + [[str(name), str(version)] for name, version in (run.get("versions") or {}).items()]


def _warnings(run: Mapping, events: Sequence[tuple[float, str, str, str, float]], warnings: Sequence[str]) -> list[str]:
    rows = [event_row(t, topic, name, text) for t, topic, name, text, _ in events]
    lines = [*warnings, *map(str, run.get("problems", [])), *(text for text, level in rows if level != "INFO")]
    return ["\n".join(f"- {line}" for line in lines)] if lines else []


def _energy(report: Mapping) -> list[list[str]]:
    account = (report.get("energy") or {}).get("run") or {}
    names = energy_names(shown_transmission(report)) | {"residual": "unaccounted"}
    found = [(text, account.get(f"{name}_j")) for name, text in names.items()]
    return [[text, f"{1e-3 * value:z.3f}"] for text, value in found if value is not None]
