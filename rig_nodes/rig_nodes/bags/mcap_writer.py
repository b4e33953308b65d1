# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writer of the MCAP container: the same bytes as mcap.writer with chunks, zstd and all CRCs, in a third of its time.

The bag writer uses it. Most of a run's messages are some hundred bytes long; for those, the library's writing record by
record and field by field costs more than the rest of recording. The library's record classes write everything except
messages.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import defaultdict
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from .mcap_file import MAGIC

COMPRESSION = b"zstd"
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MESSAGE_OPCODE = int(Opcode.MESSAGE)  # a plain number, because an enumeration's member costs as much as all the packing
_MESSAGE_HEAD = 2 + 4 + 8 + 8  # bytes of the head that the record's length includes
_MESSAGE_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of the entries
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, first and last time, size, CRC, length of the compression's name
_PACKED = struct.Struct("<Q")  # packed size
_FOOTER = struct.Struct("<BQQQ")


class McapWriter:
    """Writer of messages into a binary file that is at its start.

    It does not close the file. An OSError of the file is passed on.
    """

    def __init__(self, file: BinaryIO, profile: str, library: str, chunk_bytes: int, packed: bool = True) -> None:
        """Write the beginning of the file.

        A chunk larger than ``chunk_bytes`` is closed without a call of :meth:`flush`; ``packed`` says whether chunks are packed.
        """
        self._file, self._chunk_bytes = file, chunk_bytes
        self._compression = COMPRESSION if packed else b""
        self._compress = zstandard.ZstdCompressor().compress if packed else bytes
        self._data_crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = defaultdict(int)
        self._chunks, self._chunk_count = bytearray(), 0  # the index of the chunks as the file will hold it
        self._metadata: list[MetadataIndex] = []
        self._first = self._last = 0  # first and last time of the messages in closed chunks
        self._begin_chunk()
        self._write(MAGIC)
        self._write(_bytes(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Store a new schema and return its number."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._into_chunk(_bytes(self._schemas[-1]))
        return len(self._schemas)

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: dict[str, str]) -> int:
        """Store a new channel for messages of a schema and return its number."""
        self._channels.append(
            Channel(id=len(self._channels) + 1, topic=topic, message_encoding=encoding, schema_id=schema, metadata=metadata)
        )
        self._into_chunk(_bytes(self._channels[-1]))
        return len(self._channels)

    def add_message(self, channel: int, log_time: int, data: bytes, sequence: int) -> None:
        """Store a message; ``log_time`` [ns] is also its publish time."""
        size = _MESSAGE_HEAD + len(data)
        self._indices[channel] += log_time, self._size
        self._parts += _MESSAGE.pack(_MESSAGE_OPCODE, size, channel, sequence, log_time, log_time), data
        self._size += 9 + size
        if self._size > self._chunk_bytes:
            self._end_chunk()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Store named texts outside the chunks."""
        record, offset = _bytes(Metadata(name=name, metadata=values)), self._file.tell()
        self._metadata.append(MetadataIndex(offset=offset, length=len(record), name=name))
        self._write(record)

    @property
    def size(self) -> int:
        """Bytes of the file so far, without the chunk in progress."""
        return self._file.tell()

    def flush(self) -> None:
        """Close the chunk in progress, unless it has no message, and hand everything to the operating system."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the end of the file: summary, indices and magic."""
        self._end_chunk()
        self._write(_bytes(DataEnd(self._data_crc)))
        start, data, groups = self._file.tell(), bytearray(), []
        for opcode, part in (
            (Opcode.SCHEMA, map(_bytes, self._schemas)),
            (Opcode.CHANNEL, map(_bytes, self._channels)),
            (Opcode.STATISTICS, [_bytes(self._statistics())]),
            (Opcode.CHUNK_INDEX, [self._chunks]),
            (Opcode.ATTACHMENT_INDEX, []),
            (Opcode.METADATA_INDEX, map(_bytes, self._metadata)),
        ):
            begin = len(data)
            data += b"".join(part)
            groups.append(SummaryOffset(group_opcode=opcode, group_start=start + begin, group_length=len(data) - begin))
        offsets = start + len(data)
        data += b"".join(map(_bytes, groups))
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 8 + 8 + 4, start, offsets), zlib.crc32(data))
        self._file.write(data)
        self._file.write(_bytes(Footer(summary_start=start, summary_offset_start=offsets, summary_crc=crc)))
        self._file.write(MAGIC)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._first,
            message_end_time=self._last,
            schema_count=len(self._schemas),
        )

    def _begin_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._indices: dict[int, list[int]] = defaultdict(list)  # channel -> log time and offset of each message

    def _into_chunk(self, record: bytes) -> None:
        self._parts.append(record)
        self._size += len(record)

    def _end_chunk(self) -> None:
        if not self._indices:
            return
        first = min(min(index[::2]) for index in self._indices.values())
        last = max(max(index[::2]) for index in self._indices.values())
        self._first, self._last = (min(self._first, first) if self._chunk_count else first), max(self._last, last)
        content = b"".join(self._parts)
        packed, compression = self._compress(content), self._compression
        at = self._file.tell()
        self._write(
            _CHUNK.pack(
                Opcode.CHUNK,
                _CHUNK.size - 9 + len(compression) + _PACKED.size + len(packed),
                first,
                last,
                len(content),
                zlib.crc32(content),
                len(compression),
            )
            + compression
            + _PACKED.pack(len(packed))
            + packed
        )
        indices_at, places, rows = self._file.tell(), {}, []
        for channel, index in self._indices.items():
            places[channel] = indices_at + sum(map(len, rows))
            entries = array("Q", index).tobytes()
            rows.append(_MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries)
            self._counts[channel] += len(index) // 2
        table = b"".join(rows)
        self._write(table)
        self._chunk_count += 1
        self._chunks += _bytes(
            ChunkIndex(
                message_start_time=first,
                message_end_time=last,
                chunk_start_offset=at,
                chunk_length=indices_at - at,
                message_index_offsets=places,
                message_index_length=len(table),
                compression=compression.decode(),
                compressed_size=len(packed),
                uncompressed_size=len(content),
            )
        )
        self._begin_chunk()

    def _write(self, data: bytes) -> None:
        """Write to the part of the file that the data's CRC covers."""
        self._data_crc = zlib.crc32(data, self._data_crc)
        self._file.write(data)


def _bytes(record: McapRecord) -> bytes:
    """Return a record of the library's classes as bytes of a file."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
