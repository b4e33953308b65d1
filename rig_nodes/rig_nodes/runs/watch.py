# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips of a rig in the arrays that the engine evaluates, and what people are told when one fires.

runs.rig_base owns one; plant.engine.watch looks at the arrays after every controller sample.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..base import SAMPLE, Floats, RigError
from ..plant import ALL, BOTH_INSIDE, BOTH_SHOWN, FIRST_STAY, INSIDE, ONE_SHOWN, OTHER, REPORTED, RESTING, SHOWN, TRIP, Watch, World
from ..rig import GEAR, MEASURED, SHIFTING, STAYED, Sum, Trip

_SAID = {GEAR: -1, SHIFTING: -2}  # places of what the controller reports
_Terms = tuple[tuple[int, float], ...]


class Watched:
    """The trips of a rig that runs.

    Parameters
    ----------
    trips : sequence of Trip
        The trips; none where they are not watched.
    world : World
        What the engine moves.
    noise : (channels,) array of float
        Standard deviation of each channel's noise by which the trips were made [SI].

    Attributes
    ----------
    arrays : Watch
        What the engine reads and changes.

    Raises
    ------
    RigError
        When a trip's quantity is no number of the rig.
    """

    def __init__(self, trips: Sequence[Trip], world: World, noise: Floats) -> None:
        self._world, self._channels, self.trips = world, list(world.plan.channels), tuple(trips)
        used = [self._sum(one) for trip in trips for one in (trip.quantity, *(each.sum for each in trip.enabled))]
        often = Counter(key for key, _ in used)
        sums = sorted(often, key=self._kind)
        numbers, signed = {key: number for number, key in enumerate(sums)}, iter(used)
        records, conditions = np.zeros(len(trips), TRIP), []
        for one, trip in zip(records, trips):
            key, sign = next(signed)
            way = 1.0 if trip.above else -1.0
            one["sum"], one["way"], one["delay"] = numbers[key], sign * way, round(trip.delay / SAMPLE)
            one["limit"], one["clear"] = way * trip.limit, way * trip.clear
            one["near"] = one["near_clear"] = math.inf
            if trip.warning is not None:
                one["near"], one["near_clear"] = trip.warning, trip.warning_over
            one["rises"], one["begin"] = trip.rises, len(conditions)
            # those that many trips have come first: one sum that is looked at then rules out many
            for each, (key, sign) in sorted(zip(trip.enabled, signed), key=lambda pair: -often[pair[1][0]]):
                way = 1.0 if each.above else -1.0
                conditions.append((numbers[key], sign * way, way * each.threshold))
            one["end"] = len(conditions)
        terms = [term for of, _ in sums for term in of]
        kinds, pairs = [self._kind(key) for key in sums], [(*of, (0, 0.0))[:2] for of, _ in sums]
        self.arrays = Watch(
            records,
            np.cumsum([0, *(len(of) for of, _ in sums)]),
            np.array([bisect_right(kinds, kind) for kind in range(REPORTED)], np.int64),
            np.array([place for place, _ in terms], np.int64),
            np.array([weight for _, weight in terms], float),
            np.array([[self._at(pair[k][0]) for pair in pairs] for k in (0, 1)], np.uint64),
            np.array([[pair[k][1] for pair in pairs] for k in (0, 1)], float),
            np.array([magnitude for _, magnitude in sums], np.int64),
            np.array([number for number, _, _ in conditions], np.int64),
            np.array([[way for _, way, _ in conditions], [threshold for _, _, threshold in conditions]], float),
            np.zeros(3 * len(_SAID)),
            np.stack([np.zeros(len(noise)), np.zeros(len(noise)), noise]),
            np.zeros(len(trips), np.int64),
            np.zeros((2, len(trips))),
            np.zeros((2, len(sums))),
            np.zeros(1 + len(trips), np.int64),
            np.zeros(REPORTED, np.int64),
            np.zeros((2, len(sums)), np.uint64),
            np.zeros((2, len(sums))),
            np.zeros((2, len(sums))),
        )
        self.look_anew()

    def _sum(self, quantity: Sum) -> tuple[tuple[_Terms, bool], float]:
        """Return the terms of a sum with whether it is a magnitude, the first weight positive, and the sign by which it is that."""
        terms = [(place, weight * factor) for name, weight in quantity.terms for place, factor in self._places(name)]
        terms.sort(key=lambda term: term[0] >= self._world.finite)  # one number of the world before one that is shown
        sign = -1.0 if terms[0][1] < 0.0 else 1.0
        return (tuple((place, sign * weight) for place, weight in terms), quantity.magnitude), 1.0 if quantity.magnitude else sign

    def _kind(self, key: tuple[_Terms, bool]) -> int:
        """Return of what a sum is made."""
        shown = [place >= self._world.finite for place, _ in key[0]]
        reported = [place < 0 for place, _ in key[0]]
        if all(reported):
            return RESTING if key[0][0][0] <= FIRST_STAY else REPORTED
        if any(reported) or len(shown) > 2:
            return OTHER
        if len(shown) == 1:
            return SHOWN if shown[0] else INSIDE
        return (BOTH_INSIDE, ONE_SHOWN, BOTH_SHOWN)[sum(shown)]

    def _at(self, place: int) -> int:
        """Return the place of a number within the array in which it is."""
        return FIRST_STAY - place if place <= FIRST_STAY else place % self._world.finite

    def _places(self, name: str) -> list[tuple[int, float]]:
        """Return the places of a number and their weights."""
        world = self._world
        if name in _SAID:
            return [(_SAID[name], 1.0)]
        if name.startswith(MEASURED):
            return [(world.finite + self._channels.index(name.removeprefix(MEASURED)), 1.0)]
        if name.startswith(STAYED):
            return [(FIRST_STAY - self._channels.index(name.removeprefix(STAYED)), 1.0)]
        owner, _, what = name.partition(".")
        if what == "slip":
            first = world.entries_at("v")
            if first is None:
                raise RigError(f"the slip of {owner} is no number of the rig")
            row = world.line["w"][world.plan.system.elements.index(owner)]
            return [(first.start + k, float(weight)) for k, weight in enumerate(row) if weight]
        return [(world.number(name), 1.0)]

    def look_anew(self) -> None:
        """Look at every trip after the next sample: something has changed but by the samples."""
        self.arrays.witness[:], self.arrays.counting[:] = ALL, [len(self.trips), *range(len(self.trips))]
        self.arrays.bounds[0], self.arrays.bounds[1], self.arrays.looked[:] = -math.inf, math.inf, 0

    def says(self, gear: int, shifting: bool) -> None:
        """Take what a controller outside reports: the number of its gear, and whether it shifts."""
        self.arrays.said[: 2 * len(_SAID)] = (gear, shifting) * 2

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

    def reason(self, when: float) -> tuple[str, str]:
        """Return why the rig trips at a time [s], and the name of the trip: of several in one sample the first, with the others."""
        first, *others = self.latched()
        also = f"; at the same time {', '.join(f'trip {trip.name}' for trip in others)}" if others else ""
        return first.sentence(self.value(first), when) + also, first.name

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
        self.arrays.stays[0] = self.arrays.said[:] = 0.0
        self.look_anew()
