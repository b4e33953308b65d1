# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig procedure NAME``: series of a measuring procedure, with a bag and a report for each repeat."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

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
    from ..analysis import Member, aligned, format_report, table_of
    from ..api import run_series
    from ..base import DEFAULT_RIG, interrupted_code, printable, quoted
    from ..controllers import embedded_line
    from ..runs import Series, load_procedure, parse_settings, prepare, run_folder

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

    def begins(series: Series, repeat: int) -> None:
        print(f"series {series.label}, run {repeat + 1} of {series.repeats}", flush=True)

    failed, members = 0, list[Member]()
    for report, member in run_series(procedure, ready, folder, begins):
        print(format_report(report), end="\n\n", flush=True)
        members.append(member)
        end = report["run"]["end"]
        if end["state"] == "interrupted":
            print(f"rig: {end['reason']}", file=sys.stderr)
            return interrupted_code(end["reason"])
        if end["state"] != "ended":
            failed += 1
            print(f"rig: series {member.label}: {end['reason']}", file=sys.stderr)
    print(f"found by {procedure.name}, means of the runs of each series:")
    head, rows = table_of(members)
    print("\n".join(map(printable, aligned([head, *rows]))))
    print(f"written to {folder}; look at one with: ./rig view {quoted(folder)}/<series>-<run>", flush=True)
    return 1 if failed else 0
