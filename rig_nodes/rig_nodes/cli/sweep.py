# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig sweep``: a sequence with many values of its parameters; one table holds each run's metrics."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import ProgressLine
from .run_arguments import add_in_process, controller_of, delay

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable

    from ..rig import RigConfig
    from ..studies import Plan

HELP = "run a sequence for many values of its parameters, on all cores or a cluster"
MOST_REASONS = 5
OF_A_PLAN = (
    "vary",
    "method",
    "samples",
    "seed",
    "repeats",
    "settings",
    "in_process",
    "parameters",
    "rig",
    "controller",
    "level",
    "delay",
    "calculate",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("what", help="a sequence, with --vary; a sweep's .yaml file; or a sweep's folder, to go on with it")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="NAME=SPEC",
        help='a parameter, as --set or --with name it, and what it takes: "LOW .. HIGH", '
        '"LOW .. HIGH in 5", "LOW .. HIGH step 10 ms" (and log behind it), "A, B, C"; may '
        "be repeated",
    )
    parser.add_argument(
        "--method",
        metavar="NAME",
        help="grid (default), list (values row by row), random, lhs (Latin hypercube; default with --samples)",
    )
    parser.add_argument("--samples", type=int, metavar="N", help="members that random and lhs draw")
    parser.add_argument("--repeats", type=int, metavar="N", help="runs of each point, with other noise (default 1)")
    parser.add_argument(
        "--seed", type=int, metavar="N", help="of the points drawn and of the first member; the others' seeds follow (default 1)"
    )
    parser.add_argument(
        "--set", action="append", metavar="KEY=VALUE", dest="settings", help="a value of the rig for all members (may be repeated)"
    )
    parser.add_argument(
        "--with",
        action="append",
        metavar="NAME=VALUE",
        dest="parameters",
        help="a parameter of the sequence for all members (may be repeated)",
    )
    parser.add_argument("--rig", metavar="NAME", help="rig or .yaml file (default: the sequence's own)")
    parser.add_argument(
        "--controller",
        metavar="SPEC",
        help="your controller in place of the Alfa46 in all members, one that the rig starts itself: "
        "python:, c:, simulink: or fmu: (docs/how_to/controllers.md)",
    )
    add_in_process(parser)
    parser.add_argument(
        "--calculate",
        metavar="NAME",
        help="a calculation of the rig's folder on each run, in place of the metrics of shifts (./rig calculate lists them)",
    )
    parser.add_argument(
        "--level",
        choices=("duty", "current"),
        help="what the controller returns, if it can return both (default: the first that it names)",
    )
    parser.add_argument("--delay", type=delay, metavar="N", help="samples of 1 ms until the controller's answer acts (default: 1)")
    parser.add_argument(
        "--out", metavar="DIR", help="folder (default: runs/<sequence>-sweep-<n>); one that holds the same sweep is gone on with"
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes on this machine (default 2)")
    parser.add_argument("--dask", metavar="ADDRESS", help="a Dask cluster instead: its scheduler, or local:N")
    parser.add_argument("--bags", action="store_true", help="keep a bag with its report of every member")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def main(args: argparse.Namespace) -> int:
    """Run the members that are not finished yet and print the results; return 1 when none was completed."""
    from ..base import RigError, ended_by, quoted
    from ..rig import load_rig
    from ..runs import run_folder, start_server, unless_empty

    if args.jobs < 1:
        raise RigError(f"--jobs is {args.jobs}, expected at least 1")
    if not (args.vary or args.what.endswith((".yaml", ".yml")) or Path(args.what).is_dir()):
        raise RigError('a sweep needs something to vary: --vary NAME="LOW .. HIGH" or NAME="A, B, C"')
    plan, folder, bags = _chosen(args)
    if plan.plugged:
        print(plan.plugged.check(load_rig(plan.rig, plan.fixed)), file=sys.stderr, flush=True)
    # the server compiles when nothing is cached yet; errors of the plan have been reported before this
    if args.jobs > 1 and not args.dask:
        start_server("rig_nodes.studies.sweep.run", rigs=[plan.rig])

    from ..api import run_plan
    from ..studies import RESULTS, parquet

    parquet()
    folder = folder or (run_folder(None, plan.name) if args.out is None else Path(args.out))
    config, start = load_rig(plan.rig, plan.fixed), time.monotonic()
    line: ProgressLine | None = None
    failed = 0

    def watch(of: int, begun: int) -> Callable[[int, dict], None]:
        nonlocal line
        if begun:
            print(f"{folder}: {begun} of {of} members are finished already", file=sys.stderr, flush=True)
        shown = line = ProgressLine(of, begun)

        def progress(done: int, entry: dict) -> None:
            nonlocal failed
            failed += entry["end"]["state"] != "ended"
            shown.show(done, f"{done} of {of} members" + (f", {failed} not ended" if failed else ""))

        return progress

    with unless_empty(folder):
        found = run_plan(plan, folder, bags, args.jobs, args.dask, watch)
    interrupted = ended_by(found.interrupted) if found.interrupted else None  # reason of the end, exit code
    if interrupted and line:
        line.leave()
    seconds, now = time.monotonic() - start, len(found.entries) - found.begun
    summary = {
        "folder": str(folder),
        "results": None if interrupted else str(folder / RESULTS),
        "members": found.of,
        "finished": len(found.entries),
        "finished_before": found.begun,
        "seconds": round(seconds, 3),
        "members_per_second": round(now / seconds, 3) if now and seconds else None,
        **_what_came(found.entries, config),
    }
    if args.json:
        print(json.dumps(summary, indent=1, ensure_ascii=False))
    else:
        print(_text(summary, config))
    if interrupted:
        print(f"rig: {interrupted[0]}; go on with: ./rig sweep {quoted(folder)}", file=sys.stderr)
        return interrupted[1]
    if not summary["ends"].get("ended"):
        print(f"rig: none of the {found.of} members came to its end", file=sys.stderr)
        return 1
    return 0


def _chosen(args: argparse.Namespace) -> tuple[Plan, Path | None, bool]:
    """Return (plan, folder to continue with or None, bags)."""
    from ..base import DEFAULT_RIG, RigError, load_yaml, rig_of
    from ..runs import pairs, parse_parameters, parse_settings
    from ..studies import Plan, make_plan, plan_of, plugged_of, read_manifest, read_plan

    given = [name for name in OF_A_PLAN if getattr(args, name) not in (None, [])]
    options = {"settings": "--set", "parameters": "--with", "in_process": "--in-process"}
    if Path(args.what).is_dir():
        if given or args.out or args.bags:
            first = options.get(given[0], f"--{given[0]}") if given else "--out" if args.out else "--bags"
            raise RigError(f"{args.what} is a sweep's folder, which defines the sweep; leave out {first}")
        manifest = read_manifest(args.what)
        return plan_of(manifest["plan"]), Path(args.what), manifest["bags"]
    if args.what.endswith((".yaml", ".yml")) and "vary" in (load_yaml(args.what) or {}):
        if given:
            raise RigError(
                f"{args.what} is a sweep, which defines what it varies; leave out "
                f"{options.get(given[0], f'--{given[0]}')}, or write it there"
            )
        return read_plan(args.what, DEFAULT_RIG), None, args.bags
    vary = pairs("--vary", args.vary or [], 'NAME=SPEC, e.g. alfa46.t12="-250 ms .. -150 ms"')
    numbers = {name: getattr(args, name) for name in ("seed", "repeats") if getattr(args, name) is not None}
    plugged = plugged_of(controller_of(args.controller, args.in_process), args.level, 1 if args.delay is None else args.delay)
    return (
        make_plan(
            Plan(
                args.what,
                args.rig or rig_of(args.what, DEFAULT_RIG),
                method=args.method or "",
                samples=args.samples,
                plugged=plugged,
                calculation=args.calculate or "",
                fixed=parse_settings(args.settings or []),
                fixed_with=parse_parameters(args.parameters or []),
                **numbers,
            ),
            vary,
        ),
        None,
        args.bags,
    )


def _what_came(entries: Iterable[dict], config: RigConfig) -> dict:
    """Return ends, reasons and the spread of the metrics of the finished members."""
    import numpy as np

    from ..analysis import SHORT, instruments_of, named_metrics, uncertainty, unlike

    box = config.transmission if config.structure.gears else None  # without gears there are no shifts
    ends: dict[str, int] = {}
    reasons: dict[str, int] = {}
    faults: dict[str, int] = {}  # what went wrong at the end of controllers
    values: dict[str, dict[str, list[float]]] = {}
    errors: dict[str, dict[str, float]] = {}
    instruments = instruments_of(config.as_dict()) if box else {}
    shown = [metric.key for metric in named_metrics(SHORT)]
    table: dict[str, list[float]] = {}
    shifts = valid = 0
    starts: list[tuple[str, dict, dict]] = []
    for entry in entries:
        for row in entry.get("table", {}).get("rows", ()):
            for (name, unit), cell in zip(entry["table"]["columns"].items(), row):
                if unit and cell is not None:
                    table.setdefault(f"{name} [{unit}]", []).append(cell)
        state, reason = entry["end"]["state"], entry["end"]["reason"]
        ends[state] = ends.get(state, 0) + 1
        if state != "ended":
            reasons[reason] = reasons.get(reason, 0) + 1
        if fault := entry["end"].get("fault"):
            faults[fault] = faults.get(fault, 0) + 1
        for number, row in enumerate(entry["shifts"], 1):
            name = f"member {entry['member']}" + (f" shift {number}" if len(entry["shifts"]) > 1 else "")
            starts.append((name, row, uncertainty(row, instruments, box) if row["input_speed_rpm"] else {}))
            shifts, valid = shifts + 1, valid + row["valid"]
            if not row["valid"] or not box.changes(row["from_gear"], row["to_gear"]):
                continue
            way = box.way(row["from_gear"], row["to_gear"])
            for key, error in uncertainty(row, instruments, box).items():
                errors.setdefault(way, {})[key] = max(error, errors.get(way, {}).get(key, 0.0))
            for key in shown:
                if row[key] is not None:
                    values.setdefault(way, {}).setdefault(key, []).append(row[key])
    spread = {
        way: {key: [float(np.min(x)), float(np.median(x)), float(np.max(x))] for key, x in of.items()} for way, of in values.items()
    }
    summed = {name: [float(np.min(x)), float(np.median(x)), float(np.max(x))] for name, x in table.items()}
    largest = {way: {key: of[key] for key in shown if key in of} for way, of in errors.items()}
    found = {"ends": ends, "reasons": reasons, "faults_at_the_end": faults, "shifts": shifts, "valid_shifts": valid}
    starts_differ = unlike(starts, box, "shifts") if box else []
    return {**found, "spread": spread, "largest_errors": largest, "table": summed, "starts": starts_differ}


def _text(summary: dict, config: RigConfig) -> str:
    from ..analysis import SHORT, aligned, named_metrics
    from ..base import quoted

    lines = [
        f"{summary['finished']} of {summary['members']} members finished"
        + ("" if summary["table"] else f", {summary['shifts']} shifts, {summary['valid_shifts']} of them valid")
    ]
    if summary["members_per_second"]:
        lines.append(f"{summary['members_per_second']:.1f} members a second")
    reasons = sorted(summary["reasons"].items(), key=lambda item: -item[1])
    lines += [f"{count} did not end: {reason}" for reason, count in reasons[:MOST_REASONS]]
    faults = sorted(summary["faults_at_the_end"].items(), key=lambda item: -item[1])
    lines += [f"warning: at the end of {count}, {fault}" for fault, count in faults[:MOST_REASONS]]
    if len(reasons) > MOST_REASONS:
        lines.append(f"and {len(reasons) - MOST_REASONS} more reasons, in the column 'reason'")
    for way, of in summary["spread"].items():
        lines.append(f"{way}, valid shifts: lowest, median, highest")
        shown, errors = [one for one in named_metrics(SHORT) if one.key in of], summary["largest_errors"].get(way, {})
        cells = [[one.cell({one.key: x}, errors) for x in of[one.key]] for one in shown]
        headings = [f"  {one.heading(config.transmission)}" for one in shown]
        lines += aligned([[heading, *(f"{cell:>8}" for cell in row)] for heading, row in zip(headings, cells)])
    lines += summary["starts"]
    if summary["table"]:
        width = max(map(len, summary["table"]))
        lines.append("all rows of the calculation: lowest, median, highest")
        lines += [f"  {name:<{width}}" + "".join(f"{value:>z12.5g}" for value in x) for name, x in summary["table"].items()]
    if summary["results"]:
        page = f"./rig report {quoted(summary['folder'])} --html page.html"
        lines.append(f"written to {summary['results']}; look at it with: {page}")
    return "\n".join(lines)
