# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint decision, at one instant, of which friction elements stick and which slip.

Used by driveline/kernel.py at every event inside a step.

The decision starts with all candidates stuck. Each pivot releases the most overloaded element in the direction of its overload. A
released element that would move against its friction sticks again; from then on its limit is its kinetic torque, which makes the
remaining problem convex with box constraints. After 3 m pivots the lowest index is taken first (Murty's rule, which cannot cycle
unless a limit grows with a torque). After 12 m pivots, where there are losses, all sets are tried in turn if there are at most
MOST_SETS; if none of them is consistent, the last set of the pivots is kept and the step counts as capped. An overloaded element
whose slip others prevent keeps its limit torque instead of slipping.

Losses that grow with a torque are solved again for every set that is tried. Where they have no solution, a mesh jams. A mesh at
rest then sticks whatever its torque. For a mesh that turns, nothing is decided before it is stopped. The same holds where no set
is consistent and the loss of a mesh that turns is steep enough to jam in one of the sets. Where the only change is that an
element carries its limit, the present modes are tried first: they stay when all stuck elements are within their limits and that
element would exceed its own limit if it stuck.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
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
    WORST,
    Places,
    beyond,
    has_capacity,
    high,
    if_stuck,
    lin,
    low,
    multiply,
    noinline,
    places,
    rate_of,
    sum_at,
    sum_of,
    unslip,
)
from rig_nodes.driveline.losses import FACTOR, LAST, NEXT, ON, SHARE, WEIGHTS, brakes, put_last, put_losses, solve_losses, worst_of
from rig_nodes.driveline.stuck import is_held, project

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.state import Loads, State, Structure

MOST_SETS = 3**6  # most sets that are tried one by one where the pivots do not end: six elements, each with three modes
SEEN = 1e-10  # rad/s: a slip above this does not come from rounding
JAMMED = -1.0  # marks an element that sticks beyond its limit, and, in work[FIRST], a step in which an impulse has acted


# int() around a constant argument or start value: a literal would make numba compile the callee once more


@njit(**INNER)
def note(t: float, f: int, kind: int, state: State) -> None:
    """Count an event of element f, and write it with speeds [rad/s] and their integrals [rad] to the ring, if it has rows."""
    v, twist, events, count = state.v, state.twist, state.events, state.count
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
        if w[f, i] != 0.0:
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
    if not is_held(work, ost, w.shape[0], work):
        project(minv, w, ost, work)


@njit(**INLINED)
def impulse_of(row: int, m: int, state: Ints | Floats, first: int, work: Floats, at: Places) -> float:
    """Return p = G^+ slip of the row-th stuck one of m elements [Nm s]; the modes are in ``state`` from ``first`` on."""
    impulse = 0.0
    other = 0
    for i in range(m):
        if state[first + i] == STUCK:
            impulse += work[at.inverse + row * m + other] * work[at.slip + i]
            other += 1
    return impulse


@njit(**INNER)
def capture(state: State, at: Places) -> None:
    """After a capped step, count as heat the energy that is lost where stuck elements remove more slip than that of rounding.

    An impulse p = G^+ slip takes p slip / 2 from each of them.
    """
    mode, work, row = state.mode, state.work, 0
    for f in range(mode.shape[0]):
        if mode[f] == STUCK:
            slip = work[at.slip + f]
            if abs(slip) > SEEN:
                state.el[E_FRIC, f] += 0.5 * impulse_of(row, mode.shape[0], mode, int(0), work, at) * slip
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
def stop(t: float, on: int, structure: Structure, cap: Floats, loss: Floats, state: State) -> int:
    """Stop at once the element ``on`` of a mesh that jams, and return the number of events.

    No finite torque satisfies the law of friction there, so an impulse stops it (Genot and Brogliato, New results on Painleve
    paradoxes, European Journal of Mechanics A 18, 1999). Elements without a limit of torque pass the impulse on, all others slip.
    An impulse p = G^+ slip removes an energy of p slip / 2 at each element.
    """
    noinline()
    w, v, mode, el, work = structure.w, state.v, state.mode, state.el, state.work
    m, n = w.shape
    at = places(n, m, structure.sh.shape[0], loss.shape[0])
    for f in range(m):
        rigid = mode[f] == STUCK and (cap[HI0, f] == np.inf or cap[LO0, f] == -np.inf)
        work[at.state + f] = STUCK if rigid or f == on else 0.0
        work[at.candidate + f] = 0.0
        work[at.slip + f] = rate_of(w, f, v)
    project(structure.minv, w, at.state, work)
    row = 0
    for f in range(m):
        if work[at.state + f] == STUCK:
            impulse = impulse_of(row, m, work, at.state, work, at)
            el[IMPULSE, f] += impulse
            el[E_FRIC, f] += 0.5 * impulse * work[at.slip + f]
            row += 1
    unslip(v, m, work, at.state, at.slip, at.r, work)
    work[FIRST] = JAMMED
    note(t, on, int(LOCK), state)
    made = 1
    mode[on] = STUCK
    for f in range(m):
        if work[at.state + f] != STUCK and has_capacity(cap, f):
            slip = rate_of(w, f, v)
            old = mode[f]
            new = int(FORWARD) if slip > 0.0 else int(BACKWARD)
            if abs(slip) <= SEEN:
                work[at.candidate + f] = 1.0 if old == OPEN else 0.0
            elif old != new:
                note(t, f, int(CLOSE) if old == OPEN else (int(CROSS) if abs(old) < 2 else int(BREAK)), state)
                made += 1
                mode[f] = new
    return made


@njit(**INLINED)
def carried(cap: Floats, f: int, mode: float, x: float) -> float:
    """Return the torque of an element that slips or carries its limit, at share x of a step [Nm]."""
    if mode == LOCKED_HIGH:
        return high(cap, f, x)
    if mode == LOCKED_LOW:
        return low(cap, f, x)
    return mode * lin(cap[KIN0, f], cap[KIN1, f], x)


@njit(**INLINED)
def first_set(mode: Ints, work: Floats, at: Places) -> bool:
    """Set the modes that are tried first, and return whether they are the present ones; otherwise all candidates stick."""
    kept = True
    for f in range(mode.shape[0]):
        if work[at.candidate + f] != 0.0 and (abs(mode[f]) < 2 or work[at.side + f] != 0.0):
            kept = False
    for f in range(mode.shape[0]):
        work[at.once + f] = 0.0
        work[at.state + f] = STUCK if work[at.candidate + f] != 0.0 and not kept else mode[f]
    return kept


@njit(**INLINED)
def stick_all(m: int, work: Floats, at: Places) -> None:
    """Let all candidates stick."""
    for f in range(m):
        if work[at.candidate + f] != 0.0:
            work[at.state + f] = STUCK


@njit(**INLINED)
def sets_of(losses: int, cap: Floats, work: Floats, at: Places) -> int:
    """Return how many sets of modes are tried one by one where the pivots do not end; 0 without losses or above MOST_SETS."""
    sets = 1 if losses > 0 else 0
    for f in range(cap.shape[1]):
        if sets > 0 and limited(f, cap, at.candidate, work):
            sets = 3 * sets if sets < MOST_SETS else 0
    return sets


@njit(**INLINED)
def release(f: int, direction: float, structure: Structure, work: Floats, at: Places) -> None:
    """Let a candidate slip in the direction of its overload, or carry its limit where others prevent that."""
    work[at.state + f] = direction
    work[at.once + f] = 1.0
    hold(structure.minv, structure.w, at.state, work)
    if dependent(f, structure.w, structure.minv, work, at.p):
        work[at.state + f] = 3.0 * direction


@njit(**INLINED)
def choose_set(number: int, m: int, cap: Floats, work: Floats, at: Places) -> None:
    """Set the modes of one of the sets that are tried one by one; before the first the last modes of the pivots are kept."""
    left = number
    for f in range(m):
        if number == 0:
            work[at.slip1 + f] = work[at.state + f]
        if limited(f, cap, at.candidate, work):
            work[at.state + f] = STUCK if left % 3 == 0 else (FORWARD if left % 3 == 1 else BACKWARD)
            work[at.once + f] = 1.0
            left //= 3
        elif work[at.candidate + f] != 0.0:
            work[at.state + f] = STUCK


@njit(**INLINED)
def hold_back(trying: bool, structure: Structure, work: Floats, at: Places) -> bool:
    """Let candidates carry their limit where others prevent their slip; return whether one slips that does not any more."""
    changed = False
    for f in range(structure.w.shape[0]):
        mode = abs(work[at.state + f])
        if work[at.candidate + f] != 0.0 and (mode == 3.0 or (trying and mode == 1.0)):
            held = dependent(f, structure.w, structure.minv, work, at.p)
            if held and mode == 1.0:
                work[at.state + f] *= 3.0
            elif not held and mode == 3.0:
                # an element whose slip is no longer prevented by others slips in the direction in which it was loaded
                work[at.state + f] = FORWARD if work[at.state + f] > 0.0 else BACKWARD
                changed = True
    return changed


@njit(**INLINED)
def forces_of_set(x: float, structure: Structure, loads: Loads, loss: Floats, state: State, at: Places) -> None:
    """Set the forces on the speeds, and the torques on which losses depend, without stuck elements and losses."""
    w, sh, kc, cap, work, n = structure.w, structure.sh, structure.kc, loads.cap, state.work, state.v.shape[0]
    put_losses(loss, cap, int(0), int(-1))
    put_losses(loss, cap, int(1), int(-1))
    for k in range(loss.shape[0]):
        work[at.given + k] = 0.0
    for j in range(n):
        work[at.force + j] = lin(loads.q[0, j], loads.q[1, j], x)
    for a in range(sh.shape[0]):
        torque = kc[0, a] * state.twist[a] + kc[1, a] * rate_of(sh, a, state.v)
        for j in range(n):
            work[at.force + j] -= sh[a, j] * torque
    for f in range(w.shape[0]):
        mode = work[at.state + f]
        torque = 0.0 if mode == STUCK else carried(cap, f, mode, x)
        for k in range(loss.shape[0]):
            work[at.given + k] += loss[k, WEIGHTS + f] * torque
        if work[at.candidate + f] == 0.0:
            torque += cap[VISC, f] * rate_of(w, f, state.v)
        if torque != 0.0:
            for j in range(n):
                work[at.force + j] -= w[f, j] * torque


@njit(**INLINED)
def losses_of_set(structure: Structure, loss: Floats, state: State, at: Places) -> bool:
    """Set NEXT to the losses of the set that is tried; return False where they have no solution."""
    w, work, count, n = structure.w, state.work, loss.shape[0], state.v.shape[0]
    m = w.shape[0]
    for k in range(count):
        for j in range(n):
            row = 0.0
            for f in range(m):
                if work[at.state + f] == STUCK:
                    row += loss[k, WEIGHTS + f] * work[at.r + f * n + j]
            for i in range(n):
                row += loss[k, WEIGHTS + m + i] * work[at.p + i * n + j]
            work[at.row + j] = row
            work[at.given + k] += row * work[at.force + j]
        for other in range(count):
            on = int(loss[other, ON])
            by = brakes(loss[other, FACTOR], work[at.state + on])
            fall = -loss[k, WEIGHTS + on] * by
            for j in range(n):
                fall += work[at.row + j] * w[on, j] * by
            work[at.fall + k * count + other] = fall
    return solve_losses(loss, state.v, work, at.given, at.fall, at.newton)


@njit(**INLINED)
def brake_set(w: Floats, cap: Floats, loss: Floats, work: Floats, at: Places) -> None:
    """Let the losses of the set that is tried act."""
    for k in range(loss.shape[0]):
        loss[k, LAST] = loss[k, NEXT]
    put_last(loss, cap)
    for k in range(loss.shape[0]):
        on = int(loss[k, ON])
        torque = brakes(loss[k, FACTOR], work[at.state + on]) * loss[k, LAST]
        for j in range(w.shape[1]):
            work[at.force + j] -= w[on, j] * torque


@njit(**INLINED)
def overload(f: int, x: float, cap: Floats, work: Floats, at: Places) -> tuple[float, float]:
    """Return by how much a stuck candidate exceeds its limit [Nm], 0 where it does not, and 1 or -1 for the direction."""
    torque, kin, hi, lo = work[at.torque0 + f], lin(cap[KIN0, f], cap[KIN1, f], x), high(cap, f, x), low(cap, f, x)
    forced = work[at.side + f]
    if work[at.once + f] != 0.0:
        forced = 0.0
        if hi < np.inf:
            hi = kin
        if lo > -np.inf:
            lo = -kin
    tol = 1e-11 * (1.0 + abs(torque))
    if forced > 0.0 and torque > hi - 1e-9 * (1.0 + abs(hi)):
        return max(torque - hi, tol), 1.0
    if forced < 0.0 and torque < lo + 1e-9 * (1.0 + abs(lo)):
        return max(lo - torque, tol), -1.0
    if torque - hi > tol:
        return torque - hi, 1.0
    if lo - torque > tol:
        return lo - torque, -1.0
    return 0.0, 0.0


@njit(**INLINED)
def most_overloaded(x: float, least: bool, w: Floats, cap: Floats, work: Floats, at: Places) -> tuple[int, float]:
    """Return the most overloaded stuck candidate, or the first one (least), -1 without one, and the direction of its overload."""
    m, n = w.shape
    worst, worst_by, worst_dir = int(-1), 0.0, 0.0
    for f in range(m):
        if work[at.candidate + f] == 0.0 or work[at.state + f] != STUCK:
            continue
        work[at.torque0 + f] = sum_of(work, at.r + f * n, at.force, n)
        if work[at.once + f] == JAMMED:
            continue
        over, direction = overload(f, x, cap, work, at)
        if direction != 0.0 and (worst < 0 or (not least and over > worst_by * (1.0 + 1e-9))):
            worst, worst_by, worst_dir = f, over, direction
    return worst, worst_dir


@njit(**INLINED)
def moves_back(x: float, least: bool, structure: Structure, loads: Loads, losses: int, work: Floats, at: Places) -> int:
    """Return the released candidate that moves most against its friction, or the first one (least), -1 without one."""
    w, cap, n, back, back_by = structure.w, loads.cap, structure.w.shape[1], -1, 0.0
    for f in range(w.shape[0]):
        mode = work[at.state + f]
        if work[at.candidate + f] == 0.0 or abs(mode) != 1.0:
            continue
        size = 0.0
        for j in range(n):
            size += abs(w[f, j] * work[at.accel + j])
        against = -sum_at(work, at.accel, w, f) * mode
        close = 1e-11 * (1.0 + size)
        if least and losses > 0:
            # the acceleration by the error of the losses is the tolerance: two choices may differ by no more than that
            kin = lin(cap[KIN0, f], cap[KIN1, f], x)
            for i in range(n):
                for j in range(n):
                    close += 1e-9 * (1.0 + kin) * w[f, i] * structure.minv[i, j] * w[f, j]
        if against > close and (back < 0 or (not least and against > back_by)):
            back, back_by = f, against
    return back


@njit(**INLINED)
def certain(x: float, w: Floats, cap: Floats, work: Floats, at: Places) -> bool:
    """Return whether each element that carries its limit would exceed it if it stuck."""
    sure = True
    for f in range(w.shape[0]):
        mode = work[at.state + f]
        if work[at.candidate + f] != 0.0 and abs(mode) == 3.0:
            limit = high(cap, f, x) if mode > 0.0 else low(cap, f, x)
            sure &= beyond(limit, mode, if_stuck(f, work, at.state, work, at.torque0, w, at.r, work)) > 0.0
    return sure


@njit(**INLINED)
def keep_last(tried: bool, structure: Structure, work: Floats, at: Places) -> None:
    """Take the last modes of the pivots, where no set was consistent; tried is whether sets were tried after them."""
    w, minv = structure.w, structure.minv
    for f in range(w.shape[0]):
        if work[at.candidate + f] != 0.0 and tried:
            work[at.state + f] = work[at.slip1 + f]
    hold(minv, w, at.state, work)
    for f in range(w.shape[0]):
        if work[at.candidate + f] != 0.0 and abs(work[at.state + f]) == 3.0 and not dependent(f, w, minv, work, at.p):
            work[at.state + f] = FORWARD if work[at.state + f] > 0.0 else BACKWARD


@njit(**INLINED)
def change_modes(t: float, w: Floats, state: State, at: Places) -> int:
    """Give the candidates the modes that were found, take the slip of rounding off stuck ones; return the number of events."""
    mode, work, made = state.mode, state.work, 0
    for f in range(mode.shape[0]):
        if work[at.candidate + f] == 0.0:
            continue
        old = mode[f]
        new = int(work[at.state + f])
        if abs(new) >= 2:
            kind = int(LOCK) if abs(old) < 2 else 0
        elif abs(old) >= 2:
            kind = int(BREAK)
        elif old == 0:
            kind = int(CLOSE)
        else:
            kind = int(CROSS) if old != new else 0
        if kind != 0:
            note(t, f, kind, state)
            made += 1
        mode[f] = new
        work[at.candidate + f] = 0.0
    for f in range(mode.shape[0]):
        # the root leaves a slip of rounding size; remove it so that a locked element has no slip
        if mode[f] == STUCK:
            work[at.slip + f] = rate_of(w, f, state.v)
    capture(state, at)
    unslip(state.v, mode.shape[0], mode, int(0), at.slip, at.r, work)
    return made


@njit(**INNER)
def resolve(x: float, t: float, structure: Structure, loads: Loads, loss: Floats, state: State) -> int:
    """Decide jointly, at acceleration level, which of the zero-slip elements (flagged as candidates) stick and which slip.

    It returns the number of events. For a mesh that turns and jams the function decides nothing and returns -1 - f with the number
    f of the element that :func:`stop` must stop first.
    """
    noinline()
    minv, w, cap, work = structure.minv, structure.w, loads.cap, state.work
    m, n = w.shape
    losses = loss.shape[0]
    at = places(n, m, structure.sh.shape[0], losses)
    kept = first_set(state.mode, work, at)
    done = solved = False
    worst = back = int(-1)
    steep = int(-1)  # number of a mesh that turns and could jam in one of the sets
    pivots = 12 * m + 4
    for it in range(pivots + sets_of(losses, cap, work, at)):
        trying, least, solved = it >= pivots, it > 3 * m, True
        if trying:
            choose_set(it - pivots, m, cap, work, at)
        hold(minv, w, at.state, work)
        changed = hold_back(trying, structure, work, at)
        forces_of_set(x, structure, loads, loss, state, at)
        if losses > 0:
            solved = losses_of_set(structure, loss, state, at)
            jams = int(-1)
            if least or not solved:
                jams = jammed(minv, w, loss, at.state, at.p, at.fall, work)
                if jams >= 0 and work[at.candidate + jams] == 0.0:
                    steep = jams
            if not solved:
                if trying:
                    continue
                if jams >= 0:
                    if kept:
                        kept = False
                        stick_all(m, work, at)
                        continue
                    if work[at.candidate + jams] == 0.0:
                        return -1 - jams
                    work[at.state + jams] = STUCK
                    work[at.once + jams] = JAMMED
                    continue
            brake_set(w, cap, loss, work, at)
        multiply(work, at.p, at.force, at.accel, n)
        worst, direction = most_overloaded(x, least, w, cap, work, at)
        back = moves_back(x, least, structure, loads, losses, work, at)
        if kept:
            kept = False
            if worst >= 0 or changed or not certain(x, w, cap, work, at):
                stick_all(m, work, at)
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
            release(worst, direction, structure, work, at)
        elif back >= 0:
            work[at.state + back] = STUCK
        elif not changed:
            done = True
            break
    if not done and steep >= 0:
        return -1 - steep
    if not (done and solved):
        state.count[N_CAPPED] += 1
        state.count[WORST] = max(worst, back) if solved else worst_of(loss, work, at.newton)
        for f in range(m):
            if state.count[WORST] < 0 and work[at.candidate + f] != 0.0:
                state.count[WORST] = f
    if not done:
        keep_last(it >= pivots, structure, work, at)
    return change_modes(t, w, state, at)
