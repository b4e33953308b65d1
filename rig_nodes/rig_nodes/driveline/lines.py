# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The straight lines that replace the laws of a driveline in a part of a step, and what the laws are after it.

Used by driveline/law_steps.py. A line has the law's mean over the expected change of its argument. Its slope is in the matrix of
the bare step where the law has a row among the shafts or is friction over slip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import E_FRIC, E_SHAFT, E_VISC, HI0, IMPULSE, KIN0, LAM, LO0, TAU, VISC, lin, noinline
from rig_nodes.driveline.contacts import contact_damping, sliding_heat, spring_with_friction
from rig_nodes.driveline.heat import heat_error, heat_line
from rig_nodes.driveline.laws import (
    ANGLE,
    ARGUMENT,
    CAPACITY,
    FRICTION,
    GEARING,
    HEAT,
    INERTIA,
    INPUT,
    MOTION,
    RATIO,
    SHAFT,
    TEETH,
    TIME,
    TORQUE,
    Laws,
)
from rig_nodes.driveline.maps import argument, map_error, map_line, ratio_of
from rig_nodes.driveline.motion import product
from rig_nodes.driveline.state import Loads, put
from rig_nodes.driveline.tables import Tables, along, curves_at, line, over_two, piece, value
from rig_nodes.driveline.teeth import teeth_error, teeth_line
from rig_nodes.driveline.variators import own_speed, ratio_error, ratio_line

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.laws import Given, LawState, Model, Moving
    from rig_nodes.driveline.state import State

CLOSE = 1e-11  # relative tolerance of torques between the lines of a step and those for its final change of the arguments


class Part(NamedTuple):
    """A part of a step.

    Parameters
    ----------
    d, t : float
        Its length and the time at its start [s].
    begin, end : float
        Shares of the step at which it begins and ends.
    """

    d: float
    t: float
    begin: float
    end: float


class Lines(NamedTuple):
    """The lines of all laws in a part of a step, and what the bare step gets instead of the laws.

    Parameters
    ----------
    start, way : (laws,) arrays
        Argument at the start, and its expected change.
    slope, torque, other : (laws,) arrays
        Of a CAPACITY `other` is the factor at the end; of FRICTION `slope` is that over slip and `other` the mean capacity; of a
        SHAFT, a TORQUE and an INERTIA `torque` is that at the start; `slope` is that over the argument, of an INERTIA the expected
        speed at the end; `other` is the damping of a SHAFT and the mean of an INERTIA; `torque` of a HEAT is its mean power;
        `torque` and `other` of TEETH are both efficiencies. Those of a torque over two arguments are described in driveline.maps.
    push : (2, laws) array
        Of a TORQUE what is on the speeds at both ends.
    loads : Loads
        Forces and capacities over the part, with the laws.
    kc : (2, s) array
        Stiffness and damping of the shafts, with the laws.
    held : (n, n) array
        Mass matrix with the inertias of laws; made only where there are some.
    w : (m, n) array
        Slips by the speeds, with the present ratios of gears whose ratio varies.
    """

    start: Floats
    way: Floats
    slope: Floats
    torque: Floats
    other: Floats
    push: Floats
    loads: Loads
    kc: Floats
    held: Floats
    w: Floats


@njit(**INNER)
def least_capacity(tables: Tables, k: int, x: float) -> float:
    """Return the smallest value of a capacity's table near x that is more than the effect of the rounding of x."""
    noinline()
    most = 0.0
    middle = piece(tables, k, x)
    for number in range(middle - 1, middle + 2):
        begin, end, height, point, rise = line(tables, k, number)
        most = max(most, abs(height))
        if end - begin < np.inf:
            most = max(most, abs(height + rise * (end - point)))
    return CLOSE * most


@njit(**INNER)
def capacity_at(laws: Laws, k: int, x: float, lines: Lines, last: bool) -> tuple[float, float]:
    """Return the factor on a capacity at x, and the smallest one that counts; `last` is whether its other argument is at its end.

    The slip of a locked clutch, and the change of angle of a body that it holds, are of rounding size and of either sign. Where the
    table goes through 0 there, this rounding must not open and close the clutch in turn.
    """
    noinline()
    s = laws.second[k]
    if s < 0:
        factor, least = value(laws.tables, k, x), least_capacity(laws.tables, k, x)
    else:
        u = lines.start[s] + (lines.way[s] if last else 0.0)
        first, other, _, _ = curves_at(laws.tables, s, u)
        factor = over_two(laws.tables, s, x, u)[0]
        least = max(least_capacity(laws.tables, first, x), least_capacity(laws.tables, other, x))
    return factor if factor > least else 0.0, least


@njit(**INNER)
def share_of(first: float, last: float, begin: float, end: float) -> tuple[float, float]:
    """Return the values at two shares, begin and end, of a straight line between two numbers."""
    noinline()
    return lin(first, last, begin), lin(first, last, end)


@njit(**INLINED)
def expect(part: Part, laws: Laws, factors: Floats, own: LawState, v: Floats, lines: Lines) -> tuple[bool, bool]:
    """Set the arguments and their expected changes over a part; return if there are inertias, and motions or varying ratios."""
    heavy = driven = False
    for k in range(laws.kind.shape[0]):
        lines.start[k], lines.way[k] = argument(k, part, laws, factors, own, v)
        heavy = heavy or laws.kind[k] == INERTIA
        driven = driven or laws.kind[k] == MOTION or laws.kind[k] == GEARING
    return heavy, driven


@njit(**INLINED)
def capacity_line(k: int, laws: Laws, lines: Lines) -> None:
    """Multiply the capacities of a CAPACITY's element by its factors at both ends."""
    f, cap = laws.element[k], lines.loads.cap
    lines.other[k], _ = capacity_at(laws, k, lines.start[k] + lines.way[k], lines, True)
    c0, _ = capacity_at(laws, k, lines.start[k], lines, False)
    for row in (KIN0, LO0, HI0):
        cap[row, f] *= c0
        cap[row + 1, f] *= lines.other[k]


@njit(**INLINED)
def friction_line(k: int, laws: Laws, lines: Lines) -> None:
    """Turn the friction over slip of an element into a capacity and a drag."""
    f, cap = laws.element[k], lines.loads.cap
    a0, a1 = abs(lines.start[k]), abs(lines.start[k] + lines.way[k])
    mu = value(laws.tables, k, a0)
    if abs(a1 - a0) > 1e-9 * (1.0 + a0):
        lines.slope[k] = (value(laws.tables, k, a1) - mu) / (a1 - a0)
    else:
        lines.slope[k] = along(laws.tables, k, a0, 1e-9)[1]
    mean = 0.5 * (cap[KIN0, f] + cap[KIN0 + 1, f])
    lines.other[k] = mean
    at_rest = value(laws.tables, k, 0.0)
    for end in range(2):
        kin = cap[KIN0 + end, f]
        cap[KIN0 + end, f] = kin * mu - mean * lines.slope[k] * a0
        cap[LO0 + end, f] *= at_rest
        cap[HI0 + end, f] *= at_rest
    cap[VISC, f] += mean * lines.slope[k]


@njit(**INLINED)
def shaft_line(k: int, d: float, laws: Laws, own: LawState, sh: Floats, lines: Lines) -> None:
    """Put the torque of a shaft at the start on the speeds, and its slope and damping into its row."""
    x, dx, slot, q = lines.start[k], lines.way[k], laws.slot[k], lines.loads.q
    lines.torque[k], lines.slope[k] = along(laws.tables, k, x, dx)
    lines.other[k] = contact_damping(laws.damping[k], laws.gap[k], x, dx, lines.torque[k], lines.slope[k], dx / d)
    for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
        lines.torque[k] += own.spring[i]
        lines.slope[k] += spring_with_friction(laws.springs[i, 0], laws.springs[i, 1], own.spring[i], dx)[0]
    lines.kc[0, slot], lines.kc[1, slot] = lines.slope[k], lines.other[k]
    for j in range(q.shape[1]):
        q[0, j] -= lines.torque[k] * sh[slot, j]
        q[1, j] -= lines.torque[k] * sh[slot, j]


@njit(**INLINED)
def torque_line(k: int, g0: float, g1: float, laws: Laws, lines: Lines) -> None:
    """Put a torque with the factors g0 and g1 at both ends on the speeds, and its slope into its row where it has one."""
    x, dx, slot, q = lines.start[k], lines.way[k], laws.slot[k], lines.loads.q
    lines.torque[k], lines.slope[k] = along(laws.tables, k, x, dx)
    push0, push1 = g0 * lines.torque[k], g1 * lines.torque[k]
    if slot < 0:
        push1 += g1 * lines.slope[k] * dx
    else:
        implicit_slope = 0.5 * (g0 + g1) * lines.slope[k]
        lines.kc[0, slot], lines.kc[1, slot] = 0.0, 0.0
        if laws.by[k] == ANGLE:
            lines.kc[0, slot] = -implicit_slope
        else:
            lines.kc[1, slot] = -implicit_slope
            push0 -= implicit_slope * x
            push1 -= implicit_slope * x
    lines.push[0, k], lines.push[1, k] = push0, push1
    for j in range(q.shape[1]):
        q[0, j] += push0 * laws.on[k, j]
        q[1, j] += push1 * laws.on[k, j]


@njit(**INLINED)
def inertia_bend(k: int, laws: Laws, lines: Lines, dx: float) -> tuple[float, float]:
    """Return the mean of an inertia over a change of its angle [kg m2], and its slope [kg m2/rad]."""
    x = lines.start[k]
    j0, j1 = value(laws.tables, k, x), value(laws.tables, k, x + dx)
    return 0.5 * (j0 + j1), (j1 - j0) / dx if abs(dx) > 1e-9 else along(laws.tables, k, x, 1e-9)[1]


@njit(**INLINED)
def inertia_line(k: int, first: bool, laws: Laws, v: Floats, lines: Lines) -> None:
    """Add an inertia's mean to the mass matrix, and put the torque of its change on the speeds."""
    q, on = lines.loads.q, laws.on
    lines.other[k], bend = inertia_bend(k, laws, lines, lines.way[k])
    w0 = product(on[k], v)
    w1 = w0 if first else lines.slope[k]
    lines.torque[k] = 0.25 * bend * (w0 * w0 + w1 * w1)
    for i in range(q.shape[1]):
        q[0, i] -= lines.torque[k] * on[k, i]
        q[1, i] -= lines.torque[k] * on[k, i]
        for j in range(q.shape[1]):
            lines.held[i, j] += lines.other[k] * on[k, i] * on[k, j]


@njit(**INLINED)
def make_lines(part: Part, attempt: int, heavy: bool, model: Model, given: Given, moving: Moving, lines: Lines) -> None:
    """Set what the bare step gets for a part of a step; the twists of laws with a row begin at 0.

    Parameters
    ----------
    part : Part
        The part.
    attempt : int
        How often it has been tried.
    heavy : bool
        Whether there are inertias among the laws.
    model, given, moving : Model, Given, Moving
        The driveline at the part's start.
    lines : Lines
        The lines, with arguments and expected changes; the rest is set.
    """
    laws, sh, cap, state = model.laws, model.structure.sh, given.loads.cap, moving.state
    for j in range(state.v.shape[0]):
        lines.loads.q[0, j], lines.loads.q[1, j] = share_of(given.loads.q[0, j], given.loads.q[1, j], part.begin, part.end)
    for f in range(state.mode.shape[0]):
        for row in (KIN0, LO0, HI0):
            lines.loads.cap[row, f], lines.loads.cap[row + 1, f] = share_of(cap[row, f], cap[row + 1, f], part.begin, part.end)
        lines.loads.cap[VISC, f] = cap[VISC, f]
    put(lines.kc, model.structure.kc)
    if heavy:
        put(lines.held, model.mass)
    for k in range(laws.kind.shape[0]):
        kind = laws.kind[k]
        if kind == CAPACITY:
            capacity_line(k, laws, lines)
        elif kind == FRICTION:
            friction_line(k, laws, lines)
        elif kind == SHAFT:
            shaft_line(k, part.d, laws, moving.own, sh, lines)
        elif kind == TORQUE and laws.second[k] >= 0:
            map_line(k, part, attempt == 0, given.factors, laws, moving, lines)
        elif kind == TORQUE:
            g0, g1 = share_of(given.factors[0, laws.factor[k]], given.factors[1, laws.factor[k]], part.begin, part.end)
            torque_line(k, g0, g1, laws, lines)
        elif kind == INERTIA:
            inertia_line(k, attempt == 0, laws, state.v, lines)
        elif kind == GEARING:
            ratio_line(k, part, attempt == 0, given.factors, model, moving, lines)
        elif kind == HEAT:
            heat_line(k, attempt == 0, laws, moving.own, lines)
        elif kind == TEETH:
            teeth_line(k, attempt, laws, lines, moving.loss)
        if laws.slot[k] >= 0:
            state.twist[laws.slot[k]] = 0.0


@njit(**INLINED)
def capacity_error(k: int, dx: float, laws: Laws, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of a CAPACITY over the change dx of its argument."""
    asked, least = capacity_at(laws, k, lines.start[k] + dx, lines, True)
    error = abs(asked - lines.other[k])
    # a capacity of 0 counts as equal to the smallest one that is more than rounding
    if min(asked, lines.other[k]) == 0.0 and error <= 2.0 * least:
        error = 0.0
    return error, asked


@njit(**INLINED)
def friction_error(k: int, dx: float, laws: Laws, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of FRICTION over the change dx of the slip."""
    a0, a1 = abs(lines.start[k]), abs(lines.start[k] + dx)
    if abs(a1 - a0) > 1e-9 * (1.0 + a0):
        asked = (value(laws.tables, k, a1) - value(laws.tables, k, a0)) / (a1 - a0)
        return lines.other[k] * abs((asked - lines.slope[k]) * (a1 - a0)), 1.0 + lines.other[k]
    return 0.0, 1.0


@njit(**INLINED)
def shaft_error(k: int, d: float, dx: float, laws: Laws, own: LawState, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of a SHAFT over the change dx of its twist in the time d."""
    x = lines.start[k]
    first, asked = along(laws.tables, k, x, dx)
    damped = contact_damping(laws.damping[k], laws.gap[k], x, dx, first, asked, dx / d)
    for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
        asked += spring_with_friction(laws.springs[i, 0], laws.springs[i, 1], own.spring[i], dx)[0]
    error = abs((asked - lines.slope[k]) * dx)
    error += abs((damped - lines.other[k]) * dx / d)
    return error, 1.0 + abs(lines.torque[k]) + abs(asked * dx)


@njit(**INLINED)
def inertia_error(k: int, d: float, dx: float, w0: float, w1: float, laws: Laws, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of an INERTIA over the change dx of its angle in the time d, from speed w0 to w1."""
    mean, bend = inertia_bend(k, laws, lines, dx)
    error = abs(0.25 * bend * (w0 * w0 + w1 * w1) - lines.torque[k]) + abs(mean - lines.other[k]) * abs(w1 - w0) / d
    return error, 1.0 + abs(lines.torque[k])


@njit(**INLINED)
def turned_by(k: int, laws: Laws, before: State, state: State, slots: int) -> float:
    """Return the integral of the speed that a law reads over the part of a step [rad]."""
    turned = 0.0
    for j in range(state.v.shape[0]):
        turned += laws.of[k, j] * (state.twist[slots + j] - before.twist[slots + j])
    return turned


@njit(**INLINED)
def change_of(k: int, laws: Laws, before: State, state: State, lines: Lines) -> float:
    """Return by how much the argument of a law has changed in a part of a step."""
    by, slot = laws.by[k], laws.slot[k]
    if by == INPUT or by == TIME:
        return lines.way[k]
    if by == RATIO:
        return ratio_of(laws, k, state.v) - lines.start[k]
    if by != ANGLE:
        return product(laws.of[k], state.v) - lines.start[k]
    if slot >= 0 and laws.second[k] < 0:
        return state.twist[slot]
    return turned_by(k, laws, before, state, lines.kc.shape[1])


@njit(**INLINED)
def worst_law(part: Part, model: Model, given: Given, moving: Moving, before: State, lines: Lines) -> int:
    """Return the law whose line is furthest from that for the change of its argument in a part of a step; -1 where all are met.

    These changes are expected from now on.
    """
    laws, d, state, worst, most = model.laws, part.d, moving.state, int(-1), CLOSE
    for k in range(laws.kind.shape[0]):
        if laws.kind[k] == ARGUMENT:
            lines.way[k] = change_of(k, laws, before, state, lines)
    for k in range(laws.kind.shape[0]):
        kind, slot = laws.kind[k], laws.slot[k]
        if kind == ARGUMENT:
            continue
        dx = change_of(k, laws, before, state, lines)
        error, scale = 0.0, 1.0
        if kind == CAPACITY:
            error, scale = capacity_error(k, dx, laws, lines)
        elif kind == FRICTION:
            error, scale = friction_error(k, dx, laws, lines)
        elif kind == SHAFT:
            error, scale = shaft_error(k, d, dx, laws, moving.own, lines)
        elif kind == TORQUE and laws.second[k] >= 0:
            error, scale = map_error(k, part, dx, given.factors, laws, before, state, lines)
        elif kind == TORQUE:
            asked = along(laws.tables, k, lines.start[k], dx)[1]
            error, scale = abs(asked * dx - lines.slope[k] * (dx if slot >= 0 else lines.way[k])), 1.0 + abs(lines.torque[k])
        elif kind == INERTIA:
            w1 = product(laws.on[k], state.v)
            error, scale = inertia_error(k, d, dx, product(laws.on[k], before.v), w1, laws, lines)
            lines.slope[k] = w1
        elif kind == GEARING:
            error, scale = ratio_error(k, part, dx, given.factors, model, state, lines)
        elif kind == HEAT:
            error, scale = heat_error(k, d, laws, moving, before, lines)
        elif kind == TEETH:
            error, scale = teeth_error(k, dx, laws, state, lines)
        if not error <= most * scale:
            worst, most = k, error / scale
        lines.way[k] = dx
    return worst


@njit(**INLINED)
def leave_friction(k: int, drag: float, laws: Laws, before: State, state: State, lines: Lines) -> None:
    """Count as friction what the bare step has counted as drag of an element; ``drag`` is its own [Nm s/rad]."""
    f, visc, el = laws.element[k], lines.loads.cap[VISC, laws.element[k]], state.el
    heat = el[E_VISC, f] - before.el[E_VISC, f]
    share = (visc - drag) / visc if visc != 0.0 else 0.0
    el[E_VISC, f] -= share * heat
    el[E_FRIC, f] += share * heat
    el[IMPULSE, f] += (visc - drag) * turned_by(k, laws, before, state, lines.kc.shape[1])
    el[LAM, f] += (visc - drag) * product(laws.of[k], state.v)


@njit(**INLINED)
def leave_shaft(k: int, laws: Laws, moving: Moving, lines: Lines) -> None:
    """Set torque, twist and heat of a shaft after a part of a step, and its springs."""
    x, dx, slot, own, state = lines.start[k], lines.way[k], laws.slot[k], moving.own, moving.state
    own.work[0] += lines.torque[k] * dx
    own.torque[k] = value(laws.tables, k, x + dx)
    rate = product(laws.of[k], state.v)
    damped = contact_damping(laws.damping[k], laws.gap[k], x + dx, 0.0, own.torque[k], 0.0, rate)
    for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
        stiffness = laws.springs[i, 0]
        was = own.spring[i]
        _, own.spring[i] = spring_with_friction(stiffness, laws.springs[i, 1], was, dx)
        state.shaft[E_SHAFT, slot] += sliding_heat(stiffness, laws.springs[i, 1], was, dx)
        own.torque[k] += own.spring[i]
    state.shaft[TAU, slot] = own.torque[k] + damped * rate
    state.twist[slot] = x + dx


@njit(**INLINED)
def value_after(k: int, laws: Laws, lines: Lines) -> float:
    """Return the value of a law's table after a part of a step."""
    x, s = lines.start[k] + lines.way[k], laws.second[k]
    return value(laws.tables, k, x) if s < 0 else over_two(laws.tables, s, x, lines.start[s] + lines.way[s])[0]


@njit(**INLINED)
def leave_lines(part: Part, laws: Laws, given: Given, moving: Moving, before: State, lines: Lines) -> None:
    """Set the state of the laws after a part of a step."""
    own, state, factors = moving.own, moving.state, given.factors
    for k in range(laws.kind.shape[0]):
        kind, slot, x, dx = laws.kind[k], laws.slot[k], lines.start[k], lines.way[k]
        if laws.by[k] == ANGLE:
            own.at[k] = x + dx
            own.way[k] = (product(laws.of[k], state.v) - product(laws.of[k], before.v)) / (2.0 * part.d)
        else:
            own.way[k] = dx / part.d
        if kind == CAPACITY:
            own.torque[k] = value_after(k, laws, lines)
        elif kind == FRICTION:
            leave_friction(k, given.loads.cap[VISC, laws.element[k]], laws, before, state, lines)
            own.torque[k] = value(laws.tables, k, abs(x + dx))
        elif kind == SHAFT:
            leave_shaft(k, laws, moving, lines)
        elif kind == TORQUE:
            g1 = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.end)
            own.torque[k] = g1 * value_after(k, laws, lines)
            if laws.second[k] >= 0:
                own.torque[laws.second[k]] = lines.other[k] / part.d
            if slot >= 0:
                own.work[0] -= 0.5 * lines.kc[0, slot] * state.twist[slot] * state.twist[slot]
                own.work[0] -= state.shaft[E_SHAFT, slot] - before.shaft[E_SHAFT, slot]
        elif kind == INERTIA:
            own.work[0] += lines.torque[k] * dx
            own.torque[k] = value(laws.tables, k, x + dx)
        elif kind == GEARING:
            end = lin(factors[0, laws.factor[k]], factors[1, laws.factor[k]], part.end)
            own.torque[k] = end * value(laws.tables, k, x + dx)
            state.v[own_speed(lines.w[laws.element[k]])] = 0.0
        elif kind == HEAT:
            own.torque[k] = lines.torque[k]
