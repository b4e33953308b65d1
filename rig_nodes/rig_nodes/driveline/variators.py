# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A gear whose ratio varies in a part of a step: with an input, as that of a variator, or over an angle, as a Hooke's joint's.

Used by driveline/law_steps.py. The gear is a friction element without a limit, w_a - s w_b - z = 0, with one ratio s for the whole
part and a speed z that is prescribed as that of a motion: from (r0 - s) w_b to (r1 - s) w_b, so that w_a = r w_b at both ends. For
s between the ratios r0 and r1 at the ends with which the sum of both z is 0 the gear takes no power: torques follow the ratio.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import lin, noinline
from rig_nodes.driveline.motion import product
from rig_nodes.driveline.tables import line, piece, value

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.laws import Model, Moving
    from rig_nodes.driveline.lines import Lines, Part
    from rig_nodes.driveline.state import State


@njit(**INNER)
def own_speed(row: Floats) -> int:
    """Return which of the speeds is the prescribed one of a gear, which stands last in the row of its element."""
    noinline()
    last = int(0)
    for j in range(row.shape[0]):
        if row[j] != 0.0:
            last = j
    return last


@njit(**INLINED)
def ratio_line(k: int, part: Part, first: bool, factors: Floats, model: Model, moving: Moving, lines: Lines) -> None:
    """Put the ratio of a part of a step into the row of the element of a gear, and set its speed z and the accelerations of this.

    In ``lines`` `other` is the speed of b that is expected at the end, which has to be predicted the `first` time; `slope` and
    `torque` become the accelerations of z at both ends. The rows of the model have the ratios at the start of the run.
    """
    laws, w, state = model.laws, model.structure.w, moving.state
    f, on, x, dx, factor = laws.element[k], laws.on[k], lines.start[k], lines.way[k], laws.factor[k]
    g0 = lin(factors[0, factor], factors[1, factor], part.begin)
    g1 = lin(factors[0, factor], factors[1, factor], part.end)
    # how far the input is above its straight line in the middle bends it as that of a motion
    bent = 4.0 * factors[2, factor] * (part.end - part.begin) * (part.end - part.begin)
    t0, t1, z = value(laws.tables, k, x), value(laws.tables, k, x + dx), own_speed(w[f])
    b0 = product(on, state.v)
    a0 = product(w[f], state.v) + laws.gap[k] * b0 + state.v[z]
    if first:
        lines.other[k] = b0
    b1 = lines.other[k]
    # the ratio at the start is that which was reached, as that of the input may jump
    r0, r1 = moving.own.torque[k], g1 * t1
    a1, ratio = r1 * b1, 0.5 * (r0 + r1)
    if b0 + b1 != 0.0:
        ratio = min(max((a0 + a1) / (b0 + b1), min(r0, r1)), max(r0, r1))
    z0, z1 = a0 - ratio * b0, a1 - ratio * b1
    turning = product(laws.of[k], state.v)
    steep0, steep1 = line(laws.tables, k, piece(laws.tables, k, x))[4], line(laws.tables, k, piece(laws.tables, k, x + dx))[4]
    rate0 = (g1 - g0 + bent) / part.d * t0 + g0 * steep0 * turning
    rate1 = (g1 - g0 - bent) / part.d * t1 + g1 * steep1 * (2.0 * dx / part.d - turning)
    more = rate1 * b1 - rate0 * b0 + (r1 - r0) * (b1 - b0) / part.d
    lines.slope[k], lines.torque[k] = (z1 - z0) / part.d - 0.5 * more, (z1 - z0) / part.d + 0.5 * more
    state.v[z] = z0
    for j in range(on.shape[0]):
        lines.w[f, j] = w[f, j] - (ratio - laws.gap[k]) * on[j]


@njit(**INLINED)
def ratio_error(k: int, part: Part, dx: float, factors: Floats, model: Model, state: State, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of the speed of a gear's a after a part of a step in which what its ratio follows has changed by dx."""
    laws, w, f = model.laws, model.structure.w, model.laws.element[k]
    lines.other[k] = b1 = product(laws.on[k], state.v)
    a1 = product(w[f], state.v) + laws.gap[k] * b1 + state.v[own_speed(w[f])]
    end = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.end)
    return abs(a1 - end * value(laws.tables, k, lines.start[k] + dx) * b1), 1.0 + abs(a1)
