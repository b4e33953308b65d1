# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig import`: a logger's file (CSV, Parquet, MDF, MAT, xlsx or TDMS) becomes a run, by a profile that assigns its columns."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .shared_arguments import add_set

if TYPE_CHECKING:
    import argparse

    from ..bags import Profile

HELP = "make a run of a logger's file: CSV, Parquet, MDF, MAT, xlsx or TDMS"
INTERMIXED = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("file", metavar="FILE", help="file of a logger, or of rig export")
    add_profile_arguments(parser)
    parser.add_argument("--out", metavar="DIR", help="folder for the run (default: runs/<file>-<n>)")
    add_set(parser, 'one value of the rig that is another, e.g. w0.inertia="0.8 kg m2"')


def add_profile_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `rig import` and `rig compare` take for a file."""
    parser.add_argument(
        "--profile",
        metavar="P",
        help="profile of the file: a .yaml file, or one of a rig's folder (german, polish); without one a first one is written",
    )
    parser.add_argument("--rig", metavar="NAME", help="rig whose inertias, ratios and instrument errors hold for the file")
    parser.add_argument("--orders", metavar="LIST", help="when (s of the file) which gear was ordered: 'TIME:FROM-TO, ...'")
    parser.add_argument("--period", metavar="TIME", help="time between rows of a file without times, e.g. '0.1 ms'")


def profile_of(args: argparse.Namespace) -> Profile | None:
    """Return the profile of the arguments, with the period that they give; None without such arguments."""
    from dataclasses import replace

    from ..bags import Profile, read_profile, time_above_0

    profile = read_profile(args.profile) if args.profile else None
    if args.period is not None:
        profile = replace(profile or Profile(), period=time_above_0(args.period, "--period"), time=None)
    return profile


def main(args: argparse.Namespace) -> int:
    """Import the file and print the report of the run, or write a first profile."""
    import os
    import shutil

    from ..analysis import format_report
    from ..api import imported
    from ..bags import CellError, read_measurement, sequence_name
    from ..base import DEFAULT_RIG, RigError, quoted
    from ..rig import load_rig
    from ..runs import parse_settings, run_folder, unless_empty

    profile = profile_of(args)
    settings = {**(profile.settings if profile else {}), **parse_settings(args.settings)}
    rig = args.rig or (profile.rig if profile else None)
    if settings and not rig:
        from ..bags import NO_RIG

        raise RigError(f"--set {next(iter(settings))}: {NO_RIG}")
    named_by = "--rig" if args.rig else f"profile {profile.name}" if profile and profile.rig else ""
    rig = rig or DEFAULT_RIG
    try:
        found = read_measurement(args.file, profile, load_rig(rig, settings).as_dict(), named_by, args.orders)
    except CellError as error:
        if args.profile or (target := _proposal(args)).exists():
            raise
        _write_proposal(args, target, rig)
        raise RigError(f"{error}; {target} is written for it, which --profile takes") from None
    if found is None:
        return _propose(args, rig)
    folder = run_folder(args.out, sequence_name(Path(args.file)))
    part = folder.with_name(f".{folder.name}.{os.getpid()}")
    with unless_empty(folder):
        try:
            report = imported(found, part, Path(args.file))
            os.replace(part, folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    if "bench" not in report:
        print(format_report(report))
    for note in found.notes:
        print(f"note: {note}")
    rows = len(next(iter(found.channels.values())))
    print(f"written to {folder}: {len(found.channels)} signals, {rows} rows at {found.period * 1e3:.7g} ms")
    print(f"look at it with: ./rig view {quoted(folder)}")
    return 0


def _proposal(args: argparse.Namespace) -> Path:
    """Return the path of the profile that is written for a file."""
    return Path(f"{Path(args.file).stem}.profile.yaml")


def _write_proposal(args: argparse.Namespace, target: Path, rig: str) -> list[str]:
    """Write a first profile, and return the columns that are only comments in it."""
    from ..bags import proposed, read_foreign
    from ..base import atomic_write
    from ..rig import load_rig

    text, unsure = proposed(read_foreign(args.file), load_rig(rig).as_dict(), rig)
    atomic_write(target, text)
    return unsure


def _propose(args: argparse.Namespace, rig: str) -> int:
    from ..bags import why_none
    from ..base import RigError, quoted
    from ..rig import load_rig

    target = _proposal(args)
    if target.exists():
        raise RigError(f"{target}: is there already; use it with --profile {quoted(target)}, or remove it to have it made anew")
    unsure = _write_proposal(args, target, rig)
    print(f"nothing is imported yet: {why_none(args.file, load_rig(rig).as_dict())}; {target} holds a guess what its heads are")
    if unsure:
        shown = ", ".join(f"'{head}'" for head in unsure[:6])
        print(f"not determined: {shown}{' and more' if len(unsure) > 6 else ''}; they are comments in it")
    print(f"look at it, then: ./rig import {quoted(args.file)} --profile {quoted(target)} --out {quoted(args.out or 'runs/NAME')}")
    return 0
