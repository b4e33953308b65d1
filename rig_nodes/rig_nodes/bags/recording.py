# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What of a run's messages goes into its bag: all of them, those outside of pauses, or those of the last seconds.

The recorder uses it. What is left out on purpose is counted by topic, so that it is not taken for lost.
"""

from __future__ import annotations

import json
from collections import Counter, deque
from collections.abc import Callable

from .metadata import profile_text
from .pieces import AT_END, LEFT_OUT
from .writer import BagWriter, MessageRefused

KEPT_BYTES = 256 << 20  # bytes of messages that are kept in memory at most


class BagRecording:
    """The way of messages into a bag. The class is not thread-safe.

    What is latched describes the run and is always stored: a part of a run could not be read without it.

    Attributes
    ----------
    left_out : Counter of str
        Messages per topic that were not stored on purpose.
    refused : Counter of str
        Messages per topic that the bag did not take.
    paused : bool
        True while nothing is stored.
    """

    def __init__(
        self, writer: BagWriter, takes: Callable[[str], bool] = lambda _: True, keep: int = 0, paused: bool = False
    ) -> None:
        """Begin.

        Parameters
        ----------
        writer : BagWriter
            The bag.
        takes : callable
            Returns whether a topic is stored.
        keep : int
            Simulated time [ns] of which messages are kept in memory until :meth:`snapshot` or :meth:`close` writes them; 0 to
            write all at once.
        paused : bool
            True to begin with a pause.
        """
        self.writer, self.keep, self.paused = writer, keep, paused
        self.left_out: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._takes = takes
        self._kept: deque[tuple[str, str, bytes, int, str]] = deque()
        self._bytes = 0
        self._at_end: Counter[str] = Counter()  # of what was left out, messages after the last stored one

    def take(self, topic: str, ros_type: str, data: bytes, time: int, qos: str) -> None:
        """Store one message, keep it, or leave it out; ``time`` is its simulated time [ns]."""
        if qos == "latched":
            self._store(topic, ros_type, data, time, qos)
        elif self.paused or not self._takes(topic):
            self._leave_out(topic)
        elif self.keep:
            self._kept.append((topic, ros_type, data, time, qos))
            self._bytes += len(data)
            while self._bytes > KEPT_BYTES or self._kept[0][3] < time - self.keep:
                self._drop()
        else:
            self._store(topic, ros_type, data, time, qos)

    def snapshot(self) -> None:
        """Write what is kept in memory."""
        while self._kept:
            self._store(*self._kept.popleft())
        self._bytes = 0

    def close(self) -> None:
        """Write what is kept and the end of the bag, with the counts of what was left out."""
        self.snapshot()
        if self.left_out:
            for key, counts in ((LEFT_OUT, self.left_out), (AT_END, self._at_end)):
                self.writer.custom[key] = json.dumps(dict(sorted(counts.items())))
        self.writer.close()

    def _drop(self) -> None:
        topic, _, data, _, _ = self._kept.popleft()
        self._bytes -= len(data)
        self._leave_out(topic)

    def _leave_out(self, topic: str) -> None:
        self.left_out[topic] += 1
        self._at_end[topic] += 1

    def _store(self, topic: str, ros_type: str, data: bytes, time: int, qos: str) -> None:
        try:
            self.writer.write(topic, ros_type, data, time, profile_text(qos))
        except MessageRefused:
            self.refused[topic] += 1
        if self._at_end:
            self._at_end.pop(topic, None)
