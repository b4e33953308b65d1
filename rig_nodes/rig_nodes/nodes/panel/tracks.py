# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The last seconds of a running rig's messages, and what a page's charts get of them: extremes of signals by stretches of time.

nodes.panel.panel fills them. Messages are kept as they came; only those of signals that some page shows are decoded.
"""

from __future__ import annotations

import struct
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from ...bags import cdr
from ...view import Blocks, Envelope

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from ...rig import Catalogue

KEPT = 25.0  # s of messages and of decoded signals
STRETCH = 1.0  # s of a topic's messages that are forgotten together
BYTES = 64_000_000  # of messages that are kept at most, three times what KEPT s of the largest rig need
LATE = 0.04  # s by which messages of one topic may come behind those of another
MOST_SIGNALS, MOST_BINS = 64, 2000  # of one page, and of one frame
HEAD = struct.Struct("<IIdd")  # number of the page's wish, stretches, time of the first [s], length of each [s]


class Track:
    """Times (n,) [s] and values (n,) of a signal over the last KEPT seconds, in the unit that people read."""

    def __init__(self) -> None:
        self._t, self._v, self._from, self._to = np.empty(1024), np.empty(1024), 0, 0

    def add(self, t: np.ndarray, values: np.ndarray) -> None:
        """Append samples (n,) at growing times (n,) [s], and forget those older than KEPT s."""
        self._from += int(np.searchsorted(self.t, t[-1] - KEPT))
        held = self._to - self._from
        if self._to + len(t) > len(self._t):
            size = max(1024, 2 * (held + len(t)))
            for name in ("_t", "_v"):
                moved = np.empty(size)
                moved[:held] = getattr(self, name)[self._from : self._to]
                setattr(self, name, moved)
            self._from, self._to = 0, held
        self._t[self._to : self._to + len(t)] = t
        self._v[self._to : self._to + len(t)] = values
        self._to += len(t)

    @property
    def t(self) -> np.ndarray:
        """The times."""
        return self._t[self._from : self._to]

    @property
    def values(self) -> np.ndarray:
        """The values."""
        return self._v[self._from : self._to]

    def between(self, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times and values from one time to before another [s]."""
        part = slice(*np.searchsorted(self.t, (first, last)))
        return self.t[part], self.values[part]


class Messages:
    """The last messages of one topic, as they were sent, oldest first.

    Those of a stretch of time lie in one piece: some hundred thousand small objects that come and go leave holes in a process's
    memory, which then grows for hours.
    """

    def __init__(self) -> None:
        self._stretches: deque[tuple[float, bytearray, list[int]]] = deque()  # when it began [s], data, where each message ends

    def add(self, messages: list[bytes], now: float) -> None:
        """Append messages that have come at a time [s]."""
        if not self._stretches or now >= self._stretches[-1][0] + STRETCH:
            self._stretches.append((now, bytearray(), []))
        _, data, ends = self._stretches[-1]
        for one in messages:
            data += one
            ends.append(len(data))

    def began(self) -> float:
        """Return when the oldest stretch began [s]."""
        return self._stretches[0][0]

    def forget(self) -> int:
        """Forget the oldest stretch; return its size [bytes]."""
        return len(self._stretches.popleft()[1])

    def __bool__(self) -> bool:
        return bool(self._stretches)

    def __iter__(self) -> Iterator[bytes]:
        for _, data, ends in self._stretches:
            begin = 0
            for end in ends:
                yield bytes(data[begin:end])
                begin = end


class Tracks:
    """The messages of one rig by topic, and the tracks of the signals that are shown.

    Attributes
    ----------
    now : float
        Newest time of the rig [s].
    messages : dict of str to Messages
        The kept messages of each topic.
    also : collection of str
        Signals that are not in the catalogue; :meth:`put` gives their values.
    """

    def __init__(self, known: Catalogue, clock: str, also: Collection[str] = ()) -> None:
        self._known, self._clock = known, clock
        self.also = also
        self.now, self._bytes = 0.0, 0
        self.messages = {name: Messages() for name in known.topics}
        self._shown: dict[str, Track] = {}
        self._blocks: dict[str, Blocks] = {}

    def add(self, taken: Mapping[str, list[bytes]]) -> bool:
        """Take new messages; return True when the rig's time has begun again, after which everything older is forgotten."""
        again = False
        if clock := taken.get(self._clock):
            now = cdr.stamp(clock[-1]) * 1e-9
            again = now < self.now - 1.0
            if again:
                self.__init__(self._known, self._clock, self.also)
            self.now = now
        for topic, messages in taken.items():
            if topic in self.messages:
                self._keep(topic, messages)
        return again

    def _keep(self, topic: str, messages: list[bytes]) -> None:
        kept = self.messages[topic]
        kept.add(messages, self.now)
        self._bytes += sum(map(len, messages))
        if self._known.topics[topic].qos != "latched":
            while kept and (kept.began() < self.now - KEPT - STRETCH or self._bytes > BYTES):
                self._bytes -= kept.forget()
        shown = [one for one in self._known.on_topic(topic) if one.name in self._shown]
        if shown:
            self._decode(topic, messages, [one.name for one in shown])

    def show(self, names: Iterable[str]) -> None:
        """Decode these signals from now on, those new among them also from what is kept, and no others."""
        wanted = {name for name in names if name in self._known.signals or name in self.also}
        for name in self._shown.keys() - wanted:
            del self._shown[name]
        new: dict[str, list[str]] = {}
        for name in wanted - self._shown.keys():
            self._shown[name] = Track()
            if name in self._known.signals:
                new.setdefault(self._known.signals[name].topic, []).append(name)
        for topic, signals in new.items():
            if topic in self.messages:
                self._decode(topic, list(self.messages[topic]), signals)

    def put(self, name: str, t: np.ndarray, values: np.ndarray) -> None:
        """Append values (n,) at growing times (n,) [s] to a signal that is not in the catalogue, if it is shown."""
        track = self._shown.get(name)
        if track is not None and (not len(track.t) or t[0] > track.t[-1]):
            track.add(t, values)

    def _decode(self, topic: str, messages: list[bytes], names: list[str]) -> None:
        if topic not in self._blocks:
            self._blocks[topic] = Blocks(self._known.topics[topic])
        block = self._blocks[topic].of(messages)
        if block is None:
            return
        good = (block.times > 0.0) & (np.diff(block.times, prepend=-np.inf) >= 0.0)
        if not good.any():
            return
        for name in names:
            signal, track = self._known.signals[name], self._shown[name]
            try:
                values = signal.shown(block.values(signal)[good].astype(float))
            except (ValueError, IndexError):
                continue  # messages of a user's node that are not of the topic's form
            track.add(block.times[good], values)

    def latest(self, name: str) -> float | None:
        """Return the newest value of a signal that is shown; None when there is none."""
        track = self._shown.get(name)
        return float(track.values[-1]) if track is not None and len(track.t) else None

    def between(self, name: str, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times and values of a signal that is shown; arguments as for :meth:`Track.between`."""
        return self._shown[name].between(first, last) if name in self._shown else (np.empty(0), np.empty(0))


class Wish:
    """What one page shows: signals, and the length of a stretch of time; :meth:`frame` gives what is new of it.

    Parameters
    ----------
    number : int
        The page's number of this wish, which stands at the head of its frames.
    names : list of str
        The signals, at most MOST_SIGNALS.
    length : float
        Length of a stretch [s]: that of a pixel of the page's charts.
    """

    def __init__(self, number: int, names: list[str], length: float) -> None:
        self.number, self.names, self.length = number, names[:MOST_SIGNALS], length
        self._next: int | None = None  # number of the next stretch

    def restart(self) -> None:
        """Begin anew with what is kept."""
        self._next = None

    def frame(self, tracks: Tracks) -> bytes | None:
        """Return what has been complete since the last call: HEAD, then for each signal the lowest values and the highest.

        A stretch without a sample is NaN. After a pause that is longer than a frame may be, the oldest stretches are left out. None
        when nothing is new.
        """
        last = int((tracks.now - LATE) / self.length)
        first = max(0, last - MOST_BINS, int((tracks.now - KEPT) / self.length) + 1, self._next or 0)
        if not self.names or last <= first:
            return None
        self._next, count = last, last - first
        start, end = first * self.length, last * self.length
        out = np.full((len(self.names), 2, count), np.nan, "<f4")
        for row, name in zip(out, self.names):
            t, values = tracks.between(name, start, end)
            if len(t):
                found = Envelope(start, end, count)
                found.add(t, values)
                row[0, found.filled], row[1, found.filled] = found.low[found.filled], found.high[found.filled]
        return HEAD.pack(self.number, count, start, self.length) + out.tobytes()
