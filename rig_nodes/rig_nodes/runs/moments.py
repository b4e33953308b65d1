# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of a rig from which state messages are made: at the present tick of the graph, or at several for a block of messages.

runs.topics uses the former, runs.bag_outputs the latter. The engine keeps what a step leaves to the next one at each
tick, some kilobytes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ..base import SAMPLE_NS, TICK_SAMPLES
from ..plant import beginning
from .rig import Rig
from .shown_state import ShownState


class _States:
    """The states of a device, read by their names."""

    __slots__ = ("_numbers", "_places")

    def __init__(self, numbers: list[float], places: dict[str, int]) -> None:
        """Keep the list of all numbers of the rig, whose content changes, and the place of each state in it."""
        self._numbers, self._places = numbers, places

    def __getitem__(self, name: str) -> float:
        return self._numbers[self._places[name]]


class Present(ShownState):
    """The state of a rig when it was last read.

    All numbers are read at once and are Python's, because reading and calculating with single numbers of numpy takes some five
    times as long.

    Parameters
    ----------
    rig : Rig
        The rig.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig, self.facts, self.stored_first = rig, rig.facts, rig.stored_first
        self._numbers: list[float] = []
        self._devices: dict[str, _States] = {}
        self._entries_at: dict[tuple[str, int | None], slice | None] = {}
        self.read()

    def read(self) -> None:
        """Read the rig as it is now."""
        rig = self._rig
        self.config, self.status, self.reason, self.stopped_by_person = rig.config, rig.status, rig.reason, rig.stopped_by_person
        self.sample, self.command_age, self.safe = rig.sample, rig.command_age, rig.safe
        self._numbers[:] = self.facts.world.numbers.tolist()
        self._others: dict[tuple[str, int | None], list] = {}  # arrays that are not among the numbers
        self.energies = self.energy()

    def device(self, name: str) -> _States:
        """Return the states of a device by its name [SI]."""
        if name not in self._devices:
            self._devices[name] = _States(self._numbers, self.facts.world.states_at(name))
        return self._devices[name]

    def number(self, place: int) -> float:
        """Return a number of the plant by its place in the world."""
        return self._numbers[place]

    def entries(self, array: str, row: int | None = None) -> list:
        """Return the numbers of an array of the driveline's record, or of one of its rows."""
        which = array, row
        if which not in self._entries_at:
            self._entries_at[which] = self.facts.world.entries_at(array, row)
        if (places := self._entries_at[which]) is not None:
            return self._numbers[places]
        if which not in self._others:
            self._others[which] = self._rig.entries(array, row)
        return self._others[which]

    def each(self, function: Callable[[np.void], float]) -> float:
        """Return the value that a function takes of the driveline's record."""
        return self._rig.each(function)


class Moments(ShownState):
    """The state of a rig at each of some ticks; every reading is an array (ticks,).

    What a person or a sequence can change, like the configuration, is the same at all of them.

    Parameters
    ----------
    rig : Rig
        The rig.
    """

    def __init__(self, rig: Rig) -> None:
        """Read the rig as it is now; the class describes the parameters."""
        self._rig, self.facts, self.stored_first = rig, rig.facts, rig.stored_first
        self._type = beginning(rig.world.record.dtype)
        self.begin()
        self.show(np.zeros(0, np.int64))

    def begin(self) -> None:
        """Read what is the same at all ticks from now on."""
        rig = self._rig
        self.config, self.status, self.reason, self.stopped_by_person = rig.config, rig.status, rig.reason, rig.stopped_by_person
        self._ages: dict[int, float] = {}  # by sample

    def is_over(self) -> bool:
        """Return True when something has changed that is the same at all ticks."""
        rig = self._rig
        return rig.config is not self.config or (rig.status, rig.reason, rig.stopped_by_person) != (
            self.status,
            self.reason,
            self.stopped_by_person,
        )

    def note(self) -> None:
        """Note at a tick what the rig itself does not keep."""
        self._rig.keep_moment()
        if self._rig.shifts and not self._rig.embedded:
            self._ages[self._rig.sample] = self._rig.command_age

    def show(self, samples: np.ndarray) -> None:
        """Show the ticks at samples (ticks,), which follow each other."""
        first = int(samples[0]) // TICK_SAMPLES if len(samples) else 0
        kept, self._capacity = self._rig.moments(first, len(samples))
        self.sample = samples
        self._records = kept.view(self._type)[:, 0]
        self._numbers = kept[:, : self.facts.world.finite].view(np.float64)
        self._devices: dict[str, np.ndarray] = {}
        self.__dict__.pop("energies", None)

    @property
    def command_age(self) -> np.ndarray:
        """Time since the sample that the newest command answers (ticks,) [s]."""
        if self._rig.embedded:  # it answers each sample before the next one
            return np.where(self.sample > 0, SAMPLE_NS * 1e-9, 0.0)
        if not self._rig.shifts:
            return np.zeros(len(self.sample))
        return np.array([self._ages[sample] for sample in self.sample.tolist()])

    @property
    def safe(self) -> np.ndarray:
        """True in the safe state (ticks,)."""
        return self._records["safe"] > 0.0

    @cached_property
    def energies(self) -> dict[str, np.ndarray]:  # type: ignore[override]
        """Energies by their names (ticks,) [J]."""
        return self.energy()

    def device(self, name: str) -> np.ndarray:
        """Return the states of a device by its name (ticks,) [SI]."""
        if name not in self._devices:
            self._devices[name] = self.facts.world.states_in(self._records, name)
        return self._devices[name]

    def number(self, place: int) -> np.ndarray:
        """Return a number of the plant by its place in the world (ticks,)."""
        return self._numbers[:, place]

    def entries(self, array: str, row: int | None = None) -> Any:
        """Return the numbers of an array of the driveline's record, or of one of its rows (numbers, ticks)."""
        if array == "cap":
            return self._capacity.T  # the only row of it that is read
        numbers = self._records["driveline"][array]
        return (numbers if row is None else numbers[:, row]).T

    def each(self, function: Callable[[np.void], float]) -> np.ndarray:
        """Return the value that a function takes of the driveline's record at each tick (ticks,)."""
        return np.array([function(line) for line in self._records["driveline"]])
