# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reader of a recorded run: signals, logger rows, events, and the check that nothing is missing.

The report, the view and the tests use it. The messages are those of bags.messages.
"""

from __future__ import annotations

import json
import math
import re
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..base import RUN_FILE, BagError, RigError, RigWarning
from ..rig import Catalogue, Signal, Structure, Transmission, catalogue, installed_topics, structure_of, transmission_of
from . import limits
from .blocks import false_heads, out_of_reach
from .mcap_scan import read_mcap, read_pieces
from .messages import Messages, recovered, stamps_of
from .pieces import files_of_run, plain, read_metadata
from .records import Contents, Stream
from .rig_in_bag import holds_rig, rig_record
from .sequence_numbers import Numbers, holes, lives_of

UNREADABLE = (RigError, KeyError, TypeError, ValueError, AttributeError, IndexError)  # exceptions that an invalid record may raise
SHIFTED = 1e-7  # s; a stamp that is later than the time of its row by more than this is not so by rounding
T = TypeVar("T")
_PLACES = 40  # bits of a message's place in its file
_LENGTH = struct.Struct("<I")
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?")
_BLOCK = dict.fromkeys(("first_sample", "period", "rows", "channels"), "number") | {"data": "sequence"}
_EVENT = {"name": "string", "text": "string", "value": "number"}


@dataclass(frozen=True)
class Logger:
    """Rows of a logger.

    Attributes
    ----------
    t0 : float
        Time of row 0 [s].
    period : float
        Time between rows [s].
    channels : dict of str to (n,) array of float
        Values of each column by name [SI].
    first : int
        Number of row 0 since time 0.
    """

    t0: float
    period: float
    channels: dict[str, np.ndarray]
    first: int = 0

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.channels.values()))) if self.channels else 0

    def time(self) -> np.ndarray:
        """Time of every row [s]."""
        return self.t0 + self.period * np.arange(self.rows)


class Bag(Messages):
    """A recorded run that is read and checked when it is opened.

    It stays in memory, which takes about 1 MB per second of run.

    Attributes
    ----------
    path : Path
        The .mcap file, of several pieces the first.
    counts : dict of str to int
        Messages per topic.
    types : dict of str to str
        Message type per topic.
    damage : list of str
        One sentence per fault that recovery passed over; empty for a sound bag.
    library : str
        Name of the program that wrote the bag, as the bag gives it.
    end : dict of str to str
        The bag's record of how its run ended (bags.run_end); empty without one.
    """

    def __init__(self, path: str | Path, recover: bool = False) -> None:
        """Open the folder of a run or its .mcap file.

        Parameters
        ----------
        path : str or Path
            The run's folder or the .mcap file.
        recover : bool
            True to read the undamaged part of a cut or damaged bag.

        Raises
        ------
        BagError
            When the bag is damaged or missing; the error names the damage or what is missing.
        """
        files = files_of_run(Path(path))
        self.path, self._columns = files[0], {}
        self._hold(_joined([_read(file, recover) for file in files], files))

    @classmethod
    def pieces(cls, path: str | Path, size: int, recover: bool = False) -> Iterator[Bag]:
        """Read the bag piece by piece in the order of the file.

        A piece takes the columns of loggers from the pieces before it.

        Parameters
        ----------
        path : str or Path
            The run's folder or the .mcap file.
        size : int
            Approximate size of a piece [bytes of messages].
        recover : bool
            True to read the undamaged part of a damaged bag; the ``damage`` of the last piece then lists all damage.

        Yields
        ------
        Bag
            One piece of the bag.

        Raises
        ------
        BagError
            As the constructor does; damage is raised when the reading reaches it.
        """
        files = files_of_run(Path(path))
        columns: dict[str, list[str]] = {}
        damage: list[str] = []
        for file in files:
            piece = None
            with plain(file) as opened:
                for contents in read_pieces(opened, recover, size):
                    piece = cls.of(files[0], contents, columns)
                    piece.damage = damage + _named(piece.damage, file, files)
                    yield piece
            damage = [] if piece is None else piece.damage

    @classmethod
    def of(cls, path: Path, contents: Contents, columns: dict[str, list[str]] | None = None) -> Bag:
        """Make a bag of contents that were already read from a file.

        Parameters
        ----------
        path : Path
            The .mcap file.
        contents : Contents
            What was read from the file.
        columns : dict of str to list of str, optional
            Known columns of loggers by topic; newly found columns are added to it.
        """
        bag = cls.__new__(cls)
        bag.path, bag._columns = path, {} if columns is None else columns
        bag._hold(contents)
        return bag

    @property
    def recovered(self) -> str:
        """One sentence on what recovery saved; empty for a sound bag."""
        return recovered(sum(self.counts.values()), self.recorded_to, self.damage) if self.damage else ""

    @cached_property
    def record(self) -> Mapping:
        """The rig's structure and values (RigConfig.as_dict) in today's form.

        They are taken from the bag, or from run.json beside it when the recorder ended before the bag held them. Without either,
        they are those of the installed rig whose topics are most like the bag's, which a warning says. BagError is raised for an
        invalid record.
        """
        stored = None
        with suppress(BagError):  # run_info() itself raises this error to its callers
            if info := self.run_info() or self._ordered():
                stored = info.get("configuration", info)
        try:
            record = rig_record(stored, self.types)
        except UNREADABLE as error:
            raise self._no_rig(error) from None
        if not holds_rig(stored):
            like = f"the installed rig '{record['name']}', whose topics are most like its own"
            warnings.warn(RigWarning(f"{self.path}: does not name its rig, and is read as a bag of {like}"), stacklevel=3)
        return record

    @cached_property
    def structure(self) -> Structure:
        """The structure of the bag's rig; BagError is raised when the bag's record is invalid."""
        return self.of_rig(lambda record: structure_of(record["structure"]))

    @cached_property
    def catalogue(self) -> Catalogue:
        """Topics and signals of the bag's rig; BagError is raised when the bag's record is invalid."""
        return self.of_rig(catalogue)

    @cached_property
    def _known(self) -> Catalogue | None:
        """The catalogue, or None when nothing tells which rig the bag is of."""
        try:
            return self.catalogue
        except BagError:
            return None

    @cached_property
    def transmission(self) -> Transmission:
        """Gears, clutches and shafts of the bag's rig; BagError is raised when the bag does not record a rig with gears."""
        return self.of_rig(transmission_of)

    def of_rig(self, made: Callable[[Mapping], T]) -> T:
        """Return what a function makes of the record of the bag's rig; BagError is raised when that is invalid."""
        try:
            return made(self.record)
        except UNREADABLE as error:
            raise self._no_rig(error) from None

    def _no_rig(self, error: Exception) -> BagError:
        """Return the error to raise when the bag's record of its rig is invalid."""
        if isinstance(error, BagError):
            return error
        return BagError(
            f"{self.path}: its record of the rig cannot be used ({type(error).__name__}: {error}); expected what "
            "`rig run` and `rig simulate` put into a bag"
        )

    def has_field(self, signal: Signal) -> bool:
        """Return True when the bag's messages have the field of a signal, even if there are no messages."""
        stream = self._streams.get(signal.topic)
        try:
            return stream is not None and _FIELD.fullmatch(signal.field)[1] in dict(self._definition(stream).tree.fields)
        except BagError:
            return False

    def columns(self, topic: str) -> list[str]:
        """Return a logger's columns from the channel list on the same node; empty when there is no such list."""
        try:
            return self._channel_names(topic)
        except BagError:
            return []

    def series(self, signal: str | Signal) -> tuple[np.ndarray, np.ndarray]:
        """Return the time and value of a signal.

        Parameters
        ----------
        signal : str or Signal
            The signal, or its name in the catalogue of the bag's rig.

        Returns
        -------
        times : (n,) array of float
            Time of each message [s].
        values : (n,) array of float
            Value of the signal [SI].

        Raises
        ------
        RigError
            When the signal is unknown.
        BagError
            When the bag does not hold the signal's topic or field.
        """
        signal = self.catalogue.signal(signal) if isinstance(signal, str) else signal
        stream = self._stream(signal.topic)
        name, index = _FIELD.fullmatch(signal.field).groups()
        if name not in dict(self._definition(stream).tree.fields):
            raise BagError(
                f"{self.path}: {signal.topic} has no field '{name}' for signal {signal.name}; "
                f"the bag is of another version of {stream.ros_type}"
            )
        values = self._field(stream, name)
        if index is not None:
            values = values[:, int(index)]
        return stamps_of(self._heads(stream)) / 1e9, np.ascontiguousarray(values, float)

    def logger(self, topic: str = "/instruments/hmg4000", fill: bool = False, after: Logger | None = None) -> Logger:
        """Return all rows of a logger; the ChannelList on the same node names its columns.

        Parameters
        ----------
        topic : str
            Topic of the logger's blocks.
        fill : bool
            True to put NaN where rows are missing.
        after : Logger, optional
            Rows of the piece before, which these must follow.

        Returns
        -------
        Logger
            The rows, with one (n,) array per column.

        Raises
        ------
        BagError
            When rows are missing and ``fill`` is False, or when blocks and channel list do not match.
        """
        if topic not in self._streams and self._known and topic in self._known.controller_topics:
            raise BagError(f"{self.path}: has no topic {topic}; the run's controller names no signals of its own")
        self._stream(topic)
        names = self._channel_names(topic)
        head, values = self._blocks(topic)
        if not len(head):
            raise BagError(f"{self.path}: {topic} holds no rows; the run ended before its first block")
        if np.any(head["channels"] != len(names)):
            raise BagError(
                f"{self.path}: a block of {topic} has {head['channels'].max()} columns where the channel list names {len(names)}"
            )
        if not 0.0 < head["period"][0] < math.inf:
            raise BagError(f"{self.path}: the period of {topic} is {head['period'][0]} s; expected one above 0")
        if np.any(head["period"] != (head["period"][0] if after is None else after.period)):
            raise BagError(f"{self.path}: the period of {topic} changes within the run; one logger has one period")
        if what := out_of_reach(head, len(names)):
            raise BagError(f"{self.path}: {topic}: {what}")
        first, period = int(head["first_sample"][0]), float(head["period"][0])
        starts = head["first_sample"].astype(np.int64) - first
        ends = starts + head["rows"]
        due = 0 if after is None else after.first + after.rows - first
        if np.any(starts < np.append(due, ends[:-1])):
            raise BagError(
                f"{self.path}: blocks of {topic} overlap or are out of order; the bag was put together from several runs"
            )
        lost = int(ends[-1] - head["rows"].sum(dtype=np.int64))
        if lost and not fill:
            at = (first + int(ends[:-1][starts[1:] > ends[:-1]][0])) * period
            raise BagError(
                f"{self.path}: {topic} misses {lost} rows, the first at {at:.4f} s; record again or have the gaps filled with NaN"
            )
        columns = np.empty((len(names), int(head["rows"].sum(dtype=np.int64))))
        np.concatenate([rows.reshape(-1, len(names)).T for rows in values], axis=1, out=columns)
        if lost:
            whole = np.full((len(names), int(ends[-1])), np.nan)
            whole[:, np.concatenate([np.arange(a, b) for a, b in zip(starts, ends)])] = columns
            columns = whole
        t0, stamp = first * period, float(stamps_of(self._heads(self._streams[topic]))[0]) / 1e9
        if SHIFTED < stamp - t0 < period:
            t0 = stamp  # an imported recording, whose rows do not begin at a multiple of the period
        return Logger(t0, period, dict(zip(names, columns)), first)

    def gaps(self) -> dict[str, int]:
        """Count the messages that never reached the bag, by the holes in their sequence numbers.

        Topics without holes are left out. A topic counts from 0, and from the next multiple of 2^32 after a restart of its
        publisher, so a late start shows as a gap. Where the bag begins later than the run (:attr:`recorded_from`), the count
        begins at the first recorded number. Messages lost at the very end show only in the
        counts of their publishers (:meth:`distinct`).

        Returns
        -------
        dict of str to int
            Lost messages by topic.
        """
        self._numbers.check()
        return self._numbers.gaps(self.recorded_from > 0.0)

    @cached_property
    def _numbers(self) -> Numbers:
        numbers = Numbers()
        numbers.add(self)
        return numbers

    @cached_property
    def recorded_from(self) -> float:
        """Time of the run [s] at which the recording begins: 0 for the project's own recorder, for others the first stamp."""
        return self.begin_by(self._numbers)

    @property
    def recorded_to(self) -> int:
        """Time of the run [ns] at which the recording ends; of other recorders, whose log times may be dates, the latest stamp."""
        return self.end_by(self._numbers, self.last)

    def disorder(self) -> list[str]:
        """Return a sentence for each topic of the rig whose messages are there twice or not in the order of sending."""
        return self._numbers.disorder(self)

    def false_blocks(self) -> dict[str, str]:
        """Return by topic a sentence on blocks of samples that do not hold what their heads say; blocks of other forms are none."""
        found = {}
        for topic, ros_type in self.types.items():
            if ros_type == "rig_msgs/msg/SampleBlock" and self.counts[topic]:
                with suppress(BagError):
                    self.require(topic, _BLOCK)
                    try:
                        head, _ = self._blocks(topic)
                    except BagError as error:
                        found[topic] = str(error).removeprefix(f"{self.path}: ")
                    else:
                        if what := false_heads(head):
                            found[topic] = f"{topic}: {what}"
        return found

    def begin_by(self, numbers: Numbers) -> float:
        """Return :attr:`recorded_from` by the first stamps of all pieces of the bag, of which this may be one."""
        if self._own:
            return 0.0
        return max(0.0, float(min(self._measured(numbers.firsts), default=0)) / 1e9)

    def end_by(self, numbers: Numbers, last: int) -> int:
        """Return :attr:`recorded_to` by the stamps and the last log time of all pieces of the bag, of which this may be one."""
        return last if self._own else max(self._measured(numbers.lasts), default=last)

    def _measured(self, stamps: dict[str, int]) -> list[int]:
        """Return the stamps of the rig's own measurements; of all topics where there is none."""
        known = self._known.all_topics if self._known else installed_topics()
        # users' messages may have no stamp; latched ones carry that of the run's start and are sent again to new subscribers
        measured = [stamp for topic, stamp in stamps.items() if topic in known and known[topic].qos == "measurement"]
        return measured or list(stamps.values())

    def counted(self) -> list[str]:
        """Return the topics with counted messages."""
        return [topic for topic, stream in self._streams.items() if stream.times and self._counted(stream)]

    def numbers_of(self, topic: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the stamps [ns] and the sequence numbers of a topic's messages; BagError when one of them has none."""
        head = self._heads(self._streams[topic])
        return stamps_of(head), head["seq"].copy()

    def gap_of_last_life(self, topic: str) -> int:
        """Count lost messages of one topic as :meth:`gaps` does, but only since its publisher's last start.

        The bag must be the run's own.
        """
        lives = self._lives(self._streams[topic]) if topic in self._streams else []
        return holes(lives[-1]) if lives else 0

    def distinct(self, topic: str, last_life: bool = False) -> int:
        """Count the messages of a topic without repeated ones; 0 for a topic that the bag does not hold.

        Parameters
        ----------
        topic : str
            Topic to count.
        last_life : bool
            True to count only the messages since the last start of the publisher.
        """
        stream = self._streams.get(topic)
        if stream is None or not self._counted(stream):
            return self.counts.get(topic, 0)
        lives = self._lives(stream)
        return sum(len(np.unique(seqs)) for seqs in (lives[-1:] if last_life else lives))

    def _lives(self, stream: Stream) -> list[np.ndarray]:
        """Return a topic's sequence numbers, one array from 0 on per start of its publisher; empty for uncounted messages."""
        return lives_of(self._heads(stream)["seq"]) if stream.times and self._counted(stream) else []

    def check(self) -> list[str]:
        """Return every fault of the bag as sentences: damage, lost messages and logger rows, wrong metadata.

        Checksums are verified when the bag is opened. A sound bag gives an empty list.
        """
        problems = list(self.damage)
        problems += map(str, self._numbers.refused.values())
        problems += self.disorder()
        gaps = self._numbers.gaps(self.recorded_from > 0.0)
        problems += [f"{topic} lost {n} of {n + self.distinct(topic)} messages" for topic, n in gaps.items()]
        for topic, ros_type in self.types.items():
            if ros_type == "rig_msgs/msg/SampleBlock" and self.counts[topic]:
                try:
                    self.logger(topic)
                except BagError as error:
                    problems.append(str(error))
        beside = self.path.parent / "metadata.yaml"
        if beside.exists():
            counts = Counter[str]()
            for name, count in self.counts.items():
                counts[self.topic_of(name)] += count  # metadata.yaml knows no names of channels
            problems += _compare(beside, counts)
        return problems

    def events(self) -> list[tuple[float, str, str, str, float]]:
        """Return all events in order of time as (t [s], topic, name, text, value)."""
        found = []
        for topic, ros_type in self.types.items():
            if ros_type == "rig_msgs/msg/Event" and self.counts[topic]:
                self.require(topic, _EVENT)
                times = self._times(self._stream(topic)).tolist()
                found += [
                    (time / 1e9, topic, message.name, message.text, float(message.value))
                    for time, (_, message) in zip(times, self.messages(topic))
                ]
        return sorted(found, key=lambda event: event[0])

    def run_info(self) -> dict:
        """Return the configuration that the run was made with; empty when the bag holds none."""
        for topic, ros_type in self.types.items():
            if ros_type == "rig_msgs/msg/RunInfo" and self.counts[topic]:
                self.require(topic, {"json": "string"})
                for _, message in self.messages(topic):
                    return self._object(topic, message.json)
        return {}

    def _ordered(self) -> dict:
        """Return what run.json beside the bag says of its run; empty when there is no such file."""
        with suppress(OSError, UnicodeDecodeError):
            return self._object(RUN_FILE, (self.path.parent / RUN_FILE).read_text(encoding="utf-8"))
        return {}

    def _object(self, topic: str, text: str) -> dict:
        """Parse a JSON object from a message; BagError when it is something else, too large or nested too deep."""
        if len(text) > limits.JSON:
            raise BagError(f"{self.path}: {topic} holds {len(text)} characters of JSON, more than the {limits.JSON} that are read")
        try:
            found = json.loads(text)
            deep = limits.deeper(found, limits.JSON_DEPTH)
        except RecursionError:
            found, deep = None, True
        except ValueError as error:
            raise BagError(f"{self.path}: {topic} is not JSON ({error})") from None
        if deep:
            raise BagError(f"{self.path}: {topic} holds JSON nested deeper than the {limits.JSON_DEPTH} levels that are read")
        if not isinstance(found, dict) or any(not isinstance(found.get(key) or {}, dict) for key in ("configuration", "versions")):
            raise BagError(f"{self.path}: {topic} is no description of a run, expected a JSON object with its configuration")
        return found

    def _blocks(self, topic: str) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the heads of all sample blocks and the flat values of each block."""
        stream = self._stream(topic)
        self.require(topic, _BLOCK)
        definition = self._definition(stream)
        if [(name, node.item and node.item.name) for name, node in definition.tail] != [("data", "float64")]:
            raise BagError(f"{self.path}: {topic} holds {stream.ros_type}, which is no block of samples")
        head = np.frombuffer(self._joined(stream, definition.size), definition.dtype())
        length_at = definition.size + -(definition.size - 4) % 4
        at = length_at + 4 + -length_at % 8
        values = []
        for count, data in zip((head["rows"].astype(np.int64) * head["channels"]).tolist(), self._payloads(stream)):
            if count == 0 or len(data) < at + 8 * count or _LENGTH.unpack_from(data, length_at)[0] != count:
                raise BagError(f"{self.path}: a block of {topic} does not hold the {count} values that its head says")
            values.append(np.frombuffer(data, "<f8", count, at))
        return head, values

    def _channel_names(self, topic: str) -> list[str]:
        """Return a logger's columns from the channel list on the same node."""
        node = topic.rpartition("/")[0]
        for other, ros_type in self.types.items():
            if ros_type == "rig_msgs/msg/ChannelList" and self.counts[other] and other.rpartition("/")[0] == node:
                self.require(other, {"names": "sequence"})
                for _, message in self.messages(other):
                    return self._columns.setdefault(topic, list(message.names))
        if topic in self._columns:
            return self._columns[topic]
        raise BagError(f"{self.path}: no channel list under {node} says what the columns of {topic} are")


def _read(file: Path, recover: bool) -> Contents:
    with plain(file) as opened:
        return read_mcap(opened, recover)


def _joined(contents: list[Contents], files: list[Path]) -> Contents:
    """Return what several files hold as one; the places of their messages follow each other."""
    if len(contents) == 1:
        return contents[0]
    streams: list[Stream] = []
    damage: list[str] = []
    for number, (held, file) in enumerate(zip(contents, files)):
        damage += _named(held.damage, file, files)
        for stream in held.streams.values():
            stream.places = [place + (number << _PLACES) for place in stream.places]
            streams.append(stream)
    return Contents(dict(enumerate(streams)), damage, contents[0].library, contents[-1].end)


def _named(damage: list[str], file: Path, files: list[Path]) -> list[str]:
    return damage if len(files) == 1 else [f"{file.name}: {text}" for text in damage]


def _compare(metadata: Path, counts: dict[str, int]) -> list[str]:
    """Return one sentence per difference between metadata.yaml and the file beside it."""
    try:
        stated = read_metadata(metadata.parent).counts
    except RigError as error:
        return [str(error)]
    return [
        f"{metadata}: counts {stated.get(topic, 0)} messages of {topic} where the bag holds {counts.get(topic, 0)}"
        for topic in {**stated, **counts}
        if stated.get(topic, 0) != counts.get(topic, 0)
    ]
