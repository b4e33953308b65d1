# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A logger's channels of one run of any rig, and the gear orders of a run: what all analyses read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..base import RigError
from ..rig import CONTROLLER_EVENTS, GEAR_WAS, NEUTRAL, SHIFT_ORDERED, Transmission


@dataclass(frozen=True)
class Logged:
    """A logger's channels of one run.

    Attributes
    ----------
    t0 : float
        Time of row 0 [s].
    period : float
        Time between rows [s].
    channels : dict of str to (n,) array of float
        Values by name [SI], all of the same length.

    Raises
    ------
    RigError
        When a channel of ``needed`` is missing or the shapes do not fit.
    """

    t0: float
    period: float
    channels: dict[str, np.ndarray]

    use = "the results"  # what they are needed for, as the error names it

    def __post_init__(self) -> None:
        missing = [name for name in self.needed if name not in self.channels]
        if missing:
            raise RigError(f"the recording has no channel {', '.join(missing)}; {self.use} need {', '.join(self.needed)}")
        if not self.period > 0.0:
            raise RigError(f"the recording's period is {self.period} s; it must be above 0")
        lengths = {name: np.shape(self.channels[name]) for name in self.needed or self.channels}
        if len(set(lengths.values())) != 1 or len(next(iter(lengths.values()))) != 1:
            raise RigError(f"the recording's channels have the shapes {lengths}; all must be 1-D of one length")

    @property
    def needed(self) -> tuple[str, ...]:
        """The channels that must be present."""
        return ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.channels[next(iter(self.needed or self.channels))])


@dataclass(frozen=True)
class Recording(Logged):
    """A logger's channels of one run of a transmission, with the gear orders of the run.

    Channels are as in Logged (rad/s, Nm, Pa gauge, A).

    Attributes
    ----------
    orders : list of (float, int, int)
        Time [s], gear before, gear ordered; 0 is neutral. The time is when the controller accepted the order, whichever valve
        is switched first.
    transmission : Transmission
        The transmission that was shifted.
    begin : int
        Number of the first row in ``channels``; the rows before it, from ``t0`` on, are not held.

    Raises
    ------
    RigError
        When a channel of the shift metrics is missing or the shapes do not fit.
    """

    orders: list[tuple[float, int, int]]
    transmission: Transmission
    begin: int = 0

    use = "shift metrics"

    @property
    def needed(self) -> tuple[str, ...]:
        """The channels without which there are no shift metrics."""
        return self.transmission.channels

    @property
    def rows(self) -> int:
        """Number of rows from ``t0`` to the last one held."""
        return self.begin + super().rows

    def part(self, name: str, first: int, last: int) -> np.ndarray:
        """Return a channel from row ``first`` to before row ``last``, as far as these rows are held."""
        return np.asarray(self.channels[name][max(0, first - self.begin) : max(0, last - self.begin)], dtype=float)


def orders_in(events: Iterable[tuple[float, str, str, str, float]]) -> list[tuple[float, int, int]]:
    """Return the orders among the events of a bag as (time [s], gear before, gear ordered).

    The first gear before is neutral, unless an imported run states which one was engaged.
    """
    orders, before = [], NEUTRAL
    for t, topic, name, _, value in events:
        if topic == CONTROLLER_EVENTS and name == GEAR_WAS:
            before = int(value)
        elif topic == CONTROLLER_EVENTS and name == SHIFT_ORDERED:
            orders.append((t, before, int(value)))
            before = int(value)
    return orders
