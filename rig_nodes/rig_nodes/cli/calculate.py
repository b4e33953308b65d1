# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig calculate NAME``: a calculation of a rig's folder as a table; without NAME, which there are."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ..base import DEFAULT_RIG
from .shared_arguments import add_json, add_set

if TYPE_CHECKING:
    import argparse

    from ..bags import Bag
    from ..runs import Table

HELP = "print a calculation of a rig's folder, with its values or on a recording"
LOST = 3  # exit code: calculated, but something of the run is not in its bag


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="the calculation; alone: which there are")
    parser.add_argument(
        "--rig", metavar="NAME", help=f"rig, its folder or .yaml file (default: that of --run as it was run, else {DEFAULT_RIG})"
    )
    parser.add_argument("--run", metavar="RUN", help="folder of a run or its .mcap file, for a calculation on a recording")
    add_set(parser, "change one value of the rig")
    add_json(parser, "write the table as JSON; - for stdout")


def main(args: argparse.Namespace) -> int:
    """Print the table, or the list of calculations."""
    from ..bags import faults_of, with_end
    from ..base import RigError, printable, unknown
    from ..rig import config_of_record, load_rig, with_overrides
    from ..runs import calculations_of, of_bag, parse_settings
    from .json_output import write_json

    bag = None if args.run is None else _opened(args.run)
    rig = args.rig or (bag.record.get("name") if bag else None) or DEFAULT_RIG
    known = calculations_of(rig)
    if not known:
        raise RigError(f"the rig '{rig}' has no calculations; write a calculations.py beside its rig.yaml: docs/how_to/rigs.md")
    if args.name is None:
        rows = [
            {"name": one.name, "on a recording": "yes" if one.of_recording else "no", "what": one.text} for one in known.values()
        ]
        if args.json:
            write_json(args.json, {"calculations": rows})
        else:
            print("\n".join(_lines([list(rows[0]), *(list(row.values()) for row in rows)])))
        return 0
    if args.name not in known:
        raise RigError(unknown(f"calculation of '{rig}'", args.name, known))
    wanted = known[args.name]
    if wanted.of_recording and bag is None:
        raise RigError(f"the calculation {args.name} needs a recording: --run RUN")
    if bag is not None and not wanted.of_recording:
        raise RigError(f"the calculation {args.name} takes no recording; leave out --run")
    settings = parse_settings(args.settings)
    if bag is None or args.rig:
        config = load_rig(rig, settings)
    else:
        config = with_overrides(config_of_record(bag.record, str(bag.path)), settings)
    table = wanted.table(config, None if bag is None else of_bag(bag))
    if args.json != "-":
        _print(table)
    if args.json:
        write_json(
            args.json, {"name": args.name, "rig": rig, "text": table.text, "columns": dict(table.columns), "rows": table.in_units()}
        )
    if bag is None:
        return 0
    faults = [f"the bag is damaged: {bag.recovered}"] if bag.recovered else faults_of(bag, with_end(bag, {}))
    for fault in faults:
        print(f"rig: {printable(bag.path)}: {printable(fault)}", file=sys.stderr)
    return LOST if faults else 0


def _opened(run: str) -> Bag:
    """Return the bag of a run that has begun."""
    from ..nodes import open_bag

    bag = open_bag(run)
    bag.check_began()
    return bag


def _print(table: Table) -> None:
    heading = [f"{name} [{unit}]" if unit not in ("", "-") else name for name, unit in table.columns.items()]
    cells = [[_shown(cell) for cell in row] for row in table.in_units()]
    print("\n".join([table.text, "", *_lines([heading, *cells])]))


def _shown(cell: float | str | None) -> str:
    return "-" if cell is None else cell if isinstance(cell, str) else f"{cell:z.5g}"


def _lines(rows: list[list[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
