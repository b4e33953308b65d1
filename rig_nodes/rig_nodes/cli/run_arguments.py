# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arguments that ``run`` and ``simulate`` share: which sequence, which rig, where to."""

from __future__ import annotations

import argparse
import math
import sys
from typing import NamedTuple

LOST = 3  # exit code of a run that came to its end and lost messages or time
LEAST_COME = 2.0  # s that a program needs to be found
MOST_DELAY = 50  # samples: half of the time after which a silent controller is the safe state


def seed(text: str) -> int:
    """The number of --seed: what fits into 63 bits."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number from 0 to 2^63 - 1")
    return value


def delay(text: str) -> int:
    """The samples of --delay."""
    if not text.isdecimal() or int(text) > MOST_DELAY:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number of samples from 0 to {MOST_DELAY}")
    return int(text)


class StepTimeout(NamedTuple):
    """Seconds of wall clock for a sample, and for a controller of its own program to come; None: for ever."""

    step: float | None = 5.0
    come: float | None = 60.0


def step_timeout(text: str) -> StepTimeout:
    """What --step-timeout says; a controller has as long to come, but 2 s at least and a minute at most."""
    if text == "none":
        return StepTimeout(None, None)
    seconds = above_zero(text, None)
    return StepTimeout(seconds, min(max(seconds, LEAST_COME), StepTimeout().come))


def above_zero(text: str, endless: str | None) -> float:
    """A number above zero, inf for the word ``endless`` where there is one."""
    try:
        value = math.inf if text == endless else float(text)
    except ValueError:
        value = 0.0
    if not value > 0.0 or (math.isinf(value) and text != endless):
        raise argparse.ArgumentTypeError(f"'{text}': expected a number above 0{f' or {endless}' if endless else ''}")
    return value


def add_shared_arguments(parser: argparse.ArgumentParser, by_hand: bool = False) -> None:
    """Sequence and its parameters, output folder, rig, seed, changed values, controller and its level.

    by_hand: it goes without a sequence too.
    """
    text = "name of an installed sequence or a .yaml file"
    if by_hand:
        parser.add_argument("sequence", nargs="?", help=f"{text}; without one the rig runs until Ctrl-C and takes orders over ROS")
    else:
        parser.add_argument("sequence", help=text)
    parser.add_argument("--out", metavar="DIR", help="folder for the run (default: runs/<sequence>-<n>)")
    parser.add_argument("--rig", metavar="NAME", help="rig, its folder or .yaml file (default: the one that the sequence is of)")
    parser.add_argument("--seed", type=seed, default=1, help="seed of the transducers' noise and errors (default: 1)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="settings",
        help='change one value of the rig, e.g. alfa46.t12="200 ms" (may be repeated)',
    )
    parser.add_argument(
        "--with",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="parameters",
        help='give a parameter of the sequence a value, e.g. speed="1500 rpm" (may be repeated)',
    )
    parser.add_argument(
        "--controller",
        metavar="SPEC",
        help="your controller in place of the Alfa46, e.g. python:FILE.py:CLASS or c:FILE.c (docs/how_to/controllers.md)",
    )
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
        "--level", choices=("duty", "current"), help="what the controller returns, when it knows both (default: its first)"
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="exit code 1 also when a shift of the report is not valid, e.g. for tests of a controller",
    )


def add_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """Which topics beyond the rig's own are recorded, and whether a loss is one."""
    from ..graph.topic_choice import EXCLUDE, TOPICS

    for flag, keywords in (TOPICS, EXCLUDE):
        parser.add_argument(flag, **keywords)
    parser.add_argument("--allow-loss", action="store_true", help="exit code 0 also when messages or time were lost (default: 3)")


def exit_code(state: str, report: dict, strict: bool, lost: str = "") -> int:
    """Of a run that ended in this state; lost: what it lost, unless that is allowed. Says why when --strict makes it 1,
    and what a controller's end went wrong with.
    """
    controller = report["run"].get("controller") or {}
    if "end_fault" in controller:
        print(f"rig: warning: controller {controller['name']}: {controller['end_fault']}", file=sys.stderr)
    if state != "ended":
        return 130 if state == "interrupted" else 1
    invalid = sum(not shift["valid"] for shift in report["shifts"])
    if strict and invalid:
        print(f"rig: --strict: {invalid} of {len(report['shifts'])} shifts not valid; the report says why", file=sys.stderr)
        return 1
    return LOST if lost else 0
