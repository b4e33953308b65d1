# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig report`: shift metrics and energy balance of a recorded run, computed anew from its bag.

It rewrites the report beside the bag and keeps from it the facts that only the run itself had (lateness, end). A report of another
run, or of a bag that has been damaged since, stays unchanged. A folder of runs, as procedures and
sweeps leave it, gets a table and its spread (cli.report_of_runs). ``--html`` and ``--pdf`` write a page, ``--picture`` the
figure of a shift.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from ..analysis import (
    FACTOR_B,
    REPORT_FILE,
    Limit,
    build_report,
    format_report,
    gather,
    info_of,
    is_of,
    judged,
    limit_lines,
    parse_limits,
    read_limits,
    read_report,
    results_of,
    what_was_lost,
    write_report,
)
from ..bags import NO_REPORT, faults_of, is_loggers_file, topic_of_today, with_end
from ..base import RigError, load_yaml, printable, quoted
from ..nodes import end_of, facts_of, lost_messages, run_part
from .output_files import OutputFile
from .report_of_runs import is_folder_of_runs, report_folder, write_pages
from .shared_arguments import add_dark, add_list, check_dark

if TYPE_CHECKING:
    import argparse

    from ..analysis import Gathered

HELP = "print the results of a run and rewrite its report.json, or make a page of them"
METADATA = "metadata.yaml"
LOST = 3  # exit code: the report is made, but something of the run is not in its bag


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("run", metavar="RUN", help="folder of a run, its .mcap file, or a folder of runs")
    parser.add_argument("--json", action="store_true", help="print the report as JSON instead of a table")
    parser.add_argument("--html", type=OutputFile("page"), metavar="FILE", help="write one self-contained page, which prints on A4")
    parser.add_argument(
        "--pdf", type=OutputFile("pdf"), metavar="FILE", help="print that page as PDF, with a Chromium or Chrome on the PATH"
    )
    parser.add_argument(
        "--picture",
        type=OutputFile("picture"),
        metavar="FILE",
        help="draw a shift, a run without shifts, or the shifts of a folder of runs, as .png or .svg",
    )
    parser.add_argument(
        "--shift", type=int, metavar="N", help="the shift, or of a folder of runs the change of gears, that --picture draws (1)"
    )
    add_dark(parser)
    add_list(parser, "--limit", "NAME=RANGE", "limits", "judge a result, e.g. t_c='.. 700 ms' or FROM-TO:k='0.95 ..'")
    parser.add_argument("--limits", metavar="FILE", dest="limits_file", help="the same from a .yaml file")
    parser.add_argument(
        "--annex-a", action="store_true", help="also by the recipe of the laboratory's program (Annex A), with the difference"
    )
    parser.add_argument("--factor", type=float, metavar="B", help=f"Annex A's factor of the settled torque ({FACTOR_B})")
    parser.add_argument("--truth", action="store_true", help="also results from the plant's states in the bag")


def main(args: argparse.Namespace) -> int:
    """Compute the report, print it and write it beside the bag; return 1 for a bag of which only a part is left."""
    if args.factor is not None and not args.annex_a:
        raise RigError("--factor is Annex A's; give --annex-a too")
    if args.factor is not None and not args.factor > 1.0:
        raise RigError(f"--factor is {args.factor:g}; it is the upper edge of a band around the settled torque, e.g. {FACTOR_B}")
    if args.shift is not None and args.picture is None:
        raise RigError("--shift says which shift --picture draws; give --picture too")
    check_dark(args)
    annex = (FACTOR_B if args.factor is None else args.factor) if args.annex_a else None
    if args.pdf is not None:
        from ..view import browser

        browser()  # refuses a machine without one before anything is computed
    limits = [*(read_limits(args.limits_file) if args.limits_file else []), *parse_limits(args.limits)]
    if is_loggers_file(args.run):
        raise RigError(
            f"{args.run}: is a logger's file; a run, which has a report, is made of it by ./rig import {quoted(args.run)}"
        )
    if is_folder_of_runs(Path(args.run)):
        return report_folder(args, limits)
    return _of_bag(args, annex, limits)


def _judge(report: dict, limits: list[Limit]) -> None:
    """Put the verdicts on the limits into a report."""
    if limits:
        report["limits"] = [one.as_dict() for one in judged(results_of(report), limits)]


def _show(report: dict, as_json: bool) -> None:
    if as_json:
        print(json.dumps(report, indent=2, ensure_ascii=False), flush=True)
        return
    print("\n".join([format_report(report), *map(printable, limit_lines(report.get("limits", ())))]), flush=True)


def _of_bag(args: argparse.Namespace, annex: float | None, limits: list[Limit]) -> int:
    bag = gather(args.run, annex_a=annex, recover=True)
    bag.check_began()
    path = Path(args.run)
    folder = path if path.is_dir() else path.parent
    old = read_report(folder)
    another = old is not None and not is_of(bag, old["run"])
    if another or (old and not bag.recovered and old["run"].get("recovered")):
        old = None  # it is of another run, or of this run while its bag was damaged
    run = old["run"] if old else _run_of(bag, folder, {} if another else facts_of(folder))
    run = run if bag.recovered else with_end(bag, run)
    damaged_since = bag.recovered and run.get("recovered") != bag.recovered
    if damaged_since:
        run = _run_of_the_rest(bag, folder, run, old is not None)
    report = build_report(bag, run, annex, args.truth)
    faults = [] if bag.recovered else faults_of(bag, run)
    if faults:
        report["run"]["problems"] = [*faults, *report["run"].get("problems", [])]
    _judge(report, limits)
    _show(report, args.json)
    if bag.recovered:
        print(f"rig: {bag.path} is damaged; the report is of what is left of it", file=sys.stderr)
    if another:
        print(f"rig: {folder / REPORT_FILE} is of another run and is left as it is", file=sys.stderr)
    elif damaged_since and old:
        print(f"rig: {folder / REPORT_FILE} was made when more of the bag was there and is left as it is", file=sys.stderr)
    else:
        write_report(folder, report)
    lost = what_was_lost(run)
    if not bag.recovered and lost:
        print(f"rig: not whole: {lost}", file=sys.stderr)

    def page() -> str:
        from ..api import page_of

        return page_of(bag, report, [f"Not whole: {lost}."] if lost else [])

    write_pages(args, page)
    if args.picture is not None:
        _draw(args, report)
    if faults:
        print(f"rig: {bag.path}: {printable('; '.join(faults))}", file=sys.stderr)
    return 1 if bag.recovered else LOST if faults else 0


def _draw(args: argparse.Namespace, report: dict) -> None:
    from ..api import Run
    from ..view import write_figure

    shift = 1 if args.shift is None and report["shifts"] else args.shift
    write_figure(Run(Path(args.run), report).plot(shift, args.dark), args.picture)


def _run_of(bag: Gathered, folder: Path, facts: dict[str, dict]) -> dict:
    """Return what bag and logs contain about a run without a report: one of a launch file, or with a killed supervisor."""
    known = info_of(bag)
    if facts:
        return run_part(bag, folder, known, end_of(facts, bag.structure.shifts))
    return {**known, "end": {"reason": NO_REPORT}}


def _run_of_the_rest(bag: Gathered, folder: Path, run: dict, reported: bool) -> dict:
    """Return the run part for a bag that was damaged after it was written.

    Its lost messages are counted anew and its end is not known. ``reported`` is True when ``run`` is of a report of the whole bag.
    """
    reason = "unknown from what is left of the bag"
    if reported and (end := run.get("end")):
        reason += f"; the reason in its report: {end.get('reason') if isinstance(end, dict) else end}"
    rest = {**run, "lost": None, "recovered": bag.recovered, "end": {"state": "unknown", "reason": reason}}
    if facts := facts_of(folder):
        rest["lost_by_topic"] = lost_messages(bag, facts)
        rest["lost"] = sum(rest["lost_by_topic"].values())
    elif written := _written(bag, folder):
        rest["lost"] = sum(max(0, count - bag.counts.get(topic, 0)) for topic, count in written.items())
        rest["lost"] += run.get("lost") or 0
    return rest


def _written(bag: Gathered, folder: Path) -> dict[str, int]:
    """Return the messages per topic when the bag was closed; empty without complete metadata of this bag in the folder."""
    path = folder / METADATA
    if not path.is_file():
        return {}
    try:
        info = load_yaml(path)["rosbag2_bagfile_information"]
        if info["relative_file_paths"] != [bag.path.name]:
            return {}
        written: Counter[str] = Counter()  # a topic with two types has two entries
        for entry in info["topics_with_message_count"]:
            written[topic_of_today(str(entry["topic_metadata"]["name"]))] += int(entry["message_count"])
        return written
    except (RigError, TypeError, KeyError, ValueError):
        return {}  # the metadata are damaged like the bag, so the lost messages stay unknown
