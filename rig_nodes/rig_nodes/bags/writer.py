# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writer of a run: MCAP files that stay readable however the process ends, and rosbag2's metadata.yaml.

The headless run and the recorder use it. The same calls give the same bytes.
"""

from __future__ import annotations

import io
import itertools
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .. import __version__
from ..base import DiskFull, RigError, atomic_write, not_written
from ..rig import Topic, installed_topics
from . import limits, metadata
from .cdr import exact
from .definitions import Definition, installed
from .growing_file import GrowingFile
from .mcap_writer import McapWriter, indexed, joined
from .pieces import pack
from .records import BYTES
from .run_end import OF_RUN, RECORD_NAME

if TYPE_CHECKING:
    T = TypeVar("T")

FLUSH_NS = 100_000_000
CHUNK_BYTES = 4 * 1024 * 1024
BUFFER = 1024 * 1024  # bytes that are handed to the operating system at once, when it is time
# bytes that a disk must have left behind the end of a bag, for the other files of a run, and that the end takes for a topic
RESERVE, OF_TOPIC = 96 * 1024, 1024
LIBRARY = f"rig_nodes {__version__}"
LIBRARY_OF_RUN = LIBRARY + OF_RUN  # for a bag that ends with BagWriter.end
LARGEST = limits.CHUNK - limits.RECORD * 2 - 64  # bytes of a message whose chunk, with its topic's description, can be read
_SEQUENCE = struct.Struct("<I")  # the low half of a sequence number
_SEQUENCE_AT = slice(20, 24)  # its place in a message of the rig's own form


@dataclass(slots=True)
class _Topic:
    """A topic of the bag: channel number, definition, offered profiles and the properties of its messages."""

    channel: int
    definition: Definition | None  # None for a topic that was described by another bag
    ros_type: str
    offered: str
    counted: bool
    own: bool  # True for a topic of the catalogue: its messages are stored without padding
    size: int  # bytes of every message, 0 when the size varies
    hash: str  # RIHS01 of the type, or empty
    count: int = 0  # messages written
    before: int = 0  # of these, messages in earlier files
    name: str = ""  # in the file, where the bag knows it by another one


@dataclass(frozen=True)
class Layout:
    """How a bag is stored in files.

    Attributes
    ----------
    size : int
        Bytes of a file after which the next one begins; 0 for no limit.
    length : int
        Simulated time of a file after which the next one begins [ns]; 0 for no limit.
    packing : str
        What zstd packs: ``chunk``, each chunk of a file; ``file``, files as a whole, when they are closed; ``none``.
    """

    size: int = 0
    length: int = 0
    packing: str = "chunk"


@dataclass(frozen=True)
class Column:
    """Messages of one topic, all of the same size.

    Attributes
    ----------
    topic : str
        The topic.
    places : (n,) array of int64
        Place of each message in the order of all that are written together; it grows, and no two messages have the same.
    times : (n,) array of int64
        Simulated times from 0 on [ns].
    data : (n, size) array of uint8
        The messages.
    """

    topic: str
    places: np.ndarray
    times: np.ndarray
    data: np.ndarray

    @property
    def sequences(self) -> np.ndarray:
        """The low half of the sequence number in each message of the rig's own form (n,)."""
        return np.ascontiguousarray(self.data[:, _SEQUENCE_AT]).view("<u4")[:, 0]

    def before(self, place: int) -> Column:
        """Return the messages before a place."""
        return self._cut(slice(0, np.searchsorted(self.places, place)))

    def after(self, place: int) -> Column:
        """Return the messages behind a place."""
        return self._cut(slice(np.searchsorted(self.places, place, "right"), None))

    def _cut(self, part: slice) -> Column:
        return Column(self.topic, self.places[part], self.times[part], self.data[part])


class MessageRefused(RigError):
    """The error for one message that cannot be stored; the bag stays open for further messages."""


class BagWriter:
    """Writer of one bag in one folder: ``<folder>/<name>_<piece>.mcap`` and, after closing, ``<folder>/metadata.yaml``.

    With a layout that has limits, further files follow with the next numbers. File names end in a number because
    ``ros2 bag reindex`` accepts only such files as pieces of a bag.

    A chunk is closed and handed to the operating system when the simulated time of the messages passes a
    multiple of 100 ms, so that a killed process loses at most that much of what it gave. A chunk above 4 MiB is closed earlier.
    A recorder that runs slower than real time additionally calls :meth:`flush`. The class is not thread-safe.
    """

    def __init__(
        self,
        folder: str | Path,
        name: str,
        piece: int = 0,
        topics: Mapping[str, Topic] | None = None,
        library: str = LIBRARY,
        layout: Layout = Layout(),
    ) -> None:
        """Create the file, and the folder when it does not exist.

        Parameters
        ----------
        folder : str or Path
            Folder of the bag.
        name : str
            First part of the file name.
        piece : int
            Number at the end of the file name.
        topics : mapping of str to Topic, optional
            Topics of the run's rig (Catalogue.all_topics); those of the installed rigs when the rig is not known.
        library : str
            Name of the program that the file gives.
        layout : Layout
            When the next file begins, and what is packed.

        Raises
        ------
        RigError
            When the file already exists or cannot be made.
        DiskFull
            When the disk has no room for the end of a bag; no file is left then.
        """
        self.folder = Path(folder)
        self.custom: dict[str, str] = {}  # further facts for metadata.yaml
        self._name, self._piece, self._layout = name, piece, layout
        self._known = installed_topics() if topics is None else topics
        self._earlier: dict[str, _Topic] = {}  # topics of the files before, with all messages up to then
        self._files: list[metadata.File] = []  # files that are closed
        self._split = False
        self._end: dict[str, str] = {}
        self._closed = False
        self._library = library
        self._failure: tuple[type[RigError], str] | None = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._open()
        except FileExistsError as error:
            raise RigError(f"{error.filename} is there already; name another folder or remove it") from None
        except OSError as error:
            at = error.filename or self.folder
            raise RigError(f"{at} cannot be made ({error.strerror}); name a folder that can be written") from None
        self._writer = self._guard(self._begin)
        if (left := self._room()) < RESERVE:  # not even an empty bag could be ended
            self._close_file()
            self.path.unlink()
            raise DiskFull(
                f"{self.path} has room for {max(0, left) // 1024} kB, less than a bag's end needs; free 1 MB of its disk"
            )

    def write(self, topic: str, ros_type: str, data: bytes, log_time_ns: int, offered: str = "") -> None:
        """Store one encoded message as it is.

        On topics of the catalogue the padding that DDS may have appended is removed.

        Parameters
        ----------
        topic : str
            Topic of the message.
        ros_type : str
            Message type, e.g. ``rig_msgs/msg/Measurement``.
        data : bytes
            CDR with encapsulation.
        log_time_ns : int
            Simulated time from 0 on [ns], stored as log and publish time.
        offered : str
            Profiles, as in a channel, of a topic outside the catalogue; those of a measurement when empty.

        Raises
        ------
        MessageRefused
            When the bytes are not such a message, the topic changes its type or the time is out of range.
        RigError
            When the bag is closed or the disk accepts no more data.
        """
        if self._closed or self._failure:
            self._writable()
        if not 0 <= log_time_ns <= limits.LAST:
            raise MessageRefused(f"topic {topic}: a message of {log_time_ns / 1e9:g} s; times are 0 to {limits.LAST / 1e9:g} s")
        if len(data) > LARGEST:
            raise MessageRefused(f"topic {topic}: a message of {len(data)} bytes; at most {LARGEST} are recorded")
        known = self._topics.get(topic) or self._guard(self._add_topic, topic, ros_type, offered)
        if known.ros_type != ros_type:
            raise MessageRefused(f"topic {topic} holds {known.ros_type}, got a {ros_type}; a topic has one type")
        if known.own and known.definition is not None and len(data) != known.size:
            try:
                data = exact(known.definition, data)
            except ValueError as error:
                raise MessageRefused(f"topic {topic}: {error}; expected exact little-endian CDR") from None
        self._add(topic, known, data, log_time_ns)

    def write_columns(self, columns: Sequence[Column]) -> None:
        """Store messages that encoders of bags.cdr in this process made, on topics of the catalogue; they are not checked.

        Parameters
        ----------
        columns : sequence of Column
            The messages; they are stored in the order of their places.

        Raises
        ------
        RigError
            When the bag is closed or the disk accepts no more data.
        """
        self._writable()
        columns = [column for column in columns if len(column.data)]
        while new := [column for column in columns if column.topic not in self._topics]:
            # a topic is described in front of its first message
            first = min(new, key=lambda column: column.places[0])
            self._store([column.before(first.places[0]) for column in columns])
            self._add_made(first.topic, int(first.times[0]), first.data[0].tobytes())
            columns = [column.after(first.places[0]) for column in columns]
            columns = [column for column in columns if len(column.data)]
        self._store(columns)

    def _store(self, columns: Sequence[Column]) -> None:
        """Store messages of topics that have a channel in the bag."""
        columns = [column for column in columns if len(column.data)]
        if not columns:
            return
        order = np.argsort(np.concatenate([column.places for column in columns]), kind="stable")
        times = np.concatenate([column.times for column in columns])[order]
        if self._split or self._layout.size or self._layout.length:
            self._store_each(columns, order.tolist(), times.tolist())
            return
        channels = []
        for column in columns:
            topic = self._topics[column.topic]
            numbers = column.sequences if topic.counted else topic.count + np.arange(len(column.data))
            topic.count += len(column.data)
            channels.append((topic.channel, column.times, numbers, column.data))
        content, ends = joined(channels, order)
        of = np.repeat(np.array([channel for channel, *_ in channels], np.uint16), [len(column.data) for column in columns])[order]
        # a chunk begins with the first message behind a multiple of its length
        window = np.maximum.accumulate(times // FLUSH_NS)
        begins = [0, *(np.flatnonzero(window[1:] > window[:-1]) + 1).tolist(), len(times)]
        starts = np.append(0, ends)[begins]
        at = starts[:-1].tolist()
        each = indexed(of, times, np.append(0, ends[:-1]) - np.repeat(starts[:-1], np.diff(begins)), np.diff(begins).tolist())
        self._look_after()
        tight = self._room() < len(content) + RESERVE  # then the disk is looked at behind each chunk
        for k, (begin, end) in enumerate(itertools.pairwise(begins)):
            self._begin_chunk(int(times[begin]), tight)
            records = content[at[k] : int(starts[k + 1])]
            self._guard(self._writer.add_records, records, of[begin:end], times[begin:end], ends[begin:end] - at[k], each[k])
            self._first, self._last = min(self._first, int(times[begin:end].min())), max(self._last, int(times[begin:end].max()))
        self._guard(self._writer.hand_over)
        self._kept = self._writer.last
        self._end_before_full()

    def _store_each(self, columns: Sequence[Column], order: Sequence[int], times: Sequence[int]) -> None:
        """Store messages one by one, as before each the next file may begin."""
        every = [(column.topic, message.tobytes()) for column in columns for message in column.data]
        for k, time in zip(order, times):
            self._add_made(every[k][0], time, every[k][1])

    def _add_made(self, topic: str, log_time_ns: int, data: bytes) -> None:
        known = self._topics.get(topic) or self._guard(self._add_topic, topic, self._known[topic].ros_type, "")
        self._add(topic, known, data, log_time_ns)

    def _begin_chunk(self, log_time_ns: int, hand_over: bool = True) -> bool:
        """Begin a new chunk where a message of this time begins one; return True where it begins the next file too.

        ``hand_over`` is False where the caller hands closed chunks to the operating system.
        """
        if self._flush_at is not None and log_time_ns < self._flush_at:
            return False
        fresh = False
        if self._flush_at is None:
            self._first = self._last = log_time_ns
        else:
            if hand_over:
                self._hand_over()
            else:
                self._guard(self._writer.end_chunk)
            if self._split or self._full(log_time_ns):
                self._guard(self._next)
                self._first = self._last = log_time_ns
                fresh = True
        self._flush_at = (log_time_ns // FLUSH_NS + 1) * FLUSH_NS
        return fresh

    def _add(self, topic: str, known: _Topic, data: bytes, log_time_ns: int) -> None:
        """Store a message, in a new chunk where its time begins one."""
        if self._begin_chunk(log_time_ns):
            known = self._guard(self._add_topic, topic, known.ros_type, known.offered)
        sequence = _SEQUENCE.unpack_from(data, _SEQUENCE_AT.start)[0] if known.counted else known.count
        try:
            self._writer.add_message(known.channel, log_time_ns, data, sequence)
        except OSError as error:
            raise self._fail(error) from None
        known.count += 1
        if log_time_ns > self._last:
            self._last = log_time_ns
        elif log_time_ns < self._first:
            self._first = log_time_ns

    def describe(self, topic: str, ros_type: str, encoding: str, text: str, about: Mapping[str, str], name: str = "") -> None:
        """Prepare a topic as another bag holds it; its messages are then stored byte by byte, also of types not installed here.

        Parameters
        ----------
        topic : str
            Name by which :meth:`write` knows the topic; it must not be known to this bag.
        ros_type : str
            Message type.
        encoding : str
            Encodings of message and definition, as ``cdr/ros2msg``.
        text : str
            The definition.
        about : mapping of str to str
            The channel's own metadata, whose profiles metadata.yaml repeats.
        name : str
            The topic in the file, where it has several types and therefore ``topic`` is another name.
        """
        self._writable()
        message, _, language = encoding.partition("/")
        schema = self._schemas.get(key := f"{ros_type}\n{language}\n{text}")
        if schema is None:
            there = ros_type or language or text  # a channel may have no definition
            schema = self._writer.register_schema(ros_type, language, text.encode(errors=BYTES)) if there else 0
            self._schemas[key] = schema
        channel = self._writer.register_channel(name or topic, message, schema, dict(about))
        offered, digest = about.get(metadata.OFFERED), about.get("topic_type_hash", "")
        offered = metadata.NOT_OFFERED if offered is None else metadata.profiles_of_today(offered)
        self._topics[topic] = _Topic(channel, None, ros_type, offered, False, False, 0, digest, name=name)

    def split(self) -> None:
        """Begin the next file with the next chunk."""
        self._split = True

    def end(self, state: str, reason: str, trip: str = "") -> None:
        """Say how the run ended (run_end.RunEnd); :meth:`close` stores it as the last record of the bag."""
        self._end = {"state": state, "reason": reason} | ({"trip": trip} if trip else {})

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.count for name, topic in {**self._earlier, **self._topics}.items()}

    def flush(self) -> None:
        """Close the chunk in progress and hand all data to the operating system."""
        self._writable()
        self._hand_over()

    def _hand_over(self) -> None:
        self._look_after()
        self._guard(self._writer.flush)
        self._kept = self._writer.last
        self._end_before_full()

    def _look_after(self) -> None:
        """End the bag in order when others have removed, moved or cut its file, or closed its folder.

        Raises
        ------
        RigError
            When the recording cannot go on.
        """
        try:
            why, whole = self._growing.harm(self.path, f"{self._last / 1e9:.3f} s")
        except OSError as error:
            raise self._fail(error) from None
        if why:
            raise self._stop(RigError(why), whole)

    def _room(self) -> int:
        """Return the bytes that the disk has left for chunks in front of the end of the bag."""
        waiting = self._file.tell() - self._growing.written  # in the file's buffer
        return self._growing.left() - waiting - self._size_of_end()

    def _size_of_end(self) -> int:
        return self._writer.size_of_end + OF_TOPIC * len(self._topics)

    def _fits(self, size: int) -> bool:
        """Return whether the disk has room for a chunk of so many bytes."""
        self._growing.keep(self._file.tell() + size + self._size_of_end() + RESERVE)
        self._left = self._room() - size
        return self._left >= 0

    def _close_file(self) -> None:
        """Close the file with what is in its buffer, as far as the disk takes it."""
        for step in () if self._file.closed else (self._file.flush, self._growing.give_back, self._file.close):
            with suppress(OSError):
                step()

    def _end_before_full(self, reserve: int = RESERVE) -> None:
        """End the bag in order, and raise DiskFull, where the disk took no further chunk or has less than the reserve left."""
        if self._writer.complete and self._left >= reserve:
            return
        with suppress(OSError):
            self._writer.flush()
        self._last = self._writer.last
        self._first = min(self._first, self._last)
        for topic in self._topics.values():
            topic.count = topic.before + self._writer.counts[topic.channel]
        left = f"{max(0, self._left) // 1024} kB are left of the {reserve // 1024} kB that the other files of a run need"
        why = left if self._writer.complete else "there is no room for what comes next"
        raise self._stop(DiskFull(f"{self.path} was ended in order at {self._last / 1e9:.3f} s, before the disk is full: {why}"))

    def _stop(self, why: RigError, whole: bool = True) -> RigError:
        """End the bag for a reason, which every later call repeats; one that is not ``whole`` any more is only closed.

        Returns the reason; where the disk does not take the end either, that.
        """
        try:
            with suppress(RigError):  # of metadata.yaml, which no reader needs
                if whole:
                    self.end("failed", str(why))
                    self._finish()
        except OSError as error:
            return self._fail(error)
        self._close_file()
        self._failure = type(why), str(why)
        return why

    def close(self) -> None:
        """Write the end of the file and metadata.yaml; a second call does nothing.

        After a failed write it only closes the file; what the file holds stays readable by recovery.
        """
        if self._closed:
            return
        self._closed = True
        if self._failure:
            self._close_file()
            return
        self._guard(self._writer.flush)
        self._look_after()
        self._end_before_full(0)
        self._guard(self._finish)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _writable(self) -> None:
        if self._failure:
            kind, text = self._failure
            raise kind(text)
        if self._closed:
            raise RigError(f"{self.path} is closed; nothing can be added to it")

    def _guard(self, action: Callable[..., T], *arguments: object) -> T:
        """Call the action; a write error becomes this bag's error, which every later call repeats."""
        try:
            return action(*arguments)
        except OSError as error:
            raise self._fail(error) from None

    def _fail(self, error: OSError) -> RigError:
        size = 0
        self._close_file()
        with suppress(OSError):
            size = self.path.stat().st_size
        kept = max([self._kept, *(last for end, last in self._unflushed if end <= size)])
        failure = not_written(self.path, error, f"what was recorded up to {kept / 1e9:.3f} s stays readable")
        self._failure = type(failure), str(failure)
        return failure

    def _open(self) -> None:
        """Create the next file; its topics, times and counts begin anew."""
        self.path = self.folder / f"{self._name}_{self._piece}.mcap"
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._flush_at: int | None = None  # ns; None before the first message
        self._first = self._last = 0
        self._kept = 0  # ns, up to which everything is handed to the operating system
        self._left = RESERVE  # bytes that the disk has left behind the newest chunk and the end
        self._unflushed: deque[tuple[int, int]] = deque()  # of McapWriter, once it has begun the file
        self._growing = GrowingFile(self.path)
        self._file = io.BufferedWriter(self._growing, BUFFER)

    def _begin(self) -> McapWriter:
        writer = McapWriter(self._file, "ros2", self._library, CHUNK_BYTES, self._layout.packing == "chunk", self._fits)
        self._unflushed = writer.unflushed
        self._file.flush()
        self._growing.keep(self._file.tell() + RESERVE)
        return writer

    def _full(self, time: int) -> bool:
        """Return True when a message of this time [ns] belongs into the next file."""
        size, length = self._layout.size, self._layout.length
        return bool((size and self._writer.size >= size) or (length and time >= self._first + length))

    def _next(self) -> None:
        """Close the file and begin the next one."""
        self._end_file()
        self._earlier |= self._topics
        self._piece += 1
        self._split = False
        self._open()
        self._writer = self._begin()

    def _add_topic(self, topic: str, ros_type: str, offered: str) -> _Topic:
        definition = installed(ros_type)
        entry = self._known.get(topic)
        if entry or not offered:
            offered = metadata.profile_text(entry.qos if entry else "measurement")
        if ros_type not in self._schemas:
            text = definition.text.encode()
            self._schemas[ros_type] = self._writer.register_schema(ros_type, "ros2msg", text)
        channel = self._writer.register_channel(
            topic, "cdr", self._schemas[ros_type], {metadata.OFFERED: offered, "topic_type_hash": definition.type_hash}
        )
        before = self._earlier[topic].count if topic in self._earlier else 0
        self._topics[topic] = _Topic(
            channel,
            definition,
            ros_type,
            offered,
            entry is not None and definition.counted,
            entry is not None,
            definition.size if definition.fixed else 0,
            definition.type_hash,
            before,
            before,
        )
        return self._topics[topic]

    def _end_file(self) -> None:
        """Write the end of the file, and pack it where whole files are packed."""
        self._writer.flush()
        topics = [_topic_entry(name, topic, topic.count - topic.before) for name, topic in self._topics.items()]
        this = metadata.File(self.path.name, self._first, self._last, sum(topic["count"] for topic in topics))
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata.bag_metadata([this], topics)})
        self._writer.finish()
        self._file.flush()
        self._growing.give_back()
        self._file.close()
        if self._layout.packing == "file":
            this = replace(this, name=pack(self.path).name)
        self._files.append(this)

    def _finish(self) -> None:
        if self._end:
            self._writer.flush()
            self._writer.add_metadata(RECORD_NAME, self._end)
        self._end_file()
        topics = [_topic_entry(name, topic, topic.count) for name, topic in {**self._earlier, **self._topics}.items()]
        information = metadata.bag_metadata(self._files, topics, self._layout.packing == "file", self.custom)
        # an atomic write, because a folder with metadata.yaml counts as a finished bag
        atomic_write(self.folder / "metadata.yaml", metadata.metadata_file(information))


def _topic_entry(name: str, topic: _Topic, count: int) -> dict:
    return {"name": topic.name or name, "type": topic.ros_type, "offered": topic.offered, "hash": topic.hash, "count": count}
