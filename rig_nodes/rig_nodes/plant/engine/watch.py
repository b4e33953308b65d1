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
    from ...base import Floats, Ints, Record

# sum: number of its quantity among the sums; first, last: its conditions; rises > 0: the quantity counts from the sample at which
# all conditions became true, when it was base; limit, clear: value above which its time runs, and at which this begins anew; near,
# near_clear: the same of the warning; low: at or below it nothing happens; delay: samples; count, near_count: samples for which the
# criterion has held; latched, warned: 1 since it tripped or warned; told: 1 since people know it; value: quantity at that time
TRIP = np.dtype(
    [
        *((name, "i8") for name in ("sum", "first", "last", "delay")),
        *((name, "f8") for name in ("rises", "limit", "clear", "near", "near_clear", "low")),
        *((name, "i8") for name in ("count", "near_count", "latched", "warned", "told")),
        *((name, "f8") for name in ("base", "value")),
    ]
)


class Watch(NamedTuple):
    """The trips of a rig.

    Parameters
    ----------
    trips : (trips,) record array of TRIP
        The trips; a criterion "below" has its weights and limits with the other sign.
    first : (sums + 1,) array of int64
        First term of each sum.
    places : (terms,) array of int64
        Where a term's number is: in the world; behind it, in the columns of the logger's row; below 0, in ``said``.
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
    first: Ints
    places: Ints
    weights: Floats
    magnitudes: Ints
    conditions: Ints
    thresholds: Floats
    said: Floats


@njit(**INLINED)
def summed(k: int, watch: Watch, numbers: Floats, log: Floats, row: int) -> float:
    """Return a sum of numbers of the world, of a row of the logger and of what the controller reports."""
    total = 0.0
    for t in range(watch.first[k], watch.first[k + 1]):
        place = watch.places[t]
        if place < 0:
            total += watch.weights[t] * watch.said[-1 - place]
        elif place < numbers.shape[0]:
            total += watch.weights[t] * numbers[place]
        else:
            total += watch.weights[t] * log[row, place - numbers.shape[0]]
    return abs(total) if watch.magnitudes[k] else total


@njit(**INLINED)
def enabled(one: Record, watch: Watch, numbers: Floats, log: Floats, row: int) -> bool:
    """Return whether all conditions of a trip hold."""
    for c in range(one.first, one.last):
        if not watch.thresholds[0, c] * summed(watch.conditions[c], watch, numbers, log, row) > watch.thresholds[1, c]:
            return False
    return True


@njit(**INLINED)
def counted(count: int, value: float, limit: float, clear: float) -> int:
    """Return for how many samples a value has been past its limit: it begins above the limit, and ends at ``clear``."""
    return count + 1 if value > limit or (count > 0 and value > clear) else 0


@njit(**INNER)
def watched(watch: Watch, numbers: Floats, log: Floats, row: int) -> int:
    """Look at all trips after a sample.

    Parameters
    ----------
    watch : Watch
        The trips, which it changes.
    numbers : array of float
        The beginning of the world [SI].
    log : (rows, channels) array of float
        The ring of the logger's rows.
    row : int
        Row of this sample.

    Returns
    -------
    int
        WHOLE, WARNED for a new warning, TRIPPED for a trip.
    """
    how = WHOLE
    for k in range(watch.trips.shape[0]):
        one = watch.trips[k]
        value = summed(one.sum, watch, numbers, log, row)
        if one.rises > 0.0:
            if not enabled(one, watch, numbers, log, row):
                one.base = value
            value -= one.base
        if value <= one.low:
            one.count = one.near_count = one.warned = one.told = 0
            continue
        if not enabled(one, watch, numbers, log, row):
            one.count = one.near_count = 0
            continue
        one.near_count = counted(one.near_count, value, one.near, one.near_clear)
        if one.near_count == 0:
            one.warned = one.told = 0
        elif one.near_count > one.delay and one.warned == 0:
            one.warned, one.value = 1, value
            how = max(how, WARNED)
        one.count = counted(one.count, value, one.limit, one.clear)
        if one.count > one.delay:
            one.latched, one.value = 1, value
            how = TRIPPED
    return how
