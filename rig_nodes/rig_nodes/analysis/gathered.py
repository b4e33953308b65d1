# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sources of a report, gathered from the pieces of a bag, so that a long bag need not be in memory as a whole.

`rig view` uses it for a run without a report. The logger's rows are 0.7 MB for each second of run; they are held around one
order at a time, which is all that the metrics of a shift look at.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np

from ..bags.reader import Bag, Logger
from ..bags.sequence_numbers import Numbers
from ..errors import RigError
from ..transmission import Transmission
from . import energy, no_change
from .metrics import BEFORE, LONGEST, Recording, is_shift, shift_metrics, shifts, with_ends

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..description.structure import Structure

SPARE = 0.05  # s of rows more on both sides of a shift than its metrics use
LOGGER = "/instruments/hmg4000"

Order = tuple[float, int, int]


class Gathered:
    """What build_report asks of a bag, from its pieces.

    Attributes
    ----------
    began : bool
        True, as for every bag that has a piece.
    """

    began = True

    def __init__(self, small: Bag, orders: Sequence[Order], box: Transmission) -> None:
        """Prepare for the pieces.

        Parameters
        ----------
        small : Bag
            Events and description of the whole run, with the names of all topics.
        orders : sequence of (float, int, int)
            Time [s], gear before and gear ordered of each order of the run.
        box : Transmission
            Gears and clutches of the rig.
        """
        self._small, self._orders, self._box = small, list(orders), box
        # a run without a change between gears is measured as a whole
        self._whole = not any(box.changes(before, after) for _, before, after in orders)
        self._due = with_ends(orders)  # shifts whose rows have not all come
        self._rows: list[dict] = []
        self._parts: list[tuple[int, dict[str, np.ndarray]]] = []  # number of the first row, and channels
        self._last: Logger | None = None  # the newest rows
        self._t0, self._end = 0.0, 0  # time of row 0 [s], number of rows
        self._refused: RigError | None = None
        self._numbers = Numbers()
        wanted = {topic: list(names.values()) for topic, names in energy.all_fields(small.structure, box).items()}
        wanted |= no_change.FIELDS if self._whole else {}
        self._fields: dict[str, dict[str, list[np.ndarray]]] = {
            topic: {name: [] for name in ("", *names)} for topic, names in wanted.items()
        }  # times under the name ""
        self._no_fields: dict[str, RigError] = {}

    def add(self, piece: Bag) -> None:
        """Take what the report needs of the next piece."""
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
        if piece.counts.get(LOGGER) and self._refused is None:
            try:
                self._add_rows(piece.logger(LOGGER, fill=True, after=self._last))
            except RigError as error:
                self._refused = error

    def _add_rows(self, logger: Logger) -> None:
        if self._last is None:
            self._t0 = logger.t0
        first = round((logger.t0 - self._t0) / logger.period)
        # copies, because the channels of a logger are views of all its columns
        self._parts.append((first, {name: logger.channels[name].copy() for name in self._box.channels if name in logger.channels}))
        self._last, self._end = logger, first + logger.rows
        while not self._whole and self._due and self._window(self._due[0][0])[1] <= self._end:
            self._close()

    def _window(self, order: Order) -> tuple[int, int]:
        """Return the first row and the one after the last row that the metrics of a shift may look at."""
        period = self._last.period if self._last else 1.0
        since = order[0] - self._t0
        return floor((since - BEFORE - SPARE) / period), ceil((since + LONGEST + SPARE) / period)

    def _close(self) -> None:
        """Compute the metrics of the next shift, and forget the rows that no later one needs."""
        order, end = self._due.pop(0)
        recording = self._recording(*self._window(order))
        if is_shift(recording, order):
            self._rows.append(shift_metrics(recording, order, end))
        begin = self._window(self._due[0][0])[0] if self._due else self._end
        self._parts = [part for part in self._parts if part[0] + len(next(iter(part[1].values()))) > begin]

    def _recording(self, first: int, last: int) -> Recording:
        """Return the rows of a window, as far as the run has them; NaN where rows are missing."""
        first = min(max(first, 0), self._end)
        last = min(max(last, first), self._end)
        channels = {name: np.full(last - first, np.nan) for name in (self._parts[-1][1] if self._parts else self._box.channels)}
        for number, part in self._parts:
            for name, values in part.items():
                start, stop = max(number, first), min(number + len(values), last)
                if start < stop:
                    channels[name][start - first : stop - first] = values[start - number : stop - number]
        period = self._last.period if self._last else 1.0
        return Recording(self._t0, period, channels, self._orders, self._box, first)

    def shifts(self) -> tuple[Recording, list[dict]]:
        """Return the recording and the metrics of all shifts, once, after the last piece.

        The recording has all rows of a run without a change between gears, else no rows.

        Raises
        ------
        RigError
            When the bag has no rows of the logger, or not the channels that the metrics need.
        """
        if self._refused:
            raise self._refused
        if self._last is None:
            self._small.logger(LOGGER)  # raises, with the reason
        if self._whole:
            recording = self._recording(0, self._end)
            self._parts.clear()
            return recording, shifts(recording)
        while self._due:
            self._close()
        return self._recording(self._end, self._end), self._rows

    def fields(self, topic: str, names: list[str]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return what Bag.fields does, of the whole run."""
        if topic in self._no_fields:
            raise self._no_fields[topic]
        times, empty = self._small.fields(topic, names)
        columns = self._fields[topic]
        return np.concatenate([*columns[""], times]), [
            np.concatenate(columns[name]) if columns[name] else none for name, none in zip(names, empty)
        ]

    def gaps(self) -> dict[str, int]:
        """Return the number of lost messages by topic, as Bag.gaps does."""
        return self._numbers.gaps(self.recorded_from > 0.0)

    @property
    def recorded_from(self) -> float:
        """Time of the run [s] at which the recording begins, as in Bag."""
        return self._small.begin_by(self._numbers)

    @property
    def types(self) -> dict[str, str]:
        """Message type per topic."""
        return self._small.types

    @property
    def record(self) -> Mapping:
        """The rig's structure and values."""
        return self._small.record

    @property
    def structure(self) -> Structure:
        """The structure of the rig."""
        return self._small.structure

    @property
    def transmission(self) -> Transmission:
        """Gears and clutches of the rig."""
        return self._box

    def run_info(self) -> dict:
        """Return the configuration that the run was made with."""
        return self._small.run_info()
