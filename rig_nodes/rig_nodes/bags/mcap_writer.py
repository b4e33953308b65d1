# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writer of the MCAP container: the same bytes as mcap.writer with chunks, zstd and all CRCs, in a third of its time.

The bag writer uses it. Most of a run's messages are some hundred bytes long; for those, the library's writing record by
record and field by field costs more than the rest of recording. Here single messages of a chunk are put together when it is
closed, all heads and all index entries at once; many messages of a channel come as an array and are laid into place at
once. A closed chunk is packed by a thread while the next one is gathered. The library's record classes write everything except
messages.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from array import array
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, McapRecord, Metadata, MetadataIndex, Schema, Statistics, SummaryOffset

from . import limits
from .mcap_file import MAGIC

COMPRESSION = b"zstd"
MOST_PACKING, MOST_BYTES = 16, 64 << 20  # closed chunks, and their bytes, that wait for the thread that packs them
_MESSAGE = np.dtype(
    [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("logged", "<u8"), ("published", "<u8")]
)
_HEAD = _MESSAGE.itemsize
_MESSAGE_LENGTH = 2 + 4 + 8 + 8  # bytes of the head that the record's length includes
_MESSAGE_INDEX = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4")])  # bytes: of the entries
_INDEX_LENGTH = 2 + 4  # bytes of its head that its length includes
_PLACE = np.dtype([("channel", "<u2"), ("index", "<u8")])  # of the table in a chunk's index
_ENTRY = np.dtype([("logged", "<u8"), ("begin", "<u8")])  # one for each message: log time, and place of the record in the chunk
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, first and last time, size, CRC, length of the compression's name
_PACKED = struct.Struct("<Q")  # packed size
_CHUNK_INDEX = struct.Struct("<BQQQQQI")  # opcode, length, first and last time, chunk's offset and length, bytes of the table
_INDICES = struct.Struct("<QI")  # behind the table: bytes of the indices, length of the compression's name
_SIZES = struct.Struct("<QQ")  # behind that name: packed size, size
_NONE = np.zeros(0, np.int64)
_FOOTER = struct.Struct("<BQQQ")
_KEPT = 1 << 17  # bytes of the chunks' index that are kept as they are
_CHANNEL_COUNT, _REST = 10, 1024  # bytes of a channel in the statistics, and of all else in the end of a file, at most


class McapWriter:
    """Writer of messages into a binary file that is at its start.

    It does not close the file. An OSError of the file is passed on.
    """

    def __init__(
        self,
        file: BinaryIO,
        profile: str,
        library: str,
        chunk_bytes: int,
        packed: bool = True,
        fits: Callable[[int], bool] = lambda _: True,
    ) -> None:
        """Write the beginning of the file.

        A chunk larger than ``chunk_bytes`` is closed without a call of :meth:`flush`; ``packed`` is True when chunks are packed.
        ``fits`` is asked before each chunk with its bytes in the file; once it says no, that chunk and all later ones are left out.
        """
        self._file, self._chunk_bytes, self._fits = file, chunk_bytes, fits
        self.complete = True  # False: chunks were left out
        self._compression = COMPRESSION if packed else b""
        self._compress = zstandard.ZstdCompressor().compress if packed else bytes
        self._packer = ThreadPoolExecutor(1)  # packs and sums without Python's lock
        # its thread starts before anything is recorded: Python waits for ever for a thread that gets no memory while it starts
        self._packer.submit(zlib.crc32, b"").result()
        # closed chunks that are being packed: packed bytes, compression and CRC, size, index
        self._packing: deque[tuple[Future[tuple[bytes, bytes, int]], int, Index]] = deque()
        self._waiting = 0  # bytes of their content
        self._data_crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self.counts: Counter[int] = Counter()  # messages in the file by channel
        self._described = 0  # bytes of the descriptions of schemas and channels
        self._chunks, self._chunk_count = bytearray(), 0  # the newest index of the chunks as the file will hold it
        # what was before, packed: of an hour with fifty topics it is 25 MB
        self._chunks_before: list[bytes] = []
        self._bytes_before = 0
        self._metadata: list[MetadataIndex] = []
        self._first = self._last = 0  # first and last time of the messages in closed chunks
        # for each chunk that the file may still hold in its buffer: its end in the file, and the last time of its messages [ns]
        self.unflushed: deque[tuple[int, int]] = deque()
        self._begin_chunk()
        self._write(MAGIC)
        self._write(_bytes(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Store a new schema and return its number."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._describe(_bytes(self._schemas[-1]))
        return len(self._schemas)

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: dict[str, str]) -> int:
        """Store a new channel for messages of a schema and return its number."""
        self._channels.append(
            Channel(id=len(self._channels) + 1, topic=topic, message_encoding=encoding, schema_id=schema, metadata=metadata)
        )
        self._describe(_bytes(self._channels[-1]))
        return len(self._channels)

    def add_message(self, channel: int, log_time: int, data: bytes, sequence: int) -> None:
        """Store a message; ``log_time`` [ns] is also its publish time. One larger than a chunk has a chunk of its own."""
        if len(data) > self._chunk_bytes:
            self.end_chunk()
        self._of.append(channel)
        self._times.append(log_time)
        self._sequences.append(sequence)
        self._data.append(data)
        self._size += _HEAD + len(data)
        if self._size > self._chunk_bytes:
            self.end_chunk()

    def add_records(
        self, content: bytes | memoryview, channels: np.ndarray, log_times: np.ndarray, ends: np.ndarray, index: Index | None = None
    ) -> None:
        """Store the records of messages as :func:`joined` makes them.

        Parameters
        ----------
        content : bytes
            The records.
        channels : (n,) array of uint16
            Channel of each message.
        log_times : (n,) array of int
            Their times [ns].
        ends : (n,) array of int
            End of each record in the content.
        index : Index, optional
            Their index from :func:`indexed`, for a chunk that holds nothing else.
        """
        self._gather()
        self._index = None if self._parts else index
        self._parts.append((content, channels, log_times, ends))
        self._size += len(content)
        if self._size > self._chunk_bytes:
            self.end_chunk()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Store named texts outside the chunks."""
        record, offset = _bytes(Metadata(name=name, metadata=values)), self.size
        self._metadata.append(MetadataIndex(offset=offset, length=len(record), name=name))
        self._write(record)

    @property
    def last(self) -> int:
        """Last time of the messages whose chunks are in the file [ns], 0 before the first."""
        return self._last

    @property
    def size(self) -> int:
        """Bytes of the file so far, with all closed chunks."""
        self._put_chunks()
        return self._file.tell()

    @property
    def size_of_end(self) -> int:
        """Bytes that :meth:`finish` writes behind the chunks, at most."""
        return self._described + self._bytes_before + len(self._chunks) + _CHANNEL_COUNT * len(self._channels) + _REST

    def flush(self) -> None:
        """Close the chunk in progress, unless it has no message, and hand everything to the operating system."""
        self.end_chunk()
        self._put_chunks()
        self.hand_over()

    def hand_over(self) -> None:
        """Hand all that is written to the operating system; the chunk in progress stays open."""
        self._file.flush()
        self.unflushed.clear()

    def finish(self) -> None:
        """Write the end of the file: summary, indices and magic."""
        self.end_chunk()
        self._put_chunks()
        self._packer.shutdown()
        self._write(_bytes(DataEnd(self._data_crc)))
        start, data, groups = self._file.tell(), bytearray(), []
        for opcode, part in (
            (Opcode.SCHEMA, map(_bytes, self._schemas)),
            (Opcode.CHANNEL, map(_bytes, self._channels)),
            (Opcode.STATISTICS, [_bytes(self._statistics())]),
            (Opcode.CHUNK_INDEX, [*map(zlib.decompress, self._chunks_before), self._chunks]),
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
            channel_message_counts=self.counts,
            chunk_count=self._chunk_count,
            message_count=sum(self.counts.values()),
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
        self._index: Index | None = None  # of the only part
        self._size = 0

    def _describe(self, record: bytes) -> None:
        """Put the description of a schema or channel into the chunk; the summary repeats it."""
        self._described += len(record)
        self._gather()
        self._index = None
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
        self._index = None
        self._parts.append((b"".join(records), heads["channel"], heads["logged"].astype(np.int64), ends))
        self._of, self._times, self._sequences, self._data = [], [], [], []

    def end_chunk(self) -> None:
        """Close the chunk in progress, unless it has no message."""
        self._gather()
        if not any(len(part[2]) for part in self._parts):
            return
        index = self._index or self._index_of_parts()
        content = self._parts[0][0] if len(self._parts) == 1 else b"".join([part[0] for part in self._parts])
        self._packing.append((self._packer.submit(self._pack, content), len(content), index))
        self._waiting += len(content)
        self._begin_chunk()
        while self._packing and (self._packing[0][0].done() or len(self._packing) > MOST_PACKING or self._waiting > MOST_BYTES):
            self._put_chunk()

    def _pack(self, content: bytes | memoryview) -> tuple[bytes, bytes, int]:
        """Return a chunk's content as the file holds it, its compression and its CRC.

        What packs better than readers trust is stored as it is.
        """
        try:
            packed, compression = self._compress(content), self._compression
        except zstandard.ZstdError as error:  # a compressor that has begun fails for lack of memory alone
            raise MemoryError(str(error)) from error
        if len(packed) * limits.EXPANSION < len(content):
            packed, compression = bytes(content), b""
        return packed, compression, zlib.crc32(content)

    def _put_chunks(self) -> None:
        """Write all closed chunks."""
        while self._packing:
            self._put_chunk()

    def _put_chunk(self) -> None:
        """Write the first of the closed chunks, as soon as it is packed; once one does not fit, none is written."""
        packing, size, index = self._packing[0]
        packed, compression, crc = packing.result()
        self.complete = self.complete and self._fits(len(packed) + len(index.records) + _CHUNK.size + _PACKED.size)
        self._waiting -= size
        self._packing.popleft()  # an interrupt while it is packed leaves it where it is
        if not self.complete:
            return
        length = _CHUNK.size - 9 + len(compression) + _PACKED.size + len(packed)
        head = _CHUNK.pack(Opcode.CHUNK, length, index.first, index.last, size, crc, len(compression))
        at = self._file.tell()
        indices_at = at + 9 + length
        self.unflushed.append((indices_at, index.last))  # before the write, which may fail behind the chunk
        self._write(b"".join([head, compression, _PACKED.pack(len(packed)), packed, index.records]))
        for channel, count in zip(index.channels.tolist(), index.counts.tolist()):
            self.counts[channel] += count
        table = np.empty(len(index.channels), _PLACE)
        table["channel"], table["index"] = index.channels, indices_at + index.places
        self._first, self._last = min(self._first, index.first) if self._chunk_count else index.first, max(self._last, index.last)
        self._chunk_count += 1
        self._chunks += _CHUNK_INDEX.pack(
            Opcode.CHUNK_INDEX,
            _CHUNK_INDEX.size - 9 + table.nbytes + _INDICES.size + len(compression) + _SIZES.size,
            index.first,
            index.last,
            at,
            indices_at - at,
            table.nbytes,
        )
        self._chunks += table.tobytes() + _INDICES.pack(len(index.records), len(compression)) + compression
        self._chunks += _SIZES.pack(len(packed), size)
        if len(self._chunks) > _KEPT:
            self._chunks_before.append(zlib.compress(self._chunks, 1))
            self._bytes_before += len(self._chunks)
            self._chunks.clear()

    def _index_of_parts(self) -> Index:
        begins, begin = [], 0  # of each record
        for content, _, _, ends in self._parts:
            begins.append(begin + np.append(0, ends[:-1]) if len(ends) else ends)
            begin += len(content)
        channels, times = np.concatenate([part[1] for part in self._parts]), np.concatenate([part[2] for part in self._parts])
        return indexed(channels.astype(np.uint16), times, np.concatenate(begins), [len(times)])[0]

    def _write(self, data: bytes) -> None:
        """Write to the part of the file that the data's CRC covers."""
        self._data_crc = zlib.crc32(data, self._data_crc)
        self._file.write(data)


@dataclass(frozen=True)
class Index:
    """The indices of a chunk.

    Attributes
    ----------
    first, last : int
        First and last log time of its messages [ns].
    channels : (n,) array of int
        Its channels in the order of their first messages.
    counts : (n,) array of int
        Number of messages of each.
    places : (n,) array of int
        Place of the index of each in the records.
    records : memoryview
        The records of all indices.
    """

    first: int
    last: int
    channels: np.ndarray
    counts: np.ndarray
    places: np.ndarray
    records: memoryview


def indexed(channels: np.ndarray, times: np.ndarray, begins: np.ndarray, sizes: Sequence[int]) -> list[Index]:
    """Return the indices of chunks that follow each other.

    Parameters
    ----------
    channels : (n,) array of uint16
        Channel of each message.
    times : (n,) array of int
        Their log times [ns].
    begins : (n,) array of int
        Place of each record in its chunk.
    sizes : sequence of int
        Number of messages in each chunk.

    Returns
    -------
    list of Index
        The indices of each chunk.
    """
    bounds = np.cumsum([0, *sizes])
    chunk_of = np.repeat(np.arange(len(sizes)), sizes)
    entries = np.empty(len(times), _ENTRY)
    entries["logged"], entries["begin"] = times, begins
    numbers = int(channels.max()) + 1
    groups = chunk_of * numbers + channels
    if numbers * len(sizes) <= 1 << 16:
        groups = groups.astype(np.uint16)  # is sorted in a third of the time
    order = np.argsort(groups, kind="stable")
    groups = groups[order]
    group_begins = np.append(0, np.flatnonzero(groups[1:] != groups[:-1]) + 1)
    counts = np.append(group_begins[1:], len(order)) - group_begins
    firsts = order[group_begins]  # the first message of each
    in_turn = np.argsort(firsts)
    heads = np.empty(len(counts), _MESSAGE_INDEX)
    heads["opcode"], heads["channel"] = Opcode.MESSAGE_INDEX, channels[firsts]
    heads["bytes"] = _ENTRY.itemsize * counts
    heads["length"] = heads["bytes"] + _INDEX_LENGTH
    lengths = heads.itemsize + _ENTRY.itemsize * counts
    ends = np.cumsum(lengths[in_turn])
    places = np.empty_like(ends)
    places[in_turn] = ends
    places -= lengths
    out = np.empty(int(ends[-1]), np.uint8)
    _lay(out, places, _rows_of_bytes(heads))
    behind = places + heads.itemsize - _ENTRY.itemsize * group_begins
    _lay(out, np.repeat(behind, counts) + _ENTRY.itemsize * np.arange(len(order)), _rows_of_bytes(entries[order]))
    low, high = (reduce.reduceat(times, bounds[:-1]).tolist() for reduce in (np.minimum, np.maximum))
    of, counts, places, records = heads["channel"][in_turn], counts[in_turn], places[in_turn], memoryview(out)
    turns = np.searchsorted(chunk_of[firsts[in_turn]], np.arange(len(sizes) + 1)).tolist()
    starts = [*places[turns[:-1]].tolist(), len(out)]
    return [
        Index(low[k], high[k], of[begin:end], counts[begin:end], places[begin:end] - starts[k], records[starts[k] : starts[k + 1]])
        for k, (begin, end) in enumerate(itertools.pairwise(turns))
    ]


def joined(channels: Sequence[tuple[int, np.ndarray, np.ndarray, np.ndarray]], order: np.ndarray) -> tuple[memoryview, np.ndarray]:
    """Return the records of messages of several channels in a given order.

    Parameters
    ----------
    channels : sequence of (int, array of int, array of int, array of uint8)
        For each channel its number, and of its messages the log times [ns], which are the publish times too, and the sequence
        numbers (n,), and the bytes (n, size).
    order : (total,) array of int
        Number of each message, counted through all channels, in the order of the result.

    Returns
    -------
    content : memoryview
        The records.
    ends : (total,) array of int
        End of each record in the content.
    """
    counts, sizes = zip(*[data.shape for _, _, _, data in channels])
    size = np.repeat(sizes, counts)
    heads = np.empty(len(size), _MESSAGE)
    heads["opcode"], heads["length"] = Opcode.MESSAGE, size + _MESSAGE_LENGTH
    heads["channel"] = np.repeat([channel for channel, _, _, _ in channels], counts)
    heads["logged"] = heads["published"] = np.concatenate([times for _, times, _, _ in channels])
    heads["sequence"] = np.concatenate([sequences for _, _, sequences, _ in channels])
    ends = np.cumsum((size + _HEAD)[order])
    begins = np.empty(len(size), np.int64)
    begins[order] = ends
    begins -= size
    content, first = np.empty(int(ends[-1]), np.uint8), 0
    _lay(content, begins - _HEAD, _rows_of_bytes(heads))
    for _, _, _, data in channels:
        _lay(content, begins[first : first + len(data)], data)
        first += len(data)
    return memoryview(content), ends


def _rows_of_bytes(records: np.ndarray) -> np.ndarray:
    """Return records (n, ...) as their bytes (n, size)."""
    return records.view(np.uint8).reshape(len(records), -1)


def _lay(content: np.ndarray, places: np.ndarray, data: np.ndarray) -> None:
    """Lay each row of bytes (n, size) at its place in the content."""
    kind = f"V{data.shape[1]}"
    everywhere = np.ndarray(len(content) - data.shape[1] + 1, kind, content, 0, (1,))  # what the content has from each place on
    everywhere[places] = data.view(kind)[:, 0]


def _bytes(record: McapRecord) -> bytes:
    """Return a record of the library's classes as bytes of a file."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
