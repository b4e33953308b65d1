# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips of a rig in the arrays that the engine evaluates, and what people are told when one fires.

runs.rig_base owns one; plant.engine.watch looks at the arrays after every controller sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base import SAMPLE, RigError
from ..plant import TRIP, Watch, World
from ..rig import GEAR, HYSTERESIS, MEASURED, SHIFTING, Sum, Trip

_SAID = {GEAR: -1, SHIFTING: -2}  # places of what the controller reports


def _is_measured(trip: Trip) -> bool:
    """Return whether a trip's quantity is what a transducer shows."""
    return any(name.startswith(MEASURED) for name, _ in trip.quantity.terms)


class Watched:
    """The trips of a rig that runs.

    Parameters
    ----------
    trips : sequence of Trip
        The trips; none where they are not watched.
    world : World
        What the engine moves.

    Attributes
    ----------
    arrays : Watch
        What the engine reads and changes.

    Raises
    ------
    RigError
        When a trip's quantity is no number of the rig.
    """

    def __init__(self, trips: Sequence[Trip], world: World) -> None:
        self._world, self._channels = world, list(world.plan.channels)
        self.trips = tuple(sorted(trips, key=_is_measured))
        self._sums: list[tuple[list[tuple[int, float]], bool]] = []
        records, conditions = np.zeros(len(self.trips), TRIP), []
        look, places = np.zeros((len(self.trips), 4)), np.zeros((len(self.trips), 2), np.uint64)
        for k, (one, trip) in enumerate(zip(records, self.trips)):
            way = 1.0 if trip.above else -1.0
            one["sum"], one["delay"] = self._sum(trip.quantity, way), round(trip.delay / SAMPLE)
            one["limit"], one["clear"] = way * trip.limit, way * trip.clear
            one["near"] = one["near_clear"] = math.inf
            if trip.warning is not None:
                one["near"], one["near_clear"] = trip.warning, trip.warning * (1.0 - HYSTERESIS)
            one["rises"], one["begin"] = trip.rises, len(conditions)
            conditions += [(self._sum(each.sum, 1.0), 1.0 if each.above else -1.0, each.threshold) for each in trip.enabled]
            one["end"] = len(conditions)
            first, low = int(one["sum"]), min(one["near_clear"], one["clear"])
            if trip.rises:  # it counts from the moment at which its conditions hold, of which the first is a value above another
                first, low = conditions[int(one["begin"])][0], trip.enabled[0].threshold
            places[k], look[k] = self._first_look(first, low)
            one["quiet"] = look[k, -1]
        terms = [term for sum_, _ in self._sums for term in sum_]
        self.arrays = Watch(
            records,
            look,
            places,
            sum(not _is_measured(trip) for trip in self.trips),
            np.cumsum([0, *(len(sum_) for sum_, _ in self._sums)]),
            np.array([place for place, _ in terms], np.int64),
            np.array([weight for _, weight in terms], float),
            np.array([magnitude for _, magnitude in self._sums], np.int64),
            np.array([number for number, _, _ in conditions], np.int64),
            np.array([[sign for _, sign, _ in conditions], [sign * value for _, sign, value in conditions]], float),
            np.zeros(len(_SAID)),
        )

    def _first_look(self, number: int, low: float) -> tuple[list[int], list[float]]:
        """Return places and row of a sum that must be above ``low`` for a trip; where it does not fit, all is always looked at."""
        terms, magnitude = self._sums[number]
        finite, sign = self._world.finite, -1.0 if magnitude else 1.0
        inside = [term for term in terms if term[0] < finite]
        measured = [(place - finite, weight) for place, weight in terms if place >= finite]
        if len(measured) > 1 or len(terms) > 2:
            return [0, 0], [0.0, 0.0, 1.0, -math.inf]
        both = [*inside, (0, 0.0), *measured] if measured else [*inside, (0, 0.0)]
        (first, weight), (second, other) = both[0], both[-1 if measured else 1]
        return [first, second], [weight, other, sign, low]

    def _sum(self, quantity: Sum, way: float) -> int:
        """Add a sum, with its weights times ``way``, and return its number."""
        terms = [(place, way * weight * factor) for name, weight in quantity.terms for place, factor in self._places(name)]
        self._sums.append((terms, quantity.magnitude))
        return len(self._sums) - 1

    def _places(self, name: str) -> list[tuple[int, float]]:
        """Return the places of a number and their weights."""
        world = self._world
        if name in _SAID:
            return [(_SAID[name], 1.0)]
        if name.startswith(MEASURED):
            return [(world.finite + self._channels.index(name.removeprefix(MEASURED)), 1.0)]
        owner, _, what = name.partition(".")
        if what == "slip":
            first = world.entries_at("v")
            if first is None:
                raise RigError(f"the slip of {owner} is no number of the rig")
            row = world.line["w"][world.plan.system.elements.index(owner)]
            return [(first.start + k, float(weight)) for k, weight in enumerate(row) if weight]
        return [(world.number(name), 1.0)]

    def says(self, gear: int, shifting: bool) -> None:
        """Take what a controller outside reports: the number of its gear, and whether it shifts."""
        self.arrays.said[:] = gear, shifting

    def latched(self) -> tuple[Trip, ...]:
        """Return the trips that have fired since the last reset, in their order."""
        return tuple(self.trips[k] for k in np.flatnonzero(self.arrays.trips["latched"]))

    def near(self) -> tuple[Trip, ...]:
        """Return the trips whose warning holds, in their order."""
        return tuple(self.trips[k] for k in np.flatnonzero(self.arrays.trips["warned"]))

    def value(self, trip: Trip) -> float:
        """Return the quantity of a trip [SI] as it was when it fired or warned."""
        value = float(self.arrays.trips["value"][self.trips.index(trip)])
        return value if trip.above else -value

    def warnings(self, when: float) -> list[tuple[str, float]]:
        """Return sentence and value [SI] of each warning that is new at a time [s]."""
        trips = self.arrays.trips
        new = [self.trips[k] for k in np.flatnonzero(trips["warned"] > trips["told"])]
        trips["told"] = trips["warned"]
        return [(trip.warns(self.value(trip), when), self.value(trip)) for trip in new]

    def reset(self) -> None:
        """Watch anew from now on."""
        for name in ("count", "near_count", "counts", "latched", "warned", "told"):
            self.arrays.trips[name] = 0
        self.arrays.first_look[:, -1] = self.arrays.trips["quiet"]
