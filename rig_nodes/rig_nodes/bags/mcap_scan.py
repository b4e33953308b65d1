# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reader of whole MCAP files: every message by channel, checked, or the undamaged part of a damaged file.

The bag reader uses it. It reports the byte at which a file is damaged. The file is never in memory as a whole; what exceeds
bags.limits is refused before it is unpacked.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path

from ..base import BagError
from .mcap_file import (
    CHANNEL,
    CHUNK,
    DATA_END,
    FOOTER,
    FOOTER_BODY,
    HEADER,
    MAGIC,
    MESSAGE,
    METADATA,
    RECORD,
    SCHEMA,
    STATISTICS,
    Damage,
    McapFile,
    check_expansion,
    chunk_head,
    library,
    named_texts,
    plain_record,
)
from .records import Contents, Records
from .run_end import RECORD_NAME


def read_mcap(path: Path, recover: bool = False) -> Contents:
    """Read and check a whole file.

    Parameters
    ----------
    path : Path
        The .mcap file.
    recover : bool
        True to read past damage: every record that can be read, of every chunk with a valid checksum, is kept, up to the first
        place where the records themselves cannot be followed.

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


class _Scan(Records):
    """One pass over a whole file."""

    def __init__(self, file: McapFile, recover: bool) -> None:
        super().__init__(file, recover)
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
                self.contents.damage.append(damage.sentence(file.size))
                self.described_by_summary()
            self.contents.damage += [fault.sentence(file.size) for fault in self.take_faults()]
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
        elif opcode == METADATA:
            name, texts = named_texts(self.file, start, end)
            if name == RECORD_NAME:
                self.contents.end = texts

    def _check_data(self, position: int, start: int, end: int) -> None:
        """Check the checksum over everything before the end-of-data record."""
        if end - start < 4:
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
        if end - start < FOOTER_BODY.size:
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
