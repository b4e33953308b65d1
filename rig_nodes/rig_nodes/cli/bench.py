# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig bench [PART ...]``: how fast the rig computes on this machine, part by part; ``--json`` for programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..base import ProgressLine
from ..studies import TITLES
from .shared_arguments import add_json

if TYPE_CHECKING:
    import argparse

HELP = "measure how fast the rig computes on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(TITLES)}, or all (default): some three minutes on an idle machine"
    )
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="the fastest of so many runs counts")
    add_json(parser, "write the numbers as JSON; - for stdout, without tables")


def main(args: argparse.Namespace) -> int:
    """Measure the chosen parts, print and write the numbers."""
    from ..api import measured, parts_of, whole
    from ..base import DEFAULT_RIG

    parts, repeats = parts_of(args.parts), whole("repeats", args.repeats, 1)
    from ..studies import lines, machine, machine_line
    from .json_output import write_json

    line = ProgressLine()
    results: dict = {"machine": machine()}
    text = args.json != "-"
    if text:
        print(machine_line(results["machine"]), flush=True)
    try:
        for number, part in enumerate(parts):
            head = f"[{number + 1}/{len(parts)}] {part}"
            results[part] = measured(
                part, DEFAULT_RIG, repeats, lambda detail, head=head, number=number: line.show(number, f"{head}: {detail}")
            )
            line.leave()
            if text:
                print("\n".join(["", TITLES[part], "", *lines(part, results[part])]), flush=True)
    finally:
        line.leave()
    if args.json:
        write_json(args.json, results)
    return 0
