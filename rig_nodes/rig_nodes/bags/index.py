# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Index of a bag's messages, so that a bag can be replayed from any time without reading the whole file.

The replay uses it. Chunks are found from the file's summary, or from their heads when the file has no summary. Each chunk is
read and checked only when its time comes.
"""

from __future__ import annotations

import hashlib
import struct
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator
from pathlib import Path
from typing import NamedTuple

from ..base import BagError
from . import limits
from .mcap_file import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    FOOTER_BODY,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    RECORD,
    SCHEMA,
    STATISTICS,
    ChunkHead,
    Damage,
    McapFile,
    check_expansion,
    chunk_head,
    library,
    named_texts,
    plain_record,
    text,
)
from .records import Records, Stream, by_name
from .run_end import RECORD_NAME

_CHUNK_INDEX = struct.Struct("<QQQQI")
_PLACE = struct.Struct("<HQ")  # of the table in a chunk's index
_INDICES = struct.Struct("<QI")  # behind the table: bytes of the indices, length of the compression's name
_SIZE = struct.Struct("<Q")  # behind that name, twice: packed size, size
_STATISTICS = struct.Struct("<QHIIIIQQI")
_METADATA_INDEX = struct.Struct("<QQ")  # place and length of the record; its name follows
_CRC = 4  # bytes of the checksum that is all of the end-of-data record
_PLAIN = 1 << 20  # bytes of messages outside of chunks that form one part
OWN_RECORDS = ("rosbag2", RECORD_NAME)  # metadata records that every bag writer makes anew
HOLE = 86_400_000_000_000  # ns without a message that no reader passes in real time: a day


class _Part(NamedTuple):
    """A chunk, or records outside of chunks: bytes in the file, log times [ns] and channels (None when unknown)."""

    start: int
    end: int
    first: int
    last: int
    channels: frozenset[int] | None


class BagIndex:
    """A bag whose messages are read on demand; of a damaged bag it gives the undamaged part.

    Channels are known by the names of records.by_name: their topics, where a topic has one type.

    Attributes
    ----------
    path : Path
        The .mcap file.
    counts : dict of str to int
        Messages per topic.
    types : dict of str to str
        Message type per topic.
    first, last : int
        Log times of the first and the last message [ns].
    library : str
        Name of the program that wrote the file, as the file gives it.
    end : dict of str to str
        The file's record of how its run ended (bags.run_end); empty without one.
    beside : list of str
        Attachments and metadata records of others, by what they are and, where the file says it, their names.
    unread : dict of str to int
        Messages met so far that cannot be read though their chunk can, by topic, or by channel where it is not described.
    damage : list of str
        One sentence per fault met so far; each is passed to ``on_damage`` when it is met.
    """

    def __init__(self, path: str | Path, growing: bool = False) -> None:
        """Open an .mcap file; ``growing`` is True where one that is still being written is read up to its present end.

        Raises
        ------
        BagError
            When there is no such file, it is not a bag or it holds no message.
        """
        self.path = Path(path)
        self.damage: list[str] = []
        self.on_damage: Callable[[str], None] = lambda _: None
        self._file = McapFile(self.path, growing)
        self.writer = self._file.writer
        self.library = ""
        self._unread: dict[tuple[str, int], int] = {}  # (topic or channel, byte in the file) -> messages
        try:
            self._parts: list[_Part] = []
            self._count: Counter[int] = Counter()
            self._summary_at = 0  # byte at which the summary begins, 0 without one
            if not self._by_summary():
                stated = self._count
                self._by_walking()
                if self.damage:  # what the summary counts is still known of what cannot be read
                    self._count |= Counter({number: stated[number] for number in self._records.contents.streams})
            self._streams = by_name(self._records.contents.streams.values())
            self._set_times()
        except BaseException:
            self._file.__exit__()
            raise
        self._parts.sort(key=lambda part: (part.first, part.start))
        numbers = self._records.contents.streams
        self.counts = dict.fromkeys(self._streams, 0)
        for number, count in self._count.items():
            self.counts[numbers[number].name] += count
        self.types = {topic: stream.ros_type for topic, stream in self._streams.items()}
        self.first = min((part.first for part in self._parts), default=0)
        self.last = max((part.last for part in self._parts), default=0)

    def __enter__(self) -> BagIndex:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.__exit__()

    @property
    def unread(self) -> dict[str, int]:
        """Messages met so far that cannot be read though their chunk can, by topic or channel."""
        found: Counter[str] = Counter()
        for (name, _), count in self._unread.items():
            found[name] += count
        return dict(found)

    def spans(self) -> list[tuple[int, int]]:
        """Return first and last log time [ns] of each stretch of the file between holes in time (HOLE), in order."""
        found: list[tuple[int, int]] = []
        for part in self._parts:
            for first, last in _stretches(self._times_in(part)) if part.last - part.first > HOLE else [(part.first, part.last)]:
                found.append((first, last))
        return joined_spans(found)

    def _times_in(self, part: _Part) -> list[int]:
        """Return the log times of a part's messages in order; none when it cannot be read."""
        try:
            streams = self._read(part, ()).values()
        except Damage:
            self._records.take()
            return []
        finally:
            self._records.take_faults()
        return sorted(time for stream in streams for time in stream.times)

    def digest(self) -> bytes:
        """Return a hash of the file: of the end of a whole one, with the checksum of all that lies before, otherwise of all bytes.

        Raises
        ------
        BagError
            When the file cannot be read.
        """
        file, found, begin, head = self._file, hashlib.sha256(), 0, RECORD.pack(DATA_END, _CRC)
        try:
            if self._summary_at:
                end_of_data = self._summary_at - len(head) - _CRC
                record = file.bytes_at(end_of_data, len(head) + _CRC)
                begin = end_of_data if record.startswith(head) and any(record[len(head) :]) else 0
            for at in range(begin, file.size, _PLAIN):
                found.update(file.bytes_at(at, min(_PLAIN, file.size - at)))
        except Damage as damage:
            raise BagError(f"{self.path}: {damage.sentence(file.size)}") from None
        return found.digest()

    def channel(self, topic: str) -> tuple[str, str, dict[str, str]]:
        """Return a topic's encoding as ``message/definition``, its definition and the metadata of its channel."""
        stream = self._streams[topic]
        return stream.encoding, stream.text, stream.metadata

    def topic_of(self, name: str) -> str:
        """Return the topic of a channel; it is the name unless one topic has several types."""
        return self._streams[name].topic

    def empty(self, topic: str) -> Stream:
        """Return a topic's channel without its messages."""
        return self._streams[topic].emptied()

    def timeline(
        self, topics: Collection[str], begin: int = 0, end: int = limits.LAST + 1
    ) -> Iterator[tuple[int, tuple[str, bytes]]]:
        """Yield the messages of some topics in order of log time; messages of equal time keep the order of the file.

        Chunks may overlap; overlapping chunks are in memory together.

        Parameters
        ----------
        topics : collection of str
            Topics to read.
        begin, end : int
            Log times [ns] from ``begin`` to before ``end``.

        Yields
        ------
        (int, (str, bytes))
            Log time [ns], and topic with bytes.
        """
        wanted = {number for number, stream in self._records.contents.streams.items() if stream.name in topics}
        others = self._records.contents.streams.keys() - wanted
        rows: list[tuple] = []
        for part in self._parts:
            if part.last < begin or part.first >= end or not (part.channels is None or wanted & part.channels):
                continue
            ripe = bisect_left(rows, (part.first,))
            for time, _, _, topic, data in rows[:ripe]:
                yield time, (topic, data)
            del rows[:ripe]
            rows += self._rows(part, topics, others, begin, end)
            rows.sort()
        for time, _, _, topic, data in rows:
            yield time, (topic, data)

    def _rows(self, part: _Part, topics: Collection[str], others: Container[int], begin: int, end: int) -> list[tuple]:
        """Return messages of a part as time, place in the file, topic and bytes; report damage and return none.

        ``others`` are channels of other topics, whose messages are not read.
        """
        try:
            streams = self._read(part, others).values()
        except Damage as damage:
            self._tell(damage)
            self._records.take()
            return []
        self._tell_faults()
        if any(stream.times and not part.first <= min(stream.times) <= max(stream.times) <= part.last for stream in streams):
            self._tell(Damage("a chunk holds messages outside the times that its record gives", part.start))
        return [
            (time, part.start, place, stream.name, data)
            for stream in streams
            if stream.name in topics
            for time, place, data in zip(stream.times, stream.places, stream.payloads)
            if begin <= time < end
        ]

    def _read(self, part: _Part, others: Container[int]) -> dict[int, Stream]:
        position = part.start
        while position < part.end:
            opcode, start, end = self._file.record(position)
            if opcode == CHUNK:
                self._records.chunk(chunk_head(self._file, start, end), position, others)
            elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                self._records.records(plain_record(self._file, start, end), position, others)
            elif part.channels is not None and position == part.start:
                raise Damage("there is no chunk where the summary says", position)
            position = end
        return self._records.take().streams

    def _tell_faults(self) -> None:
        """Report the faults of single records, and count the messages among them."""
        for fault in self._records.take_faults():
            if fault.lost:
                self._unread[fault.lost, fault.offset] = fault.count
            self._tell(fault)

    def _tell(self, damage: Damage) -> None:
        """Keep a fault and report it once; raise BagError when nothing after it can be trusted."""
        sentence = damage.sentence(self._file.size)
        if damage.fatal:
            raise BagError(f"{self.path}: {sentence}; have the program that wrote the bag write it again")
        if sentence not in self.damage:
            self.damage.append(sentence)
            self.on_damage(sentence)

    def _by_summary(self) -> bool:
        """Take everything from the summary; return False when it is missing or incomplete."""
        self._records = Records(self._file, tolerant=True)
        self._begin()
        try:
            # a summary may repeat channels without their definitions: then the data itself tells what it holds
            found = self._summary() and not self._records.take_faults()
        except Damage as damage:
            self._tell(damage)
            found = False
        except struct.error:
            found = False
        if not found:
            self._summary_at = 0
        return found

    def _begin(self) -> None:
        self._parts, self._count = [], Counter()
        self.end: dict[str, str] = {}
        self.beside: list[str] = []

    def _summary(self) -> bool:
        file = self._file
        opcode, start, end = file.record(len(MAGIC))
        if opcode == HEADER:
            self.library = library(file, start, end)
        footer = file.size - len(MAGIC) - FOOTER_BODY.size - RECORD.size
        if footer < len(MAGIC) or file.bytes_at(file.size - len(MAGIC), len(MAGIC)) != MAGIC:
            return False  # the walk over the file reports the same fault
        opcode, start, end = file.record(footer)
        if opcode != FOOTER or end - start != FOOTER_BODY.size:
            return False
        position, _, crc = FOOTER_BODY.unpack(file.bytes_at(start, FOOTER_BODY.size))
        if not len(MAGIC) <= position < footer:
            return False
        if crc and file.checksum(position, end - 4) != crc:
            raise Damage("the summary does not match its checksum, which lies", end - 4)
        self._summary_at = position
        statistics, unpacked, same, records = None, 0, {}, 0
        while position < footer:
            opcode, start, end = file.record(position)
            if end - start > limits.RECORD and opcode in (SCHEMA, CHANNEL, STATISTICS, CHUNK_INDEX):
                raise Damage(f"a record of {end - start} bytes is larger than the {limits.RECORD} that are read", position)
            if opcode in (SCHEMA, CHANNEL):
                self._records.records(plain_record(file, start, end), position)
            elif opcode == STATISTICS:
                statistics = file.bytes_at(start, end - start)
            elif opcode == METADATA_INDEX:
                at, _ = _METADATA_INDEX.unpack(file.bytes_at(start, _METADATA_INDEX.size))
                self._take_metadata(*file.record(at)[1:])
                records += 1
            elif opcode == CHUNK_INDEX:
                part, size = _part_of(file.bytes_at(start, end - start), same)
                unpacked += size
                if part.end > footer:
                    return False
                self._parts.append(part)
            position = end
        check_expansion(unpacked, file.size, footer)
        return statistics is not None and self._agrees(statistics, records)

    def _agrees(self, statistics: bytes, records: int) -> bool:
        """Take the counts; return False when the known chunks do not hold all messages or the counts name unknown channels.

        ``records`` is the number of metadata records that the summary lists.
        """
        messages, _, _, attachments, metadata, chunks, _, _, length = _STATISTICS.unpack_from(statistics)
        if length > len(statistics) - _STATISTICS.size:
            return False
        counts = Counter(dict(struct.iter_unpack("<HQ", statistics[_STATISTICS.size : _STATISTICS.size + length])))
        if sum(counts.values()) != messages:
            return False
        self._count = counts
        return (
            not attachments
            and metadata == records  # otherwise the walk over the file finds them
            and chunks == len(self._parts)
            and counts.keys() <= self._records.contents.streams.keys()
            and (chunks > 0 or messages == 0)
        )

    def _by_walking(self) -> None:
        """Take everything from the heads of the file's records, up to the first that cannot be followed."""
        self._records = Records(self._file, tolerant=True)
        self._begin()
        try:
            position = len(MAGIC)
            opcode, start, position = self._file.record(position)
            if opcode != HEADER:
                raise Damage("the file's header is missing", len(MAGIC))
            self.library = library(self._file, start, position)
            unpacked, plain = 0, position
            while True:
                try:
                    opcode, start, end = self._file.record(position)
                except Damage:
                    self._close_plain(plain, position)
                    raise
                if opcode not in (SCHEMA, CHANNEL, MESSAGE) or self._records.held >= _PLAIN:
                    self._close_plain(plain, position)
                    plain = end
                if opcode == DATA_END:
                    return
                if opcode in (0, FOOTER):
                    raise Damage("a record is garbled or the end of the data is missing", position)
                try:
                    if opcode == CHUNK:
                        head = chunk_head(self._file, start, end)
                        unpacked += head.size
                        check_expansion(unpacked, end, position)
                        self._add_chunk(head, position, end)
                    elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                        plain = min(plain, position)
                        self._records.records(plain_record(self._file, start, end), position)
                    elif opcode == METADATA:
                        self._take_metadata(start, end)
                    elif opcode == ATTACHMENT:
                        self._take_attachment(start, end)
                    self._tell_faults()
                except Damage as damage:
                    if opcode == CHUNK:
                        self._records.take()
                        self._records.described_by_summary()
                    else:
                        self._close_plain(plain, position)
                        plain = end
                    if damage.fatal:
                        raise
                    self._tell(damage)
                position = end
        except Damage as damage:
            self._tell(damage)

    def _take_metadata(self, start: int, end: int) -> None:
        """Take the metadata record whose content lies from ``start`` to ``end``: the run's end, or one of others."""
        name, texts = named_texts(self._file, start, end)
        if name == RECORD_NAME:
            self.end = texts
        elif name not in OWN_RECORDS:
            self.beside.append(f"metadata record '{name}'")

    def _take_attachment(self, start: int, end: int) -> None:
        content = self._file.bytes_at(start, min(end - start, limits.RECORD))
        try:
            name, _ = text(content, 16, len(content))  # behind its two times
        except (struct.error, ValueError):
            name = ""
        self.beside.append(f"attachment '{name}'")

    def _set_times(self) -> None:
        """Read the times of chunks whose heads cannot be right: some recorders leave them 0."""
        for place, part in enumerate(self._parts):
            if not 0 < part.last <= limits.LAST or part.first > part.last:
                times = self._times_in(part) or [0]
                self._parts[place] = part._replace(first=times[0], last=times[-1])

    def _add_chunk(self, head: ChunkHead, position: int, end: int) -> None:
        """Add a chunk by the message indices behind it; read the chunk when they are missing or name unknown channels."""
        counts: dict[int, int] = {}
        after = end
        try:
            while True:
                opcode, start, stop = self._file.record(after)
                if opcode != MESSAGE_INDEX or stop - start < 6:
                    break
                number, length = struct.unpack("<HI", self._file.bytes_at(start, 6))
                counts[number] = length // 16
                after = stop
        except Damage:
            counts = {}  # the file ends within the indices
        if not counts or not counts.keys() <= self._records.contents.streams.keys():
            self._records.chunk(head, position)
            streams = self._records.take().streams
            counts = {number: len(stream.times) for number, stream in streams.items() if stream.times}
        self._add(_Part(position, end, head.first, head.last, frozenset(counts)), counts)

    def _close_plain(self, start: int, end: int) -> None:
        """Add what was read outside of chunks as a separate part."""
        if not self._records.held:
            return
        streams = self._records.take().streams
        counts = {number: len(stream.times) for number, stream in streams.items() if stream.times}
        if counts:
            times = [time for number in counts for time in (min(streams[number].times), max(streams[number].times))]
            self._add(_Part(start, end, min(times), max(times), frozenset(counts)), counts)

    def _add(self, part: _Part, counts: dict[int, int]) -> None:
        self._count.update(counts)
        if part.channels:
            self._parts.append(part)


def joined_spans(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return stretches of log time [ns] in order, those that no hole in time (HOLE) separates as one."""
    found: list[tuple[int, int]] = []
    for first, last in sorted(spans):
        if found and first - found[-1][1] <= HOLE:
            found[-1] = found[-1][0], max(found[-1][1], last)
        else:
            found.append((first, last))
    return found


def _stretches(times: list[int]) -> list[tuple[int, int]]:
    """Return the stretches of times [ns] in order."""
    return joined_spans([(time, time) for time in times])


def _part_of(record: bytes, same: dict) -> tuple[_Part, int]:
    """Return a chunk by its record in the summary, and its unpacked size [bytes]; ``same`` holds the sets of channels met."""
    first, last, start, length, offsets = _CHUNK_INDEX.unpack_from(record)
    position = _CHUNK_INDEX.size
    table = record[position : position + offsets]  # each channel's number and the place of its message index
    numbers = table[:: _PLACE.size] + table[1 :: _PLACE.size]
    channels = same.get(numbers)
    if channels is None:
        channels = same[numbers] = frozenset(number for number, _ in _PLACE.iter_unpack(table))
    _, compression = _INDICES.unpack_from(record, position + offsets)
    (size,) = _SIZE.unpack_from(record, position + offsets + _INDICES.size + compression + _SIZE.size)
    return _Part(start, start + length, first, last, channels or None), size
