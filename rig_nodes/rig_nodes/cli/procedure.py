# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig procedure NAME``: series of a measuring procedure, with a bag and a report for each repeat."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ..base import waiting
from .shared_arguments import add_set

if TYPE_CHECKING:
    import argparse

HELP = "run series of a measuring procedure of the laboratory, with bags"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("procedure", help="name of an installed procedure or a .yaml file")
    parser.add_argument(
        "--series", metavar="A,B", help="labels or numbers of series, e.g. 19,20 (default: all; --labels lists them)"
    )
    parser.add_argument("--labels", action="store_true", help="print the labels of the series and run nothing")
    parser.add_argument("--out", metavar="DIR", help="folder for the runs (default: runs/<procedure>-<n>)")
    parser.add_argument("--rig", metavar="NAME", help="rig, its folder or .yaml file (default: the one that the sequence is of)")
    add_set(parser, "change one value of the rig that the series do not set themselves")


def main(args: argparse.Namespace) -> int:
    """Run the chosen series one after the other; return 0 only when every sequence was completed."""
    from ..analysis import Member, aligned, build_report, format_report, gather, member_of, table_of, write_procedure, write_report
    from ..base import DEFAULT_RIG, interrupted_code, printable, quoted
    from ..controllers import embedded_line
    from ..runs import load_procedure, parse_settings, prepare, run_folder, simulate

    procedure = load_procedure(args.procedure, DEFAULT_RIG)
    chosen = procedure.series(args.series.split(",") if args.series else None)
    if args.labels:
        print("\n".join(series.label for series in chosen))
        return 0
    settings = parse_settings(args.settings)
    ready = [(series, *prepare(series, args.rig, settings)) for series in chosen]
    folder = run_folder(args.out, procedure.name)
    if ready[0][1].structure.shifts:
        print(embedded_line(), flush=True)
    failed, members = 0, list[Member]()
    rows = [series.about for series in chosen]
    for series, config, sequence in ready:
        for repeat in range(series.repeats):
            run_into = folder / f"{series.label}-{repeat + 1}"
            run_into.mkdir()
            print(f"series {series.label}, run {repeat + 1} of {series.repeats}", flush=True)
            with waiting("computing the run"):
                run = simulate(config, sequence, run_into, series.first_seed + repeat)
            report = build_report(gather(run_into, run), run)
            write_report(run_into, report)
            print(format_report(report), end="\n\n", flush=True)
            members.append(member_of(series.label, run_into.name, report))
            # after each run, so that an interrupted procedure keeps what it found
            write_procedure(folder, procedure.about, rows, members)
            if run["end"]["state"] == "interrupted":
                print(f"rig: {run['end']['reason']}", file=sys.stderr)
                return interrupted_code(run["end"]["reason"])
            if run["end"]["state"] != "ended":
                failed += 1
                print(f"rig: series {series.label}: {run['end']['reason']}", file=sys.stderr)
    print(f"found by {procedure.name}, means of the runs of each series:")
    head, rows = table_of(members)
    print("\n".join(map(printable, aligned([head, *rows]))))
    print(f"written to {folder}; look at one with: ./rig view {quoted(folder)}/<series>-<run>", flush=True)
    return 1 if failed else 0
