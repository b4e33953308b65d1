# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig compare`: runs, bags and loggers' files side by side on one clock, with differences in measuring errors."""

from __future__ import annotations

import os
import sys
from importlib import import_module  # import is a word of Python
from typing import TYPE_CHECKING

from .output_files import OutputFile

if TYPE_CHECKING:
    import argparse

    from ..analysis import Source

HELP = "lay runs, bags and loggers' files over each other, with differences in measuring errors"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    import_verb = import_module("rig_nodes.cli.import")
    parser.add_argument("runs", nargs="+", metavar="RUN", help="folder of a run, its .mcap file, or a logger's file; two or more")
    parser.add_argument("--align", choices=("events", "correlation"), help="how (default: events where all hold the same orders)")
    import_verb.add_profile_arguments(parser)
    parser.add_argument("--json", type=OutputFile("json"), metavar="FILE", help="write offsets, metrics and signals as JSON")
    parser.add_argument("--html", type=OutputFile("page"), metavar="FILE", help="write one self-contained page")
    parser.add_argument("--rrd", type=OutputFile("rrd"), metavar="FILE", help="write a file for Rerun, with its layout")


INTERMIXED = True
LOST = 3  # exit code: compared, but something of a run is not in its bag
MOST_ROWS = 2_000_000  # of all recordings together, 200 s at 10 kHz, that are laid over each other


def main(args: argparse.Namespace) -> int:
    """Compare, print, and write what was asked for."""
    from ..api import Compared
    from ..base import RigError, atomic_write, printable
    from .json_output import write_json

    if len(args.runs) < 2:
        raise RigError(f"{args.runs[0]} alone cannot be compared; name two or more runs, bags or loggers' files")
    faults: list[str] = []
    sources = _sources(args, faults)
    compared = Compared(sources, args.align)
    found = compared.found
    print(compared)
    if args.json:
        write_json(args.json, found.as_dict())
    if args.html:
        from ..view import Pages, compare_page

        atomic_write(args.html, compare_page(found, Pages(compared.record)))
    if args.rrd:
        from ..view import Pages, write_compare_file

        write_compare_file(found, Pages(compared.record), args.rrd)
    for fault in faults:
        print(f"rig: {printable(fault)}", file=sys.stderr)
    return LOST if faults else 0


def _sources(args: argparse.Namespace, faults: list[str]) -> list[Source]:
    """Return what is to be compared; a file without a rig of its own has that of the first run, which a line states.

    ``faults`` takes a sentence for each thing that makes a bag another recording than its run was.
    """
    from ..analysis import Source, gather, source_of
    from ..bags import faults_of, is_loggers_file, read_measurement, rig_record, why_none, with_end
    from ..base import DEFAULT_RIG, RigError, no_file, quoted
    from ..rig import load_gearbox_rig, load_rig, transmission_of

    import_verb = import_module("rig_nodes.cli.import")
    profile = import_verb.profile_of(args)
    files = [run for run in args.runs if is_loggers_file(run)]
    if (given := [name for name in ("profile", "rig", "orders", "period") if getattr(args, name) is not None]) and not files:
        if missing := next((run for run in args.runs if not os.path.exists(run)), None):
            raise RigError(f"{missing}: {no_file(missing)}")
        raise RigError(f"--{given[0]} is for loggers' files; runs have their own")
    bags = {run: gather(run, most_rows=MOST_ROWS // len(args.runs)) for run in args.runs if run not in files}
    runs: dict[str, Source] = {}
    for run, bag in bags.items():
        runs[run] = source_of(run, bag)
        faults += [f"{run}: {fault}" for fault in faults_of(bag, with_end(bag, {}))]
    named = args.rig or (profile.rig if profile else None)
    if named:
        settings = profile.settings if profile and not args.rig else None
        record, named_by = load_gearbox_rig(named, settings, "a logger's file").as_dict(), f"rig '{named}'"
    elif bags:
        first = next(iter(bags))
        record, named_by = bags[first].record, f"rig '{bags[first].record.get('name')}' of {first}"
    else:
        record, named_by = load_rig(DEFAULT_RIG).as_dict(), ""
    sources = []
    for run in args.runs:
        if run in runs:
            sources.append(runs[run])
            continue
        found = read_measurement(run, profile, record, named_by, args.orders)
        if found is None:
            raise RigError(
                f"{run}: {why_none(run, record)}; a profile, which --profile takes, is proposed by ./rig import {quoted(run)}"
            )
        print(f"{run}: inertias and instrument errors of {named_by or 'the exported run'}")
        for note in found.notes:
            print(f"  {note}")
        rig = rig_record(found.record)
        sources.append(Source(run, found.recording(transmission_of(rig)), rig))
    return sources
