# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recorder takes and how it stores it: the options that `rig run` and the recorder share.

The recorder uses it, and `rig run` and the launch file refuse wrong options with it before anything starts. It imports no ROS.
"""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING, Any

from ...base import RigError, number_within

if TYPE_CHECKING:
    from ...bags import Layout

CLOCK = "/clock"  # not recorded, because the playback of a bag publishes a clock of its own
SECOND_CLOCK = "second_clock"  # name of the events about other nodes that send it
SMALLEST, SHORTEST = 100_000, 0.5  # bytes, s of a file; with less, its definitions and indices would be most of it
LONGEST = 1e6  # s


def _size(text: str) -> int:
    if not text.isdecimal() or int(text) < SMALLEST:
        raise argparse.ArgumentTypeError(f"'{text}': expected bytes, {SMALLEST} or more")
    return int(text)


def _seconds(text: str) -> float:
    return number_within(text, f"length of a file; give seconds of simulated time, {SHORTEST} or more", SHORTEST, LONGEST)


OPTIONS: list[tuple[str, dict[str, Any]]] = [
    (
        "--topics",
        {
            "metavar": "REGEX",
            "help": "beside the rig's own topics, record only those whose whole name matches (default: every topic of the ROS "
            "domain)",
        },
    ),
    ("--exclude", {"metavar": "REGEX", "help": "beside the rig's own topics, record none whose whole name matches"}),
    (
        "--own-topics",
        {
            "metavar": "REGEX",
            "help": "of the rig's own topics, record only those whose whole name matches, and the latched ones, which describe "
            "the run (default: all)",
        },
    ),
    ("--max-bag-size", {"type": _size, "default": 0, "metavar": "BYTES", "help": "begin another file of the bag at this size"}),
    (
        "--max-bag-duration",
        {"type": _seconds, "default": 0.0, "metavar": "S", "help": "begin another file of the bag after so many simulated seconds"},
    ),
    (
        "--compression-mode",
        {
            "choices": ("chunk", "file", "none"),
            "default": "chunk",
            "help": "what zstd packs: each chunk, or a file as a whole when it is closed (default: chunk)",
        },
    ),
    (
        "--keep-last",
        {
            "type": _seconds,
            "default": 0.0,
            "metavar": "S",
            "help": "keep the last simulated seconds in memory, and write them when /recorder/snapshot is called and at the end",
        },
    ),
    ("--start-paused", {"action": "store_true", "help": "record nothing until /recorder/resume is called"}),
]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    for flag, keywords in OPTIONS:
        parser.add_argument(flag, **keywords)


def words(args: argparse.Namespace) -> tuple[str, ...]:
    """Return the command line of a recorder with the options that ``args`` holds; RigError for a wrong pattern."""
    TopicChoice(args.topics, args.exclude, args.own_topics)
    found: list[str] = []
    for flag, keywords in OPTIONS:
        value = getattr(args, flag[2:].replace("-", "_"))
        if value != keywords.get("default") and value is not None and value is not False:
            found += [flag] if value is True else [flag, str(value)]
    return tuple(found)


def layout(args: argparse.Namespace) -> Layout:
    """Return how the bag is stored in files."""
    from ...bags import Layout  # not above: the Python of `ros2 launch` may lack the packages that it needs

    return Layout(args.max_bag_size, round(args.max_bag_duration * 1e9), args.compression_mode)


class TopicChoice:
    """The topics that are recorded: a choice by regular expressions on whole names; None stands for no such condition.

    Parameters
    ----------
    topics : str or None
        Only topics that match are taken.
    exclude : str or None
        Topics that match are left out.
    own : str or None
        Of the rig's own topics, only those that match are taken.

    Raises
    ------
    RigError
        When one of them is no regular expression.
    """

    def __init__(self, topics: str | None = None, exclude: str | None = None, own: str | None = None) -> None:
        """Compile the expressions."""
        self._topics, self._exclude = _pattern("--topics", topics), _pattern("--exclude", exclude)
        self._own = _pattern("--own-topics", own)

    def takes_own(self, name: str) -> bool:
        """Return whether a topic of the rig is recorded."""
        return self._own is None or self._own.fullmatch(name) is not None

    def takes(self, name: str) -> bool:
        """Return whether a topic is recorded; /clock and hidden topics, such as an action's feedback, never are."""
        if name == CLOCK or any(part.startswith("_") for part in name.split("/")):
            return False
        if self._exclude is not None and self._exclude.fullmatch(name):
            return False
        return self._topics is None or self._topics.fullmatch(name) is not None


def _pattern(option: str, text: str | None) -> re.Pattern | None:
    try:
        return None if text is None else re.compile(text)
    except re.error as error:
        raise RigError(f"{option} {text}: is no regular expression ({error}), e.g. '/camera/.*|/rosout'") from None
