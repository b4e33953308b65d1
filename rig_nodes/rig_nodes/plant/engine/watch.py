# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a trip's criterion holds, after every controller sample: compiled, and the same wherever a rig runs.

plant.engine.loop calls it; runs.watch fills the arrays from a rig's trips.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...base import INLINED, INNER, njit
from .outcome import TRIPPED, WARNED, WHOLE

if TYPE_CHECKING:
    import numpy.typing as npt

    from ...base import Floats, Ints, Record

# sum: number of its quantity among the sums, whose sign is that of way; begin, end: its conditions; rises > 0: the quantity counts
# from base, its value in the first sample in which all conditions held; limit, clear: value above which its time runs, and at which
# this begins anew; near, near_clear: the same of the warning; delay: samples; count, near_count: samples for which the criterion
# has held; counts: 1 since base; latched, warned: 1 since it tripped or warned; told: 1 since people know it; value: quantity then
TRIP = np.dtype(
    [
        *((name, "i8") for name in ("sum", "begin", "end", "delay")),
        *((name, "f8") for name in ("way", "rises", "limit", "clear", "near", "near_clear")),
        *((name, "i8") for name in ("count", "near_count", "counts", "latched", "warned", "told")),
        *((name, "f8") for name in ("base", "value")),
    ]
)
LOW, HIGH = 0, 1  # rows of Watch.spans and Watch.bounds
STAYED, LAST, LEAST = 0, 1, 2  # rows of Watch.stays
# kinds of sums: of one number of the world, of one that is shown, of two, others, of a time for which a reading stayed the same,
# and of what the controller reports
INSIDE, SHOWN, BOTH_INSIDE, ONE_SHOWN, BOTH_SHOWN, OTHER, RESTING, REPORTED = range(8)
FIRST_STAY = -3  # place of the first channel's time; that of the next one is less by 1
ARRIVED = 2  # place in Watch.said of what the rig has of the controller's reports when it looks
ALL = -1  # in Watch.witness: nothing rules the trip out


class Watch(NamedTuple):
    """The trips of a rig.

    A trip needs several sums beyond thresholds at once: its conditions and its quantity. As long as one of them, the trip's
    witness, stays within a span, nothing of the trip can be true, and it is not looked at. When a sum leaves the span of a trip
    whose witness it is, the trip is looked at and gets another witness, or none while it counts.

    Parameters
    ----------
    trips : (trips,) record array of TRIP
        The trips; a criterion "below" has its limits with the other sign.
    first : (sums + 1,) array of int64
        First term of each sum; the sums are in the order of their kinds.
    ends : (kinds,) array of int64
        Number of the first sum behind each kind but the last one, whose sums change only with what the controller reports.
    places : (terms,) array of int64
        Where a term's number is: in the world; behind it, in the row that the transducers show; below 0, in ``said`` and, from
        FIRST_STAY on, in the first row of ``stays``.
    weights : (terms,) array of float
        Weights of the terms.
    at : (2, sums) array of uint64
        The places, in the world, in the row or in a row of ``stays``, of the numbers of a sum of one or two.
    pairs : (2, sums) array of float
        Their weights.
    magnitudes : (sums,) array of int64
        1 where the sign of a sum does not count.
    conditions : (conditions,) array of int64
        The sum of each condition.
    thresholds : (2, conditions) array of float
        Sign of each condition and, with that sign, the threshold that its sum must exceed.
    said : (6,) array of float
        What the controller reports, its gear and 1 while it shifts: in its newest answer; from ARRIVED on what the rig has of it at
        a look, the answer before, as an answer needs a sample on its way from any controller; and the same at the last look.
    stays : (3, channels) array of float
        For how many samples each channel has shown the same, what it showed in the last sample, and the noise [SI] below which this
        is no sign.
    witness : (trips,) array of int64
        The sum that rules each trip out, or ALL.
    spans : (2, trips) array of float
        Between which values it does so.
    bounds : (2, sums) array of float
        The narrowest span of each sum.
    counting : (1 + trips,) array of int64
        How many trips have no witness, and which.
    looked : (kinds,) array of int64
        Number of the first column behind each kind in ``places_looked``, ``weights_looked`` and ``spans_looked``.
    places_looked, weights_looked, spans_looked : (2, sums) arrays of uint64, float and float
        ``at``, ``pairs`` and ``bounds`` of the sums that have bounds now, closed up; the place of one of OTHER is its own number.
    """

    trips: Record
    first: Ints
    ends: Ints
    places: Ints
    weights: Floats
    at: npt.NDArray[np.uint64]
    pairs: Floats
    magnitudes: Ints
    conditions: Ints
    thresholds: Floats
    said: Floats
    stays: Floats
    witness: Ints
    spans: Floats
    bounds: Floats
    counting: Ints
    looked: Ints
    places_looked: npt.NDArray[np.uint64]
    weights_looked: Floats
    spans_looked: Floats


@njit(**INLINED)
def summed(k: int, watch: Watch, numbers: Floats, row: Floats) -> float:
    """Return a sum of numbers of the world, of what the transducers show and of what the controller reports, with its sign."""
    total = 0.0
    for t in range(watch.first[k], watch.first[k + 1]):
        place = watch.places[t]
        if place <= FIRST_STAY:
            total += watch.weights[t] * watch.stays[STAYED, FIRST_STAY - place]
        elif place < 0:
            total += watch.weights[t] * watch.said[ARRIVED - 1 - place]
        elif place < numbers.shape[0]:
            total += watch.weights[t] * numbers[place]
        else:
            total += watch.weights[t] * row[place - numbers.shape[0]]
    return total


@njit(**INLINED)
def past(j: int, value: float, bounds: Floats) -> int:
    """Return 1 for a sum outside its bounds, without the branch that ``or`` would be."""
    return int(value < bounds[LOW, j]) | int(value > bounds[HIGH, j])


@njit(**INLINED)
def counted(count: int, value: float, limit: float, clear: float) -> int:
    """Return for how many samples a value has been past its limit: it begins above the limit, and ends at ``clear``."""
    return count + 1 if value > limit or (count > 0 and value > clear) else 0


@njit(**INNER)
def looked_at(one: Record, value: float) -> int:
    """Look at a trip whose conditions hold, by its quantity; the result is that of :func:`watched`."""
    how = WHOLE
    if one.rises > 0.0:
        if one.counts == 0:
            one.counts, one.base = 1, value
        value -= one.base
    one.value = max(one.value, value) if one.count + one.near_count > 0 else value
    one.near_count = counted(one.near_count, value, one.near, one.near_clear)
    if one.near_count == 0:
        one.warned = one.told = 0
    elif one.near_count > one.delay and one.warned == 0:
        one.warned, how = 1, WARNED
    one.count = counted(one.count, value, one.limit, one.clear)
    if one.count > one.delay:
        one.latched, how = 1, TRIPPED
    return how


@njit(**INNER)
def ruled_out(k: int, by: int, way: float, threshold: float, value: float, watch: Watch) -> None:
    """Make a sum the witness of a trip: ``way`` times it, or its magnitude, is not above the threshold now."""
    low, high = -np.inf, np.inf
    if watch.magnitudes[by] and way > 0.0:
        low, high = -threshold, threshold
    elif way > 0.0 or (watch.magnitudes[by] and value < 0.0):
        high = threshold
    else:
        low = -threshold
    watch.witness[k], watch.spans[LOW, k], watch.spans[HIGH, k] = by, low, high


@njit(**INNER)
def looked_closer(k: int, watch: Watch, numbers: Floats, row: Floats) -> int:
    """Look at a trip of which something may be true, and find its witness; the result is that of :func:`watched`."""
    one = watch.trips[k]
    for c in range(one.begin, one.end):
        by, way, threshold = watch.conditions[c], watch.thresholds[0, c], watch.thresholds[1, c]
        value = summed(by, watch, numbers, row)
        if not way * (abs(value) if watch.magnitudes[by] else value) > threshold:
            one.count = one.near_count = one.counts = one.warned = one.told = 0
            ruled_out(k, by, way, threshold, value, watch)
            return WHOLE
    value = summed(one.sum, watch, numbers, row)
    how = looked_at(one, one.way * (abs(value) if watch.magnitudes[one.sum] else value))
    if one.count + one.near_count + one.counts > 0:
        watch.witness[k] = ALL
    else:
        ruled_out(k, one.sum, one.way, min(one.near, one.limit), value, watch)
    return how


@njit(**INNER)
def bounded(watch: Watch) -> None:
    """Find the bounds of the sums, and the trips that count, by the witnesses."""
    bounds, counting = watch.bounds, 0
    bounds[LOW], bounds[HIGH] = -np.inf, np.inf
    for k in range(watch.witness.shape[0]):
        j = watch.witness[k]
        if j == ALL:
            counting += 1
            watch.counting[counting] = k
        else:
            bounds[LOW, j] = max(bounds[LOW, j], watch.spans[LOW, k])
            bounds[HIGH, j] = min(bounds[HIGH, j], watch.spans[HIGH, k])
    watch.counting[0] = counting
    j = column = 0
    for kind in range(RESTING):
        while j < watch.ends[kind]:
            if bounds[LOW, j] > -np.inf or bounds[HIGH, j] < np.inf:
                watch.spans_looked[LOW, column], watch.spans_looked[HIGH, column] = bounds[LOW, j], bounds[HIGH, j]
                for i in range(2):
                    watch.places_looked[i, column] = watch.at[i, j] if kind != OTHER else j
                    watch.weights_looked[i, column] = watch.pairs[i, j]
                column += 1
            j += 1
        watch.looked[kind] = column


@njit(**INNER)
def looked_over(outside: bool, watch: Watch, numbers: Floats, row: Floats) -> int:
    """Look at the trips that count and, where a sum is outside its bounds, at all that are not ruled out; see :func:`watched`."""
    how, moved, said = WHOLE, outside, watch.said
    said[4], said[5] = said[2], said[3]
    for i in range(watch.witness.shape[0] if outside else watch.counting[0]):
        k = i if outside else watch.counting[i + 1]
        j = watch.witness[k]
        value = summed(j, watch, numbers, row) if j != ALL else np.inf
        if j == ALL or value < watch.spans[LOW, k] or value > watch.spans[HIGH, k]:
            how = max(how, looked_closer(k, watch, numbers, row))
            moved = moved or watch.witness[k] != ALL
    if moved:
        bounded(watch)
    return how


@njit(cache=True, error_model="numpy", forceinline=True, _nrt=False)
def watched(watch: Watch, numbers: Floats, row: Floats, noise: Floats) -> int:
    """Look at all trips after a sample.

    Parameters
    ----------
    watch : Watch
        The trips, which it changes.
    numbers : array of float
        The beginning of the world [SI].
    row : (channels,) array of float
        What the transducers show.
    noise : (channels,) array of float
        Standard deviation of the noise in it.

    Returns
    -------
    int
        WHOLE, WARNED for a new warning, TRIPPED for a trip.
    """
    bounds, said, ends, stays = watch.spans_looked, watch.said, watch.looked, watch.stays
    at, weights, outside = watch.places_looked, watch.weights_looked, 0
    for j in range(ends[INSIDE]):
        outside |= past(j, weights[0, j] * numbers[at[0, j]], bounds)
    for j in range(ends[INSIDE], ends[SHOWN]):
        outside |= past(j, weights[0, j] * row[at[0, j]], bounds)
    for j in range(ends[SHOWN], ends[BOTH_INSIDE]):
        outside |= past(j, weights[0, j] * numbers[at[0, j]] + weights[1, j] * numbers[at[1, j]], bounds)
    for j in range(ends[BOTH_INSIDE], ends[ONE_SHOWN]):
        outside |= past(j, weights[0, j] * numbers[at[0, j]] + weights[1, j] * row[at[1, j]], bounds)
    for j in range(ends[ONE_SHOWN], ends[BOTH_SHOWN]):
        outside |= past(j, weights[0, j] * row[at[0, j]] + weights[1, j] * row[at[1, j]], bounds)
    for j in range(ends[BOTH_SHOWN], ends[OTHER]):
        outside |= past(j, summed(at[0, j], watch, numbers, row), bounds)
    for j in range(watch.ends[OTHER], watch.ends[RESTING]):
        c = watch.at[0, j]
        same = row[c] == stays[LAST, c] and noise[c] >= stays[LEAST, c]
        stays[STAYED, c] = stays[STAYED, c] + 1.0 if same else 0.0
        stays[LAST, c] = row[c]
        outside |= past(j, watch.pairs[0, j] * stays[STAYED, c], watch.bounds)
    away = outside != 0 or said[2] != said[4] or said[3] != said[5]
    how = looked_over(away, watch, numbers, row) if away or watch.counting[0] > 0 else WHOLE
    said[2], said[3] = said[0], said[1]
    return how
