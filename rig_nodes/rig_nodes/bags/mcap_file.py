# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bytes of an MCAP file: its records, the heads of its chunks, and the faults that its readers report with their place.

bags.records reads messages with it, bags.mcap_scan whole files, bags.index parts of them. The records are those of the MCAP
specification, version 0.
"""

from __future__ import annotations

import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

from ..base import BagError, quoted
from . import limits
from .in_writing import writer_of

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
ATTACHMENT, STATISTICS, METADATA, METADATA_INDEX, DATA_END = 0x09, 0x0B, 0x0C, 0x0D, 0x0F
PRIVATE = 0x80  # opcodes from here on are private to the program that wrote the file
RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
CHUNK_HEAD = struct.Struct("<QQQI")
FOOTER_BODY = struct.Struct("<QQI")
_BLOCK = 1 << 20  # bytes per read
_SQLITE = b"SQLite f"  # the first bytes of a file of sqlite3


class Damage(Exception):
    """A fault at one byte of a file.

    ``cut`` is True when the file simply ends there, ``fatal`` when the file asks for more than may be read. ``lost`` names the
    topic or channel of a message that cannot be read, ``count`` is the number of such messages.
    """

    def __init__(self, what: str, offset: int, cut: bool = False, fatal: bool = False, lost: str = "") -> None:
        super().__init__(what)
        self.what, self.offset, self.cut, self.fatal, self.lost = what, offset, cut, fatal, lost
        self.count = 1

    def sentence(self, size: int) -> str:
        """Return a sentence on what is wrong and where, in a file of ``size`` bytes."""
        more = f" (and {self.count - 1} more like it)" if self.count > 1 else ""
        return f"{self.what.removesuffix(',')}{more}{',' * self.what.endswith(',')} at byte {self.offset} of {size}"


class StillWritten(BagError):
    """The bag of a run that goes on."""


class McapFile:
    """The bytes of a file and the records of its container; ``size`` is its length [bytes].

    ``writer`` names another process that still writes it (in_writing.writer_of), which is refused unless ``growing`` is True.
    """

    def __init__(self, path: Path, growing: bool = False) -> None:
        """Open the file; BagError when it cannot be read, is not an MCAP file, or is still being written."""
        try:
            self._file = open(path, "rb", buffering=0)
            self.size = os.fstat(self._file.fileno()).st_size
            head = self._file.read(len(MAGIC))
            closed = self.size > len(MAGIC) and os.pread(self._file.fileno(), len(MAGIC), self.size - len(MAGIC)) == MAGIC
        except OSError as error:
            raise BagError(f"{path}: cannot be read ({error.strerror})") from None
        self.path = path
        self._block, self._from = b"", 0
        wrong = ""
        self.writer = "" if closed else writer_of(path)
        if self.writer and not growing:
            self._file.close()
            raise StillWritten(
                f"{path}: is still being written by {self.writer}; read it when that has ended, or make a bag of what it holds so "
                "far with ./rig bag recover. ./rig status and ./rig view --live follow a rig that runs"
            )
        if not head:
            wrong = "is empty (0 bytes); the run that made it wrote nothing, record it again"
        elif head == _SQLITE:
            wrong = not_sqlite(path)
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


def not_sqlite(path: Path) -> str:
    """Return why a bag of sqlite3 is not read where a run is expected, with the way to a bag that is."""
    return f"is a bag of sqlite3; make one of MCAP of it: ./rig bag merge {quoted(path)} --out NEW"


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
    if unpacked > limits.UNPACKED + limits.EXPANSION * read:
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


def metadata_of(content: bytes, position: int, end: int) -> dict[str, str]:
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


def text(content: bytes, position: int, end: int, errors: str = "strict") -> tuple[str, int]:
    """Return a length-prefixed string and the position after it; ValueError when it runs past ``end``."""
    (length,) = struct.unpack_from("<I", content, position)
    stop = position + 4 + length
    if stop > end:
        raise ValueError("text runs past its record")
    return str(content[position + 4 : stop], "utf-8", errors), stop


def named_texts(file: McapFile, start: int, end: int) -> tuple[str, dict[str, str]]:
    """Return the name and the texts of the metadata record whose content lies from ``start`` to ``end``; empty when garbled."""
    content = file.bytes_at(start, min(end - start, limits.RECORD))
    try:
        name, position = text(content, 0, len(content))
        return name, metadata_of(content, position, len(content))
    except (struct.error, ValueError):
        return "", {}
