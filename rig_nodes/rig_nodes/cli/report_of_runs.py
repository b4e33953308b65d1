# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig report` of a folder of runs, as `rig procedure` and `rig sweep` leave it; and the pages that `rig report` writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..analysis import (
    MET,
    Member,
    aligned,
    judged_members,
    limit_lines,
    members_in,
    named_shifts,
    read_procedure,
    spread,
    spread_lines,
    table_of,
    warnings_of,
)
from ..base import RigError, atomic_write, optional, printable, quoted

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from ..analysis import Limit
    from ..view import Description

LOST = 3  # exit code: the report is made, but runs are missing in it
UNFINISHED = "the sweep is not finished"
OF_ONE_RUN = (("annex_a", "annex-a"), ("truth", "truth"))


def is_folder_of_runs(path: Path) -> bool:
    """Return True for a folder without a bag of its own in which there are runs or a sweep."""
    if not path.is_dir() or any(path.glob("*.mcap")):
        return False
    from ..studies import SWEEP

    return (path / SWEEP).exists() or any(path.glob("*/report.json"))


def write_pages(args: argparse.Namespace, make: Callable[[], str]) -> None:
    """Write the page of a report to the files of --html and --pdf."""
    if args.html is None and args.pdf is None:
        return
    page = make()
    if args.html is not None:
        atomic_write(args.html, page)
    if args.pdf is not None:
        from ..view import pdf_of

        atomic_write(args.pdf, pdf_of(page))


def report_folder(args: argparse.Namespace, limits: list[Limit]) -> int:
    """Print the table of a folder of runs with its spread, and write the pages that were asked for."""
    for name, option in OF_ONE_RUN:
        if getattr(args, name):
            raise RigError(f"--{option} is for a single recording; {args.run} is a folder of runs")
    folder = Path(args.run)
    title, about, members = _read(folder)
    verdicts = [one.as_dict() for one in judged_members(members, limits)]
    listed = [one for one in verdicts if one["verdict"] != MET] or verdicts
    head, rows = table_of(members)
    spreads, warnings = spread(member.results for member in members), warnings_of(members)
    if args.json:
        runs = [{"series": one.label, "run": one.name, "results": [result.as_dict() for result in one.results]} for one in members]
        content = {"runs": runs, "spread": spreads, "limits": verdicts}
        print(json.dumps(content, indent=2, ensure_ascii=False), flush=True)
    else:
        lines = [*aligned([head, *rows]), "", "spread over all runs", *spread_lines(spreads), *warnings, *limit_lines(listed)]
        print("\n".join(map(printable, lines)), flush=True)

    def make() -> str:
        from ..view import campaign_page

        return campaign_page(title, about, (head, rows), spreads, warnings, (verdicts, listed), _figures(folder, False))

    write_pages(args, make)
    if args.picture is not None:
        _draw(args, folder)
    unfinished = [text for text in about if text.startswith(UNFINISHED)]
    for text in unfinished:
        print(f"rig: {printable(folder)}: {printable(text)}", file=sys.stderr)
    return LOST if unfinished else 0


def _figures(folder: Path, wanted: bool) -> list[Description]:
    """Return the figures of a folder; ``wanted`` is True where one without any is refused."""
    from ..view import figures_of_campaign, read_campaign

    try:
        return figures_of_campaign(read_campaign(folder))
    except RigError:
        if wanted:
            raise
        return []


def _draw(args: argparse.Namespace, folder: Path) -> None:
    """Draw a change of gears over what was varied: the first, or that of --shift."""
    optional("matplotlib")
    from ..view import draw_figure, write_figure

    drawn = _figures(folder, True)
    number = 1 if args.shift is None else args.shift
    if not 1 <= number <= len(drawn):
        raise RigError(f"--shift {number}: these runs have {len(drawn)} changes of gears, each with a figure")
    write_figure(draw_figure(drawn[number - 1], args.dark), args.picture)


def _read(folder: Path) -> tuple[str, list[str], list[Member]]:
    """Return title, sentences on what was run, and the runs of a folder."""
    from ..studies import SWEEP

    if (folder / SWEEP).exists():
        return _of_sweep(folder)
    content, members = read_procedure(folder), members_in(folder)
    about = [content["description"], f"Source: {content['source']}."] if content else []
    about.append(f"{len(members)} runs of {len({one.label for one in members})} series; the table has the mean of each series.")
    return f"Procedure {content['procedure']}" if content else f"Runs in {folder.name or folder.absolute().name}", about, members


def _of_sweep(folder: Path) -> tuple[str, list[str], list[Member]]:
    from ..analysis import OF_A_RUN, Result, instruments_of, quality_of, results_of, uncertainty
    from ..rig import load_rig
    from ..studies import SWEEP_JOURNAL, decode, plan_of, read_manifest

    manifest = read_manifest(folder)
    plan = plan_of(manifest["plan"])
    config = load_rig(plan.rig, plan.fixed)
    record = config.as_dict()
    box = config.transmission if config.structure.gears else None
    instruments = instruments_of(record) if box else {}
    units = {one.name: f" {one.unit}" if one.unit else "" for one in plan.varied}
    path, members = folder / SWEEP_JOURNAL, []
    lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
    entries = [entry for line in lines if (entry := decode(line)) is not None]
    for entry in sorted(entries, key=lambda entry: entry["member"]):
        values = ", ".join(f"{name} = {_written(value)}{units.get(name, '')}" for name, value in entry["values"].items())
        label, failed = values or f"seed {entry['seed']}", entry["end"]["state"] != "ended"
        results, grades = [], []
        if box is not None and entry["shifts"]:
            errors = [uncertainty(row, instruments, box) for row in entry["shifts"]]
            results = results_of({"run": {"configuration": record}, "shifts": entry["shifts"], "uncertainty": errors})
            grades = [one["grade"] for row in entry["shifts"] if (one := quality_of(row, box)) and one["grade"]]
        for row in entry.get("table", {}).get("rows", ()):
            columns = entry["table"]["columns"].items()
            results += [
                Result(name, name, OF_A_RUN, OF_A_RUN, unit, 4, cell)
                for (name, unit), cell in zip(columns, row)
                if unit and cell is not None
            ]
        name, reason = f"member {entry['member']}", entry["end"]["reason"] if failed else ""
        members.append(Member(label, name, results, grades, reason, named_shifts(name, entry), box))
    if not members:
        raise RigError(f"{folder}: no member of this sweep is finished; go on with it: ./rig sweep {quoted(folder)}")
    about = [f"{len(members)} members of a sweep of rig {config.name} over {', '.join(one.name for one in plan.varied)}."]
    if len(members) < manifest["members"]:
        rest = f"{len(members)} of {manifest['members']} members are finished; go on with it: ./rig sweep {quoted(folder)}"
        about.append(f"{UNFINISHED}: {rest}")
    return f"Sweep {plan.name}", about, members


def _written(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
