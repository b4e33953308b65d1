# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig calibrate`: it identifies the rig's unknown parameters again and, with --write, puts them into its configuration."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from ..base import DEFAULT_RIG, ProgressLine
from .shared_arguments import add_json

if TYPE_CHECKING:
    from ..studies import Found, Parameter

HELP = "find a rig's unknown parameters on the laboratory's rows, or on its own"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "--rig",
        default=DEFAULT_RIG,
        metavar="NAME",
        help=f"rig, its folder or .yaml file: whose calibration.yaml and validation.yaml (default: {DEFAULT_RIG}, on the "
        "laboratory's rows)",
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help="put what was found into the rig's rig.yaml and the settings of its controller; without it nothing is changed",
    )
    add_json(parser, "write values, misses, sensitivities, spreads and profiles")
    parser.add_argument(
        "--generations",
        type=int,
        default=120,
        metavar="N",
        help="of the search over the bounds (default 120, some 10 min); 0: only from where the rig is, a minute",
    )
    parser.add_argument(
        "--starts",
        type=int,
        default=0,
        metavar="N",
        help="least squares from so many random places of the bounds too (default 0; half a minute each for a clutch)",
    )
    parser.add_argument("--stages", nargs="+", metavar="NAME", help="only these of calibration.yaml")
    parser.add_argument(
        "--trade-offs",
        action="store_true",
        help="then what it costs to mend each of two rows that pull against each other (minutes)",
    )
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the search (default 1)")
    parser.epilog = "What may change, and how far, stands in calibration.yaml: docs/how_to/rigs.md."


def main(args: argparse.Namespace) -> int:
    """Search, print the result and, on request, write it; RigError when the search is not possible."""
    from ..api import calibrate
    from ..base import ended_by
    from .json_output import write_json

    line = ProgressLine()
    try:
        result = calibrate(
            args.rig,
            generations=args.generations,
            starts=args.starts,
            stages=args.stages,
            trade_offs=args.trade_offs,
            jobs=args.jobs,
            seed=args.seed,
            watch=line.show,
        )
    except KeyboardInterrupt as stop:
        what, code = ended_by(stop)
        print(f"\nrig: {what}; nothing was changed", file=sys.stderr)
        return code
    line.leave()
    _print(result.found, result.known, result.curves)
    if args.json:
        write_json(args.json, result.as_dict())
    if args.write:
        result.write()
        print("written to the rig's configuration")
    return 0


def _print(found: Found, parameters: dict[str, Parameter], curves: list[Any]) -> None:
    """Print the values, the misses before and after, and the trade-offs."""
    print(f"{'parameter':24} {'value':>12} {'spread':>12} {'profile':>12} {'bounds':>25}  (SI)")
    for name, value in found.values.items():
        p = parameters[name]
        bounds = f"{p.low:.4g} to {p.high:.4g}"
        print(f"{name:24} {value:12.5g} {found.spread[name]:12.3g} {found.profile[name]:12.3g} {bounds:>25}  {', '.join(p.of)}")
    print(f"\n{'row':30} {'before':>12} {'after':>12} {'miss':>8}  (SI; miss in tolerances)")
    for stage, misses in found.after.items():
        for before, after in zip(found.before[stage], misses):
            print(f"{after.row:30} {before.value:12.5g} {after.value:12.5g} {after.tolerances:8.2f}")
    for curve in curves:
        print(f"\ntrade-off of {curve.stage}, misses in tolerances: {curve.rows[0]} against {curve.rows[1]}")
        for point in curve.points:
            print("  weight {:6g}  {:8.2f}  {:8.2f}".format(point.weight, *point.misses))
