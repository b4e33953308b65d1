# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig simulate SEQUENCE``: a sequence without ROS traffic, as fast as possible; it writes the same bag as ``run``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ..base import printable, quoted
from .run_arguments import add_shared_arguments, controller_of, exit_code, settings_of

if TYPE_CHECKING:
    import argparse

HELP = "run a test sequence without ROS traffic, as fast as it goes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_shared_arguments(parser)


def main(args: argparse.Namespace) -> int:
    """Check, run and report; return 0 only when the sequence was completed."""
    from ..analysis import format_report, write_report
    from ..api import simulated
    from ..base import DEFAULT_RIG, interrupted_code, rig_of
    from ..controllers import embedded_line, level_line, load_controller
    from ..rig import load_rig
    from ..runs import Ordered, check_controller, check_level, load_sequence, parse_parameters, run_folder

    args.controller = controller_of(args.controller, args.in_process)
    rig = args.rig or rig_of(args.sequence, DEFAULT_RIG)
    config = load_rig(rig, settings_of(args, rig))
    sequence = load_sequence(args.sequence, parse_parameters(args.parameters), rig, DEFAULT_RIG, config)
    sequence.check_rig(config)
    controller = None
    if args.controller or args.level or args.delay != 1:
        check_controller(config)
        controller = load_controller(args.controller, config, args.level)
        check_level(config, controller.level)
        print(level_line(controller), flush=True)
        controller.say = lambda text: print(f"            {printable(text)}", flush=True)
        controller.pace(args.step_timeout.step)
        controller.wait(args.step_timeout.come)
    folder = run_folder(args.out, sequence.name)
    if controller is None and config.structure.shifts:
        print(embedded_line(), flush=True)
    shown = [""]

    def progress(t: float, text: str) -> None:
        if text != shown[0]:
            shown[0] = text
            print(f"{t:8.2f} s  {printable(text)}", flush=True)

    report = simulated(folder, Ordered(config, rig, sequence, args.seed, args.delay, args.controller), progress, controller)
    print(format_report(report))
    write_report(folder, report)
    print(f"written to {folder}; look at it with: ./rig view {quoted(folder)}", flush=True)
    end = report["run"]["end"]
    state, reason = end["state"], end["reason"]
    if state != "ended":
        print(f"rig: {printable(reason)}", file=sys.stderr)
    if state == "interrupted":
        return interrupted_code(reason)
    return exit_code(state, report, args.strict)
