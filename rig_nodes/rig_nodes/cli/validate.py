# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig validate``: every number and trend that the laboratory printed, compared with the rig; for another rig its own rows."""

from __future__ import annotations

import platform
import sys
import time
from importlib import import_module
from typing import TYPE_CHECKING

from ..base import ProgressLine
from .output_files import OutputFolder
from .shared_arguments import add_json, add_rig, add_set

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

HELP = "compare a rig with its validation rows, the HydmAG with all printed results"
STARTING = 2.0  # cost of starting the processes, in the unit of a programme's runs_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "--rows", nargs="+", default=[], metavar="PATTERN", help="only these rows; * matches any text, e.g. 'up_t_*'"
    )
    parser.add_argument(
        "--procedures", nargs="+", default=[], metavar="NAME", help="only rows of these procedures, e.g. grid_up delay_series"
    )
    add_json(parser, "write rows, summary and versions as JSON; - for stdout")
    parser.add_argument("--pictures", type=OutputFolder(), metavar="FOLDER", help="write the figures of chapters 7 to 9 as SVG")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes that run series (default: 2)")
    add_rig(parser, "rig, its folder or .yaml file: whose validation.yaml")
    add_set(parser, "change one value of the rig")


def main(args: argparse.Namespace) -> int:
    """Run what the rows need, print and write the comparison; return 1 when a run tripped."""
    from ..api import load, validated, whole
    from ..controllers import embedded_line
    from ..runs import parse_settings
    from ..studies import terminal
    from .json_output import write_json

    began, jobs, all_runs = time.monotonic(), whole("jobs", args.jobs, 1), 0
    rig = load(args.rig, **parse_settings(args.settings))

    def watch(runs: dict[str, tuple[int, float]]) -> Callable[[str, int, int], None]:
        nonlocal all_runs
        all_runs = sum(count for count, _ in runs.values())
        line = ProgressLine(STARTING + sum(count * size for count, size in runs.values()))
        done = STARTING
        if runs and "" not in runs:
            print(embedded_line(), file=sys.stderr, flush=True)

        def progress(procedure: str, count: int, of: int) -> None:
            nonlocal done
            done += runs[procedure][1]
            line.show(done, (f"{procedure:<15} {count:>3}" if procedure else f"{count}") + f" of {of} runs", count == of)

        return progress

    found = validated(rig, args.rows, args.procedures, args.pictures, jobs, watch)
    of_holds = ""
    if found.programme:
        print(f"{all_runs} runs with their metrics in {time.monotonic() - began:.1f} s", file=sys.stderr)
        of_holds = import_module(f"{found.programme}.document").of_holds(found.rows)
    if args.json != "-":
        print(terminal(found.rows, of_holds))
    if args.json:
        write_json(
            args.json,
            {
                "rows": [row.as_dict() for row in found.rows],
                "summary": found.summary,
                "versions": _versions(),
                "rig": args.rig,
                "settings": rig.settings,
                "procedures": list(found.procedures),
            },
        )
    if args.pictures:
        print(f"{found.figures} figures written to {args.pictures}", file=sys.stderr)
    if found.trips:
        print(f"rig: {len(found.trips)} of the runs tripped, the first one {found.trips[0]}", file=sys.stderr)
        return 1
    return 0


def _versions() -> dict[str, str]:
    from importlib.metadata import version

    import rig_nodes

    return {
        "rig_nodes": rig_nodes.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "numba")},
    }
