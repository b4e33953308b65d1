# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig calibrate`: finds the rig's unknown parameters again and, with --write, puts them into its configuration."""

import argparse
import sys
from dataclasses import asdict

from .progress import ProgressLine

HELP = "find the rig's unknown parameters on the laboratory's rows"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--write", action="store_true", help="put what was found into rigs/hydmag/rig.yaml and "
                        "config/controllers/alfa46.yaml of the package; without it nothing is changed")
    parser.add_argument("--json", metavar="FILE", help="write values, misses, sensitivities and spreads")
    parser.add_argument("--generations", type=int, default=120, metavar="N",
                        help="of the search over the bounds (default 120, some 10 min); 0: only from where the rig is, "
                             "a minute")
    parser.add_argument("--starts", type=int, default=0, metavar="N",
                        help="least squares from so many random places of the bounds too (default 0; half a minute "
                             "each for a clutch)")
    parser.add_argument("--stages", nargs="+", metavar="NAME", help="only these: losses, clutch_s1, clutch_s2, release")
    parser.add_argument("--trade-offs", action="store_true",
                        help="then what it costs to mend each of two rows that pull against each other (minutes)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the search (default 1)")
    parser.epilog = "What may change, and how far, stands in validation/calibration.yaml of the package."


def main(args: argparse.Namespace) -> int:
    from ..config.names import find_config, unknown
    from ..config.units import SI
    from ..errors import RigError, ended_by
    from ..testbench.configuration import load_rig
    from ..validation import calibrate as c
    from ..validation.calibration_rows import ROWS
    from ..validation.trade_off import trade_offs
    from .written import check_json, write_json

    check_json(args.json)
    for name, least in (("generations", 0), ("starts", 0), ("jobs", 1)):
        if getattr(args, name) < least:
            raise RigError(f"--{name} is {getattr(args, name)}, expected at least {least}")
    for stage in args.stages or ():
        if stage not in ROWS:
            raise RigError(f"--stages: {unknown('stage', stage, ROWS)}")
    parameters = {f"{stage}.{name}": p for stage, those in c.load_stages().items() for name, p in those.items()}

    line = ProgressLine()

    def progress(stage: str, turn: int, cost: float) -> None:
        line.tell(turn, f"{stage}: generation {turn}, misses cost {cost:.3f}")

    def pair(stage: str, one: str, other: str) -> None:
        line.tell(0.0, f"{stage}: {one} against {other}")

    def plain(miss) -> dict:
        return {"row": miss.row, "value": miss.value, "tolerances": miss.tolerances}

    curves = []
    try:
        found, rig = c.calibrate(load_rig(c.LABORATORY), args.generations, args.jobs, args.seed, args.stages, progress,
                                 args.starts)
        if args.trade_offs:
            curves = trade_offs(rig, found.after, found.sensitivities, args.jobs, pair)
    except KeyboardInterrupt as stop:
        what, code = ended_by(stop)
        print(f"\nrig: {what}; nothing was changed", file=sys.stderr)
        return code
    line.leave()
    print(f"{'parameter':24} {'value':>12} {'spread':>12}  (SI)")
    for name, value in found.values.items():
        print(f"{name:24} {value:12.5g} {found.spread[name]:12.3g}  {', '.join(parameters[name].of)}")
    print(f"\n{'row':30} {'before':>12} {'after':>12} {'miss':>8}  (SI; miss in tolerances)")
    for stage, misses in found.after.items():
        for before, after in zip(found.before[stage], misses):
            print(f"{after.row:30} {before.value:12.5g} {after.value:12.5g} {after.tolerances:8.2f}")
    for curve in curves:
        print(f"\ntrade-off of {curve.stage}, misses in tolerances: {curve.rows[0]} against {curve.rows[1]}")
        for point in curve.points:
            print("  weight {:6g}  {:8.2f}  {:8.2f}".format(point.weight, *point.misses))
    if args.json:
        write_json(args.json, {
            "values": found.values, "spread": found.spread, "sensitivities": found.sensitivities,
            "before": [plain(miss) for misses in found.before.values() for miss in misses],
            "after": [plain(miss) for misses in found.after.values() for miss in misses],
            "trade_offs": [asdict(curve) for curve in curves],
            "bounds": {n: [p.low, p.high] for n, p in parameters.items()}, "units": SI})
    if args.write:
        c.write_values(found.values, find_config("rigs", c.LABORATORY), find_config("controllers", "alfa46"))
        print("written to the rig's configuration")
    return 0
