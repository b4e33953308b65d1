# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of an MCAP file by channel, as its records give them; one bad record costs no other.

bags.mcap_scan and bags.index use it. Whole chunks are read at once, which is several times faster than record by record. A channel
without a definition, or of another encoding than ROS 2's, is read like any other: its messages are bytes.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace
from itertools import count

import lz4.frame
import zstandard

from ..base import RigError
from . import limits
from .definitions import parse
from .mcap_file import (
    CHANNEL,
    FOOTER,
    FOOTER_BODY,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    PRIVATE,
    RECORD,
    SCHEMA,
    ChunkHead,
    Damage,
    McapFile,
    check_expansion,
    metadata_of,
    plain_record,
    text,
)
from .old_form import Convert, form_of_today, topic_of_today

CDR = "cdr/"  # begin of the encoding of ROS 2's messages
ENCODING = f"{CDR}ros2msg"  # that of the messages which can be decoded
BYTES = "surrogateescape"  # a definition need not be text; this keeps its bytes
_FRAME = b"\x28\xb5\x2f\xfd"  # begin of what zstd packed, which is no encapsulation of CDR
MOST_FAULTS = 1000  # records of a chunk that are at fault, after which it is no chunk of records
_NO_SCHEMA = 0  # number of the definition that a channel without one names


@dataclass
class Stream:
    """The messages of one channel in the order of the file: log times [ns], payloads, places in the file.

    A message's place is its number among all messages of the file; ``metadata`` is the channel's own metadata. ``name`` is
    that by which the bag's readers know the channel: its topic, unless another channel of the file has the same topic with
    another type.
    """

    topic: str
    ros_type: str
    encoding: str
    text: str
    metadata: dict[str, str] = field(default_factory=dict)
    times: array = field(default_factory=lambda: array("q"))
    payloads: list[bytes] = field(default_factory=list)
    places: array = field(default_factory=lambda: array("Q"))
    convert: Convert | None = None  # converts a message of the file to the form of ``text``; None when no conversion is needed
    name: str = ""

    def __post_init__(self) -> None:
        self.name = self.name or self.topic

    def emptied(self) -> Stream:
        """Return the same channel without messages."""
        return replace(self, times=array("q"), payloads=[], places=array("Q"))

    def same_as(self, other: Stream) -> bool:
        """Return True when both have the same topic, type and form of messages."""
        if (self.topic, self.ros_type, self.encoding) != (other.topic, other.ros_type, other.encoding):
            return False
        if self.text == other.text:
            return True
        try:
            return self.encoding == ENCODING and parse(self.ros_type, self.text).tree == parse(other.ros_type, other.text).tree
        except RigError:
            return False


@dataclass
class Contents:
    """All channels of a file or of a part of it.

    ``damage`` holds one sentence per fault that recovery passed over; ``library`` is the name of the program that wrote the
    file, as the file gives it; ``end`` is the file's record of how its run ended (bags.run_end), empty without one.
    """

    streams: dict[int, Stream] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    library: str = ""
    end: dict[str, str] = field(default_factory=dict)


class Records:
    """Collector of schemas, channels and messages in the order in which they are read; ``contents`` holds them.

    Parameters
    ----------
    file : McapFile
        The file.
    tolerant : bool
        True to pass over records that are at fault and gather the faults in ``faults``; otherwise the first one is raised.
    """

    def __init__(self, file: McapFile, tolerant: bool) -> None:
        self.file, self.tolerant = file, tolerant
        self.contents = Contents()
        self.faults: list[Damage] = []
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.held = 0  # unpacked bytes of the messages in ``contents``
        self.next_place = count().__next__
        self._twice: dict[int, int] = {}  # channel that is described again otherwise -> first byte at which that is so
        self._ended: set[int] = set()  # of these, the channels described again before the place of the reading
        self._unzip = zstandard.ZstdDecompressor(max_window_size=limits.CHUNK)
        self._texts = 0
        self._singly = Counter[int]()  # by byte of the file, unpacked bytes of messages that are packed one by one
        self._singly_sum = 0

    def take(self) -> Contents:
        """Return the messages gathered since the last call; the channels are kept."""
        taken, self.held = self.contents, 0
        self.contents = replace(taken, streams={number: stream.emptied() for number, stream in taken.streams.items()})
        return taken

    def take_faults(self) -> list[Damage]:
        """Return the faults that were passed over since the last call."""
        taken, self.faults = self.faults, []
        return taken

    def chunk(self, head: ChunkHead, at: int, without: Container[int] = ()) -> None:
        """Read the records of the chunk that begins at byte ``at`` of the file, as :meth:`records` does."""
        content = self._unpacked(head, at)
        if head.crc and zlib.crc32(content) != head.crc:
            raise Damage("a chunk does not match its checksum", at)
        self.records(content, at, without)

    def described_by_summary(self) -> None:
        """Take the channels that the summary repeats: those of a chunk that cannot be read may be described nowhere else."""
        file = self.file
        try:
            footer = file.size - len(MAGIC) - FOOTER_BODY.size - RECORD.size
            opcode, start, end = file.record(footer)
            position, _, crc = FOOTER_BODY.unpack(file.bytes_at(start, FOOTER_BODY.size))
            if opcode != FOOTER or position < len(MAGIC) or (crc and file.checksum(position, end - 4) != crc):
                return
            while position < footer:
                opcode, start, end = file.record(position)
                if opcode in (SCHEMA, CHANNEL):
                    self.records(plain_record(file, start, end), position)
                position = end
        except Damage as damage:
            if damage.fatal:
                raise
        except struct.error:
            pass  # no summary

    def _unpacked(self, head: ChunkHead, at: int) -> bytes:
        start, end = head.packed
        packed = self.file.bytes_at(start, end - start)
        try:
            if head.compression == "zstd":
                known = zstandard.frame_content_size(packed)
                content = self._unzip.decompress(packed, max_output_size=head.size) if known in (-1, head.size) else b""
            elif head.compression == "lz4":
                content = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=head.size + 1)
            elif head.compression == "":
                content = packed
            else:
                raise Damage(f"a chunk is compressed as '{head.compression}', expected zstd, lz4 or nothing,", at)
        except (zstandard.ZstdError, RuntimeError, MemoryError):
            raise Damage("a chunk cannot be decompressed", at) from None
        if len(content) != head.size:
            held = f"holds {len(content)}" if len(content) <= head.size else f"holds more than {head.size}"
            raise Damage(f"a chunk {held} bytes where its head says {head.size}", at)
        return content

    def _message(self, packed: bytes, stream: Stream, at: int) -> bytes:
        """Return a message that rosbag2 packed by itself (``compression_mode: message``), unpacked."""
        what = f"a message of {stream.topic} cannot be unpacked"
        try:
            # a frame without its size is of a stream, which rosbag2 does not write
            if 0 <= (size := zstandard.frame_content_size(packed)) <= limits.CHUNK:
                self.held += size
                self._singly[at] += size
                self._singly_sum += size
                check_expansion(self._singly_sum, self.file.size, at)
                return self._unzip.decompress(packed)
        except zstandard.ZstdError as error:
            what = f"{what} ({error})"
        raise Damage(what, at, lost=stream.name)

    def records(self, content: bytes, at: int, without: Container[int] = ()) -> None:
        """Read all records of ``content``, found at byte ``at`` of the file, but the messages of the channels ``without``."""
        record, message, streams = RECORD.unpack_from, MESSAGE_HEAD.unpack_from, self.contents.streams
        if self._twice:
            self._ended = {number for number, place in self._twice.items() if place < at}
            streams = self._assigned()
        self._singly_sum -= self._singly.pop(at, 0)  # what is read again counts once
        next_place, last, head = self.next_place, limits.LAST, MESSAGE_HEAD.size
        position, end, garbled = 0, len(content), 0
        passed: dict[str, Damage] = {}
        self.held += end
        while position < end:
            try:
                try:
                    opcode, length = record(content, position)
                    start = position + 9
                    position = start + length
                    if position > end:
                        raise Damage("a record runs past the end of its chunk", at)
                    if opcode == MESSAGE:
                        if length < head:
                            raise Damage("a message is shorter than its own head", at)
                        channel, _, log_time, _ = message(content, start)
                        if channel in without:
                            continue
                        stream = streams.get(channel)
                        if stream is None or log_time > last:
                            self._pass_over_message(channel, stream, log_time, at, passed)
                            continue
                        data = content[start + 22 : position]
                        if data[:4] == _FRAME and stream.encoding.startswith(CDR):
                            data = self._message(data, stream, at)
                        stream.payloads.append(data if stream.convert is None else stream.convert(data))
                        stream.times.append(log_time)
                        stream.places.append(next_place())
                    elif opcode == SCHEMA:
                        self._schema(content, start, position, at)
                    elif opcode == CHANNEL:
                        self._channel(content, start, position, at)
                        streams = self._assigned() if self._ended else streams
                    elif opcode < PRIVATE:
                        raise Damage(f"a record of kind {opcode} is among the messages, where it does not belong,", at)
                except (struct.error, ValueError):
                    if end - position < RECORD.size:
                        position = end  # not even a head of a record is left
                    raise Damage("a record is garbled", at) from None
            except Damage as damage:
                garbled += 1
                self._pass_over(damage, passed)
                streams = self._assigned() if self._ended else streams
                if garbled > MOST_FAULTS:
                    what = f"more than {MOST_FAULTS} records are at fault, what follows them is left out,"
                    self._pass_over(Damage(what, at), passed)
                    return

    def _pass_over(self, damage: Damage, passed: dict[str, Damage]) -> None:
        """Count a fault with those like it in ``passed``; raise it when it ends the reading."""
        if damage.fatal or not self.tolerant:
            raise damage
        first = passed.setdefault(damage.what, damage)
        if first is damage:
            self.faults.append(damage)
        else:
            first.count += 1

    def _pass_over_message(self, channel: int, stream: Stream | None, log_time: int, at: int, passed: dict[str, Damage]) -> None:
        """Do the same for a message that belongs to no channel which is known, or whose log time no reader takes."""
        lost = f"channel {channel}" if stream is None else stream.name
        if lost in passed:
            passed[lost].count += 1
            return
        if stream is not None:
            what = f"a message of {stream.topic} has the log time {log_time} ns, expected 0 to {limits.LAST},"
        elif channel in self.contents.streams:
            what = f"a message belongs to channel {channel}, which is described twice and not the same,"
        else:
            what = f"a message belongs to channel {channel}, which is not described,"
        passed[lost] = Damage(what, at, lost=lost)
        if not self.tolerant:
            raise passed[lost]
        self.faults.append(passed[lost])

    def _schema(self, content: bytes, start: int, end: int, at: int) -> None:
        if end - start > limits.RECORD:
            raise Damage(f"a message definition of {end - start} bytes is larger than the {limits.RECORD} that are read", at)
        (number,) = struct.unpack_from("<H", content, start)
        name, position = text(content, start + 2, end)
        encoding, position = text(content, position, end)
        definition, _ = text(content, position, end, BYTES)
        schema, known = (name, encoding, definition), self.schemas.get(number)
        if schema == known:
            return
        self.schemas[number] = schema  # for the channels that follow
        self._texts += end - start
        if len(self.schemas) > limits.DESCRIPTIONS or self._texts > limits.TEXTS:
            raise Damage(
                f"there are more message definitions than the {limits.DESCRIPTIONS} or {limits.TEXTS} bytes that are read",
                at,
                fatal=True,
            )
        if known is not None:
            raise Damage(f"definition {number} is given twice, as {known[0]} and otherwise, as {name},", at)

    def _channel(self, content: bytes, start: int, end: int, at: int) -> None:
        if end - start > limits.RECORD:
            raise Damage(f"a channel described by {end - start} bytes is more than the {limits.RECORD} that are read", at)
        number, schema = struct.unpack_from("<HH", content, start)
        topic, position = text(content, start + 4, end)
        encoding, position = text(content, position, end)
        fault, about = None, {}
        try:
            about = metadata_of(content, position, end)
        except (struct.error, ValueError):
            fault = Damage(f"the metadata of the channel of {topic} are garbled", at)
        if schema != _NO_SCHEMA and schema not in self.schemas:
            fault = Damage(f"topic {topic} names a message definition that is not there", at)
        name, language, definition = self.schemas.get(schema, ("", "", ""))
        recorded = definition
        topic, (definition, convert) = topic_of_today(topic), form_of_today(name, definition)
        if definition != recorded:
            about.pop("topic_type_hash", None)  # it is of the older form
        self._assign(number, Stream(topic, name, f"{encoding}/{language}", definition, about, convert=convert), at)
        if fault is not None:
            raise fault

    def _assigned(self) -> dict[int, Stream]:
        """Return the channels whose messages can be assigned where the reading is."""
        return {number: stream for number, stream in self.contents.streams.items() if number not in self._ended}

    def _assign(self, number: int, new: Stream, at: int) -> None:
        """Take a channel, or raise the fault of a second one of the same number."""
        known = self.contents.streams.setdefault(number, new)
        if not known.same_as(new):
            self._twice[number] = min(at, self._twice.get(number, at))
            self._ended.add(number)
            raise Damage(
                f"channel {number} is given twice, as {known.topic} of {known.ros_type} and as {new.topic} of {new.ros_type},", at
            )
        if len(self.contents.streams) > limits.DESCRIPTIONS:
            raise Damage(f"there are more than {limits.DESCRIPTIONS} topics", at, fatal=True)


def by_name(streams: Iterable[Stream]) -> dict[str, Stream]:
    """Return one stream per topic, and further ones, with names of their own, where a topic has several types."""
    joined: dict[str, Stream] = {}
    for stream in streams:
        first = joined.get(stream.topic)
        if first is not None and not first.same_as(stream):
            stream.name = _another_name(joined, stream)
            first = joined.get(stream.name)
        if first is None:
            joined[stream.name] = stream
        elif first is not stream:
            order = sorted(zip([*first.places, *stream.places], [*first.times, *stream.times], first.payloads + stream.payloads))
            first.places = array("Q", [place for place, _, _ in order])
            first.times = array("q", [time for _, time, _ in order])
            first.payloads = [data for _, _, data in order]
    return joined


def _another_name(joined: dict[str, Stream], stream: Stream) -> str:
    """Return the name of a stream whose topic is taken by another type."""
    name = f"{stream.topic} ({stream.ros_type or stream.encoding.partition('/')[0]})"
    number = 2
    while name in joined and not joined[name].same_as(stream):
        name, number = f"{name.removesuffix(f' {number - 1}')} {number}", number + 1
    return name
