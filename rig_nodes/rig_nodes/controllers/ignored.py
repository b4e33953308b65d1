# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The count of everything that came to a plug and was not used: bounded in memory and in lines, whatever comes.

Every plug has one (plug.py). The report has the counts under ``controller``.
"""

from __future__ import annotations

import time
from collections.abc import Callable

REASONS = 10  # reasons with a count of their own, each printed once
REST = "others, for further reasons"
AGAIN = 1.0  # s of wall clock at least between two lines on what goes on


class Ignored:
    """Counts by reason; prints each reason once, then the sum whenever it has doubled, at most once a second.

    Parameters
    ----------
    name : str
        The plug's name, for people.
    say : callable
        Takes each line for people as a str.
    """

    def __init__(self, name: str, say: Callable[[str], None]) -> None:
        self.counts: dict[str, int] = {}  # number of times by reason
        self._name, self._say = name, say
        self._total = self._printed = 0
        self._next = 0.0  # time.monotonic() from which on another sum may be printed

    def add(self, reason: str, sentence: str = "") -> None:
        """Count one thing that is not used.

        Parameters
        ----------
        reason : str
            What it was or why it is not used, in words.
        sentence : str
            The line for people the first time; by default it is made from the reason.
        """
        self._total += 1
        if reason not in self.counts and len(self.counts) >= REASONS:
            reason, sentence = REST, f"{self._name}: things come that are not used for further reasons, which are counted together"
        self.counts[reason] = self.counts.get(reason, 0) + 1
        if self.counts[reason] == 1:
            self._say(sentence or f"{self._name}: {reason}; it is not used, nor are others like it")
            self._printed, self._next = self._total, time.monotonic() + AGAIN
        elif self._total >= 2 * self._printed and time.monotonic() >= self._next:
            self._print("so far")

    def conclude(self) -> None:
        """Print the sum at the end of a run, unless all of it has been printed."""
        if self._total > self._printed:
            self._print("in all")

    def text(self) -> str:
        """Return the counts as the end of a sentence, empty when there are none."""
        counts = ", ".join(f"{reason} ({count} times)" for reason, count in self.counts.items())
        return f"; not used: {counts}" if counts else ""

    def _print(self, when: str) -> None:
        self._printed, self._next = self._total, time.monotonic() + AGAIN
        reason, count = max(self.counts.items(), key=lambda item: item[1])
        most = f", {count} of them: {reason}" if count < self._total else f": {reason}"
        self._say(f"{self._name}: {self._total} times {when} something came that is not used{most}")
