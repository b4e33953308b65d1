# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signals of a bag by their clocks, read piece by piece, so that a long bag need not be in memory.

bags.exchange.files writes them. Signals of one topic share their times and form a group; so do the columns of a logger.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import BagError, RigError, unknown
from ...rig import Signal
from ..opened import OpenedBags
from ..reader import Bag, Logger

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...base import Floats

BLOCK, SETPOINT = "rig_msgs/msg/SampleBlock", "rig_msgs/msg/Setpoint"
DESCRIBING = ("rig_msgs/msg/RunInfo", "rig_msgs/msg/Event", "rig_msgs/msg/ChannelList")
IN_MEMORY = 16 << 20  # bytes of messages in memory at once
LATE = 1_000_000_000  # ns by which a message's place in the file may be later than its time
SHOWN, SI = "shown", "si"
# unit in the messages -> its spelling in base.units and in other tools
SPELLED = {"N.m": "Nm"}


@dataclass(frozen=True)
class Column:
    """A signal as a column: its name, unit and meaning, its field in the messages, and the factor from SI to the unit."""

    name: str
    unit: str
    text: str
    signal: Signal | None = None
    factor: float = 1.0


@dataclass(frozen=True)
class Group:
    """Columns that share their times; ``topic`` is the topic of their messages, and ``logger`` is True for blocks of rows."""

    topic: str
    logger: bool
    columns: tuple[Column, ...]


@dataclass(frozen=True)
class Part:
    """Some rows of a group: times [ns] (n,), values (n, columns)."""

    group: int
    times: np.ndarray
    values: Floats


class Signals:
    """The chosen signals of a run.

    Attributes
    ----------
    groups : list of Group
        The groups, loggers first, each in the order of the catalogue.
    small : Bag
        Events and description of the whole run.
    left_out : list of str
        Topics of the bag that are not the rig's and give no signals.
    cut_off : str
        A sentence when the run was cut off, else empty.
    length : int
        Time from the first message to the last one [ns]; log times may be dates.
    """

    def __init__(self, run: str | Path, chosen: Sequence[str] = (), units: str = SI) -> None:
        """Choose signals.

        Parameters
        ----------
        run : str or Path
            Folder of a run, or its .mcap file.
        chosen : sequence of str
            Names or patterns such as ``p*``; all signals by default.
        units : str
            SI, or SHOWN for the units that people read (rpm, MPa, mA).

        Raises
        ------
        RigError
            When the run cannot be read, has no signal, or none of a name.
        """
        with OpenedBags([run]) as index:
            index.check_began()
            self._run, self.path, self._counts = run, index.files[0], index.counts
            self.small = index.bag([topic for topic, ros_type in index.types.items() if ros_type in DESCRIBING])
            self._first, self.length = index.first, index.last - index.first
            self.left_out = index.not_of(self.small.catalogue.all_topics)
            _, self.cut_off = index.end()
        self.groups = _chosen(self._all(units), chosen, self.path)
        if not self.groups:
            raise BagError(f"{self.path}: holds no signal of a rig; expected a bag of `rig run` or `rig simulate`")

    def rows(self) -> int:
        """Return the approximate number of values in the groups."""
        rows = {one.topic: self.length / 1e9 / max(1e-6, self._list_of(one.topic).period) for one in self.groups if one.logger}
        return round(sum(rows.get(one.topic, self._counts[one.topic]) * len(one.columns) for one in self.groups))

    def parts(self, progress: Callable[[float, str], None] | None = None) -> Iterator[list[Part]]:
        """Yield all rows in the order of the file, piece by piece.

        Parameters
        ----------
        progress : callable, optional
            Callable that receives the time from its begin [s] up to which the bag has been read, and a text.

        Yields
        ------
        list of Part
            The rows of one piece of the bag.

        Raises
        ------
        BagError
            When the bag is damaged.
        """
        last: dict[str, Logger] = {}
        for piece in Bag.pieces(self._run, IN_MEMORY):
            found: list[Part] = []
            for number, group in enumerate(self.groups):
                if not piece.counts.get(group.topic):
                    continue
                factors = np.array([column.factor for column in group.columns])
                if group.logger:
                    rows = last[group.topic] = piece.logger(group.topic, fill=True, after=last.get(group.topic))
                    times, columns = rows.time(), [rows.channels[column.name] for column in group.columns]
                else:
                    series = [piece.series(column.signal) for column in group.columns if column.signal is not None]
                    times, columns = series[0][0], [values for _, values in series]
                found.append(Part(number, np.rint(times * 1e9).astype(np.int64), np.column_stack(columns) * factors))
            yield found
            if progress:
                done = (piece.last - self._first) / 1e9
                progress(done, f"read up to {done:.0f} of {self.length / 1e9:.0f} s")

    def _all(self, units: str) -> list[Group]:
        small, known = self.small, self.small.catalogue.signals
        blocks = [topic for topic, ros_type in small.types.items() if ros_type == BLOCK and self._counts.get(topic)]
        groups, taken = [], set()
        for topic in blocks:
            names = small.columns(topic)
            if not names:
                continue
            stated = dict(zip(names, self._list_of(topic).units))
            groups.append(Group(topic, True, tuple(_column(name, known.get(name), stated[name], units) for name in names)))
            taken |= set(names)
        by_topic: dict[str, list[Column]] = {}
        for name, signal in known.items():
            if name not in taken and self._counts.get(signal.topic) and small.has_field(signal):
                by_topic.setdefault(signal.topic, []).append(_column(name, signal, signal.unit, units))
        for topic, like in small.catalogue.setpoints().items():
            if self._counts.get(topic.name):
                by_topic.setdefault(topic.name, []).append(_command(topic.name, like, units))
        return groups + [Group(topic, False, tuple(columns)) for topic, columns in by_topic.items()]

    def _list_of(self, topic: str) -> Any:
        """Return the message with names, units and period of a topic's blocks."""
        node = topic.rpartition("/")[0]
        lists = [name for name, ros_type in self.small.types.items() if ros_type == DESCRIBING[2]]
        (channels_topic,) = [name for name in lists if name.rpartition("/")[0] == node][:1]
        return next(message for _, message in self.small.messages(channels_topic))


def _column(name: str, signal: Signal | None, unit: str, units: str) -> Column:
    if signal is None:
        return Column(name, SPELLED.get(unit, unit), "")
    if units == SHOWN:
        return Column(name, signal.display_unit, signal.text, signal, signal.scale)
    return Column(name, SPELLED.get(signal.unit, signal.unit), signal.text, signal)


def _command(topic: str, like: Signal, units: str) -> Column:
    """Return the column of the values that a setpoint's topic carries, named after the topic."""
    name = topic.strip("/").replace("/", ".")
    field = Signal(**{**vars(like), "name": name, "topic": topic, "field": "value", "text": f"Setpoint like {like.name}."})
    return _column(name, field, like.unit, units)


def _chosen(groups: list[Group], patterns: Sequence[str], path: Path) -> list[Group]:
    if not patterns:
        return groups
    names = [column.name for group in groups for column in group.columns]
    wanted: set[str] = set()
    for pattern in patterns:
        found = fnmatch.filter(names, pattern) if any(c in pattern for c in "*?[") else [n for n in names if n == pattern]
        if not found:
            raise RigError(f"signals {pattern}: {path} has {unknown('signal', pattern, names).removeprefix('there is ')}")
        wanted.update(found)
    kept = [Group(g.topic, g.logger, tuple(c for c in g.columns if c.name in wanted)) for g in groups]
    return [group for group in kept if group.columns]


@dataclass(frozen=True)
class Rows:
    """Rows of the one table of all groups: times [ns] (n,), values (n, columns), NaN where a signal has none."""

    times: np.ndarray
    values: Floats


def on_own_clocks(groups: Sequence[Group], parts: Iterator[list[Part]]) -> Iterator[Rows]:
    """Yield a row for each time at which any signal has a value; the others are NaN there.

    Parameters
    ----------
    groups : sequence of Group
        The groups.
    parts : iterator of list of Part
        Their rows, not more than LATE out of order.

    Yields
    ------
    Rows
        Rows in order of time.
    """
    for waiting in _ordered(groups, parts):
        times = np.unique(np.concatenate([t for t, _ in waiting]))
        if len(times):
            values = np.full((len(times), sum(len(group.columns) for group in groups)), np.nan)
            at = 0
            for group, (t, rows) in zip(groups, waiting):
                values[np.searchsorted(times, t), at : at + len(group.columns)] = rows
                at += len(group.columns)
            yield Rows(times, values)


def on_one_clock(groups: Sequence[Group], parts: Iterator[list[Part]], period: int) -> Iterator[Rows]:
    """Yield a row at each multiple of a period, with the last value of each signal at this time.

    Parameters
    ----------
    groups : sequence of Group
        The groups.
    parts : iterator of list of Part
        Their rows, not more than LATE out of order.
    period : int
        Time between rows [ns].

    Yields
    ------
    Rows
        Rows in order of time; NaN before the first value of a signal.
    """
    held = [np.full(len(group.columns), np.nan) for group in groups]
    due = None
    for waiting in _ordered(groups, parts):
        ends = [int(t[-1]) for t, _ in waiting if len(t)]
        if not ends:
            continue
        if due is None:
            due = -(-min(int(t[0]) for t, _ in waiting if len(t)) // period) * period
        times = np.arange(due, max(ends) + 1, period, dtype=np.int64)
        columns = []
        for number, (t, rows) in enumerate(waiting):
            every = np.vstack([held[number], rows])
            columns.append(every[np.searchsorted(t, times, "right")])
            held[number] = every[-1]
        if len(times):
            due = int(times[-1]) + period
            yield Rows(times, np.hstack(columns))


def _ordered(groups: Sequence[Group], parts: Iterator[list[Part]]) -> Iterator[list[tuple[np.ndarray, Floats]]]:
    """Yield times and rows of each group in order of time, such that no later part has an earlier time."""
    waiting: list[list[Part]] = [[] for _ in groups]
    newest, complete = 0, 0
    for piece in parts:
        for part in piece:
            waiting[part.group].append(part)
            newest = max(newest, int(part.times[-1]))
        if newest - complete > 4 * LATE:
            complete = newest - LATE
            yield [_before(waiting, number, len(group.columns), complete) for number, group in enumerate(groups)]
    yield [_before(waiting, number, len(group.columns), None) for number, group in enumerate(groups)]


def _before(waiting: list[list[Part]], number: int, columns: int, end: int | None) -> tuple[np.ndarray, Floats]:
    """Take the rows before a time from the waiting ones, in order of time; of rows with the same time the later one counts."""
    parts = waiting[number]
    if not parts:
        return np.empty(0, np.int64), np.empty((0, columns))
    times, values = np.concatenate([part.times for part in parts]), np.concatenate([part.values for part in parts])
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
    if end is None:
        at, waiting[number] = len(times), []
    else:
        at = int(np.searchsorted(times, end))
        waiting[number] = [Part(number, times[at:], values[at:])] if at < len(times) else []
    return times[:at], values[:at]
