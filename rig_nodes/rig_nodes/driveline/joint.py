# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint decision, at one instant, of which friction elements stick and which slip.

Used by driveline/kernel.py at every event inside a step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.compiled import INLINED, INNER, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    BREAK,
    CLOSE,
    CROSS,
    E_FRIC,
    FIRST,
    FORWARD,
    HELD,
    HI0,
    IMPULSE,
    KIN0,
    KIN1,
    LO0,
    LOCK,
    LOCKED_HIGH,
    LOCKED_LOW,
    N_CAPPED,
    N_EVENTS,
    OPEN,
    RANK,
    STUCK,
    VISC,
    WEAK,
    beyond,
    has_capacity,
    high,
    if_stuck,
    lin,
    low,
    noinline,
    places,
    project,
)
from rig_nodes.driveline.losses import FACTOR, LAST, NEXT, ON, SHARE, WEIGHTS, brakes, put_losses, solve_losses

if TYPE_CHECKING:
    from rig_nodes.base.arrays import Floats, Ints

MOST_SETS = 3**6  # most sets that are tried one by one where the pivots do not end: six elements, each with three modes
SEEN = 1e-10  # rad/s: a slip above this does not come from rounding
JAMMED = -1.0  # marks an element that sticks beyond its limit, and, in work[FIRST], a step in which an impulse has acted


# int() around a constant argument or start value: a literal would make numba compile the callee once more


@njit(**INNER)
def note(t: float, f: int, kind: int, v: Floats, twist: Floats, events: Floats, count: Ints) -> None:
    """Count an event of element f, and write it with speeds [rad/s] and their integrals [rad] to the ring, if it has rows."""
    if events.shape[0] > 0:
        row = count[N_EVENTS] % events.shape[0]
        if events.shape[1] > 3:
            n = v.shape[0]
            first = twist.shape[0] - n
            for j in range(n):
                events[row, 3 + j] = v[j]
                events[row, 3 + n + j] = twist[first + j]
        events[row, 0] = t
        events[row, 1] = f
        events[row, 2] = kind
    count[N_EVENTS] += 1


@njit(**INNER)
def dependent(f: int, w: Floats, minv: Floats, work: Floats, op: int) -> bool:
    """Return whether the elements that are stuck now prevent element f from slipping, so that its slip cannot accelerate.

    The acceleration by prescribed speeds counts as well.
    """
    n = w.shape[1]
    held = 0.0
    alone = 0.0
    size = 0.0
    for i in range(n):
        size = max(size, abs(w[f, i]))
        for j in range(n):
            held += w[f, i] * work[op + i * n + j] * w[f, j]
            alone += w[f, i] * minv[i, j] * w[f, j]
    if held > RANK * alone:
        return False
    for u in range(n):
        if minv[u, u] == HELD:
            slip = 0.0
            for i in range(n):
                slip += w[f, i] * work[op + i * n + u]
            if abs(slip) > 1e-9 * HELD * size:
                return False
    return True


@njit(**INNER)
def hold(minv: Floats, w: Floats, ost: int, work: Floats) -> None:
    """Call `project` for the set of stuck elements at ost, unless P and R belong to this set already."""
    pattern, bit = 1.0, 1.0
    for f in range(w.shape[0]):
        if work[ost + f] == STUCK:
            pattern += bit
        bit *= 2.0
    if work[0] != pattern:
        project(minv, w, ost, work)


@njit(**INNER)
def capture(w: Floats, sh: Floats, mode: Ints, el: Floats, work: Floats) -> None:
    """After a capped step, count as heat the energy that is lost where stuck elements remove more slip than that of rounding.

    An impulse p = G^+ slip takes p slip / 2 from each of them.
    """
    m, n = w.shape
    at = places(n, m, sh.shape[0], int(0))
    row = 0
    for f in range(m):
        if mode[f] == STUCK:
            if abs(work[at.slip + f]) > SEEN:
                impulse = 0.0
                other = 0
                for i in range(m):
                    if mode[i] == STUCK:
                        impulse += work[at.inverse + row * m + other] * work[at.slip + i]
                        other += 1
                el[E_FRIC, f] += 0.5 * impulse * work[at.slip + f]
            row += 1


@njit(**INLINED)
def limited(f: int, cap: Floats, ocand: int, work: Floats) -> bool:
    """Return whether an undecided element (a candidate) can slip in at least one direction."""
    return work[ocand + f] != 0.0 and not (cap[HI0, f] == np.inf and cap[LO0, f] == -np.inf)


@njit(**INNER)
def jammed(minv: Floats, w: Floats, loss: Floats, state: int, op: int, fall: int, work: Floats) -> int:
    """Return the element that jams where the losses have no solution, or -1 where no loss is steep enough for that.

    Where a loss grows by at least as much as it reduces the torque on which it depends, there is no torque at which its mesh can go
    on turning. A mesh whose speed a motion prescribes, directly or through stuck elements, does not jam, because the motion goes on
    whatever the torque. The work buffer has the modes at ``state``, P of the stuck elements at ``op``, and the decrease of each
    torque by each loss at ``fall``.
    """
    noinline()
    count, n = loss.shape[0], w.shape[1]
    found = int(-1)
    most = 1.0
    driven = False
    for j in range(n):
        driven = driven or minv[j, j] == HELD
    for k in range(count):
        on = int(loss[k, ON])
        if brakes(loss[k, FACTOR], work[state + on]) != 0.0:
            gain, free, alone = 0.0, 0.0, 0.0
            for other in range(count):
                gain += loss[k, SHARE] * abs(work[fall + k * count + other])
            for i in range(n):
                for j in range(n):
                    free += w[on, i] * work[op + i * n + j] * w[on, j]
                    alone += w[on, i] * minv[i, j] * w[on, j]
            if gain >= most and not (driven and free <= max(RANK * alone, WEAK)):
                most = gain
                found = on
    return found


@njit(**INNER)
def stop(
    t: float,
    on: int,
    minv: Floats,
    w: Floats,
    sh: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
) -> int:
    """Stop at once the element ``on`` of a mesh that jams, and return the number of events.

    No finite torque satisfies the law of friction there, so an impulse stops it (Genot and Brogliato, New results on Painleve
    paradoxes, European Journal of Mechanics A 18, 1999). Elements without a limit of torque pass the impulse on, all others slip.
    An impulse p = G^+ slip removes an energy of p slip / 2 at each element.
    """
    noinline()
    m, n = w.shape
    at = places(n, m, sh.shape[0], loss.shape[0])
    for f in range(m):
        rigid = mode[f] == STUCK and (cap[HI0, f] == np.inf or cap[LO0, f] == -np.inf)
        work[at.state + f] = STUCK if rigid or f == on else 0.0
        work[at.candidate + f] = 0.0
        total = 0.0
        for j in range(n):
            total += w[f, j] * v[j]
        work[at.slip + f] = total
    project(minv, w, at.state, work)
    row = 0
    for f in range(m):
        if work[at.state + f] == STUCK:
            impulse = 0.0
            other = 0
            for i in range(m):
                if work[at.state + i] == STUCK:
                    impulse += work[at.inverse + row * m + other] * work[at.slip + i]
                    other += 1
            el[IMPULSE, f] += impulse
            el[E_FRIC, f] += 0.5 * impulse * work[at.slip + f]
            row += 1
    for f in range(m):
        if work[at.state + f] == STUCK:
            for j in range(n):
                v[j] -= work[at.r + f * n + j] * work[at.slip + f]
    work[FIRST] = JAMMED
    note(t, on, int(LOCK), v, twist, events, count)
    made = 1
    mode[on] = STUCK
    for f in range(m):
        if work[at.state + f] != STUCK and has_capacity(cap, f):
            slip = 0.0
            for j in range(n):
                slip += w[f, j] * v[j]
            old = mode[f]
            new = int(FORWARD) if slip > 0.0 else int(BACKWARD)
            if abs(slip) <= SEEN:
                work[at.candidate + f] = 1.0 if old == OPEN else 0.0
            elif old != new:
                note(t, f, int(CLOSE) if old == OPEN else (int(CROSS) if abs(old) < 2 else int(BREAK)), v, twist, events, count)
                made += 1
                mode[f] = new
    return made


@njit(**INNER)
def resolve(
    x: float,
    t: float,
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
    events: Floats,
    count: Ints,
    work: Floats,
) -> int:
    """Decide jointly, at acceleration level, which of the zero-slip elements (flagged as candidates) stick and which slip.

    It starts with all of them stuck. Each pivot releases the most overloaded element in the direction of its overload. A released
    element that would move against its friction sticks again; from then on its limit is its kinetic torque, which makes the
    remaining problem convex with box constraints. After 3 m pivots the lowest index is taken first (Murty's rule, which cannot
    cycle unless a limit grows with a torque). After 12 m pivots, where there are losses, all sets are tried in turn if there are at
    most MOST_SETS; if none of them is consistent, the last set of the pivots is kept and the step counts as capped. An overloaded
    element whose slip others prevent keeps its limit torque instead of slipping.

    Losses that grow with a torque are solved again for every set that is tried. Where they have no solution, a mesh jams. A mesh at
    rest then sticks whatever its torque. For a mesh that turns, the function decides nothing and returns -1 - f with the number f
    of the element that :func:`stop` must stop first. It returns the same where no set is consistent and the loss of a mesh that
    turns is steep enough to jam in one of the sets. Where the only change is that an element carries its limit, the present modes
    are tried first: they stay when all stuck elements are within their limits and that element would exceed its own limit if it
    stuck.
    """
    noinline()
    n = minv.shape[0]
    m = w.shape[0]
    s = sh.shape[0]
    losses = loss.shape[0]
    at = places(n, m, s, losses)
    op, orr, of, oa, ost, ocand, oforce, oonce, oslip, ol0, oy, os, orow = (
        at.p,
        at.r,
        at.force,
        at.accel,
        at.state,
        at.candidate,
        at.side,
        at.once,
        at.slip,
        at.torque0,
        at.given,
        at.fall,
        at.row,
    )
    kept = True  # whether the present modes are tried first
    for f in range(m):
        if work[ocand + f] != 0.0 and (abs(mode[f]) < 2 or work[oforce + f] != 0.0):
            kept = False
    for f in range(m):
        work[oonce + f] = 0.0
        work[ost + f] = STUCK if work[ocand + f] != 0.0 and not kept else mode[f]
    done = solved = False
    steep = int(-1)  # number of a mesh that turns and could jam in one of the sets
    pivots = 12 * m + 4
    sets = 1 if losses > 0 else 0
    for f in range(m):
        if sets > 0 and limited(f, cap, ocand, work):
            sets = 3 * sets if sets < MOST_SETS else 0
    for it in range(pivots + sets):
        trying = it >= pivots
        solved = True
        if trying:
            left = it - pivots
            for f in range(m):
                if it == pivots:
                    work[at.slip1 + f] = work[ost + f]
                if limited(f, cap, ocand, work):
                    work[ost + f] = STUCK if left % 3 == 0 else (FORWARD if left % 3 == 1 else BACKWARD)
                    work[oonce + f] = 1.0
                    left //= 3
                elif work[ocand + f] != 0.0:
                    work[ost + f] = STUCK
        hold(minv, w, ost, work)
        changed = False
        for f in range(m):
            state = abs(work[ost + f])
            if work[ocand + f] != 0.0 and (state == 3.0 or (trying and state == 1.0)):
                held = dependent(f, w, minv, work, op)
                if held and state == 1.0:
                    work[ost + f] *= 3.0
                elif not held and state == 3.0:
                    # an element whose slip is no longer prevented by others slips in the direction in which it was loaded
                    work[ost + f] = FORWARD if work[ost + f] > 0.0 else BACKWARD
                    changed = True
        put_losses(loss, cap, int(0), int(-1))
        put_losses(loss, cap, int(1), int(-1))
        for k in range(losses):
            work[oy + k] = 0.0
        for j in range(n):
            work[of + j] = lin(q[0, j], q[1, j], x)
        for a in range(s):
            rate = 0.0
            for j in range(n):
                rate += sh[a, j] * v[j]
            torque = kc[0, a] * twist[a] + kc[1, a] * rate
            for j in range(n):
                work[of + j] -= sh[a, j] * torque
        for f in range(m):
            state = work[ost + f]
            if state == STUCK:
                torque = 0.0
            elif state == LOCKED_HIGH:
                torque = high(cap, f, x)
            elif state == LOCKED_LOW:
                torque = low(cap, f, x)
            else:
                torque = state * lin(cap[KIN0, f], cap[KIN1, f], x)
            for k in range(losses):
                work[oy + k] += loss[k, WEIGHTS + f] * torque
            if work[ocand + f] == 0.0:
                slip = 0.0
                for j in range(n):
                    slip += w[f, j] * v[j]
                torque += cap[VISC, f] * slip
            if torque != 0.0:
                for j in range(n):
                    work[of + j] -= w[f, j] * torque
        if losses > 0:
            for k in range(losses):
                for j in range(n):
                    row = 0.0
                    for f in range(m):
                        if work[ost + f] == STUCK:
                            row += loss[k, WEIGHTS + f] * work[orr + f * n + j]
                    for i in range(n):
                        row += loss[k, WEIGHTS + m + i] * work[op + i * n + j]
                    work[orow + j] = row
                    work[oy + k] += row * work[of + j]
                for other in range(losses):
                    on = int(loss[other, ON])
                    by = brakes(loss[other, FACTOR], work[ost + on])
                    fall = -loss[k, WEIGHTS + on] * by
                    for j in range(n):
                        fall += work[orow + j] * w[on, j] * by
                    work[os + k * losses + other] = fall
            solved = solve_losses(loss, v, work, oy, os, at.newton)
            jams = int(-1)
            if it > 3 * m or not solved:
                jams = jammed(minv, w, loss, ost, op, os, work)
                if jams >= 0 and work[ocand + jams] == 0.0:
                    steep = jams
            if not solved:
                if trying:
                    continue
                if jams >= 0:
                    if kept:
                        kept = False
                        for f in range(m):
                            if work[ocand + f] != 0.0:
                                work[ost + f] = STUCK
                        continue
                    if work[ocand + jams] == 0.0:
                        return -1 - jams
                    work[ost + jams] = STUCK
                    work[oonce + jams] = JAMMED
                    continue
            for k in range(losses):
                loss[k, LAST] = loss[k, NEXT]
            put_losses(loss, cap, int(0), int(LAST))
            put_losses(loss, cap, int(1), int(LAST))
            for k in range(losses):
                on = int(loss[k, ON])
                torque = brakes(loss[k, FACTOR], work[ost + on]) * loss[k, LAST]
                for j in range(n):
                    work[of + j] -= w[on, j] * torque
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += work[op + i * n + j] * work[of + j]
            work[oa + i] = total
        least = it > 3 * m
        worst = int(-1)
        worst_dir = 0.0
        worst_by = 0.0
        back = -1
        back_by = 0.0
        for f in range(m):
            if work[ocand + f] == 0.0:
                continue
            state = work[ost + f]
            kin = lin(cap[KIN0, f], cap[KIN1, f], x)
            if state == STUCK:
                total = 0.0
                for j in range(n):
                    total += work[orr + f * n + j] * work[of + j]
                work[ol0 + f] = total
                if work[oonce + f] == JAMMED:
                    continue
                hi = high(cap, f, x)
                lo = low(cap, f, x)
                if work[oonce + f] != 0.0:
                    if hi < np.inf:
                        hi = kin
                    if lo > -np.inf:
                        lo = -kin
                tol = 1e-11 * (1.0 + abs(total))
                forced = work[oforce + f] if work[oonce + f] == 0.0 else 0.0
                if forced > 0.0 and total > hi - 1e-9 * (1.0 + abs(hi)):
                    over = max(total - hi, tol)
                    direction = 1.0
                elif forced < 0.0 and total < lo + 1e-9 * (1.0 + abs(lo)):
                    over = max(lo - total, tol)
                    direction = -1.0
                elif total - hi > tol:
                    over = total - hi
                    direction = 1.0
                elif lo - total > tol:
                    over = lo - total
                    direction = -1.0
                else:
                    continue
                if worst < 0 or (not least and over > worst_by * (1.0 + 1e-9)):
                    worst = f
                    worst_by = over
                    worst_dir = direction
            elif abs(state) == 1.0:
                accel = 0.0
                size = 0.0
                for j in range(n):
                    accel += w[f, j] * work[oa + j]
                    size += abs(w[f, j] * work[oa + j])
                against = -accel * state
                close = 1e-11 * (1.0 + size)
                if least and losses > 0:
                    # the acceleration by the error of the losses is the tolerance: two choices may differ by no more than that
                    for i in range(n):
                        for j in range(n):
                            close += 1e-9 * (1.0 + kin) * w[f, i] * minv[i, j] * w[f, j]
                if against > close and (back < 0 or (not least and against > back_by)):
                    back = f
                    back_by = against
        if kept:
            kept = False
            certain = worst < 0 and not changed
            for f in range(m):
                state = work[ost + f]
                if work[ocand + f] != 0.0 and abs(state) == 3.0:
                    limit = high(cap, f, x) if state > 0.0 else low(cap, f, x)
                    certain &= beyond(limit, state, if_stuck(f, work, ost, work, ol0, w, orr, work)) > 0.0
            if not certain:
                for f in range(m):
                    if work[ocand + f] != 0.0:
                        work[ost + f] = STUCK
                continue
        if trying:
            if worst >= 0 or back >= 0:
                continue
            done = True
            break
        if least and worst >= 0 and back >= 0:
            if back < worst:
                worst = -1
            else:
                back = -1
        if worst >= 0:
            work[ost + worst] = worst_dir
            work[oonce + worst] = 1.0
            hold(minv, w, ost, work)
            if dependent(worst, w, minv, work, op):
                work[ost + worst] = 3.0 * worst_dir
        elif back >= 0:
            work[ost + back] = STUCK
        elif not changed:
            done = True
            break
    if not done and steep >= 0:
        return -1 - steep
    if not (done and solved):
        count[N_CAPPED] += 1
    if not done:
        for f in range(m):
            if work[ocand + f] != 0.0 and it >= pivots:
                work[ost + f] = work[at.slip1 + f]
        hold(minv, w, ost, work)
        for f in range(m):
            if work[ocand + f] != 0.0 and abs(work[ost + f]) == 3.0 and not dependent(f, w, minv, work, op):
                work[ost + f] = FORWARD if work[ost + f] > 0.0 else BACKWARD
    made = 0
    for f in range(m):
        if work[ocand + f] == 0.0:
            continue
        old = mode[f]
        new = int(work[ost + f])
        if abs(new) >= 2:
            if abs(old) < 2:
                note(t, f, int(LOCK), v, twist, events, count)
                made += 1
        elif abs(old) >= 2:
            note(t, f, int(BREAK), v, twist, events, count)
            made += 1
        elif old == 0:
            note(t, f, int(CLOSE), v, twist, events, count)
            made += 1
        elif old != new:
            note(t, f, int(CROSS), v, twist, events, count)
            made += 1
        mode[f] = new
        work[ocand + f] = 0.0
    for f in range(m):
        # the root leaves a slip of rounding size; remove it so that a locked element has no slip
        if mode[f] == STUCK:
            slip = 0.0
            for j in range(n):
                slip += w[f, j] * v[j]
            work[oslip + f] = slip
    capture(w, sh, mode, el, work)
    for f in range(m):
        if mode[f] == STUCK:
            for j in range(n):
                v[j] -= work[orr + f * n + j] * work[oslip + f]
    return made
