# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reader of the MCAP container: every message of a file by topic, checked, or the undamaged part of a damaged file.

The bag reader uses it. It reads whole chunks at once, which is several times faster than record by record, and reports the
byte at which a file is damaged. The records are those of the MCAP specification, version 0. The file is never in memory as a
whole; what exceeds bags.limits is refused before it is unpacked.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from array import array
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import lz4.frame
import zstandard

from ..errors import BagError
from . import limits
from .old_form import Convert, form_of_today, topic_of_today

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
STATISTICS, DATA_END = 0x0B, 0x0F
PRIVATE = 0x80  # opcodes from here on are private to the program that wrote the file
RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
CHUNK_HEAD = struct.Struct("<QQQI")
FOOTER_BODY = struct.Struct("<QQI")
_BLOCK = 1 << 20  # bytes per read


@dataclass
class Stream:
    """The messages of one channel in the order of the file: log times [ns], payloads, places in the file.

    A message's place is its number among all messages of the file; ``metadata`` is the channel's own metadata.
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

    def emptied(self) -> Stream:
        """Return the same channel without messages."""
        return Stream(self.topic, self.ros_type, self.encoding, self.text, self.metadata, convert=self.convert)


@dataclass
class Contents:
    """All channels of a file or of a part of it.

    ``damage`` holds one sentence per fault that recovery passed over; ``library`` is the name of the program that wrote the
    file, as the file gives it.
    """

    streams: dict[int, Stream] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    library: str = ""


class Damage(Exception):
    """A fault at one byte of a file.

    ``cut`` is True when the file simply ends there, ``fatal`` when nothing after it can be trusted.
    """

    def __init__(self, what: str, offset: int, cut: bool = False, fatal: bool = False) -> None:
        super().__init__(what)
        self.what, self.offset, self.cut, self.fatal = what, offset, cut, fatal

    def sentence(self, size: int) -> str:
        """Return a sentence on what is wrong and where, in a file of ``size`` bytes."""
        return f"{self.what} at byte {self.offset} of {size}"


def read_mcap(path: Path, recover: bool = False) -> Contents:
    """Read and check a whole file.

    Parameters
    ----------
    path : Path
        The .mcap file.
    recover : bool
        True to read past damage: every whole chunk with a valid checksum is kept, up to the first place where the records
        themselves cannot be followed.

    Returns
    -------
    Contents
        All channels with their messages.

    Raises
    ------
    BagError
        When the file cannot be read or is not an MCAP file, and, without ``recover``, when it is damaged; the error then names
        the byte of the damage.
    """
    (contents,) = read_pieces(path, recover, math.inf)
    return contents


def read_pieces(path: Path, recover: bool, size: float) -> Iterator[Contents]:
    """Read a file as :func:`read_mcap` does, in the order of the file and piece by piece.

    Damage behind a piece is found when the iteration reaches it; the last piece lists all damage.

    Parameters
    ----------
    path : Path
        The .mcap file.
    recover : bool
        True to read past damage.
    size : float
        Approximate size of a piece [bytes of messages].

    Yields
    ------
    Contents
        One piece of the file.

    Raises
    ------
    BagError
        As :func:`read_mcap` does.
    """
    with McapFile(path) as file:
        scan = _Scan(file, recover)
        try:
            for _ in scan.run():
                if scan.held >= size:
                    yield scan.take()
        except Damage as damage:
            where = damage.sentence(file.size)
            if not recover:
                hint = (
                    "the run was cut off before it could close the bag, recovery reads all up to there"
                    if damage.cut
                    else "recovery reads what is undamaged; better fetch the file again"
                )
                raise BagError(f"{path}: {where}; {hint}") from None
            scan.contents.damage.append(where)
        yield scan.contents


class McapFile:
    """The bytes of a file and the records of its container; ``size`` is its length [bytes]."""

    def __init__(self, path: Path) -> None:
        """Open the file; BagError when it cannot be read or is not an MCAP file."""
        try:
            self._file = open(path, "rb", buffering=0)
            self.size = os.fstat(self._file.fileno()).st_size
            head = self._file.read(len(MAGIC))
        except OSError as error:
            raise BagError(f"{path}: cannot be read ({error.strerror})") from None
        self.path = path
        self._block, self._from = b"", 0
        wrong = ""
        if not head:
            wrong = "is empty (0 bytes); the run that made it wrote nothing, record it again"
        elif not MAGIC.startswith(head):
            wrong = "does not begin as an MCAP file at byte 0; expected a bag of `rig run` or `ros2 bag record -s mcap`"
        if wrong:
            self._file.close()
            raise BagError(f"{path}: {wrong}")

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def bytes_at(self, position: int, length: int) -> bytes:
        """Return ``length`` bytes from a position; Damage when the file has become shorter or cannot be read."""
        at = position - self._from
        if at < 0 or at + length > len(self._block):
            try:
                block = os.pread(self._file.fileno(), max(length, _BLOCK), position)
            except OSError as error:
                raise Damage(f"the file cannot be read ({error.strerror})", position, fatal=True) from None
            if len(block) < length:
                raise Damage("the file ends", position + len(block), cut=True)
            if length >= _BLOCK:
                return block[:length]
            self._block, self._from, at = block, position, 0
        return self._block[at : at + length]

    def checksum(self, start: int, end: int) -> int:
        """Return the CRC-32 of the bytes from ``start`` to before ``end``."""
        crc = 0
        while start < end:
            step = min(_BLOCK, end - start)
            crc = zlib.crc32(self.bytes_at(start, step), crc)
            start += step
        return crc

    def record(self, position: int) -> tuple[int, int, int]:
        """Return the opcode of the record at a byte of the file, and the start and end of its content."""
        if position + RECORD.size > self.size:
            raise Damage("the file ends without the end record of a closed bag", position, cut=True)
        opcode, length = RECORD.unpack(self.bytes_at(position, RECORD.size))
        start = position + RECORD.size
        if start + length > self.size:
            raise Damage(f"a record of {length} bytes is cut or its length is garbled", position, cut=True)
        return opcode, start, start + length


@dataclass(frozen=True)
class ChunkHead:
    """The head of a chunk: log times [ns], unpacked bytes, CRC, compression and place of the packed data."""

    first: int
    last: int
    size: int
    crc: int
    compression: str
    packed: tuple[int, int]  # start and end of the packed data in the file


def chunk_head(file: McapFile, start: int, end: int) -> ChunkHead:
    """Return the head of the chunk whose content lies from ``start`` to ``end``.

    Raises
    ------
    Damage
        When the head is garbled or the chunk exceeds the limits.
    """
    at = start - RECORD.size
    head = file.bytes_at(start, min(end - start, CHUNK_HEAD.size + 64))
    try:
        first, last, size, crc = CHUNK_HEAD.unpack_from(head)
        compression, position = text(head, CHUNK_HEAD.size, len(head))
        (length,) = struct.unpack_from("<Q", head, position)
    except (struct.error, ValueError):
        raise Damage("a chunk's head is garbled", at) from None
    position += start + 8
    if position + length != end:
        raise Damage("a chunk's head is garbled", at)
    if max(size, length) > limits.CHUNK:
        raise Damage(f"a chunk of {max(size, length)} bytes is larger than the {limits.CHUNK} that are read", at)
    return ChunkHead(first, last, size, crc, compression, (position, end))


class Records:
    """Collector of schemas, channels and messages in the order in which they are read; ``contents`` holds them."""

    def __init__(self, file: McapFile) -> None:
        self.file = file
        self.contents = Contents()
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.held = 0  # unpacked bytes of the messages in ``contents``
        self.next_place = count().__next__
        self._unzip = zstandard.ZstdDecompressor(max_window_size=limits.CHUNK)
        self._texts = 0

    def take(self) -> Contents:
        """Return the messages gathered since the last call; the channels are kept."""
        taken, self.held = self.contents, 0
        self.contents = Contents(
            {number: stream.emptied() for number, stream in taken.streams.items()}, taken.damage, taken.library
        )
        return taken

    def chunk(self, head: ChunkHead, at: int, without: Container[int] = ()) -> None:
        """Read the records of the chunk that begins at byte ``at`` of the file, as :meth:`records` does."""
        content = self._unpacked(head, at)
        if head.crc and zlib.crc32(content) != head.crc:
            raise Damage("a chunk does not match its checksum", at)
        self.records(content, at, without)

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

    def records(self, content: bytes, at: int, without: Container[int] = ()) -> None:
        """Read all records of ``content``, found at byte ``at`` of the file, but the messages of the channels ``without``."""
        record, message, streams = RECORD.unpack_from, _MESSAGE.unpack_from, self.contents.streams
        next_place, last = self.next_place, limits.LAST
        position, end = 0, len(content)
        self.held += end
        while position < end:
            try:
                opcode, length = record(content, position)
                start = position + 9
                position = start + length
                if position > end:
                    raise Damage("a record runs past the end of its chunk", at)
                if opcode == MESSAGE:
                    channel, _, log_time, _ = message(content, start)
                    if channel in without:
                        continue
                    stream = streams.get(channel)
                    if stream is None:
                        raise Damage(f"a message belongs to channel {channel}, which is not described", at)
                    if log_time > last:
                        raise Damage(f"a message of {stream.topic} has the log time {log_time} ns, expected 0 to {last},", at)
                    stream.times.append(log_time)
                    data = content[start + 22 : position]
                    stream.payloads.append(data if stream.convert is None else stream.convert(data))
                    stream.places.append(next_place())
                elif opcode == SCHEMA:
                    self._schema(content, start, position, at)
                elif opcode == CHANNEL:
                    self._channel(content, start, position, at)
                elif opcode < PRIVATE:
                    raise Damage(f"a record of kind {opcode} is among the messages, where it does not belong,", at)
            except (struct.error, ValueError):
                raise Damage("a record is garbled", at) from None

    def _schema(self, content: bytes, start: int, end: int, at: int) -> None:
        if end - start > limits.RECORD:
            raise Damage(f"a message definition of {end - start} bytes is larger than the {limits.RECORD} that are read", at)
        (number,) = struct.unpack_from("<H", content, start)
        name, position = text(content, start + 2, end)
        encoding, position = text(content, position, end)
        definition, _ = text(content, position, end)
        schema = name, encoding, definition
        if self.schemas.setdefault(number, schema) is not schema:
            if self.schemas[number] != schema:
                raise Damage(
                    f"definition {number} is given twice, as {self.schemas[number][0]} and otherwise, as {name},", at, fatal=True
                )
            return
        self._texts += end - start
        if len(self.schemas) > limits.DESCRIPTIONS or self._texts > limits.TEXTS:
            raise Damage(
                f"there are more message definitions than the {limits.DESCRIPTIONS} or {limits.TEXTS} bytes that are read",
                at,
                fatal=True,
            )

    def _channel(self, content: bytes, start: int, end: int, at: int) -> None:
        if end - start > limits.RECORD:
            raise Damage(f"a channel described by {end - start} bytes is more than the {limits.RECORD} that are read", at)
        number, schema = struct.unpack_from("<HH", content, start)
        topic, position = text(content, start + 4, end)
        encoding, position = text(content, position, end)
        if schema not in self.schemas:
            raise Damage(f"topic {topic} names a message definition that is not there", at)
        name, language, definition = self.schemas[schema]
        recorded, about = definition, _metadata(content, position, end)
        topic, (definition, convert) = topic_of_today(topic), form_of_today(name, definition)
        if definition != recorded:
            about.pop("topic_type_hash", None)  # it is of the older form
        new = Stream(topic, name, f"{encoding}/{language}", definition, about, convert=convert)
        known = self.contents.streams.setdefault(number, new)
        if known is not new and (known.topic, known.ros_type, known.encoding) != (topic, name, new.encoding):
            raise Damage(
                f"channel {number} is given twice, as {known.topic} of {known.ros_type} and as {topic} of {name},", at, fatal=True
            )
        if len(self.contents.streams) > limits.DESCRIPTIONS:
            raise Damage(f"there are more than {limits.DESCRIPTIONS} topics", at, fatal=True)


def by_topic(path: Path, streams: Iterable[Stream]) -> dict[str, Stream]:
    """Return one stream per topic; BagError when a topic has several types."""
    joined: dict[str, Stream] = {}
    for stream in streams:
        first = joined.setdefault(stream.topic, stream)
        if first is not stream:
            if first.ros_type != stream.ros_type:
                raise BagError(
                    f"{path}: topic {stream.topic} holds both {first.ros_type} and {stream.ros_type}; a topic has one type"
                )
            first.times += stream.times
            first.payloads += stream.payloads
            first.places += stream.places
    return joined


class _Scan(Records):
    """One pass over a whole file."""

    def __init__(self, file: McapFile, recover: bool) -> None:
        super().__init__(file)
        self.recover = recover
        self._unpacked_bytes = self._count = 0

    def run(self) -> Iterator[None]:
        """Read data section, end of data, summary and footer, pausing about once per chunk; raises Damage."""
        file = self.file
        if file.size < len(MAGIC):
            raise Damage("the file ends inside its first magic bytes", file.size, cut=True)
        position = len(MAGIC)
        opcode, start, end = file.record(position)
        if opcode != HEADER:
            raise Damage("the file's header is missing", position)
        self.contents.library = library(file, start, end)
        position = end
        while True:
            opcode, start, end = file.record(position)
            if opcode == DATA_END:
                break
            if opcode in (0, FOOTER):
                raise Damage("a record is garbled or the end of the data is missing", position)
            try:
                self._data_record(opcode, start, end)
            except Damage as damage:
                if not self.recover or damage.fatal:
                    raise
                self.contents.damage.append(f"{damage.what} at byte {damage.offset}")
            position = end
            yield
        self._check_data(position, start, end)
        self._check_summary(end)

    def take(self) -> Contents:
        """Return and count the messages gathered since the last call."""
        self._count += sum(len(stream.times) for stream in self.contents.streams.values())
        return super().take()

    def _data_record(self, opcode: int, start: int, end: int) -> None:
        at = start - RECORD.size
        if opcode == CHUNK:
            head = chunk_head(self.file, start, end)
            self._unpacked_bytes += head.size
            check_expansion(self._unpacked_bytes, end, at)
            self.chunk(head, at)
        elif opcode in (SCHEMA, CHANNEL, MESSAGE):
            # In a file without chunks the record itself is read like the content of a chunk.
            self.records(plain_record(self.file, start, end), at)

    def _check_data(self, position: int, start: int, end: int) -> None:
        """Check the checksum over everything before the end-of-data record."""
        if end - start != 4:
            raise Damage("the end-of-data record is garbled", position)
        (crc,) = struct.unpack("<I", self.file.bytes_at(start, 4))
        if crc and self.file.checksum(0, position) != crc:
            raise Damage("the data section does not match its checksum, which lies", position)

    def _check_summary(self, summary: int) -> None:
        """Check the records after the data, the footer with their checksum, and the last magic bytes."""
        position = summary
        counted = None
        while True:
            opcode, start, end = self.file.record(position)
            if opcode == FOOTER:
                break
            if opcode == STATISTICS and end - start >= 8:
                (counted,) = struct.unpack("<Q", self.file.bytes_at(start, 8))
            position = end
        if end - start != FOOTER_BODY.size:
            raise Damage("the footer is garbled", position)
        _, _, crc = FOOTER_BODY.unpack(self.file.bytes_at(start, FOOTER_BODY.size))
        if crc and self.file.checksum(summary, end - 4) != crc:
            raise Damage("the summary does not match its checksum, which lies", end - 4)
        rest = self.file.bytes_at(end, min(self.file.size - end, len(MAGIC) + 1))
        if rest != MAGIC:
            raise Damage("the last magic bytes are missing or followed by something", end, cut=MAGIC.startswith(rest))
        held = self._count + sum(len(stream.times) for stream in self.contents.streams.values())
        if counted is not None and counted != held and not self.contents.damage:
            raise Damage(f"the summary counts {counted} messages where the file holds {held}", summary)


def plain_record(file: McapFile, start: int, end: int) -> bytes:
    """Return a record outside of chunks, with its head; Damage when it is larger than a chunk may be."""
    if end - start > limits.CHUNK:
        raise Damage(f"a record of {end - start} bytes is larger than the {limits.CHUNK} that are read", start - RECORD.size)
    return file.bytes_at(start - RECORD.size, end - start + RECORD.size)


def check_expansion(unpacked: int, read: int, at: int) -> None:
    """Raise Damage when the file unpacks to more bytes than any recording does.

    Parameters
    ----------
    unpacked : int
        Unpacked size of the chunks read so far [bytes].
    read : int
        Bytes of the file that hold them.
    at : int
        Byte of the file that the error names.
    """
    if unpacked > limits.CHUNK + limits.EXPANSION * read:
        raise Damage(
            f"what is packed unpacks to {unpacked} bytes, more than {limits.EXPANSION} for each byte of the file,", at, fatal=True
        )


def library(file: McapFile, start: int, end: int) -> str:
    """Return the name of the program that wrote the file, from its header; empty when the header does not give it."""
    content = file.bytes_at(start, min(end - start, 4096))
    try:
        _, position = text(content, 0, len(content))
        return text(content, position, len(content))[0]
    except (struct.error, ValueError):
        return ""


def _metadata(content: bytes, position: int, end: int) -> dict[str, str]:
    """Return the pairs of texts at a byte; ValueError when they run past ``end``."""
    (length,) = struct.unpack_from("<I", content, position)
    position += 4
    stop = position + length
    if stop > end:
        raise ValueError("metadata runs past its record")
    pairs = {}
    while position < stop:
        key, position = text(content, position, stop)
        pairs[key], position = text(content, position, stop)
    return pairs


def text(content: bytes, position: int, end: int) -> tuple[str, int]:
    """Return a length-prefixed string and the position after it; ValueError when it runs past ``end``."""
    (length,) = struct.unpack_from("<I", content, position)
    stop = position + 4 + length
    if stop > end:
        raise ValueError("text runs past its record")
    return str(content[position + 4 : stop], "utf-8"), stop
