# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Divides a step at the bends of a shaft's characteristic, where a contact begins or ends.

Used by driveline/law_steps.py. The mean of a characteristic over a twist has the right energy but spreads the force of a
contact over the whole step; with the bend at the end of a part the force acts from the contact on. Between bends the bare step is
exact, so that a part has only to be short enough for no bend to be passed and passed back in it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import INNER, njit
from rig_nodes.driveline.algebra import noinline
from rig_nodes.driveline.laws import SHAFT
from rig_nodes.driveline.tables import Tables, line, piece, value

if TYPE_CHECKING:
    from rig_nodes.driveline.laws import Laws
    from rig_nodes.driveline.system import System

SEEN = 1e-7  # share of the rate of a twist: a bend that changes the rate by less does not divide the step
RESOLVED = 0.5  # rad: most phase of the oscillation of a shaft with bends that a part of a step covers
SLIDING = 0.05  # rad: the same with springs that slide, as a part in which one begins to slide is of second order
PARTS = 64  # most parts of a step
# s of processor time for a part of a step of two bodies, measured: in general, and where shafts without hysteresis are all the laws
PART_S, SHAFTS_PART_S = 5e-6, 1.4e-6
NEAR = 1e-6  # share of a change of twist within which a bend counts as at its beginning or end


@njit(**INNER)
def time_of(x: float, first: float, last: float, d: float, to: float) -> float:
    """Return the time in (0, d) at which a twist x, whose rate goes from first to last in a straight line, is `to`, or d."""
    noinline()
    half = 0.5 * (last - first) / d
    way = to - x
    root = first * first + 4.0 * half * way
    if root < 0.0:
        return d
    low = abs(first) + math.sqrt(root)
    if low == 0.0:
        return d
    t = 2.0 * way / low if first >= 0.0 else -2.0 * way / low
    if t <= 0.0 and half != 0.0:
        # the rate changes its sign first
        t = -first / half - t
    return t if 0.0 < t < d else d


@njit(**INNER)
def bend_inside(laws: Laws, k: int, x: float, dx: float, first: float, last: float, d: float, mobility: float) -> float:
    """Return the time at which the twist of a shaft passes the first bend that matters, d where there is none.

    Parameters
    ----------
    laws, k : Laws and int
        The laws, and the number of that of the shaft.
    x, dx : float
        Twist at the start, and its change [rad].
    first, last : float
        Rate of the twist at both ends [rad/s].
    d : float
        Length of the part of the step [s].
    mobility : float
        Acceleration of the twist by a torque [1/(kg m2)].

    Returns
    -------
    float
        The time [s].
    """
    noinline()
    tables, gap = laws.tables, laws.gap[k]
    number = piece(tables, k, x)
    begin, end, _, _, slope = line(tables, k, number)
    if begin < x < end and begin <= x + dx <= end:
        return d
    if dx < 0.0 and x == begin:
        number -= 1
        begin, end, _, _, slope = line(tables, k, number)
    for _ in range(64):
        bend = end if dx > 0.0 else begin
        share = (bend - x) / dx if dx != 0.0 else 1.0
        if not share < 1.0 - NEAR:
            return d
        number += 1 if dx > 0.0 else -1
        begin, end, _, _, other = line(tables, k, number)
        if share > NEAR:
            force = abs(other - slope) * abs(dx)
            if gap > 0.0 and abs(abs(bend) - gap) <= 1e-12 * gap:
                force += laws.damping[k] * max(abs(first), abs(last))
            if force * mobility * d > 8.0 * SEEN * max(abs(first), abs(last)):
                return time_of(x, first, last, d, bend)
        slope = other
    return d


@njit(**INNER)
def lets_go(laws: Laws, k: int, x: float, dx: float, first: float, last: float, d: float) -> float:
    """Return the time at which a contact with damping, which only pushes, loses its torque while it opens; d where it does not.

    The parameters are those of :func:`bend_inside`.
    """
    noinline()
    if laws.gap[k] == 0.0 or laws.damping[k] == 0.0 or abs(x) <= laws.gap[k]:
        return d
    side = 1.0 if x > 0.0 else -1.0
    begin = side * (value(laws.tables, k, x) + laws.damping[k] * first)
    end = side * (value(laws.tables, k, x + dx) + laws.damping[k] * last)
    if begin <= 0.0 or end >= 0.0:
        return d
    share = begin / (begin - end)
    return share * d if NEAR < share < 1.0 - NEAR else d


@njit(**INNER)
def longest_part(tables: Tables, k: int, x: float, rate: float, stiffness: float, mobility: float, h: float) -> float:
    """Return the longest part of a step h that resolves the oscillation of a shaft at its present stiffness.

    Parameters
    ----------
    tables, k : Tables and int
        The characteristics, and the number of that of the shaft.
    x, rate : float
        Its twist [rad] and the rate of it [rad/s].
    stiffness : float
        Stiffness of its springs with friction [Nm/rad].
    mobility : float
        Acceleration of the twist by a torque [1/(kg m2)].
    h : float
        Length of the step [s].

    Returns
    -------
    float
        The length [s]; infinite where the shaft is in its gap, or where its table has two points only and so no bend.
    """
    noinline()
    if tables.first[k + 1] - tables.first[k] == 2:
        return np.inf
    number = piece(tables, k, x)
    begin, _, _, _, slope = line(tables, k, number)
    if x == begin and rate < 0.0:
        slope = line(tables, k, number - 1)[4]
    angular = math.sqrt(max(0.0, (slope + stiffness) * mobility))
    if angular == 0.0:
        return np.inf
    return max((RESOLVED if stiffness == 0.0 else SLIDING) / angular, h / PARTS)


def parts_of_steps(system: System, h: float) -> dict[str, tuple[int, float]]:
    """Return into how many parts each shaft with bends divides a step at the stiffest piece of its table.

    Parameters
    ----------
    system : System
        The driveline.
    h : float
        Length of a step [s].

    Returns
    -------
    dict of str to (int, float)
        The number and the processor time of the parts [s], by the names of the shafts whose table has more than two points, as that
        of backlash has.
    """
    found = {}
    only_shafts = not system.meshes and all(law.kind == SHAFT and not law.springs for law in system.laws)
    for law in system.laws:
        if law.kind == SHAFT and len(law.table.x) > 2:
            steepest = np.max(np.diff(law.table.y) / np.diff(law.table.x)) + sum(stiffness for stiffness, _ in law.springs)
            angular = math.sqrt(float(steepest) * float(law.of @ system.minv @ law.of))
            parts = min(PARTS, max(1, math.ceil(h * angular / (SLIDING if len(law.springs) else RESOLVED))))
            found[law.name] = parts, parts * (SHAFTS_PART_S if only_shafts else PART_S)
    return found
