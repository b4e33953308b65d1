# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which topics beyond the rig's own a recorder takes: all of the domain, or those that --topics and --exclude leave.

Used by the recorder; by `rig run` and the launch file, which refuse a wrong pattern before anything starts. No ROS in here.
"""

from __future__ import annotations

import re

from ..errors import RigError

CLOCK = "/clock"  # a bag that is played again brings one of its own
TOPICS = (
    "--topics",
    {
        "metavar": "REGEX",
        "help": "beside the rig's own topics, record only those whose whole name matches (default: every topic of the ROS domain)",
    },
)
EXCLUDE = ("--exclude", {"metavar": "REGEX", "help": "beside the rig's own topics, record none whose whole name matches"})


class TopicChoice:
    """A choice by regular expressions on whole names; None: no such condition."""

    def __init__(self, topics: str | None = None, exclude: str | None = None) -> None:
        """RigError when one of the two is no regular expression."""
        self._topics, self._exclude = _pattern("--topics", topics), _pattern("--exclude", exclude)

    def takes(self, name: str) -> bool:
        """True for a topic to record; never for /clock, nor for a hidden one, as the feedback of an action."""
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
