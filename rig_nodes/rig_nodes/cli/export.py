# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig export WHAT``: files for other tools.

They are a run as CSV, Parquet, MDF4, MAT or CAN log; the rig or a controller as an FMU; the CAN database, the register map and
rig_record.h.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import DEFAULT_RIG
from .output_files import KINDS, NEVER, OutputFile, may_write
from .shared_arguments import add_rig, add_set

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

INTERMIXED = True  # files may come before and behind options
HELP = "write a run as CSV, Parquet, MDF4, MAT or CAN log; an FMU, the CAN database, the Modbus registers or rig_record.h"
RUNS = ("csv", "parquet", "mf4", "mat")
CAN_LOGS = ("blf", "asc", "log")
LOST = 3  # exit code: exported, but the run was cut off
DEFAULTS = {
    "fmu": "{rig}.fmu",
    "controller-fmu": "{source}.fmu",
    "dbc": "rig.dbc",
    "registers": "registers.csv",
    "record": "rig_record.h",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "what",
        choices=(*RUNS, *CAN_LOGS, *DEFAULTS),
        help="csv, parquet, mf4, mat: a run; blf, asc, log: a run as CAN frames; fmu: the rig; controller-fmu: a controller in C "
        "or C++; dbc: for CAN; registers: for Modbus, .csv or .md; record: for C and C++",
    )
    parser.add_argument(
        "sources",
        nargs="*",
        default=[],
        metavar="RUN | FILE.c",
        help="the run: its folder or .mcap file; of controller-fmu: C and C++ files for rig_controller.h",
    )
    parser.add_argument(
        "-I",
        "--include",
        action="append",
        default=[],
        metavar="FOLDER",
        help="of controller-fmu: folder of headers (may be repeated)",
    )
    parser.add_argument(
        "-o",
        "--out",
        type=OutputFile(lambda args: args.what),
        metavar="FILE",
        help="file to write (default: named after what is exported)",
    )
    add_rig(parser)
    add_set(parser)
    parser.add_argument(
        "--signals",
        action="append",
        default=[],
        metavar="NAME",
        help="of a run: names or patterns such as 'p*', with commas between (may be repeated; default: all signals)",
    )
    parser.add_argument("--units", choices=("si", "shown"), default="si", help="of a run: SI, or rpm, MPa and mA (default: si)")
    parser.add_argument(
        "--clock", metavar="TIME", help="of csv and parquet: a full row each e.g. '5 ms' (default: rows at the signals' own times)"
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI (default: 2)")


def main(args: argparse.Namespace) -> int:
    """Write the file and print its place."""
    from ..base import RigError, find_config
    from ..rig import rig_name
    from ..runs import parse_settings

    if args.what in (*RUNS, *CAN_LOGS):
        return _run(args)
    if args.signals or args.clock or args.units != "si":
        raise RigError(f"--signals, --units and --clock are for runs ({', '.join(RUNS)}), not for {args.what}")
    if args.sources and args.what != "controller-fmu":
        raise RigError(f"export {args.what} takes no files; found {' '.join(args.sources)}")
    if args.include and args.what != "controller-fmu":
        raise RigError(f"export {args.what} takes no folders of headers; found {' '.join(args.include)}")
    source = Path(args.sources[0]).stem if args.sources else "controller"
    target = args.out or Path(DEFAULTS[args.what].format(rig=rig_name(find_config("rigs", args.rig)), source=source))
    may_write("-o", target, KINDS[args.what], args)
    _of_rig(args, target, parse_settings(args.settings))
    print(f"written to {target}")
    return 0


def _run(args: argparse.Namespace) -> int:
    """Write the signals of a run."""
    from ..api import exported, seconds_of
    from ..bags import FILE_KINDS as ENDINGS
    from ..bags import csvw_path
    from ..base import ProgressLine, RigError, printable

    what, given = args.what, [f"-{'-' * (len(name) > 1)}{name}" for name in _OF_RIGS if getattr(args, _OF_RIGS[name])]
    if given or args.rig != DEFAULT_RIG:
        raise RigError(f"{(given or ['--rig'])[0]} is for FMUs and tables of a rig; a run has its own rig")
    if len(args.sources) != 1:
        raise RigError(f"export {what} takes one run, its folder or .mcap file; found {' '.join(args.sources) or 'none'}")
    run = Path(args.sources[0])
    target = args.out or Path(f"{(run if run.is_dir() else run.with_suffix('')).resolve().name}{ENDINGS[what][0]}")
    _check_place(what, target, ENDINGS[what])
    for path in (target, *([csvw_path(target)] if what == "csv" else [])):
        may_write("-o", path, NEVER, args)
    chosen = [name.strip() for text in args.signals for name in text.split(",") if name.strip()]
    if what in CAN_LOGS and (chosen or args.clock or args.units != "si"):
        raise RigError(f"--signals, --units and --clock are for {', '.join(RUNS)}; {what} holds the frames of rig.dbc")
    if args.signals and not chosen:
        raise RigError("--signals names none; leave it out for all signals")
    if args.clock and what in ("mf4", "mat"):
        raise RigError(f"--clock is for csv and parquet, which hold one table; {what} holds each signal with its own times")
    clock = seconds_of("--clock", args.clock)
    line: ProgressLine | None = None

    def watch(length: float | None) -> Callable[[float, str], None]:
        nonlocal line
        line = ProgressLine(length)
        return line.show

    try:
        found = exported(run, target, chosen, clock, args.units, watch)
    finally:
        if line is not None:
            line.leave()
    held = f"{found.count} signals{f', described in {csvw_path(target).name}' if what == 'csv' else ''}"
    if what in CAN_LOGS:
        held = f"{found.count} frames, which './rig export dbc' describes"
    print(f"written to {target}: {held}")
    if found.left_out:
        others = printable(", ".join(found.left_out))
        print(f"rig: not exported, as no signals of the rig come from them: {others}", file=sys.stderr)
    if found.cut_off:
        print(f"rig: {run}: {found.cut_off}", file=sys.stderr)
    return LOST if found.cut_off else 0


_OF_RIGS = {"I": "include", "set": "settings"}


def _check_place(what: str, target: Path, endings: tuple[str, ...]) -> None:
    """Raise RigError when the file to write has another ending, is a folder, or would be in a folder that does not exist."""
    from ..base import RigError

    if target.is_dir():
        raise RigError(f"-o {target}: it is a folder; name the file in it, which ends in {' or '.join(endings)}")
    if target.suffix.lower() not in endings:
        raise RigError(f"-o {target}: export {what} writes a file that ends in {' or '.join(endings)}")
    if not target.parent.is_dir():
        raise RigError(f"-o {target}: there is no folder {target.parent}")


def _of_rig(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    """Write what is made of a rig with its settings."""
    from ..api import load

    rig = load(args.rig, **settings)
    if args.what == "fmu":
        rig.export_fmu(target, fmi=args.fmi)
    elif args.what == "controller-fmu":
        rig.export_controller_fmu(args.sources, target, fmi=args.fmi, include=args.include)
    else:
        rig.export(target)
