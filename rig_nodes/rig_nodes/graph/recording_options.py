# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics beyond the rig's own that a recorder takes: all of the domain, or those that --topics and --exclude leave.

The recorder uses it, and `rig run` and the launch file refuse a wrong pattern with it before anything starts. It imports
no ROS.
"""

from __future__ import annotations

import re

from ..errors import RigError

CLOCK = "/clock"  # not recorded, because the playback of a bag publishes a clock of its own
TOPICS = (
    "--topics",
    {
        "metavar": "REGEX",
        "help": "beside the rig's own topics, record only those whose whole name matches (default: every topic of the ROS domain)",
    },
)
EXCLUDE = ("--exclude", {"metavar": "REGEX", "help": "beside the rig's own topics, record none whose whole name matches"})


class TopicChoice:
    """A choice by regular expressions on whole names; None stands for no such condition.

    Parameters
    ----------
    topics : str or None
        Only topics that match are taken.
    exclude : str or None
        Topics that match are left out.

    Raises
    ------
    RigError
        When one of the two is no regular expression.
    """

    def __init__(self, topics: str | None = None, exclude: str | None = None) -> None:
        """Compile the expressions."""
        self._topics, self._exclude = _pattern("--topics", topics), _pattern("--exclude", exclude)

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
