# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Heat in a part of a step: what an element loses flows into a state, as its mean power over the part.

Used by driveline/lines.py. A state is a speed on which nothing but flows act (driveline.builder.Driveline.state). What loses is a
friction element, one of the rows among the shafts, or a law, counted in this order from 0 on. The energy is that which the bare
step itself has counted, so that what an element loses is what the state takes in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, njit
from rig_nodes.driveline.algebra import E_FRIC, E_SHAFT, E_VISC, places
from rig_nodes.driveline.contacts import sliding_heat
from rig_nodes.driveline.laws import SHAFT

if TYPE_CHECKING:
    from rig_nodes.driveline.laws import Laws, LawState, Moving
    from rig_nodes.driveline.lines import Lines
    from rig_nodes.driveline.state import State

ROUNDING = 1e-15  # share of an energy since the start up to which its change is not known


@njit(**INLINED)
def heat_line(k: int, first: bool, laws: Laws, own: LawState, lines: Lines) -> None:
    """Put the power of a HEAT on its state; the `first` time it is expected to be that of the last part."""
    q, on = lines.loads.q, laws.on
    if first:
        lines.torque[k] = own.torque[k]
    for j in range(q.shape[1]):
        q[0, j] += lines.torque[k] * on[k, j]
        q[1, j] += lines.torque[k] * on[k, j]


@njit(**INLINED)
def heat_error(k: int, d: float, laws: Laws, moving: Moving, before: State, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of the power of a HEAT after a part of d of a step, and set it to the power that was lost."""
    state, source = moving.state, laws.element[k]
    m, slots, n = state.mode.shape[0], lines.kc.shape[1], state.v.shape[0]
    lost = total = 0.0
    if source < m:
        total = state.el[E_FRIC, source] + state.el[E_VISC, source]
        lost = state.el[E_FRIC, source] - before.el[E_FRIC, source] + state.el[E_VISC, source] - before.el[E_VISC, source]
    else:
        law = source - m - slots
        row = laws.slot[law] if law >= 0 else source - m
        if row >= 0:
            total = state.shaft[E_SHAFT, row]
            lost = total - before.shaft[E_SHAFT, row]
        if law >= 0 and laws.kind[law] == SHAFT:
            for i in range(laws.first_spring[law], laws.first_spring[law + 1]):
                lost += sliding_heat(laws.springs[i, 0], laws.springs[i, 1], moving.own.spring[i], state.twist[row])
        elif law >= 0:
            at, on = places(n, m, slots, moving.loss.shape[0]), laws.on[law]
            begin, end = lines.push[0, law], lines.push[1, law]
            for j in range(n):
                turned = on[j] * (state.twist[slots + j] - before.twist[slots + j])
                lost -= 0.5 * (begin + end) * turned + (end - begin) * on[j] * state.work[at.lag + j]
            if row >= 0:
                lost += 0.5 * lines.kc[0, row] * state.twist[row] * state.twist[row]
    error = max(0.0, abs(lost / d - lines.torque[k]) - ROUNDING * abs(total) / d)
    lines.torque[k] = lost / d
    return error, 1.0 + abs(lines.torque[k])
