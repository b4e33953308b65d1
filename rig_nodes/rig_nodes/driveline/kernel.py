# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One compiled step of the general driveline, with stick/slip events at their exact time inside the step.

Used by driveline/builder.py (description and runner) and by every larger kernel that moves a drive train. The topology is given by
arrays only, so that one compiled function serves every arrangement. Equations of motion and law of friction:

M dv/dt = q - W^T (lam + visc W v) - S^T tau, tau = k twist + c S v, d twist/dt = S v, slip = W v;
slipping: lam = sign(slip) kin; stuck: slip = 0, lo <= lam <= hi.

With fixed modes and without shafts the step is the trapezoidal rule, which is exact without drag (acceleration linear, speed
quadratic in time) and A-stable with it. An energy is the product of mean torque and mean slip: with these the rule satisfies
work = kinetic energy + losses to rounding, for any step, and no loss can become negative. With shafts the same holds of the
method of order 8 in driveline/collocation.py. Zero slip is a root of the quadratic and overload a root of the linear function; with
drag or shafts the shortened step is solved again until its end meets the root.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    E_FRIC,
    E_VISC,
    FIRST,
    FORWARD,
    IMPULSE,
    KIN0,
    KIN1,
    LAM,
    N_CAPPED,
    OPEN,
    RATE,
    RATE_OF,
    STUCK,
    VISC,
    WORST,
    Places,
    high,
    lin,
    low,
    multiply,
    noinline,
    places,
    short_loops,
    sum_at,
    sum_of,
    unslip,
)
from rig_nodes.driveline.begin import begin_step, mark
from rig_nodes.driveline.collocation import (
    elements_by_nodes,
    fastest_rate,
    forces_by_nodes,
    losses_by_nodes,
    make_nodes,
    part_of,
    solve_nodes,
    take_by_nodes,
)
from rig_nodes.driveline.joint import carried, jammed, resolve, stop
from rig_nodes.driveline.losses import FACTOR, LAST, NEXT, ON, brakes, end_losses, put_last, put_losses, worst_of
from rig_nodes.driveline.stuck import implicit, is_held, project, stale
from rig_nodes.driveline.wide import WIDE, find_ranges, hold_wide, know_ends, multiply_wide, push_along, rate_along, sum_along

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.state import Loads, State, Structure

JAM = 1e-3  # share of a step: accuracy of the time at which a mesh jams
SAME = 1e-9  # share of a sub-step that is rounding
ROUNDED = 2.0**-52  # share of the largest speed up to which the slip of a stuck element is that of rounding, among many
UNDECIDED = 3  # most failed decisions in a step; one of them takes as much time as a hundred successful ones


class Span(NamedTuple):
    """What a sub-step starts from: the modes do not change in it before its end.

    Parameters
    ----------
    h, done : float
        Length of the whole step, and what of it is done [s].
    scale : float
        1 plus the largest speed at the start of the whole step [rad/s], to which slips of rounding size are compared.
    longest : float
        Longest sub-step [s].
    watch : bool
        Whether events end the sub-step.
    at : Places
        Places in the work buffer.
    """

    h: float
    done: float
    scale: float
    longest: float
    watch: bool
    at: Places


@njit(**INNER)
def first_down(y0: float, b: float, y1: float, d: float, tol: float) -> float:
    """Return the first time in [0, d] at which y0 + b t + a t^2 (end value y1) goes below zero; inf if it does not."""
    # the parabola lies above its chord or above its tangent at the start
    if y0 > tol and y1 > 0.0 and (b >= 0.0 or y0 + b * d > 0.0):
        return np.inf
    a = (y1 - y0 - b * d) / (d * d)
    if y0 > tol:
        disc = b * b - 4.0 * a * y0
        if disc <= 0.0:
            return np.inf
        if y1 > 0.0 and y0 - b * b / (4.0 * a) >= -tol:
            return np.inf
        den = math.sqrt(disc) - b
        if den <= 0.0:
            return np.inf
        t = 2.0 * y0 / den
        return t if t <= d else (d if y1 <= 0.0 else np.inf)
    if y0 < -tol:
        # a root of the last sub-step at which rounding leaves a residual: accepted while the slip moves to the right side
        return 0.0 if b < 0.0 else np.inf
    low = y1 - y0
    if a > 0.0 and b < 0.0 and -b < 2.0 * a * d:
        low = -b * b / (4.0 * a)
    if low >= -tol:
        return np.inf
    return -b / a if b > 0.0 else 0.0


@njit(**INLINED)
def start_forces(x: float, structure: Structure, loads: Loads, state: State, at: Places) -> None:
    """Set forces, slips and torques of slipping elements at share x of the step, and P and R of the stuck ones."""
    w, sh, kc, cap, mode, work = structure.w, structure.sh, structure.kc, loads.cap, state.mode, state.work
    m, n = mode.shape[0], state.v.shape[0]
    for j in range(n):
        work[at.force + j] = lin(loads.q[0, j], loads.q[1, j], x)
    know_ends(w, sh, work, at)
    for a in range(sh.shape[0]):
        rate = rate_along(sh, a, state.v, work, at.sh_ends)
        work[at.rate + a] = rate
        push_along(work, at.force, sh, a, kc[0, a] * state.twist[a] + kc[1, a] * rate, at.sh_ends)
    for f in range(m):
        mo = mode[f]
        slip = 0.0 if mo == STUCK and n >= WIDE else rate_along(w, f, state.v, work, at.w_ends)
        work[at.slip0 + f] = slip
        torque = 0.0
        if mo != STUCK and mo != OPEN:
            torque = carried(cap, f, mo, x)
        work[at.torque0 + f] = torque
        torque += cap[VISC, f] * slip
        if torque != 0.0:
            push_along(work, at.force, w, f, torque, at.w_ends)
    if not is_held(mode, int(0), m, work):
        for f in range(m):
            work[at.state + f] = mode[f]
        project(structure.minv, w, at.state, work)


@njit(**INLINED)
def answer_forces(mode: Ints, n: int, work: Floats, at: Places) -> None:
    """Set the accelerations of n speeds and the torques of stuck elements by the forces at the start of a sub-step."""
    if n >= WIDE:
        if work[at.ranges] != work[0]:
            find_ranges(work, at, n)
        multiply_wide(work, at.p, at.ranges, at.force, at.accel, n)
        hold_wide(work, at.r, at.force, at.torque0, mode, n)
        return
    multiply(work, at.p, at.force, at.accel, n)
    for f in range(mode.shape[0]):
        if mode[f] == STUCK:
            work[at.torque0 + f] = sum_of(work, at.r + f * n, at.force, n)


@njit(**INLINED)
def ends(d: float, span: Span) -> bool:
    """Return whether a sub-step of d ends the step; equal parts of a step add up to it but for rounding."""
    return d >= (span.h - span.done) * (1.0 - SAME)


@njit(**INLINED)
def share_at(d: float, span: Span) -> float:
    """Return the share of the whole step at which a sub-step of d ends."""
    return 1.0 if ends(d, span) else (span.done + d) / span.h


@njit(**INLINED)
def change_forces(d: float, span: Span, structure: Structure, loads: Loads, loss: Floats, state: State) -> None:
    """Set the change of the forces, and the torques at the end, over a sub-step of d before losses and anything implicit.

    The matrices of the implicit part are made where they are not those of this sub-step.
    """
    w, sh, cap, work, at, n = structure.w, structure.sh, loads.cap, state.work, span.at, state.v.shape[0]
    if stale(d, cap, work):
        if sh.shape[0] > 0:
            make_nodes(d, structure, cap, work)
        else:
            implicit(d, w, cap, work)
    xa, xb = span.done / span.h, share_at(d, span)
    put_losses(loss, cap, int(1), int(-1))
    for j in range(n):
        work[at.dforce + j] = lin(loads.q[0, j], loads.q[1, j], xb) - lin(loads.q[0, j], loads.q[1, j], xa)
    for f in range(state.mode.shape[0]):
        mo = state.mode[f]
        if mo == OPEN:
            work[at.torque1 + f] = 0.0
        elif mo != STUCK:
            torque = carried(cap, f, mo, xb if work[at.lossy + f] == 0.0 else 1.0)
            work[at.torque1 + f] = torque
            if torque != work[at.torque0 + f]:
                push_along(work, at.dforce, w, f, torque - work[at.torque0 + f], at.w_ends)
    # spring force grows by k d (rate at the start) before anything implicit
    for a in range(sh.shape[0]):
        push_along(work, at.dforce, sh, a, structure.kc[0, a] * d * work[at.rate + a], at.sh_ends)


@njit(**INLINED)
def losses_at_end(d: float, structure: Structure, cap: Floats, loss: Floats, state: State) -> bool:
    """Set NEXT to the losses at the end of a sub-step of d, from its forces without them; return False where there are none."""
    if structure.sh.shape[0] > 0:
        return losses_by_nodes(d, structure, cap, loss, state)
    return end_losses(d, structure, cap, loss, state)


@njit(**INLINED)
def brake_meshes(structure: Structure, cap: Floats, loss: Floats, state: State, at: Places) -> None:
    """Add the losses at the end of a sub-step to torques and forces."""
    work = state.work
    put_losses(loss, cap, int(1), int(NEXT))
    for k in range(loss.shape[0]):
        f = int(loss[k, ON])
        torque = brakes(loss[k, FACTOR], state.mode[f]) * loss[k, NEXT]
        work[at.torque1 + f] += torque
        push_along(work, at.dforce, structure.w, f, torque, at.w_ends)


@njit(**INNER)
def change_wide(d: float, w: Floats, cap: Floats, mode: Ints, work: Floats, at: Places) -> None:
    """Do what :func:`change_speeds` does for many speeds without shafts."""
    noinline()
    n = w.shape[1]
    if work[3] == 0.0:
        multiply_wide(work, at.p, at.ranges, at.dforce, at.a, n)
        for j in range(n):
            work[at.dv + j] = d * (work[at.accel + j] + 0.5 * work[at.a + j])
    else:
        for j in range(n):
            work[at.a + j] = d * (work[at.force + j] + 0.5 * work[at.dforce + j])
        multiply_wide(work, at.h, int(0), at.a, at.dv, n)
    for f in range(mode.shape[0]):
        if mode[f] == STUCK:
            work[at.slip1 + f], work[at.torque1 + f] = 0.0, work[at.torque0 + f]
            continue
        gain = sum_along(work, at.dv, w, f, at.w_ends)
        work[at.slip1 + f] = work[at.slip0 + f] + gain
        if cap[VISC, f] != 0.0:
            push_along(work, at.dforce, w, f, cap[VISC, f] * gain, at.w_ends)
    hold_wide(work, at.r, at.dforce, at.torque1, mode, n)


@njit(**INLINED)
def change_speeds(d: float, structure: Structure, cap: Floats, state: State, at: Places) -> None:
    """Set the change of the speeds over a sub-step of d, and the slips and torques of stuck elements at its end."""
    w, work, n = structure.w, state.work, state.v.shape[0]
    if structure.sh.shape[0] > 0:
        solve_nodes(d, at.force, at.dforce, work, at, n)
        forces_by_nodes(d, structure, cap, work, at)
        elements_by_nodes(w, state.mode, work, at)
        return
    if n >= WIDE:
        change_wide(d, w, cap, state.mode, work, at)
        return
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += work[at.h + i * n + j] * (work[at.force + j] + 0.5 * work[at.dforce + j])
        work[at.dv + i] = d * total
    for f in range(state.mode.shape[0]):
        gain = sum_at(work, at.dv, w, f)
        work[at.slip1 + f] = work[at.slip0 + f] + gain
        torque = cap[VISC, f] * gain
        for j in range(n):
            work[at.dforce + j] -= w[f, j] * torque
    for f in range(state.mode.shape[0]):
        if state.mode[f] == STUCK:
            total = 0.0
            for j in range(n):
                total += work[at.r + f * n + j] * (work[at.force + j] + work[at.dforce + j])
            work[at.torque1 + f] = total


@njit(**INLINED)
def room_left(torque: float, sign: int, cap: Floats, f: int, x: float) -> float:
    """Return by how much the torque of a stuck element is within its upper (sign 1) or lower (-1) limit at share x of a step."""
    return high(cap, f, x) - torque if sign > 0 else torque - low(cap, f, x)


@njit(**INLINED)
def first_event(
    d: float, hit: int, side: int, span: Span, structure: Structure, cap: Floats, loss: Floats, state: State
) -> tuple[float, int, int, float, float]:
    """Return what ends a sub-step of d first.

    Parameters
    ----------
    d : float
        Length of the sub-step [s].
    hit, side : int
        Element whose root the sub-step is to end at, -1 for none yet; 1 or -1 for its upper or lower limit, 0 for its slip.
    span, structure, cap, loss, state
        As of the sub-step.

    Returns
    -------
    first : float
        Time of the first event [s], inf without one; the element that is hit does not count.
    who, way : int
        Element of this event, -1 without one, and its side.
    gap : float
        Distance of the hit element from its root at the end of the sub-step.
    again : float
        A better time for this root [s].
    """
    work, at, xa, xb = state.work, span.at, span.done / span.h, share_at(d, span)
    first, who, way, gap, again = np.inf, int(-1), int(0), 0.0, np.inf
    for f in range(state.mode.shape[0]):
        mo = state.mode[f]
        if mo == FORWARD or mo == BACKWARD:
            y0 = mo * work[at.slip0 + f]
            y1 = mo * work[at.slip1 + f]
            speeding = mo * sum_along(work, at.accel, structure.w, f, at.w_ends)
            te = first_down(y0, speeding, y1, d, 1e-12 * span.scale)
            if f == hit:
                gap = y1
                # if the sub-step ends before the root, this time lies beyond that end
                fall = 2.0 * (y1 - y0) / d - speeding
                if y1 <= 0.0:
                    again = te
                elif fall < 0.0:
                    again = d - y1 / fall
            elif te < first:
                first, who, way = te, f, 0
        elif mo == STUCK:
            l0, l1 = work[at.torque0 + f], work[at.torque1 + f]
            if f != hit and max(abs(l0), abs(l1)) < min(cap[KIN0, f], cap[KIN1, f]):
                continue  # no limit is less than the kinetic torque
            lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
            whole = work[at.lossy + f] != 0.0
            for sign in (1, -1):
                y0 = room_left(l0, sign, cap, f, 0.0 if whole else xa)
                y1 = room_left(l1, sign, cap, f, 1.0 if whole else xb)
                te = d * y0 / (y0 - y1) if y0 > 0.0 and y1 < y0 else 0.0
                if f == hit and sign == side:
                    gap, again = y1, te
                elif (y1 < -lim or y0 < -4.0 * lim) and te < first:
                    first, who, way = te, f, sign
    return first, who, way, gap, again


@njit(**INLINED)
def sub_step(span: Span, structure: Structure, loads: Loads, loss: Floats, state: State) -> tuple[float, int, int, bool, bool, int]:
    """Solve the longest sub-step in which no mode changes, from what `start_forces` has set.

    Returns
    -------
    d : float
        Its length [s].
    hit, side : int
        Element whose event ends it, -1 for none; 1 or -1 for its upper or lower limit, 0 for its slip.
    missed : bool
        Whether the slip reached zero in a longer sub-step only, so that there is no event.
    shorter : bool
        Whether it ends before a mesh jams, or is one of several parts, without an event.
    jams : int
        Element of a mesh that jams at the start of the sub-step, -1 for none.
    """
    cap, work, at = loads.cap, state.work, span.at
    d = span.h - span.done
    if span.longest <= d * (1.0 + SAME):
        d = span.longest
    hit, side, tries, below, above = int(-1), int(0), 0, 0.0, d
    missed, shorter = False, not ends(d, span)
    jams = int(-1)
    while True:
        change_forces(d, span, structure, loads, loss, state)
        if loss.shape[0] > 0:
            if not losses_at_end(d, structure, cap, loss, state):
                # a mesh jams in this sub-step; halve it until it ends just before that
                if span.watch:
                    for f in range(state.mode.shape[0]):
                        work[at.state + f] = state.mode[f]
                    jams = jammed(structure.minv, structure.w, loss, at.state, at.p, at.fall, work)
                if jams >= 0:
                    if d <= JAM * span.h:
                        break
                    shorter = True
                    hit, side, tries, below = int(-1), int(0), 0, 0.0
                    d *= 0.5
                    above = d
                    jams = int(-1)
                    continue
                state.count[N_CAPPED] += 1
                state.count[WORST] = worst_of(loss, work, at.newton)
            brake_meshes(structure, cap, loss, state, at)
        change_speeds(d, structure, cap, state, at)
        if not span.watch:
            break
        first, who, way, gap, again = first_event(d, hit, side, span, structure, cap, loss, state)
        if hit < 0 and (who < 0 or first >= d * (1.0 - 1e-12)):
            hit, side = who, way
            break
        if hit >= 0:
            # in a linear problem the shortened step ends at the root; with drag, shafts or losses it does not end exactly there
            tries += 1
            if (work[3] == 0.0 and loss.shape[0] == 0) or tries > 60:
                break
        if hit < 0 or first < d * (1.0 - 1e-9):
            if hit >= 0:
                below, above = 0.0, d
            hit, side = who, way
            d = 0.0 if first <= 1e-12 * span.h else first
            if d == 0.0:
                break
            continue
        if abs(gap) <= 1e-13 * span.scale or again == d:
            break
        if gap > 0.0:
            below = d
        else:
            above = d
        if above - below <= 1e-15 * span.h:
            # the slip reached zero only in the longer sub-step
            missed = gap > 1e-9 * span.scale
            break
        d = again if below < again < above else 0.5 * (below + above)
    return d, hit, side, missed, shorter, jams


@njit(**INLINED)
def take_elements(d: float, cap: Floats, mode: Ints, el: Floats, work: Floats, at: Places) -> None:
    """Set the friction torques at the end of a sub-step without shafts, and add impulses and heat."""
    for f in range(mode.shape[0]):
        lam = 0.5 * (work[at.torque0 + f] + work[at.torque1 + f])
        slip = 0.5 * (work[at.slip0 + f] + work[at.slip1 + f])
        el[LAM, f] = work[at.torque1 + f]
        el[IMPULSE, f] += d * lam
        if mode[f] != STUCK and mode[f] != OPEN:
            el[E_FRIC, f] += d * lam * slip  # of rounding size for a locked element
        el[E_VISC, f] += d * cap[VISC, f] * slip * slip


@njit(**INLINED)
def take(d: float, span: Span, structure: Structure, loads: Loads, loss: Floats, state: State) -> None:
    """Move the state by the sub-step of d that has been solved."""
    q, mode, v, twist, work = loads.q, state.mode, state.v, state.twist, state.work
    at, n, slots = span.at, v.shape[0], structure.sh.shape[0]
    xa, xb = span.done / span.h, share_at(d, span)
    for k in range(loss.shape[0]):
        loss[k, LAST] = loss[k, NEXT]
    if slots > 0:
        take_by_nodes(d, xa, xb, structure, loads, state, at)
    else:
        take_elements(d, loads.cap, mode, state.el, work, at)
    for j in range(n):
        gain = work[at.mean + j] if slots > 0 else 0.5 * work[at.dv + j]
        turned = d * (v[j] + gain)
        if slots == 0:
            force = 0.5 * (lin(q[0, j], q[1, j], xa) + lin(q[0, j], q[1, j], xb))
            state.e_in[j] += d * force * (v[j] + gain)
        if twist.shape[0] > slots:
            twist[slots + j] += turned
        work[at.lag + j] += 0.5 * (xa + xb - 1.0) * turned
        v[j] += work[at.dv + j]
    stuck = False
    for f in range(mode.shape[0]):
        work[at.side + f] = 0.0
        stuck |= mode[f] == STUCK
    if stuck:
        # without this, a locked clutch would creep by rounding over millions of steps
        for f in range(mode.shape[0]):
            if mode[f] == STUCK:
                slip = rate_along(structure.w, f, v, work, at.w_ends)
                work[at.slip1 + f] = slip if n < WIDE or abs(slip) > ROUNDED * span.scale else 0.0
        unslip(v, mode.shape[0], mode, int(0), at.slip1, at.r, work)


@njit(**INLINED)
def longest_part(h: float, structure: Structure, cap: Floats, work: Floats) -> float:
    """Return the longest sub-step of a step h, which shafts divide."""
    if structure.sh.shape[0] == 0:
        return h
    if work[RATE_OF] != work[0]:
        work[RATE], work[RATE_OF] = fastest_rate(structure, cap, work), work[0]
    return part_of(h, work[RATE])


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def driveline_step(h: float, t: float, structure: Structure, loads: Loads, loss: Floats, state: State) -> int:
    """Move a driveline with m friction elements from t to t + h and return the number of events in the step.

    Parameters
    ----------
    h : float
        Length of the step [s].
    t : float
        Time at its start [s].
    structure, loads, state : Structure, Loads, State
        The driveline; the state is changed in place. Beyond 6 m + 12 events in one step, or where the set of stuck elements could
        not be decided more than UNDECIDED times, the rest of the step runs with the modes as they are, and counts as capped.
    loss : (k, loss_width(n, m)) array
        Losses that grow with a torque, with the columns of driveline.losses. The capacities, above 0, of the elements that they
        own come from there.

    Returns
    -------
    int
        Number of events.
    """
    noinline()
    short_loops()
    w, cap, work, count = structure.w, loads.cap, state.work, state.count
    m = w.shape[0]
    at = places(state.v.shape[0], m, structure.sh.shape[0], loss.shape[0])
    scale, made, joint = begin_step(t, structure, cap, loss, state, at)
    done, passes, stalls, undecided = 0.0, 0, 0, 0
    hit = changed = int(-1)  # element whose event has ended the last sub-step; element of the last event
    jams = int(-1)  # element of a mesh that jams at this moment
    while True:
        if jams >= 0:
            # the only call of stop, because each call is compiled with the passing of all these arrays
            made += stop(t + done, jams, structure, cap, loss, state)
            jams = int(-1)
            joint = True
        if joint:
            mark(1e-12 * scale, w, state, at)
            # a joint decision that was reversed at once was one between equal choices: decide with the inputs of a later instant
            ahead = (h - done) * min(1e-3, 10.0 ** (stalls - 10)) if stalls > 1 else 0.0
            capped = count[N_CAPPED]
            decided = resolve((done + ahead) / h, t + done, structure, loads, loss, state)
            if decided < 0:
                jams = -1 - decided
                continue
            made += decided
            joint = False
            if count[N_CAPPED] != capped:
                undecided += 1
        passes += 1
        if passes == 6 * m + 13:
            count[N_CAPPED] += 1
            count[WORST] = changed
        if h - done <= 0.0:
            break
        put_last(loss, cap)
        start_forces(done / h, structure, loads, state, at)
        answer_forces(state.mode, state.v.shape[0], work, at)
        longest = longest_part(h, structure, cap, work)
        span = Span(h, done, scale, longest, passes <= 6 * m + 12 and undecided <= UNDECIDED, at)
        d, hit, side, missed, shorter, jams = sub_step(span, structure, loads, loss, state)
        if jams >= 0:
            continue
        if d > 0.0:
            take(d, span, structure, loads, loss, state)
            done = h if ends(d, span) else done + d
            if hit < 0 and shorter and d == longest:
                passes -= 1  # one of several parts, which does not count as an event
            elif 0.0 <= work[FIRST] <= 1e-9 * h:
                work[FIRST] = done
        if hit < 0 and not shorter:
            break
        if hit >= 0:
            stalls, changed = 0 if d > 0.0 else stalls + 1, hit
        if hit < 0 or missed:
            continue
        work[at.candidate + hit] = 1.0
        work[at.side + hit] = side
        joint = True
    return made
