# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws over two arguments in a part of a step: what the second one is, and the line that replaces a torque.

Used by driveline/lines.py. Such a torque goes in a straight line from its value at the part's start to that at its end, which is
of second order. Of its change, what follows from the speed or the turn of the bodies on which it acts is in the matrix of the bare
step, so that a torque that is steep in these, as that of a converter near its coupling point, is solved as a damper or a spring is.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import lin, noinline
from rig_nodes.driveline.laws import ANGLE, RATIO, SPEED, TIME, Laws
from rig_nodes.driveline.motion import product
from rig_nodes.driveline.tables import over_two

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.laws import LawState, Moving
    from rig_nodes.driveline.lines import Lines, Part
    from rig_nodes.driveline.state import State

FARTHEST = 1e9  # largest ratio of two speeds; that to a speed of 0 counts as this one
SLOWEST = 1e-6  # rad/s: below it the slope over a ratio, which grows without limit, is not in the matrix


@njit(**INNER)
def ratio_of(laws: Laws, k: int, v: Floats) -> float:
    """Return the ratio of two speeds that law k reads; 0 where both are 0."""
    noinline()
    over, under = product(laws.of[k], v), product(laws.on[k], v)
    if abs(over) < FARTHEST * abs(under):
        return over / under
    return 0.0 if over == 0.0 else math.copysign(FARTHEST, over if under >= 0.0 else -over)


@njit(**INLINED)
def argument(k: int, part: Part, laws: Laws, factors: Floats, own: LawState, v: Floats) -> tuple[float, float]:
    """Return what law k reads at the start of a part of a step, and the change of it that is expected."""
    by, factor, rate = laws.by[k], laws.factor[k], product(laws.of[k], v)
    if by == ANGLE:
        return own.at[k], part.d * rate + own.way[k] * part.d * part.d
    if by == SPEED:
        return rate, own.way[k] * part.d
    if by == RATIO:
        return ratio_of(laws, k, v), own.way[k] * part.d
    if by == TIME:
        return part.t, part.d
    begin = lin(factors[0, factor], factors[1, factor], part.begin)
    return begin, lin(factors[0, factor], factors[1, factor], part.end) - begin


@njit(**INNER)
def implicit_slopes(k: int, by_x: float, by_u: float, laws: Laws, u: float, v: Floats) -> tuple[float, float]:
    """Return stiffness and damping of the bodies on which a torque over two arguments acts, by its slopes over both."""
    noinline()
    s, on = laws.second[k], laws.on[k]
    size, stiff, damp = product(on, on), 0.0, 0.0
    for row, slope in ((k, by_x), (s, by_u)):
        along = slope * product(laws.of[row], on) / size
        if laws.by[row] == ANGLE:
            stiff -= along
        elif laws.by[row] == SPEED:
            damp -= along
        elif laws.by[row] == RATIO and abs(u) < FARTHEST:
            under = product(laws.on[row], v)
            if abs(under) > SLOWEST:
                damp -= (along - slope * u * product(laws.on[row], on) / size) / under
    return stiff, damp


@njit(**INLINED)
def map_line(k: int, part: Part, first: bool, factors: Floats, laws: Laws, moving: Moving, lines: Lines) -> None:
    """Put a torque over two arguments on the speeds, and its slopes into its row where it has one.

    Of the rows of ``lines`` for the law and for its second argument, `slope` of the law is the torque at the part's end without its
    implicit part, and `other` of both are the gain and the turn of the bodies on which it acts; `first` is whether these have to be
    predicted.
    """
    s, slot, q, on, v = laws.second[k], laws.slot[k], lines.loads.q, laws.on[k], moving.state.v
    begin = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.begin)
    end = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.end)
    x, u, rate = lines.start[k], lines.start[s], product(on, v)
    if first:
        lines.other[k] = moving.own.torque[s] * part.d
        lines.other[s] = part.d * (rate + 0.5 * lines.other[k])
    lines.torque[k] = over_two(laws.tables, s, x, u)[0]
    final, by_x, by_u = over_two(laws.tables, s, x + lines.way[k], u + lines.way[s])
    push0, push1 = begin * lines.torque[k], end * final
    if slot >= 0:
        middle = 0.5 * (begin + end)
        stiff, damp = implicit_slopes(k, middle * by_x, middle * by_u, laws, u, v)
        lines.kc[0, slot], lines.kc[1, slot] = stiff, damp
        push0 += damp * rate
        push1 += damp * (rate + lines.other[k]) + stiff * lines.other[s]
    lines.slope[k] = push1
    lines.push[0, k], lines.push[1, k] = push0, push1
    for j in range(q.shape[1]):
        q[0, j] += push0 * on[j]
        q[1, j] += push1 * on[j]


@njit(**INLINED)
def map_error(
    k: int, part: Part, dx: float, factors: Floats, laws: Laws, before: State, state: State, lines: Lines
) -> tuple[float, float]:
    """Return (error, scale) of a torque over two arguments after a part of a step in which the first one has changed by dx."""
    s, slot, on = laws.second[k], laws.slot[k], laws.on[k]
    end = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.end)
    asked = end * over_two(laws.tables, s, lines.start[k] + dx, lines.start[s] + lines.way[s])[0]
    now, made = product(on, state.v), lines.slope[k]
    lines.other[k] = now - product(on, before.v)
    if slot >= 0:
        lines.other[s] = state.twist[slot]
        made -= lines.kc[1, slot] * now + lines.kc[0, slot] * state.twist[slot]
    return abs(asked - made), 1.0 + abs(asked)
