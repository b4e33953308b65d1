# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arguments that ``run`` and ``simulate`` share: sequence, rig, output."""

from __future__ import annotations

import argparse
import math
import sys
from typing import NamedTuple

from ..base import MOST_DELAY, RigError
from .shared_arguments import add_list, add_set

LOST = 3  # exit code of a run that was completed but lost messages or time
LEAST_COME = 2.0  # s, least time that a program needs until it is discovered
MOST_COME = 60.0  # s, longest wait for a program
NO_TRIPS = "trips.watched=off"  # the setting of --no-trips; help need not load the rig room for it


def seed(text: str) -> int:
    """Return the number of --seed, which must fit into 63 bits."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number from 0 to 2^63 - 1")
    return value


def delay(text: str) -> int:
    """Return the samples of --delay."""
    if not text.isdecimal() or int(text) > MOST_DELAY:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number of samples from 0 to {MOST_DELAY}")
    return int(text)


class StepTimeout(NamedTuple):
    """Wall-clock limits for a sample, and for a separate controller program to connect [s]; None means no limit."""

    step: float | None = 5.0
    come: float | None = MOST_COME


def step_timeout(text: str) -> StepTimeout:
    """Return the limits of --step-timeout; a controller has as long to connect, but at least 2 s and at most a minute."""
    if text == "none":
        return StepTimeout(None, None)
    seconds = above_zero(text, None, "seconds above 0, e.g. 0.2, or none")
    return StepTimeout(seconds, min(max(seconds, LEAST_COME), MOST_COME))


def above_zero(text: str, endless: str | None, what: str = "a number above 0") -> float:
    """Return a number above zero, or inf for the word ``endless`` if there is one; ``what`` is expected."""
    try:
        value = math.inf if text == endless else float(text)
    except ValueError:
        value = 0.0
    if not value > 0.0 or (math.isinf(value) and text != endless):
        raise argparse.ArgumentTypeError(f"'{text}': expected {what}{f' or {endless}' if endless else ''}")
    return value


def add_shared_arguments(parser: argparse.ArgumentParser, by_hand: bool = False) -> None:
    """Add sequence and its parameters, output folder, rig, seed, changed values, controller and its level.

    ``by_hand`` is True when the sequence may be absent.
    """
    text = "name of an installed sequence or a .yaml file"
    if by_hand:
        parser.add_argument("sequence", nargs="?", help=f"{text}; without one the rig runs until Ctrl-C and takes orders over ROS")
    else:
        parser.add_argument("sequence", help=text)
    parser.add_argument("--out", metavar="DIR", help="folder for the run (default: runs/<sequence>-<n>)")
    parser.add_argument("--rig", metavar="NAME", help="rig, its folder or .yaml file (default: the one that the sequence is of)")
    parser.add_argument("--seed", type=seed, default=1, help="seed of the transducers' noise and errors (default: 1)")
    add_set(parser, 'change one value of the rig, e.g. alfa46.t12="200 ms"')
    parser.add_argument(
        "--no-trips",
        action="append_const",
        const=NO_TRIPS,
        dest="settings",
        help="let the rig go on beyond the limits of `rig list trips`, to see what breaks; every report of the run says so",
    )
    parser.add_argument("--faults", action="store_true", help="enable faults, for a sequence's steps and orders over ROS")
    add_list(
        parser,
        "--fault",
        "NAME",
        "fault",
        'a fault and how it sets in, e.g. "motor.weak, at=8 s" (./rig list faults); a set of them, faults/NAME.yaml; or '
        "random, drawn by the seed; enables faults",
    )
    add_list(parser, "--with", "NAME=VALUE", "parameters", 'give a parameter of the sequence a value, e.g. speed="1500 rpm"')
    parser.add_argument(
        "--controller",
        metavar="SPEC",
        help="your controller in place of the Alfa46, e.g. python:FILE.py:CLASS or c:FILE.c (docs/how_to/controllers.md)",
    )
    add_in_process(parser)
    parser.add_argument(
        "--delay",
        type=delay,
        default=1,
        metavar="N",
        help="samples of 1 ms from a measurement to the moment from which the controller's answer to it "
        "acts (default: 1; 0 where simulated time waits)",
    )
    parser.add_argument(
        "--step-timeout",
        type=step_timeout,
        default=StepTimeout(),
        metavar="S",
        help="seconds of wall clock that the controller may take for one sample, and to come, where "
        "simulated time waits, or none while debugging (default: 5, and 60 to come)",
    )
    parser.add_argument(
        "--level",
        choices=("duty", "current"),
        help="what the controller returns, if it can return both (default: the first that it names)",
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="exit code 1 also when a shift of the report is not valid, e.g. for tests of a controller",
    )


def settings_of(args: argparse.Namespace, rig: str) -> dict[str, str]:
    """Return the changed values of --set, with the faults of --faults and --fault among them.

    Parameters
    ----------
    args : argparse.Namespace
        The arguments.
    rig : str
        The rig, whose sets of faults --fault may name.

    Raises
    ------
    RigError
        When a value is given twice, or there is no such set.
    """
    from ..rig import FAULTS, orders_by_name
    from ..runs import parse_settings

    settings = parse_settings(args.settings)
    if args.faults or args.fault:
        if FAULTS in settings:
            raise RigError(f"--set {FAULTS} and --fault or --faults say the same; give one of them")
        settings[FAULTS] = orders_by_name(args.fault, rig, args.seed, settings)
    return settings


def add_in_process(parser: argparse.ArgumentParser) -> None:
    """Add --in-process; ``controller_of`` applies it."""
    parser.add_argument(
        "--in-process",
        action="store_true",
        default=None,
        help="run a Python controller in the rig's process: a debugger works there and a step costs some us less, "
        "but its crash is the rig's, and only its steps have a limit of time",
    )


def controller_of(spec: str | None, in_process: bool | None) -> str | None:
    """Return the specification of --controller with --in-process behind it, where its level would stand."""
    from ..controllers import IN_PROCESS, split_level

    if not in_process:
        return spec
    text, level = split_level(spec or "alfa46", None)
    return f"{text}{IN_PROCESS}{f'@{level}' if level else ''}"


def add_recording_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is recorded and how it is stored, and whether lost messages count as an error."""
    from ..nodes import add_options

    add_options(parser)
    parser.add_argument("--allow-loss", action="store_true", help="exit code 0 also when messages or time were lost (default: 3)")


def exit_code(state: str, report: dict, strict: bool, lost: str = "") -> int:
    """Return the exit code of a run that ended in this state.

    Prints the reason when --strict makes it 1, and what went wrong at a controller's end.

    Parameters
    ----------
    state : str
        The state in which the run ended.
    report : dict
        The run's report.
    strict : bool
        True with --strict.
    lost : str
        What the run lost, unless losses are allowed.
    """
    controller = report["run"].get("controller") or {}
    if "end_fault" in controller:
        print(f"rig: warning: controller {controller['name']}: {controller['end_fault']}", file=sys.stderr)
    if state != "ended":
        return 130 if state == "interrupted" else 1
    invalid = sum(not shift["valid"] for shift in report["shifts"])
    if strict and invalid:
        print(f"rig: --strict: {invalid} of {len(report['shifts'])} shifts not valid; the report has the reasons", file=sys.stderr)
        return 1
    return LOST if lost else 0
