# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig rerun`: the recorded commands of a bag through a plant again, or its transducers through a controller."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .run_arguments import add_in_process, controller_of
from .shared_arguments import add_set

if TYPE_CHECKING:
    from pathlib import Path

    from ..analysis import Gathered
    from ..rig import RigConfig

LOST = 3  # exit code: run again, but the bag does not hold its whole run
HELP = "run a bag again: its commands through a plant, or its transducers through a controller"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("bag", metavar="BAG", help="folder of a run, or its .mcap file")
    parser.add_argument(
        "--through",
        nargs="+",
        action=Through,
        required=True,
        metavar=("plant | controller", "SPEC"),
        help="plant, or controller and its specification, e.g. controller c:FILE.c",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for the new bag (default: runs/<name>-rerun-<n>)")
    parser.add_argument("--rig", metavar="NAME", help="another rig, its folder or .yaml file (default: the one in the bag)")
    add_set(parser)
    parser.add_argument("--level", choices=("duty", "current"), help="what the controller returns, if it can return both")
    add_in_process(parser)


class Through(argparse.Action):
    """Reads ``plant`` or ``controller SPEC``."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, *_: object) -> None:
        """Store ("plant", None) or ("controller", SPEC)."""
        words = list(values) if isinstance(values, list) else []
        if words == ["plant"]:
            namespace.through = "plant", None
        elif len(words) == 2 and words[0] == "controller":
            namespace.through = "controller", words[1]
        else:
            raise argparse.ArgumentError(self, f"'{' '.join(words)}': expected plant, or controller and its specification")


def main(args: argparse.Namespace) -> int:
    """Run the bag again; return 1 when a controller failed or the plant tripped."""
    from ..analysis import gather
    from ..bags import faults_of, with_end
    from ..base import RigError, printable, quoted
    from ..rig import config_of_record, load_rig, with_overrides
    from ..runs import check_whole, parse_settings, run_folder, unless_empty

    what, spec = args.through
    if (args.level or args.in_process) and what == "plant":
        raise RigError("--level and --in-process are of a controller; the recorded commands have their own")
    spec = controller_of(spec, args.in_process)
    bag = gather(args.bag)
    check_whole(bag)
    settings = parse_settings(args.settings)
    config = load_rig(args.rig, settings) if args.rig else with_overrides(config_of_record(bag.record, str(bag.path)), settings)
    folder = run_folder(args.out, f"{bag.path.stem.rpartition('_')[0] or bag.path.stem}-rerun")
    with unless_empty(folder):
        code = _plant(bag, config, folder) if what == "plant" else _controller(bag, config, spec, args.level, folder)
    print(f"written to {folder}; look at it with: ./rig view {quoted(folder)}", flush=True)
    faults = faults_of(bag, with_end(bag, {}))
    for fault in faults:
        print(f"rig: {printable(bag.path)}: {printable(fault)}", file=sys.stderr)
    return code or (LOST if faults else 0)


def _plant(bag: Gathered, config: RigConfig, folder: Path) -> int:
    from ..api import rerun_into
    from ..base import printable

    found = rerun_into(folder, bag, config)
    for note in found.notes:
        print(f"rig: warning: {printable(note)}", file=sys.stderr)
    if found.different:
        print(f"{len(found.different)} of {found.topics} topics differ from the recorded ones: {', '.join(found.different)}")
        for line in found.moved:
            print(line)
    else:
        print(f"all {found.topics} topics are bit for bit as recorded")
    if found.run.end["state"] != "tripped":
        return 0
    print(f"rig: the rig tripped: {printable(found.run.end['reason'])}", file=sys.stderr)
    return 1


def _controller(bag: Gathered, config: RigConfig, spec: str, level: str | None, folder: Path) -> int:
    from ..api import rerun_into
    from ..base import printable
    from ..controllers import level_line, load_controller
    from ..runs import check_controller

    check_controller(config)
    controller = load_controller(spec, config, level)
    print(level_line(controller), flush=True)
    controller.say = lambda text: print(f"            {printable(text)}", flush=True)
    controller.wait(60.0)
    found = rerun_into(folder, bag, config, controller, spec).answers
    print(f"{found.same} of {found.samples} answers are bit for bit as recorded")
    if found.first is not None:
        unit = " A" if controller.level == "current" else ""
        print(
            f"the first other answer is that at {found.first:.3f} s; commands differ by at most {found.largest:.3g}{unit}, "
            f"gear or shifting in {found.gears} answers"
        )
    if found.missing:
        print(f"{found.missing} samples were answered by only one of both")
    if controller.end_fault:
        print(f"rig: warning: controller {printable(controller.name)}: {printable(controller.end_fault)}", file=sys.stderr)
    if found.end:
        print(f"rig: {printable(found.end)}", file=sys.stderr)
        return 1
    return 0
