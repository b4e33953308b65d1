"""``rig bench WHAT``: how fast something is, on this machine; ``--json`` for programs."""

from __future__ import annotations

import json

HELP = "measure how fast the rig computes on this machine"


def add_arguments(parser) -> None:
    parser.add_argument("what", choices=("kernel",), help="kernel: the rig without bag and ROS")
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="the fastest of so many runs counts")
    parser.add_argument("--no-start", action="store_true", help="leave out the start without kept compiled code (30 s)")
    parser.add_argument("--json", action="store_true", help="for programs")


def main(args) -> int:
    from ..errors import RigError
    from ..testbench.bench_kernel import bench_kernel, lines

    if args.repeats < 1:
        raise RigError(f"--repeats {args.repeats}: at least 1 is needed")
    result = bench_kernel(args.repeats, not args.no_start)
    print(json.dumps(result, indent=2) if args.json else "\n".join(lines(result)))
    return 0
