# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The queue between ROS callbacks and the rig's loop, in which commands wait for the next sample boundary.

The nodes of the rig container put commands in, and its loop applies them.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import RigError
from ..rig import CONTROLLER_COMMAND

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..runs import Outputs

EVENTS = "/rig/events"
QUIET_NS = 1_000_000_000  # simulated time between two events of the same refusal
NUMBER = re.compile(r"[-+]?(\d[\d.]*(e[-+]?\d+)?|nan|inf)\b")


@dataclass
class Refusal:
    """One reason why commands of a topic are refused: time of its last event [ns], number since then, and the newest text."""

    reported_ns: int
    count: int = 0
    text: str = ""


def _raise(why: str) -> None:
    raise RigError(why)


class Commands:
    """Thread-safe queue of calls on the rig; a call that the rig refuses becomes an event and changes nothing else."""

    def __init__(self, outputs: Outputs, tell: Callable[[str, float], None] = lambda text, t: None) -> None:
        """Keep where events go; ``tell`` receives each refused order and the simulated time [s], for the person at the terminal."""
        self._tell = tell
        self.refused: Counter[str] = Counter()
        self._outputs = outputs
        self._queue: deque = deque()
        self._urgent: deque = deque()  # what comes before all that waits there
        self._refusals: dict[tuple[str, str], Refusal] = {}
        self._came: Counter[str] = Counter()

    def put(self, topic: str, function: Callable[..., object], *arguments: object) -> None:
        """Enqueue a call that arrived through ``topic``."""
        self._queue.append((topic, function, arguments))
        self._came[topic] += 1

    def have(self, counts: dict[str, int]) -> bool:
        """Return whether at least these numbers of commands have arrived, by topic."""
        return all(self._came[topic] >= count for topic, count in counts.items())

    def put_first(self, topic: str, function: Callable[[], object]) -> None:
        """Enqueue a call before all that wait, but for those that were enqueued so before it."""
        self._urgent.append((topic, function, ()))

    def refuse(self, topic: str, why: str) -> None:
        """Enqueue the refusal of something that arrived through ``topic``."""
        self._queue.append((topic, _raise, (why,)))

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Send an event of the rig; only calls that the loop makes may do so."""
        self._outputs.event(EVENTS, name, text, value)

    def apply(self) -> None:
        """Do what waits; the same refusal makes one event per second of simulated time, with the number of its occurrences."""
        while queue := self._urgent or self._queue:
            topic, function, arguments = queue.popleft()
            try:
                function(*arguments)
            except RigError as error:
                self.refused[topic] += 1
                self._refuse(topic, str(error))
        if self._refusals:
            self._report_repeated()

    def _refuse(self, topic: str, why: str) -> None:
        # the key is the sentence without its numbers, because each valve command names another sample
        key, text = (topic, NUMBER.sub("#", why)), f"{topic}: {why}"
        known = self._refusals.get(key)
        if known is None:
            self._refusals[key] = Refusal(self._outputs.rig.time_ns)
            self.event("command_refused", text, 1.0)
            # after a trip the valve commands that are still on their way are refused, which is no news
            if not (topic == CONTROLLER_COMMAND and self._outputs.rig.safe):
                self._tell(text if "refused" in text else f"refused: {text}", self._outputs.rig.time)
        else:
            known.count, known.text = known.count + 1, text

    def _report_repeated(self) -> None:
        now = self._outputs.rig.time_ns
        for key, refusal in list(self._refusals.items()):
            if now - refusal.reported_ns < QUIET_NS:
                continue
            if refusal.count == 0:
                del self._refusals[key]
                continue
            times = "once" if refusal.count == 1 else f"{refusal.count} times"
            self.event("command_refused", f"{refusal.text} ({times} more within 1 s)", float(refusal.count))
            self._refusals[key] = Refusal(now)
