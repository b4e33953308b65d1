# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run of any length as a report needs it: gathered from the pieces of its bag, which is never in memory as a whole.

Every verb that makes a report uses it. The logger's rows are 0.7 MB for each second of run; they are held around one order at a
time, which is all that the metrics of a shift look at.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from math import ceil, floor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bags import STATE, Bag, Logger, Numbers, OpenedBags, Recording, limits, nothing_in, recovered
from ..base import BagError, RigError
from ..rig import Transmission, ranges_of
from . import energy, no_change, state_at_order
from .annex_a import AROUND as ANNEX
from .annex_a import BLOCK as ANNEX_BLOCK
from .annex_a import shift_metrics_annex_a
from .clipped import Clipping
from .clutch_torques import SHAFTS, SPEEDS
from .clutch_torques import STATE as CLUTCH
from .definitions import BEFORE, LONGEST
from .peak import FIELDS as PEAK
from .press_bench import pressed_clutch
from .ranges import LOGGER, Ranges
from .shift import is_shift, shift_metrics, shifts, with_ends

if TYPE_CHECKING:
    from ..rig import Catalogue, Structure

SPARE = 0.05  # s of rows more on both sides of a shift than its metrics use
WHOLE = 300.0  # s; longest run whose results are looked for in all of its rows at once, 0.7 MB each
STRETCH = 30_000_000_000  # ns of a topic that are read again at a time
SMALL = ("rig_msgs/msg/Event", "rig_msgs/msg/RunInfo", "rig_msgs/msg/ChannelList")  # types that are read of the whole run

Order = tuple[float, int, int]


class Thinned:
    """Every n-th row of all channels of a logger, so many that a long run takes no more memory than a short one."""

    def __init__(self, length: float, most: int) -> None:
        """Prepare for a run of some length [s] and a greatest number of rows."""
        self._length, self._most = length, most
        self._every, self._t0, self._period = 1, 0.0, 0.0
        self._parts: list[tuple[int, dict[str, np.ndarray]]] = []  # number of the first row, of those that are kept

    def add(self, first: int, logger: Logger) -> None:
        """Take rows that begin with the row ``first`` of the run."""
        if not self._parts:
            self._t0, self._period = logger.t0, logger.period
            self._every = max(1, ceil(self._length / logger.period / self._most))
        skip = -first % self._every
        begin = (first + skip) // self._every
        if begin * len(logger.channels) > limits.FILLED:  # the time of the run is not what the heads of its blocks say
            raise BagError(f"{LOGGER}: a block begins with row {first}, far behind the end of the run")
        self._parts.append((begin, {name: values[skip :: self._every].copy() for name, values in logger.channels.items()}))

    def recording(self, orders: Sequence[Order], box: Transmission) -> Recording:
        """Return the rows as a recording with orders; NaN where rows are missing."""
        channels = {}
        for name in list(self._parts[-1][1]) if self._parts else ():
            last, newest = self._parts[-1]
            channels[name] = np.full(last + len(newest[name]), np.nan)
            for first, part in self._parts:
                values = part.pop(name)  # so that no channel is in memory twice
                channels[name][first : first + len(values)] = values
        self._parts.clear()
        return Recording(self._t0, self._period * self._every, channels, list(orders), box)


class Gathered:
    """What build_report asks of a bag, from its pieces.

    Attributes
    ----------
    source : Path or str
        The run's folder or file, from which it was gathered.
    path : Path
        The .mcap file, of several pieces the first.
    counts, types : dict
        Messages and message type per topic, as in Bag.
    damage : list of str
        One sentence per fault that recovery passed over.
    last : int
        Log time [ns] of the last message.
    began : bool
        True when time has passed in the run, as in Bag.
    ranges : Ranges
        Lowest, mean, highest and last value of each signal of a rig without gears.
    clipping : Clipping
        What it found at an end of its transducer's range.
    """

    def __init__(
        self,
        source: Path | str,
        small: Bag,
        orders: Sequence[Order],
        box: Transmission | None,
        annex_a: float | None = None,
        thinner: Thinned | None = None,
    ) -> None:
        """Prepare for the pieces.

        Parameters
        ----------
        source : Path or str
            The run's folder or file.
        small : Bag
            Events and description of the whole run, with the names of all topics (the types of SMALL).
        orders : sequence of (float, int, int)
            Time [s], gear before and gear ordered of each order of the run.
        box : Transmission or None
            Gears and clutches of the rig; None for a rig without gears.
        annex_a : float, optional
            Factor of Annex A's torque band, for its results too.
        thinner : Thinned, optional
            Keeps every n-th row, in place of what only a whole report needs.
        """
        self.source, self._small, self._orders, self._factor = source, small, list(orders), annex_a
        self._box = box
        self.path, self.types, self.damage = small.path, small.types, small.damage
        self.counts: Counter[str] = Counter(dict.fromkeys(small.types, 0))
        self.last, self.began = 0, False
        self._thinner = thinner
        self.ranges = Ranges(small) if box is None else None
        # a run without a change between gears, or of a bench of a clutch, is measured as a whole
        self._whole = not any(box.changes(before, after) for _, before, after in orders) if box else pressed_clutch(small.structure)
        self._due = with_ends(orders)  # shifts whose rows have not all come
        self._rows: list[dict] = []
        self._annex_a: list[dict] = []
        self._no_annex_a: RigError | None = None
        self._parts: list[tuple[int, dict[str, np.ndarray]]] = []  # number of the first row, and channels
        self._last: Logger | None = None  # the newest rows
        self._t0, self._end = 0.0, 0  # time of row 0 [s], number of rows
        self._refused: RigError | None = None  # why rows cannot be used
        self._too_long: RigError | None = None  # why they are not held
        self._numbers = Numbers()
        self._false_blocks: dict[str, str] = {}
        self._state: Any = None  # the rig's newest message of its state
        self.end, self.library = small.end, small.library
        self.clipping = Clipping(box.ranges if box is not None else ranges_of(small.structure, small.record))
        wanted: dict[str, list[str]] = {}
        if box is not None and thinner is None:
            wanted |= {topic: list(names.values()) for topic, names in energy.all_fields(small.structure, box).items()}
            wanted |= no_change.FIELDS if self._whole else {}
            for topic, names in state_at_order.fields(small.structure).items():
                wanted[topic] = list(dict.fromkeys([*wanted.get(topic, ()), *names]))
        self._fields: dict[str, dict[str, list[np.ndarray]]] = {
            topic: {name: [] for name in ("", *names)} for topic, names in wanted.items()
        }  # times under the name ""
        states = {clutch.state: CLUTCH for clutch in box.clutches} | {SHAFTS: (*SPEEDS, *PEAK)} if box is not None else {}
        for topic, names in states.items():
            own = self._fields.setdefault(topic, {"": []})
            own |= {name: [] for name in names if name not in own}
        self._no_fields: dict[str, RigError] = {}

    def add(self, piece: Bag) -> None:
        """Take what the report needs of the next piece."""
        self.counts.update(piece.counts)
        self.damage, self.last = piece.damage, max(self.last, piece.last)
        self.began, self.end = self.began or piece.began, piece.end or self.end
        self._false_blocks = piece.false_blocks() | self._false_blocks
        if piece.counts.get(STATE):
            with suppress(RigError):
                self._state = piece.newest(STATE)
        self._numbers.add(piece)
        for topic, columns in self._fields.items():
            if piece.counts.get(topic) and topic not in self._no_fields:
                try:
                    times, values = piece.fields(topic, [name for name in columns if name])
                except RigError as error:
                    self._no_fields[topic] = error
                    continue
                for column, new in zip(columns.values(), (times, *values)):
                    column.append(new)
        logger = None
        if piece.counts.get(LOGGER) and self._refused is None:
            try:
                logger = piece.logger(LOGGER, fill=True, after=self._last)
                if self._whole or self._box is not None:
                    self._add_rows(logger)
                self._last = logger
            except RigError as error:
                self._refused = error
        if self.ranges is not None:
            self.ranges.add(piece, logger)

    def _add_rows(self, logger: Logger) -> None:
        if self._last is None:
            self._t0 = logger.t0
        first = round((logger.t0 - self._t0) / logger.period)
        self.clipping.add(logger.channels, logger.period)
        if self._thinner is not None:
            self._thinner.add(first, logger)
        # copies, because the channels of a logger are views of all its columns
        names = logger.channels if self._box is None else [name for name in self._box.channels if name in logger.channels]
        self._parts.append((first, {name: logger.channels[name].copy() for name in names}))
        self._last, self._end = logger, first + logger.rows
        if self._whole:
            if (self._end - 1) * logger.period > WHOLE:
                self._parts.clear()
                self._too_long = RigError(
                    f"a run of more than {WHOLE:g} s in which no gear is changed is not measured as a whole; cut a part out of it "
                    "with ./rig bag cut"
                )
            return
        while self._due and self._window(self._due[0])[1] <= self._end:
            self._close()
        self._forget()

    def _window(self, due: tuple[Order, float | None]) -> tuple[int, int]:
        """Return the first row and the one after the last row that the metrics of a shift may look at."""
        period = self._last.period if self._last else 1.0
        (t, _, _), end = due
        since, before, behind = t - self._t0, BEFORE, LONGEST
        if self._factor is not None:  # the recipe searches up to the next order
            before, behind = ANNEX[0], ANNEX[1] if end is None else min(ANNEX[1], max(LONGEST, end - t))
        first = floor((since - before - SPARE) / period)
        return first // ANNEX_BLOCK * ANNEX_BLOCK, ceil((since + behind + SPARE) / period)

    def _close(self) -> None:
        """Compute the metrics of the next shift."""
        order, end = self._due[0]
        recording = self._recording(*self._window(self._due.pop(0)))
        if is_shift(recording, order):
            self._rows.append(shift_metrics(recording, order, end))
            if self._factor is not None and self._no_annex_a is None:
                try:
                    self._annex_a.append(shift_metrics_annex_a(recording, order, end, a=self._factor, b=self._factor))
                except RigError as error:
                    self._no_annex_a = error

    def _forget(self) -> None:
        """Drop the rows that no later shift needs, but for the newest, which show what channels there are."""
        begin = self._window(self._due[0])[0] if self._due else self._end
        *older, newest = self._parts
        self._parts = [part for part in older if part[0] + len(next(iter(part[1].values()))) > begin] + [newest]

    def _recording(self, first: int, last: int) -> Recording:
        """Return the rows of a window, as far as the run has them; NaN where rows are missing."""
        first = min(max(first, 0), self._end)
        last = min(max(last, first), self._end)
        period = self._last.period if self._last else 1.0
        return Recording(self._t0, period, self._channels(first, last), self._orders, self._box, first)

    def _channels(self, first: int, last: int) -> dict[str, np.ndarray]:
        channels = {name: np.full(last - first, np.nan) for name in (self._parts[-1][1] if self._parts else self._box.channels)}
        for number, part in self._parts:
            for name, values in part.items():
                start, stop = max(number, first), min(number + len(values), last)
                if start < stop:
                    channels[name][start - first : stop - first] = values[start - number : stop - number]
        return channels

    def _check_rows(self) -> float:
        """Return the period of the rows [s]; raise the error why there are none."""
        if refused := self._refused or self._too_long:
            raise refused
        return (self._last or self._small.logger(LOGGER)).period  # a bag without rows raises, with the reason

    def shifts(self) -> tuple[Recording, list[dict]]:
        """Return the recording and the metrics of all shifts, once, after the last piece.

        The recording has all rows of a run without a change between gears, else no rows.

        Raises
        ------
        RigError
            When the bag has no rows of the logger, or not the channels that the metrics need.
        """
        self._check_rows()
        if self._whole:
            recording = self._recording(0, self._end)
            self._parts.clear()
            return recording, shifts(recording)
        while self._due:
            self._close()
        return self._recording(self._end, self._end), self._rows

    def thinned(self) -> Recording:
        """Return every n-th row of the run, once, after the last piece.

        Raises
        ------
        RigError
            When the bag has no rows of the logger, or none that can be used.
        """
        if self._refused or not self._end:
            self._check_rows()
        return self._thinner.recording(self._orders, self._box)

    def by_annex_a(self) -> list[dict] | None:
        """Return the results by Annex A of each shift, after :meth:`shifts`; None where its recording has all rows.

        Raises
        ------
        RigError
            When the recipe cannot be used on the recording.
        """
        if self._no_annex_a:
            raise self._no_annex_a
        return None if self._whole else self._annex_a

    def logger(self, fill: bool) -> Logger:
        """Return all rows of the logger of a bench of a clutch; ``fill`` as for Bag.logger, and always True."""
        return Logger(self._t0, self._check_rows(), self._channels(0, self._end))

    def fields(self, topic: str, names: list[str]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return what Bag.fields does, of the whole run."""
        if topic in self._no_fields:
            raise self._no_fields[topic]
        times, empty = self._small.fields(topic, names)
        columns = self._fields.get(topic, {})
        if not columns.keys() >= set(names):
            columns = {name: [] for name in ("", *names)}
            for part in self._again(topic):
                for column, new in zip(columns.values(), (lambda t, values: (t, *values))(*part.fields(topic, names))):
                    column.append(new)
        return np.concatenate([*columns[""], times]), [
            np.concatenate(columns[name]) if columns[name] else none for name, none in zip(names, empty)
        ]

    def messages(self, topic: str) -> Iterator[tuple[int, object]]:
        """Yield what Bag.messages does, of the whole run; BagError when the bag does not hold the topic."""
        yield from self._small.messages(topic)
        if not self._small.counts[topic]:
            for part in self._again(topic):
                yield from part.messages(topic)

    def rows(self) -> Iterator[Logger]:
        """Yield the rows of the logger, stretch by stretch; RigError where rows are missing."""
        newest = None
        for part in self._again(LOGGER):
            newest = part.logger(LOGGER, after=newest)
            yield newest

    def _again(self, topic: str) -> Iterator[Bag]:
        """Yield a topic that was not foreseen, stretch by stretch."""
        columns = {LOGGER: self._small.columns(LOGGER)} if topic == LOGGER else None
        with OpenedBags([self.source]) as opened:
            for begin in range(opened.first, opened.last + 1, STRETCH):
                part = opened.bag([topic], begin, begin + STRETCH, columns)
                if part.counts[topic]:
                    yield part

    def check_began(self) -> None:
        """Raise BagError when nothing was recorded or nothing of the recording is left."""
        if not self.began:
            raise BagError(f"{self.path}: {nothing_in(self.damage, self.library)}")

    @property
    def recovered(self) -> str:
        """One sentence on what recovery saved; empty for a sound bag."""
        return recovered(sum(self.counts.values()), self.recorded_to, self.damage) if self.damage else ""

    def newest(self, topic: str) -> Any:
        """Return the rig's newest state, as Bag.newest does; of other topics none is kept."""
        return self._state if topic == STATE else None

    def disorder(self) -> list[str]:
        """Return what Bag.disorder does."""
        return self._numbers.disorder(self._small)

    def false_blocks(self) -> dict[str, str]:
        """Return what Bag.false_blocks does."""
        return self._false_blocks

    def gaps(self) -> dict[str, int]:
        """Return the number of lost messages by topic, as Bag.gaps does."""
        self._numbers.check()
        return self._numbers.gaps(self.recorded_from > 0.0)

    def gap_of_last_life(self, topic: str) -> int:
        """Return what Bag.gap_of_last_life does."""
        return self._numbers.gap_of_last_life(topic)

    def distinct(self, topic: str, last_life: bool = False) -> int:
        """Return what Bag.distinct does."""
        found = self._numbers.distinct(topic, last_life)
        return self.counts.get(topic, 0) if found is None else found

    @property
    def recorded_from(self) -> float:
        """Time of the run [s] at which the recording begins, as in Bag."""
        return self._small.begin_by(self._numbers)

    @property
    def recorded_to(self) -> int:
        """Time of the run [ns] at which the recording ends, as in Bag."""
        return self._small.end_by(self._numbers, self.last)

    @property
    def record(self) -> Mapping:
        """The rig's structure and values."""
        return self._small.record

    @property
    def structure(self) -> Structure:
        """The structure of the rig."""
        return self._small.structure

    @property
    def catalogue(self) -> Catalogue:
        """Topics and signals of the bag's rig."""
        return self._small.catalogue

    @property
    def transmission(self) -> Transmission:
        """Gears and clutches of the rig."""
        return self._small.transmission if self._box is None else self._box

    def run_info(self) -> dict:
        """Return the configuration that the run was made with."""
        return self._small.run_info()

    def events(self) -> list[tuple[float, str, str, str, float]]:
        """Return all events in order of time, as Bag.events does."""
        return self._small.events()
