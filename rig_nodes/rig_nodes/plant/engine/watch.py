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

# sum: number of its quantity among the sums; begin, end: its conditions; rises > 0: the quantity counts from base, its value in
# the first sample in which all conditions held; quiet: LOW of its first look while nothing counts; limit, clear: value above which
# its time runs, and at which this begins anew; near, near_clear: the same of the warning; delay: samples; count, near_count:
# samples for which the criterion has held; counts: 1 since base; latched, warned: 1 since it tripped or warned; told: 1 since
# people know it; value: quantity at that time
TRIP = np.dtype(
    [
        *((name, "i8") for name in ("sum", "begin", "end", "delay")),
        *((name, "f8") for name in ("rises", "quiet", "limit", "clear", "near", "near_clear")),
        *((name, "i8") for name in ("count", "near_count", "counts", "latched", "warned", "told")),
        *((name, "f8") for name in ("base", "value")),
    ]
)
# columns of Watch.first_look: weights of two numbers, -1 where the sign of their sum does not count, and what it must exceed
WEIGHT, OTHER, SIGN, LOW = range(4)


class Watch(NamedTuple):
    """The trips of a rig.

    Parameters
    ----------
    trips : (trips,) record array of TRIP
        The trips; a criterion "below" has its weights and limits with the other sign.
    first_look : (trips, 4) array of float
        A sum of two numbers for each trip, at or below whose LOW nothing of it can be true; -inf as long as something counts.
    first_places : (trips, 2) array of uint64
        The places of these numbers: both in the world for the first ``inside`` trips, else one there and one in the shown row.
    inside : int
        Number of these trips.
    first : (sums + 1,) array of int64
        First term of each sum.
    places : (terms,) array of int64
        Where a term's number is: in the world; behind it, in the row that the transducers show; below 0, in ``said``.
    weights : (terms,) array of float
        Weights of the terms.
    magnitudes : (sums,) array of int64
        1 where the sign of a sum does not count.
    conditions : (conditions,) array of int64
        The sum of each condition.
    thresholds : (2, conditions) array of float
        Sign of each condition and, with that sign, the threshold that its sum must exceed.
    said : (2,) array of float
        What the controller reports: its gear, and 1 while it shifts.
    """

    trips: Record
    first_look: Floats
    first_places: npt.NDArray[np.uint64]
    inside: int
    first: Ints
    places: Ints
    weights: Floats
    magnitudes: Ints
    conditions: Ints
    thresholds: Floats
    said: Floats


@njit(**INLINED)
def summed(k: int, watch: Watch, numbers: Floats, row: Floats) -> float:
    """Return a sum of numbers of the world, of what the transducers show and of what the controller reports."""
    total = 0.0
    for t in range(watch.first[k], watch.first[k + 1]):
        place = watch.places[t]
        if place < 0:
            total += watch.weights[t] * watch.said[-1 - place]
        elif place < numbers.shape[0]:
            total += watch.weights[t] * numbers[place]
        else:
            total += watch.weights[t] * row[place - numbers.shape[0]]
    return abs(total) if watch.magnitudes[k] else total


@njit(**INLINED)
def enabled(one: Record, watch: Watch, numbers: Floats, row: Floats) -> bool:
    """Return whether all conditions of a trip hold."""
    for c in range(one.begin, one.end):
        if not watch.thresholds[0, c] * summed(watch.conditions[c], watch, numbers, row) > watch.thresholds[1, c]:
            return False
    return True


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


@njit(**INLINED)
def looked_closer(k: int, watch: Watch, numbers: Floats, row: Floats) -> int:
    """Look at a trip of which something may be true; the result is that of :func:`watched`."""
    one, how = watch.trips[k], WHOLE
    if enabled(one, watch, numbers, row):
        how = looked_at(one, summed(one.sum, watch, numbers, row))
    else:
        one.count = one.near_count = one.counts = one.warned = one.told = 0
    watch.first_look[k, LOW] = -np.inf if one.count + one.near_count + one.counts > 0 else one.quiet
    return how


@njit(**INLINED)
def watched(watch: Watch, numbers: Floats, row: Floats) -> int:
    """Look at all trips after a sample.

    Nothing can be true of most of them by one sum of two terms, which is looked at first.

    Parameters
    ----------
    watch : Watch
        The trips, which it changes.
    numbers : array of float
        The beginning of the world [SI].
    row : (channels,) array of float
        What the transducers show.

    Returns
    -------
    int
        WHOLE, WARNED for a new warning, TRIPPED for a trip.
    """
    how, look, places = WHOLE, watch.first_look, watch.first_places
    for k in range(look.shape[0]):
        second = numbers[places[k, 1]] if k < watch.inside else row[places[k, 1]]
        value = look[k, WEIGHT] * numbers[places[k, 0]] + look[k, OTHER] * second
        if value > look[k, LOW] or look[k, SIGN] * value > look[k, LOW]:
            how = max(how, looked_closer(k, watch, numbers, row))
    return how
