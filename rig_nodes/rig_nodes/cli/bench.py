# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig bench [PART ...]``: how fast the rig computes on this machine, part by part; ``--json`` for programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..base import ProgressLine
from .shared_arguments import add_json

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

HELP = "measure how fast the rig computes on this machine"
PARTS = ("kernel", "rigs", "demo", "graph", "controllers", "scaling", "peers")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}, or all (default): some three minutes on an idle machine"
    )
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="the fastest of so many runs counts")
    add_json(parser, "write the numbers as JSON; - for stdout, without tables")


def main(args: argparse.Namespace) -> int:
    """Measure the chosen parts, print and write the numbers."""
    from ..base import RigError

    parts = _chosen(args.parts)
    if args.repeats < 1:
        raise RigError(f"--repeats {args.repeats}: at least 1 is needed")
    from ..studies import TITLES, lines, machine, machine_line
    from .json_output import write_json

    line = ProgressLine()
    results: dict = {"machine": machine()}
    text = args.json != "-"
    if text:
        print(machine_line(results["machine"]), flush=True)
    try:
        for number, part in enumerate(parts):
            head = f"[{number + 1}/{len(parts)}] {part}"
            results[part] = _measure(
                part, args.repeats, lambda detail, head=head, number=number: line.show(number, f"{head}: {detail}")
            )
            line.leave()
            if text:
                print("\n".join(["", TITLES[part], "", *lines(part, results[part])]), flush=True)
    finally:
        line.leave()
    if args.json:
        write_json(args.json, results)
    return 0


def _chosen(parts: list[str]) -> list[str]:
    from ..base import RigError, unknown

    for part in parts:
        if part not in (*PARTS, "all"):
            raise RigError(unknown("part to measure", part, (*PARTS, "all")))
    return list(PARTS) if not parts or "all" in parts else [part for part in PARTS if part in parts]


def _measure(part: str, repeats: int, show: Callable[[str], None]) -> dict | list[dict] | str:
    from ..base import DEFAULT_RIG

    if part == "kernel":
        from ..studies import bench_kernel

        return bench_kernel(DEFAULT_RIG, repeats, show)
    if part == "rigs":
        from ..studies import bench_rigs

        return bench_rigs(repeats, show)
    if part == "demo":
        from ..studies import bench_demo

        return bench_demo(repeats, show)
    if part == "graph":
        from ..base import need_ros
        from ..studies import bench_graph

        need_ros("rig bench graph")
        return bench_graph(min(repeats, 3), show)
    if part == "controllers":
        from ..rig import load_rig
        from ..studies import controllers_table

        show("every plug")
        rows = [cost._asdict() for cost in controllers_table(load_rig(DEFAULT_RIG))]
        return [{**row, "median_us": None, "p99_us": None} if row["missing"] else row for row in rows]
    if part == "scaling":
        from ..studies import bench_scaling

        return bench_scaling(DEFAULT_RIG, show)
    from ..studies import bench_peers

    return bench_peers(0.05 * repeats, show)
