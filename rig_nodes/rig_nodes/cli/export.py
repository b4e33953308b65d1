# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig export WHAT``: files for other tools.

They are the rig or a controller as an FMU, the CAN database, the register map, rig_record.h.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..config.names import DEFAULT_RIG

if TYPE_CHECKING:
    import argparse

    from ..controllers.record import ControllerRecord

INTERMIXED = True  # files may come before and behind options
HELP = "write an FMU, the CAN database, the Modbus registers or rig_record.h"
DEFAULTS = {
    "fmu": "{rig}.fmu",
    "controller-fmu": "{source}.fmu",
    "dbc": "rig.dbc",
    "registers": "registers.csv",
    "record": "rig_record.h",
}
# file endings of each export; a file with the first ending may be overwritten, because it is most likely an older export
SUFFIXES = {"fmu": (".fmu",), "controller-fmu": (".fmu",), "dbc": (".dbc",), "registers": (".csv", ".md"), "record": (".h",)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "what",
        choices=DEFAULTS,
        help="fmu: the rig; controller-fmu: a controller in C or C++; dbc: for "
        "CAN; registers: for Modbus, .csv or .md; record: for C and C++",
    )
    parser.add_argument(
        "sources", nargs="*", default=[], metavar="FILE.c", help="of controller-fmu: C and C++ files for rig_controller.h"
    )
    parser.add_argument(
        "-I",
        "--include",
        action="append",
        default=[],
        metavar="FOLDER",
        help="of controller-fmu: folder of headers (may be repeated)",
    )
    parser.add_argument("-o", "--out", metavar="FILE", help="file to write (default: named after what is exported)")
    parser.add_argument(
        "--rig", default=DEFAULT_RIG, metavar="NAME", help=f"rig, its folder or .yaml file (default: {DEFAULT_RIG})"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="settings",
        help="change one value of the rig, as for run (may be repeated)",
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI (default: 2)")


def main(args: argparse.Namespace) -> int:
    """Write the file and print its place."""
    from ..config.names import find_config
    from ..errors import RigError
    from ..testbench.configuration import rig_name
    from ..testbench.folders import parse_settings

    if args.sources and args.what != "controller-fmu":
        raise RigError(f"export {args.what} takes no files; found {' '.join(args.sources)}")
    if args.include and args.what != "controller-fmu":
        raise RigError(f"export {args.what} takes no folders of headers; found {' '.join(args.include)}")
    for folder in args.include:
        if not Path(folder).is_dir():
            raise RigError(f"--include {folder}: there is no such folder")
    if args.what == "controller-fmu" and not args.sources:
        raise RigError("export controller-fmu needs the C file of your controller, e.g. my_controller.c")
    source = Path(args.sources[0]).stem if args.sources else ""
    target = Path(args.out or DEFAULTS[args.what].format(rig=rig_name(find_config("rigs", args.rig)), source=source))
    _check_target(args.what, target, args.sources)
    _WRITERS[args.what](args, target, parse_settings(args.settings))
    print(f"written to {target}")
    return 0


def _check_target(what: str, target: Path, sources: list[str]) -> None:
    """Raise RigError when the file to write is not of this kind, or is another of the user's files."""
    from ..errors import RigError

    endings = SUFFIXES[what]
    if target.is_dir():
        raise RigError(f"-o {target}: it is a folder; name the file in it, which ends in {' or '.join(endings)}")
    if target.suffix.lower() not in endings:
        raise RigError(f"-o {target}: export {what} writes a file that ends in {' or '.join(endings)}")
    if not target.parent.is_dir():
        raise RigError(f"-o {target}: there is no folder {target.parent}")
    if not target.exists():
        return
    if any(Path(source).exists() and target.samefile(source) for source in sources):
        raise RigError(f"-o {target}: it is what is to be exported; name another file")
    if target.suffix.lower() != endings[0]:
        raise RigError(f"-o {target}: it exists; remove it first, or name another file")


def _fmu(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    from ..fmu.build import build_rig_fmu

    build_rig_fmu(target, args.rig, settings, args.fmi)


def _controller_fmu(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    from ..fmu.build import build_controller_fmu
    from ..testbench.configuration import load_gearbox_rig

    config = load_gearbox_rig(args.rig, settings, "export controller-fmu")
    build_controller_fmu(args.sources, target, config, args.fmi, [f"-I{folder}" for folder in args.include])


def _dbc(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    from ..atomic_write import atomic_write
    from ..controllers.can_database import dbc_text

    atomic_write(target, dbc_text(_record(args, settings)))


def _registers(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    from ..atomic_write import atomic_write
    from ..controllers.registers import csv_text, markdown_text

    text = markdown_text if target.suffix.lower() == ".md" else csv_text
    atomic_write(target, text(_record(args, settings)))


def _record_header(args: argparse.Namespace, target: Path, settings: dict[str, str]) -> None:
    from ..atomic_write import atomic_write
    from ..controllers.record_header import header_text

    atomic_write(target, header_text(_record(args, settings)))


def _record(args: argparse.Namespace, settings: dict[str, str]) -> ControllerRecord:
    """Return the record of the rig's controller."""
    from ..controllers.record import record_of
    from ..testbench.configuration import load_gearbox_rig

    return record_of(load_gearbox_rig(args.rig, settings, f"export {args.what}"))


_WRITERS = {"fmu": _fmu, "controller-fmu": _controller_fmu, "dbc": _dbc, "registers": _registers, "record": _record_header}
