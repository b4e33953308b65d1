# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig tune``: settings of the Alfa46 for an operating range, as a front of trade-offs, verified on other conditions."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import ProgressLine
from .shared_arguments import add_set

if TYPE_CHECKING:
    import argparse

SHIFTS = 90_000  # some 6 minutes on two cores
OF_A_TUNING = (  # arguments that api.tune takes as they are
    *("ways", "speeds", "load_up", "load_down", "oil", "rigs", "judge_rigs", "points", "fresh"),
    *("spreads", "shifts", "generations", "seed", "jobs"),
)
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
    from ..api import load, tune
    from ..base import ended_by, quoted
    from ..runs import pairs, parse_settings, run_folder, unless_empty
    from ..studies import tuning_text

    folder = run_folder(None, "tune") if args.out is None else Path(args.out)
    objectives, line = args.objectives.split(","), ProgressLine(1.0)
    try:
        with unless_empty(folder):
            _, summary, _ = tune(
                load(args.rig, **parse_settings(args.settings)),
                folder,
                **{name: getattr(args, name) for name in OF_A_TUNING},
                objectives=objectives,
                bounds=pairs("--bound", args.bounds, 'NAME=VALUE, e.g. peak="300 Nm"'),
                watch=line.show,
            )
    except KeyboardInterrupt as stop:
        line.leave()
        what, code = ended_by(stop)
        print(f"rig: {what}; go on with the same command and --out {quoted(folder)}", file=sys.stderr)
        return code
    if args.json:
        from ..analysis import plain

        print(json.dumps(plain(summary), indent=1, ensure_ascii=False))
    else:
        print(tuning_text(summary, objectives))
    return 0
