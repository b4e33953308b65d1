# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The step of a driveline with laws, which replaces the bare step where a description has them.

driveline/run.py and driveline/driven.py, for the engine of a rig, use it. In a step a law is replaced by the straight
line with the law's mean over the change of its argument, and the slope of this line is in the implicit matrix of
driveline/kernel.py. The change is not known in advance: the step is repeated until the change equals the one for which the
lines were made, which in most steps is so at once. Where repeating does not help, the step is halved.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.compiled import INLINED, INNER, intrinsic, njit, types
from rig_nodes.driveline.algebra import (
    E_FRIC,
    E_SHAFT,
    E_VISC,
    FIRST,
    HI0,
    IMPULSE,
    KIN0,
    LAM,
    LO0,
    N_CAPPED,
    TAU,
    VISC,
    lin,
    noinline,
)
from rig_nodes.driveline.bends import bend_inside, longest_part
from rig_nodes.driveline.calls import ARGUMENTS, address_of, array_types, bare_step, calling
from rig_nodes.driveline.joint import JAMMED
from rig_nodes.driveline.laws import CAPACITY, FRICTION, INERTIA, MOTION, SHAFT, TORQUE, Laws, LawState, law_state, laws_of
from rig_nodes.driveline.losses import LAST
from rig_nodes.driveline.motion import accelerations_of, drive, hold, impulse_of, invert, moved_by, product, work_of
from rig_nodes.driveline.tables import Tables, along, line, piece, value

if TYPE_CHECKING:
    from collections.abc import Callable

    from llvmlite import ir
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base.arrays import Floats, Ints

CLOSE = 1e-11  # relative tolerance of torques between the lines of a step and those for its final change of the arguments
TRIES, HALVINGS, FAILURES = 30, 12, 16


@njit(**INNER)
def spring_with_friction(stiffness: float, limit: float, torque: float, dx: float) -> tuple[float, float]:
    """Return (slope of the straight line from a torque with the spring's mean over a twist dx, torque after that twist)."""
    noinline()
    way = dx if dx >= 0.0 else -dx
    towards = torque if dx >= 0.0 else -torque
    room = max(0.0, (limit - towards) / stiffness)
    if way <= room or way < 1e-30:
        return stiffness, torque + stiffness * dx
    gained = room * 0.5 * (limit - towards) + (way - room) * (limit - towards)
    return 2.0 * gained / (way * way), limit if dx >= 0.0 else -limit


@njit(**INNER)
def in_contact(gap: float, x: float, dx: float) -> float:
    """Return the share of the twist from x to x + dx that lies outside the backlash, which reaches from -gap to gap."""
    noinline()
    if gap == 0.0:
        return 1.0
    low, high = min(x, x + dx), max(x, x + dx)
    if low == high:
        return 1.0 if x >= gap or x <= -gap else 0.0
    return 1.0 - max(0.0, min(high, gap) - max(low, -gap)) / (high - low)


@njit(**INNER)
def contact_damping(damping: float, gap: float, x: float, dx: float, push: float, slope: float, rate: float) -> float:
    """Return the damping of a shaft over the twist from x to x + dx; a contact at an end of its backlash only pushes.

    While a contact opens, the torque is zero from the twist on at which the damping would exceed the torque of the spring, as in
    the Modelica Standard Library's ElastoBacklash2. The energy that the spring still has there is lost.

    Parameters
    ----------
    damping, gap : float
        Damping in contact [Nm s/rad] and half the backlash [rad].
    x, dx : float
        Twist at the start, and its change [rad].
    push, slope : float
        Torque of the characteristic at the start [Nm], and its mean slope over the change [Nm/rad].
    rate : float
        Mean rate of the twist [rad/s].

    Returns
    -------
    float
        The damping [Nm s/rad] whose mean torque over the change is that of the contact.
    """
    noinline()
    found = damping * in_contact(gap, x, dx)
    if gap == 0.0 or (x + 0.5 * dx) * rate >= 0.0:
        return found
    side = 1.0 if x + 0.5 * dx > 0.0 else -1.0
    first = side * (push + found * rate)
    last = first + side * slope * dx
    if first >= 0.0 and last >= 0.0:
        return found
    mean = 0.0
    if first > 0.0:
        mean = 0.5 * first * first / (first - last)
    elif last > 0.0:
        mean = 0.5 * last * last / (last - first)
    # where the contact opens within the change, the line is only the mean of the characteristic
    return min(found, max(0.0, (side * mean - push - 0.5 * slope * dx) / rate))


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
def capacity_at(tables: Tables, k: int, x: float) -> float:
    """Return the factor on a capacity at x.

    The slip of a locked clutch, and the change of angle of a body that it holds, are of rounding size and of either sign. Where the
    table goes through 0 there, this rounding must not open and close the clutch in turn.
    """
    noinline()
    factor = value(tables, k, x)
    return factor if factor > least_capacity(tables, k, x) else 0.0


@njit(**INLINED)
def put(to: Floats | Ints, what: Floats | Ints) -> None:
    """Copy the numbers of an array into another one, both C-contiguous."""
    # reshape would make numba count one more reference to the memory, which takes longer than the copy
    for i in range(to.size):
        to.flat[i] = what.flat[i]


@njit(**INNER)
def restore(
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    count: Ints,
    loss0: Floats,
    v0: Floats,
    twist0: Floats,
    mode0: Ints,
    el0: Floats,
    shaft0: Floats,
    e_in0: Floats,
    count0: Ints,
) -> None:
    """Restore what a step has changed from the copies that were made before it."""
    noinline()
    put(loss, loss0)
    put(v, v0)
    put(twist, twist0)
    put(mode, mode0)
    put(el, el0)
    put(shaft, shaft0)
    put(e_in, e_in0)
    put(count, count0)


@njit(**INNER)
def share_of(first: float, last: float, begin: float, end: float) -> tuple[float, float]:
    """Return the values at two shares, begin and end, of a straight line between two numbers."""
    noinline()
    return lin(first, last, begin), lin(first, last, end)


@njit(**INNER)
def mobility_of(of: Floats, inverse: Floats) -> float:
    """Return the acceleration of a twist with the coefficients `of` (n,) by a torque [1/(kg m2)]."""
    noinline()
    total = 0.0
    for i in range(of.shape[0]):
        total += of[i] * product(inverse[i], of)
    return total


@njit(**INNER)
def resolved(laws: Laws, own: LawState, minv: Floats, v: Floats, left: float, h: float) -> float:
    """Return the part of the time left in a step h that resolves the oscillations of all shafts with a characteristic."""
    noinline()
    part = left
    for k in range(laws.kind.shape[0]):
        if laws.kind[k] == SHAFT:
            stiffness = 0.0
            for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
                stiffness += laws.springs[i, 0]
            rate = product(laws.of[k], v)
            part = min(part, longest_part(laws.tables, k, own.at[k], rate, stiffness, mobility_of(laws.of[k], minv), h))
    return part if part >= left else left / math.ceil(left / part * (1.0 - 1e-9))


@njit(**INNER)
def law_step(
    bare: int,
    h: float,
    t: float,
    laws: Laws,
    own: LawState,
    given: Floats,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
) -> bool:
    """Take a step like `driveline_step`, whose address is `bare`, with laws.

    `given` (3, inputs) are the inputs of the laws at both ends, and by how much they are above the mean of these in the middle.
    Returns False where a law was not met.
    """
    noinline()
    met = True
    done, size, cuts, most, failed = 0.0, h, 0, 6 * mode.shape[0] + 12, 0
    while done < h:
        left = h - done
        d = min(size, resolved(laws, own, minv, v, left, h))
        if d >= left * (1.0 - 1e-9):
            d = left
        end = 1.0 if d == left else (done + d) / h
        # once halving has not helped, the rest of the step is taken even if the laws are not met
        last = not met or d <= h * 0.5**HALVINGS or failed >= FAILURES
        reached = try_step(
            bare,
            d,
            t + done,
            done / h,
            end,
            last,
            cuts < most and d > 1e-9 * h,
            laws,
            own,
            given,
            mass,
            minv,
            w,
            sh,
            kc,
            q,
            cap,
            loss,
            v,
            twist,
            mode,
            el,
            shaft,
            e_in,
            events,
            count,
            work,
        )
        if 0.0 < reached < d:
            size = reached
            cuts += 1
        elif reached == d or last:
            met = met and reached == d
            done = h if d == left else done + d
            size = h if cuts > 0 or not met else 2.0 * d
        else:
            size = 0.5 * d
            failed += 1
    return met


@njit(**INNER)
def try_step(
    bare: int,
    d: float,
    t: float,
    begin: float,
    end: float,
    keep: bool,
    cut: bool,
    laws: Laws,
    own: LawState,
    given: Floats,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
) -> float:
    """Take a part d of a step, from its share begin to its share end, and return d if the laws are met.

    Otherwise it returns 0, and nothing has changed unless keep is true. With cut true it also returns less than d, and nothing has
    changed, where a shaft passes a bend, or where modes change during a prescribed motion: the next part then has the returned
    length, so that a bend lies at an end of a part, and that the work of the motion is computed over a part without a change of
    modes.
    """
    noinline()
    n, m, slots, rows = v.shape[0], mode.shape[0], sh.shape[0], laws.kind.shape[0]
    loss0 = loss.copy()
    v0, twist0, mode0, el0, shaft0, e_in0 = v.copy(), twist.copy(), mode.copy(), el.copy(), shaft.copy(), e_in.copy()
    count0 = count.copy()
    qq, cc, kk = np.empty((2, n)), np.empty((7, m)), np.empty((2, slots))
    held, inverse = np.empty((n, n)), minv
    slope, torque, other, way = np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros(rows)
    start = np.zeros(rows)
    heavy = driven = False
    for k in range(rows):
        rate = product(laws.of[k], v0)
        if laws.angle[k]:
            start[k] = own.at[k]
            way[k] = d * rate + own.way[k] * d * d
        else:
            start[k] = rate
            way[k] = own.way[k] * d
        heavy = heavy or laws.kind[k] == INERTIA
        driven = driven or laws.kind[k] == MOTION
    moved, gains, pushes, inert = np.zeros(0), np.zeros((2, 0)), qq, mass
    if driven:
        moved, gains, pushes, inverse = np.zeros(n), np.zeros((2, n)), np.empty((2, n)), np.empty((n, n))
        for k in range(rows):
            if laws.kind[k] == MOTION:
                j = moved_by(laws.on[k])
                moved[j] = 1.0
                first, final = accelerations_of(given, laws.factor[k], begin, end, d, laws.on[k, j] * v0[j])
                gains[0, j], gains[1, j] = first / laws.on[k, j], final / laws.on[k, j]
        if not heavy:
            hold(mass, moved, inverse)
    met = False
    for attempt in range(TRIES):
        if attempt > 0:
            restore(loss, v, twist, mode, el, shaft, e_in, count, loss0, v0, twist0, mode0, el0, shaft0, e_in0, count0)
        for j in range(n):
            qq[0, j], qq[1, j] = share_of(q[0, j], q[1, j], begin, end)
        for f in range(m):
            for row in (KIN0, LO0, HI0):
                cc[row, f], cc[row + 1, f] = share_of(cap[row, f], cap[row + 1, f], begin, end)
            cc[VISC, f] = cap[VISC, f]
        put(kk, kc)
        if heavy:
            put(held, mass)
        for k in range(rows):
            kind, slot, f, x, dx = laws.kind[k], laws.slot[k], laws.element[k], start[k], way[k]
            g0, g1 = 1.0, 1.0
            if laws.factor[k] >= 0:
                g0, g1 = share_of(given[0, laws.factor[k]], given[1, laws.factor[k]], begin, end)
            if kind == CAPACITY:
                other[k] = capacity_at(laws.tables, k, x + dx)
                c0 = capacity_at(laws.tables, k, x)
                for row in (KIN0, LO0, HI0):
                    cc[row, f] *= c0
                    cc[row + 1, f] *= other[k]
            elif kind == FRICTION:
                a0, a1 = abs(x), abs(x + dx)
                mu = value(laws.tables, k, a0)
                if abs(a1 - a0) > 1e-9 * (1.0 + a0):
                    slope[k] = (value(laws.tables, k, a1) - mu) / (a1 - a0)
                else:
                    slope[k] = along(laws.tables, k, a0, 1e-9)[1]
                mean = 0.5 * (cc[KIN0, f] + cc[KIN0 + 1, f])
                other[k] = mean
                at_rest = value(laws.tables, k, 0.0)
                for end_ in range(2):
                    kin = cc[KIN0 + end_, f]
                    cc[KIN0 + end_, f] = kin * mu - mean * slope[k] * a0
                    cc[LO0 + end_, f] *= at_rest
                    cc[HI0 + end_, f] *= at_rest
                cc[VISC, f] += mean * slope[k]
            elif kind == SHAFT:
                torque[k], slope[k] = along(laws.tables, k, x, dx)
                other[k] = contact_damping(laws.damping[k], laws.gap[k], x, dx, torque[k], slope[k], dx / d)
                for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
                    torque[k] += own.spring[i]
                    slope[k] += spring_with_friction(laws.springs[i, 0], laws.springs[i, 1], own.spring[i], dx)[0]
                kk[0, slot], kk[1, slot] = slope[k], other[k]
                twist[slot] = 0.0
                for j in range(n):
                    qq[0, j] -= torque[k] * sh[slot, j]
                    qq[1, j] -= torque[k] * sh[slot, j]
            elif kind == TORQUE:
                torque[k], slope[k] = along(laws.tables, k, x, dx)
                push0, push1 = g0 * torque[k], g1 * torque[k]
                if slot < 0:
                    push1 += g1 * slope[k] * dx
                else:
                    implicit_slope = 0.5 * (g0 + g1) * slope[k]
                    twist[slot] = 0.0
                    kk[0, slot], kk[1, slot] = 0.0, 0.0
                    if laws.angle[k]:
                        kk[0, slot] = -implicit_slope
                    else:
                        kk[1, slot] = -implicit_slope
                        push0 -= implicit_slope * x
                        push1 -= implicit_slope * x
                for j in range(n):
                    qq[0, j] += push0 * laws.on[k, j]
                    qq[1, j] += push1 * laws.on[k, j]
            elif kind == INERTIA:
                j0, j1 = value(laws.tables, k, x), value(laws.tables, k, x + dx)
                bend = (j1 - j0) / dx if abs(dx) > 1e-9 else along(laws.tables, k, x, 1e-9)[1]
                w0 = product(laws.on[k], v0)
                w1 = w0 if attempt == 0 else slope[k]
                torque[k] = 0.25 * bend * (w0 * w0 + w1 * w1)
                other[k] = 0.5 * (j0 + j1)
                for i in range(n):
                    qq[0, i] -= torque[k] * laws.on[k, i]
                    qq[1, i] -= torque[k] * laws.on[k, i]
                    for j in range(n):
                        held[i, j] += other[k] * laws.on[k, i] * laws.on[k, j]
        if driven:
            put(pushes, qq)
            if heavy:
                inert = held.copy()
            drive(inert, moved, gains, qq)
        if heavy:
            inverse = np.empty((n, n))
            if driven:
                hold(held, moved, inverse)
            else:
                invert(held, inverse)
            work[0] = -1.0
        work[1] = -1.0
        bare_step(bare, d, t, inverse, w, sh, kk, qq, cc, loss, v, twist, mode, el, shaft, e_in, events, count, work)
        met = True
        for k in range(rows):
            kind, slot, x = laws.kind[k], laws.slot[k], start[k]
            if laws.angle[k]:
                dx = 0.0
                if slot >= 0:
                    dx = twist[slot]
                else:
                    for j in range(n):
                        dx += laws.of[k, j] * (twist[slots + j] - twist0[slots + j])
            else:
                dx = product(laws.of[k], v) - x
            error, scale = 0.0, 1.0
            if kind == CAPACITY:
                asked = capacity_at(laws.tables, k, x + dx)
                error, scale = abs(asked - other[k]), asked
                # a capacity of 0 counts as equal to the smallest one that is more than rounding
                if min(asked, other[k]) == 0.0 and error <= 2.0 * least_capacity(laws.tables, k, x + dx):
                    error = 0.0
            elif kind == FRICTION:
                a0, a1 = abs(x), abs(x + dx)
                if abs(a1 - a0) > 1e-9 * (1.0 + a0):
                    asked = (value(laws.tables, k, a1) - value(laws.tables, k, a0)) / (a1 - a0)
                    error, scale = other[k] * abs((asked - slope[k]) * (a1 - a0)), 1.0 + other[k]
            elif kind == SHAFT:
                first, asked = along(laws.tables, k, x, dx)
                damped = contact_damping(laws.damping[k], laws.gap[k], x, dx, first, asked, dx / d)
                for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
                    asked += spring_with_friction(laws.springs[i, 0], laws.springs[i, 1], own.spring[i], dx)[0]
                rate = product(laws.of[k], v)
                error = abs((asked - slope[k]) * dx)
                error += abs((damped - other[k]) * dx / d)
                scale = 1.0 + abs(torque[k]) + abs(asked * dx)
            elif kind == TORQUE:
                _, asked = along(laws.tables, k, x, dx)
                error, scale = abs(asked * dx - slope[k] * (dx if slot >= 0 else way[k])), 1.0 + abs(torque[k])
            elif kind == INERTIA:
                j0, j1 = value(laws.tables, k, x), value(laws.tables, k, x + dx)
                w0, w1 = product(laws.on[k], v0), product(laws.on[k], v)
                bend = (j1 - j0) / dx if abs(dx) > 1e-9 else along(laws.tables, k, x, 1e-9)[1]
                error = abs(0.25 * bend * (w0 * w0 + w1 * w1) - torque[k]) + abs(0.5 * (j0 + j1) - other[k]) * abs(w1 - w0) / d
                scale = 1.0 + abs(torque[k])
                slope[k] = w1
            met = met and error <= CLOSE * scale
            way[k] = dx
        # where the kernel could not decide which elements stick, more attempts at the same part take long and do not help
        if met or (attempt >= 3 and count[N_CAPPED] > count0[N_CAPPED]):
            break
    since = work[FIRST]
    # where an impulse has acted, the work of a motion follows from the balance of energy only, however short the step
    struck = since == JAMMED
    inside = 1e-9 * d < since < d * (1.0 - 1e-9)
    bends = False
    if cut and met:
        for k in range(rows):
            if laws.kind[k] == SHAFT:
                mobility = mobility_of(laws.of[k], inverse)
                first, final = product(laws.of[k], v0), product(laws.of[k], v)
                at_bend = bend_inside(laws.tables, k, laws.gap[k], laws.damping[k], start[k], way[k], first, final, d, mobility)
                if at_bend < since:
                    since, bends = at_bend, True
        bends = bends and 1e-9 * d < since < d * (1.0 - 1e-9)
        inside = inside or bends
    if (met and cut and inside and (driven or bends)) or not (met or keep):
        restore(loss, v, twist, mode, el, shaft, e_in, count, loss0, v0, twist0, mode0, el0, shaft0, e_in0, count0)
        return since if met else 0.0
    if driven:
        gained, turned, before = np.empty(n), np.empty(n), twist0[:slots].copy()
        others = 0.0
        for j in range(n):
            gained[j], turned[j] = v[j] - v0[j], twist[slots + j] - twist0[slots + j]
            others += 0.5 * (pushes[0, j] + pushes[1, j]) * turned[j]
            e_in[j] = e_in0[j] + 0.5 * (pushes[0, j] + pushes[1, j]) * turned[j]
        for k in range(rows):
            if laws.slot[k] >= 0:
                before[laws.slot[k]] = 0.0
        for k in range(rows):
            if laws.kind[k] == MOTION:
                j = moved_by(laws.on[k])
                impulse = impulse_of(j, d, inert, w, sh, kk, pushes, cc, gained, turned, el[IMPULSE] - el0[IMPULSE], before, twist)
                own.torque[k] = impulse / d / laws.on[k, j]
                if not (inside or struck):
                    own.work[0] += impulse / d * turned[j]
        if inside or struck:
            own.work[0] += work_of(inert, kk, v0, v, before, twist, el0, el, shaft0, shaft, others)
    for k in range(rows):
        kind, slot, f, x, dx = laws.kind[k], laws.slot[k], laws.element[k], start[k], way[k]
        g1 = lin(given[0, laws.factor[k]], given[1, laws.factor[k]], end) if laws.factor[k] >= 0 else 1.0
        rate = product(laws.of[k], v0)
        if laws.angle[k]:
            own.at[k] = x + dx
            own.way[k] = (product(laws.of[k], v) - rate) / (2.0 * d)
        else:
            own.way[k] = dx / d
        if kind == CAPACITY:
            own.torque[k] = value(laws.tables, k, x + dx)
        elif kind == FRICTION:
            # the kernel counted friction over slip as drag
            drag = el[E_VISC, f] - el0[E_VISC, f]
            share = (cc[VISC, f] - cap[VISC, f]) / cc[VISC, f] if cc[VISC, f] != 0.0 else 0.0
            el[E_VISC, f] -= share * drag
            el[E_FRIC, f] += share * drag
            turned = 0.0
            for j in range(n):
                turned += laws.of[k, j] * (twist[slots + j] - twist0[slots + j])
            el[IMPULSE, f] += (cc[VISC, f] - cap[VISC, f]) * turned
            el[LAM, f] += (cc[VISC, f] - cap[VISC, f]) * product(laws.of[k], v)
            own.torque[k] = value(laws.tables, k, abs(x + dx))
        elif kind == SHAFT:
            own.work[0] += torque[k] * dx
            own.torque[k] = value(laws.tables, k, x + dx)
            rate = product(laws.of[k], v)
            damped = contact_damping(laws.damping[k], laws.gap[k], x + dx, 0.0, own.torque[k], 0.0, rate)
            for i in range(laws.first_spring[k], laws.first_spring[k + 1]):
                stiffness = laws.springs[i, 0]
                was = own.spring[i]
                by, own.spring[i] = spring_with_friction(stiffness, laws.springs[i, 1], was, dx)
                shaft[E_SHAFT, slot] += (was + 0.5 * by * dx) * dx - 0.5 * (own.spring[i] ** 2 - was**2) / stiffness
                own.torque[k] += own.spring[i]
            shaft[TAU, slot] = own.torque[k] + damped * rate
            twist[slot] = x + dx
        elif kind == TORQUE:
            own.torque[k] = g1 * value(laws.tables, k, x + dx)
            if slot >= 0:
                if laws.angle[k]:
                    own.work[0] -= 0.5 * kk[0, slot] * dx * dx
                own.work[0] -= shaft[E_SHAFT, slot] - shaft0[E_SHAFT, slot]
        elif kind == INERTIA:
            own.work[0] += torque[k] * dx
            own.torque[k] = value(laws.tables, k, x + dx)
    if not met:
        count[N_CAPPED] += 1
        return 0.0
    return d


@njit(**INNER)
def settle(
    bare: int,
    d: float,
    t: float,
    laws: Laws,
    own: LawState,
    given: Floats,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    work: Floats,
) -> None:
    """Set `loss` to the losses by torque that belong to the inputs at the start of a step, where these have jumped."""
    noinline()
    count, events = np.zeros(2, np.int64), np.zeros((0, 3))
    qq, cc, gg = q.copy(), cap.copy(), given.copy()
    put(qq[1], q[0])
    put(gg[1], given[0])
    for row in (KIN0, LO0, HI0):
        put(cc[row + 1], cap[row])
    for k in range(loss.shape[0]):
        loss[k, LAST] = 0.0
    work[1] = -1.0
    copy = LawState(own.at.copy(), own.torque.copy(), own.spring.copy(), own.way.copy(), own.work.copy())
    law_step(
        bare,
        d,
        t,
        laws,
        copy,
        gg,
        mass,
        minv,
        w,
        sh,
        kc,
        qq,
        cc,
        loss,
        v.copy(),
        twist.copy(),
        mode.copy(),
        el.copy(),
        shaft.copy(),
        e_in.copy(),
        events,
        count,
        work,
    )
    work[1] = -1.0


@njit(**INNER)
def jumped(q: Floats, q_before: Floats, cap: Floats, cap_before: Floats) -> bool:
    """Return whether torques or capacities at a step's start differ from the end of the last step by more than rounding."""
    for j in range(q.shape[1]):
        if differ(q[0, j], q_before[j]):
            return True
    for f in range(cap.shape[1]):
        for row in (KIN0, LO0, HI0):
            if differ(cap[row, f], cap_before[row + 1, f]):
                return True
    return False


@njit(**INNER)
def differ(one: float, other: float) -> bool:
    """Return whether two numbers differ by more than rounding; two equal infinities do not differ."""
    return one != other and not abs(one - other) <= 1e-9 * (1.0 + min(abs(one), abs(other)))


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def settled_step(
    bare: int,
    h: float,
    t: float,
    fresh: bool,
    laws: Laws,
    own: LawState,
    given: Floats,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
) -> int:
    """Take a step like `law_step`; where inputs have jumped (fresh), recompute the losses by torque before it.

    It counts a step as capped at most once.
    """
    if loss.shape[0] > 0 and fresh:
        settle(bare, 1e-6 * h, t, laws, own, given, mass, minv, w, sh, kc, q, cap, loss, v, twist, mode, el, shaft, e_in, work)
    capped = count[N_CAPPED] + 1
    law_step(
        bare, h, t, laws, own, given, mass, minv, w, sh, kc, q, cap, loss, v, twist, mode, el, shaft, e_in, events, count, work
    )
    count[N_CAPPED] = min(count[N_CAPPED], capped)
    return int(0)


@cache
def settled_types() -> tuple:
    """Return the types of the arguments of `settled_step`."""
    from numba import typeof

    times = types.int64, types.float64, types.float64, types.boolean
    return (*times, typeof(laws_of([], 1)), typeof(law_state([])), *array_types({"given": 2, "mass": 2, **ARGUMENTS}))


@cache
def settled_address() -> int:
    """Return the address of `settled_step`."""
    return address_of(settled_step, settled_types())


@intrinsic
def settled_step_at(
    context: TypingContext,
    address: types.Type,
    bare: types.Type,
    h: types.Type,
    t: types.Type,
    fresh: types.Type,
    laws: types.Type,
    own: types.Type,
    given: types.Type,
    mass: types.Type,
    minv: types.Type,
    w: types.Type,
    sh: types.Type,
    kc: types.Type,
    q: types.Type,
    cap: types.Type,
    loss: types.Type,
    v: types.Type,
    twist: types.Type,
    mode: types.Type,
    el: types.Type,
    shaft: types.Type,
    e_in: types.Type,
    events: types.Type,
    count: types.Type,
    work: types.Type,
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Call `settled_step` by its address."""
    return calling(settled_types())


@njit(cache=True, error_model="numpy", nogil=True)
def run_laws(
    settled: int,
    bare: int,
    t: Floats,
    laws: Laws,
    own: LawState,
    given: Floats,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
    out_v: Floats,
    out_twist: Floats,
    out_mode: Ints,
    out_el: Floats,
    out_shaft: Floats,
    out_e_in: Floats,
    out_torque: Floats,
    out_at: Floats,
    out_spring: Floats,
    out_work: Floats,
) -> None:
    """Take a step to each time after the first and record the state there; settled and bare are addresses."""
    for i in range(q.shape[0]):
        fresh = i == 0 or jumped(q[i], q[i - 1, 1], cap[i], cap[i - 1])
        settled_step_at(
            settled,
            bare,
            t[i + 1] - t[i],
            t[i],
            fresh,
            laws,
            own,
            given[i],
            mass,
            minv,
            w,
            sh,
            kc,
            q[i],
            cap[i],
            loss,
            v,
            twist,
            mode,
            el,
            shaft,
            e_in,
            events,
            count,
            work,
        )
        put(out_v[i], v)
        put(out_twist[i], twist)
        put(out_mode[i], mode)
        put(out_el[i], el)
        put(out_shaft[i], shaft)
        put(out_e_in[i], e_in)
        put(out_torque[i], own.torque)
        put(out_at[i], own.at)
        put(out_spring[i], own.spring)
        put(out_work[i], own.work)
