# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writer of the MCAP container: the same bytes as mcap.writer with chunks, zstd and all CRCs, in a third of its time.

The bag writer uses it. Most of a run's messages are some hundred bytes long; for those, the library's writing record by
record and field by field costs more than the rest of recording. Here single messages of a chunk are put together when it is
closed, all heads and all index entries at once; many messages of a channel come as an array and are laid into place at
once. The library's record classes write everything except messages.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, McapRecord, Metadata, MetadataIndex, Schema, Statistics, SummaryOffset

from .mcap_file import MAGIC

COMPRESSION = b"zstd"
_MESSAGE = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("logged", "<u8"), ("published", "<u8")]
)
_HEAD = _MESSAGE.itemsize
_MESSAGE_LENGTH = 2 + 4 + 8 + 8  # bytes of the head that the record's length includes
_MESSAGE_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of the entries
_ENTRY = 16  # bytes of an entry: log time and offset
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, first and last time, size, CRC, length of the compression's name
_PACKED = struct.Struct("<Q")  # packed size
_CHUNK_INDEX = struct.Struct("<BQQQQQI")  # opcode, length, first and last time, chunk's offset and length, bytes of the table
_INDICES = struct.Struct("<QI")  # behind the table: bytes of the indices, length of the compression's name
_SIZES = struct.Struct("<QQ")  # behind that name: packed size, size
_NONE = np.zeros(0, np.int64)
# numbers of messages of a channel after which its records may lie at the same distance again, when all are sent at fixed rates
PERIODS = (1, 2, 10)
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
        self._counts: Counter[int] = Counter()
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
        self._of.append(channel)
        self._times.append(log_time)
        self._sequences.append(sequence)
        self._data.append(data)
        self._size += _HEAD + len(data)
        if self._size > self._chunk_bytes:
            self._end_chunk()

    def add_records(self, content: bytes | memoryview, channels: np.ndarray, log_times: np.ndarray, ends: np.ndarray) -> None:
        """Store the records of messages as :func:`message_records` makes them, joined.

        Parameters
        ----------
        content : bytes
            The records.
        channels : (n,) array of int
            Channel of each message.
        log_times : (n,) array of int
            Their times [ns].
        ends : (n,) array of int
            End of each record in the content.
        """
        self._gather()
        self._parts.append((content, channels, log_times, ends))
        self._size += len(content)
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
        self._of: list[int] = []  # of each message that is in no part yet: its channel, log time, sequence number and bytes
        self._times: list[int] = []
        self._sequences: list[int] = []
        self._data: list[bytes] = []
        # the chunk so far: records of messages with their channels, times and ends, or one other record
        self._parts: list[tuple[bytes | memoryview, np.ndarray, np.ndarray, np.ndarray]] = []
        self._size = 0

    def _into_chunk(self, record: bytes) -> None:
        self._gather()
        self._parts.append((record, _NONE, _NONE, _NONE))
        self._size += len(record)

    def _gather(self) -> None:
        """Make a part of the messages that are in none yet."""
        if not self._data:
            return
        heads = np.empty(len(self._data), _MESSAGE)
        heads["opcode"], heads["length"] = Opcode.MESSAGE, array("Q", map(len, self._data))
        heads["channel"], heads["sequence"] = array("H", self._of), array("I", self._sequences)
        heads["logged"] = heads["published"] = array("Q", self._times)
        ends = np.cumsum(heads["length"].astype(np.int64) + _HEAD)
        heads["length"] += _MESSAGE_LENGTH
        packed, records = heads.tobytes(), [b""] * (2 * len(self._data))
        records[::2] = [packed[at : at + _HEAD] for at in range(0, len(packed), _HEAD)]
        records[1::2] = self._data
        self._parts.append((b"".join(records), heads["channel"], heads["logged"].astype(np.int64), ends))
        self._of, self._times, self._sequences, self._data = [], [], [], []

    def _end_chunk(self) -> None:
        self._gather()
        if not any(len(times) for _, _, times, _ in self._parts):
            return
        channels, times = (np.concatenate([part[k] for part in self._parts]).astype(np.int64) for k in (1, 2))
        first, last = int(times.min()), int(times.max())
        self._first, self._last = (min(self._first, first) if self._chunk_count else first), max(self._last, last)
        content = b"".join([part[0] for part in self._parts])
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
        indices_at, places, rows = self._file.tell(), [], []
        place = indices_at
        for channel, entries in self._indices(channels, times):
            places += channel, place
            rows.append(_MESSAGE_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries)
            place += len(rows[-1])
            self._counts[channel] += len(entries) // _ENTRY
        self._write(b"".join(rows))
        self._chunk_count += 1
        table = struct.pack("<" + "HQ" * len(rows), *places)
        self._chunks += _CHUNK_INDEX.pack(
            Opcode.CHUNK_INDEX,
            _CHUNK_INDEX.size - 9 + len(table) + _INDICES.size + len(compression) + _SIZES.size,
            first,
            last,
            at,
            indices_at - at,
            len(table),
        )
        self._chunks += table + _INDICES.pack(place - indices_at, len(compression)) + compression
        self._chunks += _SIZES.pack(len(packed), len(content))
        self._begin_chunk()

    def _indices(self, channels: np.ndarray, times: np.ndarray) -> Iterator[tuple[int, bytes]]:
        """Each channel with the log times and offsets of its messages, in the order of the channels' first messages."""
        offsets, begin = [], 0
        for content, _, _, ends in self._parts:
            if len(ends):
                offsets.append(begin + np.append(0, ends[:-1]))
            begin += len(content)
        order = np.argsort(channels, kind="stable")
        entries = np.empty((len(order), 2), "<u8")
        entries[:, 0], entries[:, 1] = times[order], np.concatenate(offsets)[order]
        table, channels = entries.tobytes(), channels[order]
        begins = np.concatenate([[0], np.flatnonzero(channels[1:] != channels[:-1]) + 1])
        firsts, stops = order[begins].tolist(), [*begins[1:].tolist(), len(order)]
        for _, channel, begin, end in sorted(zip(firsts, channels[begins].tolist(), begins.tolist(), stops)):
            yield channel, table[begin * _ENTRY : end * _ENTRY]

    def _write(self, data: bytes) -> None:
        """Write to the part of the file that the data's CRC covers."""
        self._data_crc = zlib.crc32(data, self._data_crc)
        self._file.write(data)


def message_records(channel: int, times: np.ndarray, sequences: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Return the records of messages of one channel.

    Parameters
    ----------
    channel : int
        The channel.
    times, sequences : (n,) arrays of int
        Log times [ns], which are the publish times too, and sequence numbers.
    data : (n, size) array of uint8
        The messages.

    Returns
    -------
    (n, size of a record) array of uint8
        The records.
    """
    count, size = data.shape
    out = np.empty(count, [("head", _MESSAGE), ("data", "u1", (size,))])
    head = out["head"]
    head["opcode"], head["length"], head["channel"], head["sequence"] = Opcode.MESSAGE, size + _MESSAGE_LENGTH, channel, sequences
    head["logged"] = head["published"] = times
    out["data"] = data
    return out.view(np.uint8).reshape(count, -1)


def joined(records: Sequence[np.ndarray], order: np.ndarray) -> tuple[memoryview, np.ndarray]:
    """Return records of several channels in a given order.

    Parameters
    ----------
    records : sequence of (n, size) arrays of uint8
        The records of each channel.
    order : (total,) array of int
        Number of each record, counted through all channels, in the order of the result.

    Returns
    -------
    content : memoryview
        The records.
    ends : (total,) array of int
        End of each record in the content.
    """
    ends = np.cumsum(np.repeat([each.shape[1] for each in records], [len(each) for each in records])[order])
    places = np.empty(len(order), np.int64)
    places[order] = ends
    content, first = np.empty(int(ends[-1]), np.uint8), 0
    for each in records:
        count, size = each.shape
        begins = places[first : first + count] - size
        first += count
        period = next((p for p in PERIODS if p < count and not (begins[p:] - begins[:-p] != begins[p] - begins[0]).any()), count)
        for k, begin in enumerate(begins[:period].tolist()):
            part = each[k::period]
            stride = int(begins[k + period]) - begin if len(part) > 1 else size
            np.ndarray(part.shape, np.uint8, content, begin, (stride, 1))[:] = part
    return memoryview(content), ends


def _bytes(record: McapRecord) -> bytes:
    """Return a record of the library's classes as bytes of a file."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
