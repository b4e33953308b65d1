# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig tune``: settings of the Alfa46 for an operating range, as a front of trade-offs, verified on other conditions."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import ProgressLine
from .shared_arguments import add_set

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence

    from ..studies import Problem

SHIFTS = 90_000  # some 6 minutes on two cores
HELP = "find valve profiles and delays for an operating range: a front of trade-offs, with controllers to use"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "--ways", nargs="+", metavar="WAY", help="names of both gears, FROM-TO (default: every shift to the next gear)"
    )
    parser.add_argument(
        "--speeds",
        default="1000 rpm .. 2000 rpm",
        metavar="RANGE",
        help='of the input shaft (default "1000 rpm .. 2000 rpm", the thesis\'s)',
    )
    parser.add_argument(
        "--load-up",
        default="40 Nm .. 120 Nm",
        metavar="RANGE",
        help="torque at the output before a shift up (default the thesis's)",
    )
    parser.add_argument(
        "--load-down", default="40 Nm .. 240 Nm", metavar="RANGE", help="before a shift down (default the thesis's)"
    )
    parser.add_argument(
        "--objectives",
        default="peak,time",
        metavar="A,B",
        help="two or more of peak, time, dip, energy, jerk (default peak,time); the first two are drawn and chosen by",
    )
    parser.add_argument(
        "--bound",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="bounds",
        help='largest value of an objective in any shift, e.g. peak="300 Nm" (may be repeated; '
        "dip is bounded to 5 %%, or what the compared settings dip)",
    )
    parser.add_argument("--oil", default="20 degC .. 60 degC", metavar="RANGE", help="temperatures (default 20 to 60 degC)")
    parser.add_argument("--rigs", type=int, default=11, metavar="N", help="sampled rigs beside the rig itself (default 11)")
    parser.add_argument("--judge-rigs", type=int, default=12, metavar="N", help="other sampled rigs to judge on (default 12)")
    parser.add_argument("--points", type=int, default=8, metavar="N", help="operating points to judge in (default 8)")
    parser.add_argument(
        "--fresh",
        type=int,
        default=3,
        metavar="N",
        help="judgements of the written controllers, each on rigs and in points of its own (default 3)",
    )
    parser.add_argument(
        "--spreads",
        metavar="FILE",
        help="spreads of the calibrated parameters, from rig calibrate --json (default: determined anew)",
    )
    parser.add_argument(
        "--rig",
        default="hydmag",
        metavar="NAME",
        help="rig or .yaml file; its controller is what is compared with (default: hydmag)",
    )
    add_set(parser, "change one value of the rig")
    parser.add_argument(
        "--shifts",
        type=int,
        default=SHIFTS,
        metavar="N",
        help=f"that the search tries; the same settings each time, however fast the machine is (default {SHIFTS})",
    )
    parser.add_argument("--generations", type=int, metavar="N", help="at most so many of each search")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of search and sampled rigs (default 1)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default 2)")
    parser.add_argument(
        "--out", metavar="DIR", help="folder (default: runs/tune-<n>); one that holds the same tuning is gone on with"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def main(args: argparse.Namespace) -> int:
    """Search, judge, write the controllers and print the front; RigError when tuning is not possible."""
    from ..base import RigError, ended_by, quoted
    from ..runs import Workers, free_folder
    from ..studies import TUNING, TUNING_JOURNAL, begun, load_optuna, open_journal, parquet, run_tuning, spreads_of, tuning_text

    for name, least in (("jobs", 1), ("rigs", 0), ("judge_rigs", 0), ("points", 1), ("fresh", 1), ("seed", 0)):
        if getattr(args, name) < least:
            raise RigError(f"--{name.replace('_', '-')} is {getattr(args, name)}, expected at least {least}")
    if args.shifts < 1 or (args.generations is not None and args.generations < 1):
        raise RigError("--shifts and --generations must be above 0")
    parquet()
    load_optuna()
    folder = free_folder("tune") if args.out is None else Path(args.out)
    problem = _problem(args)
    # what open_journal would refuse is refused before the spreads are determined, which takes some seconds
    begun(folder, TUNING, problem.manifest(), "tuning", () if args.spreads else ("spreads",))
    line = ProgressLine(1.0)
    with Workers(args.jobs) as workers:
        if not args.spreads:
            problem = replace(problem, spreads=spreads_of(problem.config, problem.calibration, workers))
        journal = open_journal(folder, TUNING, TUNING_JOURNAL, problem.manifest(), "tuning")
        try:
            summary = run_tuning(problem, folder, workers, journal, line.show, partial(_draw, folder, list(problem.objectives)))
        except KeyboardInterrupt as stop:
            line.leave()
            what, code = ended_by(stop)
            print(f"rig: {what}; go on with the same command and --out {quoted(folder)}", file=sys.stderr)
            return code
        finally:
            journal.close()
    if args.json:
        from ..analysis import plain

        print(json.dumps(plain(summary), indent=1, ensure_ascii=False))
    else:
        print(tuning_text(summary, problem.objectives))
    return 0


def _draw(folder: Path, objectives: list[str], name: str, way: str, rows: Sequence[Mapping], chosen: Mapping[str, Mapping]) -> None:
    """Write the chart of a way's front."""
    from ..view import front, write_charts

    write_charts([(name, front(way, rows, objectives, chosen))], folder)


def _problem(args: argparse.Namespace) -> Problem:
    """Return the requested problem, without spreads when no file gives them; RigError before anything is compiled."""
    from ..base import RigError, unknown
    from ..rig import load_gearbox_rig
    from ..runs import parse_settings
    from ..studies import OBJECTIVES, Problem, Range, calibration_for, delay_of, read_beginnings, read_spreads

    objectives = tuple(args.objectives.split(","))
    for name in objectives:
        if name not in OBJECTIVES:
            raise RigError(f"--objectives: {unknown('objective', name, OBJECTIVES)}")
    if len(objectives) < 2 or len(set(objectives)) < len(objectives):
        raise RigError("--objectives: expected two or more different ones")
    config = load_gearbox_rig(args.rig, parse_settings(args.settings), "tune")
    ways = config.transmission.ways()
    wanted = args.ways or list(ways)
    for way in wanted:
        if way not in ways:
            raise RigError(f"--ways: {unknown('way', way, ways)}")
        delay_of(config.transmission, way)
    speeds = _range("--speeds", args.speeds, "angular velocity")
    up, down = _range("--load-up", args.load_up, "torque"), _range("--load-down", args.load_down, "torque")
    ranges = {way: Range(*speeds, *(up if to > of else down)) for way, (of, to) in ways.items()}
    if config.cut_out:
        raise RigError("rig tune searches on a whole rig; give it one without source: topic")
    if config.prescribed:
        raise RigError(f"rig '{config.name}' has prescribed pressures, which no setting of the controller changes")
    bounds, oil = _bounds(args.bounds), _range("--oil", args.oil, "temperature")
    calibration = calibration_for(args.rig, config)
    spreads = read_spreads(args.spreads, calibration) if args.spreads else {}
    rig = str(Path(args.rig).absolute()) if "/" in args.rig or args.rig.endswith((".yaml", ".yml")) else args.rig
    return Problem(
        rig,
        config,
        calibration,
        read_beginnings(args.rig, config.transmission),
        {way: ranges[way] for way in ways if way in wanted},
        objectives,
        bounds,
        spreads,
        oil,
        args.rigs,
        args.judge_rigs,
        args.points,
        args.fresh,
        args.seed,
        args.generations,
        args.shifts,
    )


def _range(option: str, text: str, dimension: str) -> tuple[float, float]:
    from ..base import RigError, quantity

    low, dots, high = text.partition("..")
    if not dots:
        raise RigError(f'{option} {text}: expected "LOW .. HIGH", each with its unit')
    values = quantity(low.strip(), dimension, option), quantity(high.strip(), dimension, option)
    if not 0.0 <= values[0] < values[1]:
        raise RigError(f"{option} {text}: the range must rise from 0 or more")
    return values


def _bounds(texts: list[str]) -> dict[str, float]:
    from ..base import RigError, quantity
    from ..studies import OBJECTIVES

    dimensions = {"peak": "torque", "time": "time", "dip": "ratio", "energy": "energy"}
    out = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign or name not in OBJECTIVES:
            raise RigError(f"--bound {text}: expected NAME=VALUE, the name one of {', '.join(OBJECTIVES)}")
        if name in dimensions:
            out[name] = quantity(value, dimensions[name], f"--bound {name}")
        else:
            number, _, unit = value.strip().partition(" ")
            try:
                out[name] = float(number)
            except ValueError:
                unit = ""
            if unit.strip() != "rad/s3":
                raise RigError(f'--bound {text}: expected a number with its unit, e.g. "5e4 rad/s3"')
        if not math.isfinite(out[name]) or out[name] < 0.0 or (out[name] == 0.0 and name != "dip"):
            raise RigError(f"--bound {text}: expected {'0 or more' if name == 'dip' else 'more than 0'}")
    return out
