# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of a bag by topic, decoded by the definitions that the bag carries, so that old bags stay readable.

bags.reader makes a run of them. A topic is decoded only when it is asked for; one that is not understood stays bytes.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import repeat
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..base import BagError, RigError
from . import limits
from .cdr import all_frameless, decode_as, exact, frameless, stamp_and_seq
from .definitions import HEADER, TIME, Definition, parse
from .records import ENCODING, Contents, Stream, by_name

_HEAD = np.dtype({"names": ["sec", "nanosec", "seq"], "formats": ["<i4", "<u4", "<u8"], "offsets": [4, 8, 20], "itemsize": 28})
_STAMP = np.dtype({"names": ["sec", "nanosec"], "formats": ["<i4", "<u4"], "offsets": [4, 8], "itemsize": 12})
NOTHING = "nothing was recorded: the run was stopped before its time began"
NOT_A_RUN = "holds no message later than time 0, so there is nothing to show"  # a bag that the project did not record
NAMED = 3  # faults that a sentence names
OWN = "rig_nodes "  # the project's own recorder begins its library name with this


class Messages:
    """All messages of a bag, in memory; Bag describes the attributes."""

    path: Path

    def _hold(self, contents: Contents) -> None:
        self.damage: list[str] = contents.damage
        self.library, self.end = contents.library, contents.end
        self._own = contents.library.startswith(OWN)
        self._streams: dict[str, Stream] = by_name(contents.streams.values())
        self.counts: dict[str, int] = {topic: len(s.times) for topic, s in self._streams.items()}
        self.types: dict[str, str] = {topic: s.ros_type for topic, s in self._streams.items()}
        self._definitions: dict[str, Definition | BagError] = {}  # with the reason where it cannot be read
        self._plain: dict[str, list[bytes]] = {}

    @property
    def last(self) -> int:
        """Log time [ns] of the last message, or 0 when there is no message."""
        return max((stream.times[-1] for stream in self._streams.values() if stream.times), default=0)

    @property
    def began(self) -> bool:
        """True when time has passed in the run: some message is stamped later than the beginning of the run."""
        return any(s.times and max(s.times) > 0 for s in self._streams.values())

    def check_began(self) -> None:
        """Raise BagError when nothing was recorded or nothing of the recording is left."""
        if not self.began:
            raise BagError(f"{self.path}: {nothing_in(self.damage, self.library)}")

    def raw(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Return an iterator over the log time [ns] and the recorded bytes of every message of a topic."""
        stream = self._stream(topic)
        return zip(stream.times, stream.payloads)

    def timeline(self, topics: list[str] | None = None) -> list[tuple[int, str, bytes]]:
        """Return all messages sorted by log time; messages of equal time keep the order of the file.

        Parameters
        ----------
        topics : list of str, optional
            Topics to return; all by default.

        Returns
        -------
        list of (int, str, bytes)
            Log time [ns], topic and bytes of each message.

        Raises
        ------
        BagError
            When the bag does not hold one of the topics.
        """
        streams = [self._stream(topic) for topic in (self._streams if topics is None else topics)]
        rows = [row for s in streams for row in zip(s.times, s.places, repeat(s.topic), s.payloads)]
        rows.sort(key=itemgetter(0, 1))
        return [(time, topic, data) for time, _, topic, data in rows]

    def channel(self, topic: str) -> tuple[str, str, dict[str, str]]:
        """Return a topic's encoding as ``message/definition``, its definition and the metadata of its channel."""
        stream = self._stream(topic)
        return stream.encoding, stream.text, stream.metadata

    def topic_of(self, name: str) -> str:
        """Return the topic of a channel; it is the name unless one topic has several types."""
        return self._stream(name).topic

    def messages(self, topic: str) -> Iterator[tuple[int, object]]:
        """Yield the log time [ns] and the decoded message of every message of a topic, in order."""
        stream = self._stream(topic)
        definition = self._definition(stream)
        for time, data in zip(stream.times, stream.payloads):
            yield time, self._decode(definition, data, topic)

    def newest(self, topic: str) -> Any:
        """Return the last message of a topic, decoded; None when there is none."""
        stream = self._streams.get(topic)
        return self._decode(self._definition(stream), stream.payloads[-1], topic) if stream and stream.payloads else None

    def fields(self, topic: str, names: list[str]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the time of every message of a topic and the values of some of its fields.

        Parameters
        ----------
        topic : str
            Topic to read.
        names : list of str
            Names of top-level fields.

        Returns
        -------
        times : (n,) array of float
            Time of each message [s].
        values : list of array of float
            One array per name: (n,) for a number, (n, k) for a field that is an array.

        Raises
        ------
        BagError
            When the bag does not hold the topic or a field.
        """
        stream = self._stream(topic)
        held = dict(self._definition(stream).tree.fields)
        if unknown := [name for name in names if name not in held]:
            raise BagError(f"{self.path}: {topic} has no field '{unknown[0]}'; the bag is of another version of {stream.ros_type}")
        times = self._times(stream) * 1e-9
        return times, [np.ascontiguousarray(self._field(stream, name), float) for name in names]

    def canonical_hash(self, topics: list[str] | None = None) -> dict[str, str]:
        """Return a SHA-256 per topic over (sequence, stamp, payload) in the topic's order, and ``all`` over these.

        The hash depends neither on the container nor on how messages of different topics interleave. Messages without a sequence
        number are numbered by their order.

        Parameters
        ----------
        topics : list of str, optional
            Topics to hash; all by default.

        Returns
        -------
        dict of str to str
            Hexadecimal digest by topic, and of all topics under ``all``.
        """
        hashes = {}
        for topic in sorted(self._streams if topics is None else topics):
            digest = hashlib.sha256(f"{topic} {self._stream(topic).ros_type}\n".encode())
            for seq, stamp, data in self.entries(topic):
                digest.update(struct.pack("<QqQ", seq, stamp, len(data)) + data)
            hashes[topic] = digest.hexdigest()
        text = "".join(f"{topic} {value}\n" for topic, value in hashes.items())
        return {**hashes, "all": hashlib.sha256(text.encode()).hexdigest()}

    def entries(self, topic: str, before: int = 0) -> Iterator[tuple[int, int, bytes]]:
        """Yield number, stamp [ns] and bytes of each message of a topic by its number; where there is none, from ``before`` on.

        What cannot be understood has the bytes that were recorded.
        """
        stream, definition = self._stream(topic), None
        with suppress(BagError):
            definition = self._definition(stream)
        if definition is not None and definition.counted:
            seqs, stamps = self._numbered(definition, stream)
            order = np.argsort(seqs, kind="stable")
        else:
            order = np.arange(len(stream.times))
            seqs, stamps = order + before, np.array(stream.times, dtype=np.int64)
            if not self._own:  # its log times may be dates
                with suppress(BagError):
                    stamps = stamps_of(self._heads(stream))
        for i in order.tolist():
            data = stream.payloads[i]
            if definition is not None:
                try:  # other recorders keep the padding of DDS, which must not change the hash
                    data = exact(definition, data)
                except ValueError:
                    pass
            yield int(seqs[i]), int(stamps[i]), data

    def _numbered(self, definition: Definition, stream: Stream) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers and stamps [ns] of a topic's messages; a garbled one has the number 0 and its log time."""
        try:
            head = self._heads(stream)
            return head["seq"], stamps_of(head)
        except BagError:
            seqs, stamps = np.zeros(len(stream.times), np.uint64), np.array(stream.times, dtype=np.int64)
            for i, data in enumerate(stream.payloads):
                with suppress(ValueError):
                    stamps[i], seqs[i] = stamp_and_seq(frameless(definition, data))
            return seqs, stamps

    def _stream(self, topic: str) -> Stream:
        if topic not in self._streams:
            held = ", ".join(self._streams) or "none"
            raise BagError(f"{self.path}: has no topic {topic}; it holds {held}")
        return self._streams[topic]

    def _definition(self, stream: Stream) -> Definition:
        found = self._definitions.get(stream.name)
        if found is None:
            found = self._definitions[stream.name] = self._parsed(stream)
        if isinstance(found, BagError):
            raise found
        return found

    def _parsed(self, stream: Stream) -> Definition | BagError:
        if stream.encoding != ENCODING:
            return BagError(f"{self.path}: {stream.topic} is encoded as {stream.encoding}, expected {ENCODING}")
        try:
            return parse(stream.ros_type, stream.text)
        except RigError as error:
            return BagError(f"{self.path}: {error}")

    def _counted(self, stream: Stream) -> bool:
        """Return True when the topic's messages have a stamp and a sequence number; False for those that are not understood."""
        try:
            return self._definition(stream).counted
        except BagError:
            return False

    def is_counted(self, topic: str) -> bool:
        """Return True when the messages of a topic have a stamp and a sequence number."""
        return topic in self._streams and self._counted(self._streams[topic])

    def require(self, topic: str, fields: Mapping[str, str]) -> None:
        """Check that a topic's messages have these fields, whatever else they have.

        Parameters
        ----------
        topic : str
            The topic.
        fields : mapping of str to str
            Kind (number, string, sequence) of each field by name.

        Raises
        ------
        BagError
            When the bag does not hold the topic, or its definition there has no such field.
        """
        stream = self._stream(topic)
        held = {name: node.kind for name, node in self._definition(stream).tree.fields}
        for name, kind in fields.items():
            if held.get(name) != kind:
                raise BagError(
                    f"{self.path}: {topic} has no field '{name}' that is a {kind}; the bag is of another version of "
                    f"{stream.ros_type}"
                )

    def _decode(self, definition: Definition, data: bytes, topic: str) -> Any:
        if len(data) > limits.LISTS and definition.tree.many:
            raise BagError(
                f"{self.path}: a message of {topic} with lists of texts or messages has {len(data)} bytes, more "
                f"than the {limits.LISTS} that are decoded"
            )
        try:
            return decode_as(definition, data)
        except ValueError as error:
            raise BagError(f"{self.path}: a message of {topic} cannot be decoded: {error}") from None

    def _joined(self, stream: Stream, size: int) -> bytes:
        """Join the first ``size`` bytes of all messages; BagError when one is shorter."""
        joined = b"".join([data[:size] for data in self._payloads(stream)])
        if len(joined) != size * len(stream.payloads):
            raise BagError(f"{self.path}: a message of {stream.topic} is shorter than the {size} bytes that {stream.ros_type} has")
        return joined

    def _payloads(self, stream: Stream) -> list[bytes]:
        """Return the messages, those of the rig's own form with an empty frame_id; users may send another frame_id."""
        if not self._counted(stream):
            return stream.payloads
        if stream.topic not in self._plain:
            definition = self._definition(stream)
            try:
                self._plain[stream.topic] = all_frameless(definition, stream.payloads)
            except ValueError as error:
                raise BagError(f"{self.path}: a message of {stream.topic} cannot be decoded: {error}") from None
        return self._plain[stream.topic]

    def _times(self, stream: Stream) -> np.ndarray:
        """Return the times [ns] of all messages in the run's time, which is the log time only for the project's own recorder."""
        if self._own or not self._counted(stream):
            return np.array(stream.times, dtype=np.int64)
        return stamps_of(self._heads(stream))

    def _heads(self, stream: Stream) -> np.ndarray:
        """Return the stamp and sequence number of all messages, or only the stamp on topics that are not counted."""
        head = _HEAD if self._counted(stream) else _STAMP
        first = [node.name for _, node in self._definition(stream).tree.fields[:1]]
        if first not in ([HEADER], [TIME]):
            raise BagError(f"{self.path}: {stream.topic} holds {stream.ros_type}, whose messages begin with no stamp")
        return np.frombuffer(self._joined(stream, head.itemsize), head)

    def _field(self, stream: Stream, name: str) -> np.ndarray:
        """Return one top-level field of all messages: 1-D, or 2-D for an array."""
        definition = self._definition(stream)
        if any(leaf.path == name for leaf in definition.leaves):
            return np.frombuffer(self._joined(stream, definition.size), definition.dtype())[name]
        if stream.payloads and (sized := definition.sized(self._payloads(stream)[0])) is not None and name in (sized.names or ()):
            lists = [name for name, _ in definition.tail]
            if all(len(data) >= sized.itemsize for data in self._payloads(stream)):
                rows = np.frombuffer(self._joined(stream, sized.itemsize), sized)
                if all((rows[f"{one}#"] == rows[f"{one}#"][0]).all() for one in lists):
                    return rows[name]
        return np.array([getattr(message, name) for _, message in self.messages(stream.topic)])


def nothing_in(damage: list[str], library: str) -> str:
    """Return the reason why a bag, written by this library, holds nothing to show."""
    return f"nothing of it can be read ({in_short(damage)})" if damage else NOTHING if library.startswith(OWN) else NOT_A_RUN


def recovered(held: int, last: int, damage: list[str]) -> str:
    """Return a sentence on what recovery saved: the number of messages and the time up to which they go.

    Parameters
    ----------
    held : int
        Messages that were recovered.
    last : int
        Time of the run [ns] at which the recording ends.
    damage : list of str
        One sentence per fault.
    """
    return f"{held} messages recovered up to {last / 1e9:.3f} s ({in_short(damage)})"


def in_short(damage: list[str]) -> str:
    """Return the first faults of a bag and the number of the others, in one line."""
    more = len(damage) - NAMED
    return "; ".join(damage[:NAMED]) + (f"; {more} more faults" if more > 0 else "")


def stamps_of(head: np.ndarray) -> np.ndarray:
    """Return the stamps [ns] of message heads."""
    return head["sec"].astype(np.int64) * 1_000_000_000 + head["nanosec"]
