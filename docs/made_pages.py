# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pages of docs/made/, written from the program when the site is built: nothing of them is typed twice or kept in git.

conf.py names it as an extension of Sphinx.
"""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

import fault_pictures
import promises

import rig_nodes
from rig_nodes.base import Parser
from rig_nodes.cli import list as listed
from rig_nodes.cli.faults import page as faults_page
from rig_nodes.cli.main import VERBS, module_of
from rig_nodes.rig import page as parameters_page
from rig_nodes.rigs.hydmag.laboratory import document
from rig_nodes.studies import laboratory, of_rig
from rig_nodes.studies.faults.score import page_of_faults

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sphinx.application import Sphinx

DOCS = Path(__file__).parent
SCORES = DOCS / "reference" / "fault_benchmark.json"  # of rig faults bench --json, which takes minutes too
STORED = DOCS / "reference" / "validation.json"  # of rig validate --json, which takes too long for a build


def setup(app: Sphinx) -> dict[str, bool]:
    """Have the pages written before Sphinx looks for pages."""
    app.connect("config-inited", lambda *_: write())
    return {"parallel_read_safe": True}


def write() -> None:
    """Write the pages into docs/made, with their pictures."""
    folder = DOCS / "made"
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")
    fault_pictures.draw(folder)


def pages() -> dict[str, str]:
    """Return the text of each page by the name of its file."""
    return {
        "signals.md": listed.markdown(),
        "parameters.md": parameters_page(),
        "faults.md": faults_page() + fault_pictures.page(),
        "fault_benchmark.md": page_of_faults(json.loads(SCORES.read_text(encoding="utf-8"))),
        "metrics.md": _metrics(),
        "settings.md": _of_rig("settings", "Settings", "[Settings](../how_to/settings.md) says how they are changed."),
        "trips.md": _of_rig("trips", "Trips", "[Rigs](../how_to/rigs.md#trips) says how a rig gives its own."),
        "command_line.md": _command_line(),
        "messages.md": _messages(),
        "api.md": _api(),
        "requirements.md": promises.page(),
        **_validation(),
    }


def _table(rows: Iterable[dict[str, str]]) -> str:
    rows = list(rows)
    lines = [list(rows[0]), ["---"] * len(rows[0]), *([str(cell) for cell in row.values()] for row in rows)]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def _metrics() -> str:
    return (
        "# Metrics of a shift\n\nAs `./rig list metrics` prints them; [how a powershift works](../learn/powershift.md) shows "
        "where they are measured.\n\n" + _table(listed.ROWS["metrics"]())
    )


def _of_rig(what: str, title: str, more: str) -> str:
    head = f"# {title} of the rig hydmag\n\nAs `./rig list {what}` prints them; `--rig NAME` has those of another rig. {more}\n\n"
    return head + _table(listed.OF_A_RIG[what](None))


def _command_line() -> str:
    parts = ["# Command line\n\nWhat `./rig VERB --help` prints.\n"]
    for verb in VERBS.own:
        module = module_of(verb)
        parser = Parser(prog=f"rig {verb}", description=module.HELP, allow_abbrev=False)
        module.add_arguments(parser)
        parts.append(f"## rig {verb}\n\n```text\n{parser.format_help().rstrip()}\n```\n")
    return "\n".join(parts)


def _messages() -> str:
    parts = ["# Messages\n\nThe ROS 2 messages of the package `rig_msgs`.\n"]
    for path in sorted((DOCS.parent / "msgs").glob("*/*.*")):
        if path.suffix in (".msg", ".srv", ".action"):
            parts.append(
                f"## {path.stem}\n\n`rig_msgs/{path.parent.name}/{path.stem}`\n\n```text\n{path.read_text().strip()}\n```\n"
            )
    return "\n".join(parts)


def _api() -> str:
    parts = ["# Python API\n\nThe names of `rig_nodes`; [from Python](../how_to/python.md) shows them at work.\n"]
    for name in rig_nodes.__all__:
        thing = getattr(rig_nodes, name)
        kind = "autoclass" if isinstance(thing, type) else "autofunction"
        members = "\n   :members:" if isinstance(thing, type) else ""
        parts.append(f"## {name}\n\n```{{eval-rst}}\n.. {kind}:: rig_nodes.{name}{members}\n```\n")
    return "\n".join(parts)


def _validation() -> dict[str, str]:
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    rows = document.rows_of(stored["rows"])
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(("row", "basis", "what is claimed", "where", "laboratory", "rig", "verdict"))
    writer.writerows((r.target.id, r.basis, r.target.text, r.target.where, laboratory(r), of_rig(r), r.verdict) for r in rows)
    text = document.document(rows, stored["summary"], document.load_explanations(), stored["rig"])
    return {"validation.md": text, "validation.csv": table.getvalue()}
