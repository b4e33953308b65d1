# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One compiled step of the general driveline, with stick/slip events at their exact time inside the step.

Used by driveline/builder.py (description and runner) and by every larger kernel that moves a drive train. The topology is given by
arrays only, so that one compiled function serves every arrangement.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.compiled import INNER, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    CLOSE,
    CROSS,
    E_FRIC,
    E_SHAFT,
    E_VISC,
    FIRST,
    FORWARD,
    FREE,
    IMPULSE,
    KIN0,
    KIN1,
    LAM,
    LOCKED_HIGH,
    LOCKED_LOW,
    N_CAPPED,
    OPEN,
    STUCK,
    TAU,
    VISC,
    has_capacity,
    high,
    implicit,
    lin,
    low,
    noinline,
    places,
    project,
    stale,
)
from rig_nodes.driveline.joint import jammed, note, resolve, stop
from rig_nodes.driveline.losses import BEFORE, FACTOR, LAST, NEXT, ON, OWN, WEIGHTS, brakes, put_losses, solve_losses

if TYPE_CHECKING:
    from rig_nodes.base.arrays import Floats, Ints

JAM = 1e-3  # share of a step: accuracy of the time at which a mesh jams
UNDECIDED = 3  # most failed decisions in a step; one of them takes as much time as a hundred successful ones


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


@njit(**INNER)
def end_losses(d: float, w: Floats, sh: Floats, kc: Floats, cap: Floats, loss: Floats, v: Floats, mode: Ints, work: Floats) -> bool:
    """Set NEXT to the losses at the end of a sub-step of d, from its forces without them; return False where there is no solution.

    A force F changes the speed reached by d H F / 2, the torque of a stuck element by R (1 - d B H / 2) F, and the acceleration at
    the end by H F: mean and end of the trapezoidal rule.
    """
    m, n = w.shape
    k = loss.shape[0]
    at = places(n, m, sh.shape[0], k)
    oh, orr, of, oa, odf, ol1, orho, oz, oy, os, orow = (
        at.h,
        at.r,
        at.force,
        at.accel,
        at.dforce,
        at.torque1,
        at.rho,
        at.z,
        at.given,
        at.fall,
        at.row,
    )
    for a in range(k):
        for j in range(n):
            total = 0.0
            for f in range(m):
                if mode[f] == STUCK:
                    total += loss[a, WEIGHTS + f] * work[orr + f * n + j]
            work[orho + a * n + j] = total
        for j in range(n):
            work[oz + a * n + j] = 0.0
        for f in range(m):
            along = 0.0
            for j in range(n):
                along += work[orho + a * n + j] * w[f, j]
            for j in range(n):
                work[oz + a * n + j] += cap[VISC, f] * along * w[f, j]
        for i in range(sh.shape[0]):
            along = 0.0
            for j in range(n):
                along += work[orho + a * n + j] * sh[i, j]
            for j in range(n):
                work[oz + a * n + j] += (kc[1, i] + 0.5 * d * kc[0, i]) * along * sh[i, j]
    for a in range(k):
        y = 0.0
        for f in range(m):
            if mode[f] != STUCK:
                y += loss[a, WEIGHTS + f] * work[ol1 + f]
        for j in range(n):
            mean = 0.0
            for i in range(n):
                mean += work[oh + j * n + i] * (work[of + i] + 0.5 * work[odf + i])
            end = 2.0 * mean - work[oa + j]
            force = work[of + j] + work[odf + j]
            y += work[orho + a * n + j] * force - work[oz + a * n + j] * d * mean + loss[a, WEIGHTS + m + j] * end
            row = work[orho + a * n + j]
            for i in range(n):
                row += (loss[a, WEIGHTS + m + i] - 0.5 * d * work[oz + a * n + i]) * work[oh + i * n + j]
            work[orow + j] = row
        work[oy + a] = y
        for b in range(k):
            on = int(loss[b, ON])
            by = brakes(loss[b, FACTOR], mode[on])
            fall = -loss[a, WEIGHTS + on] * by
            for j in range(n):
                fall += work[orow + j] * w[on, j] * by
            work[os + a * k + b] = fall
    return solve_losses(loss, v, work, oy, os, at.newton)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def driveline_step(
    h: float,
    t: float,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats | None,
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
    """Move a driveline from t to t + h and return the number of events in the step.

    There are n speeds, m friction elements (m <= 50), s shafts and k losses. Every array is float64 and C-contiguous unless said
    otherwise, in SI units. Modes, kinds and names of rows are those of driveline_algebra. Nothing is allocated.

    Equations of motion and law of friction:
    M dv/dt = q - W^T (lam + visc W v) - S^T tau, tau = k twist + c S v, d twist/dt = S v, slip = W v;
    slipping: lam = sign(slip) kin; stuck: slip = 0, lo <= lam <= hi.

    Parameters
    ----------
    h : float
        Length of the step [s].
    t : float
        Time at its start [s].
    minv : (n, n) array
        Inverse of M.
    w : (m, n) array
        W, slips by the speeds.
    sh : (s, n) array
        S, rates of the shafts' twists by the speeds.
    kc : (2, s) array
        Stiffness and damping of the shafts.
    q : (2, n) array
        Forces on the speeds. Rows 0 and 1 of q and the 0/1 pairs of cap hold the right limit at t and the left limit at t + h.
        They are linear in between, so jumps belong on step boundaries.
    cap : (7, m) array
        Rows KIN0, KIN1: kinetic torque >= 0; LO0, LO1 <= 0 and HI0, HI1 >= 0: stick limits (a limit below the kinetic torque
        counts as the kinetic torque; infinite at both ends or at none); VISC: drag coefficient over the step. An element with
        kin, lo, hi zero at both ends is OPEN.
    loss : (k, loss_width(n, m)) array, or None
        Losses that grow with a torque, with the columns of driveline_losses. The capacities, above 0, of the elements that they
        own come from there. None where there are no losses: the step is then compiled without them, which saves a tenth
        of its time.
    v : (n,) array
        Speeds, changed in place.
    twist : (s,) or (s + n,) array
        Twists of the shafts and, where there is room, the integrals of the speeds; changed in place.
    mode : (m,) array of int64
        Modes, changed in place. The mode OPEN is set automatically at the start of the step; a locked element must have zero
        slip when it is passed in.
    el : (4, m) array
        Output. LAM: friction torque at the end (positive opposes positive slip, without drag); IMPULSE += int lam dt;
        E_FRIC += int lam slip dt; E_VISC += int visc slip^2 dt.
    shaft : (2, s) array
        Output. TAU: torque at the end; E_SHAFT += int c (S v)^2 dt.
    e_in : (n,) array
        Output, += int q v dt.
    events : (rows, 3) or (rows, 3 + 2 n) array
        Time, element, kind, and the speeds v and their integrals at each event, a ring that is filled from row 0. Where it has
        speeds, twist must have room for the integrals.
    count : (2,) array of int64
        N_EVENTS: events so far; N_CAPPED: steps in which the bound on events or pivots was reached. Beyond 6 m + 12 events in
        one step, or where the set of stuck elements could not be decided more than UNDECIDED times, the rest of the step runs
        with the modes as they are.
    work : array
        At least work_size(n, m, s, k) numbers, zeros at first.

    Returns
    -------
    int
        Number of events.

    Notes
    -----
    With fixed modes the step is the trapezoidal rule, which is exact where there is neither drag nor shaft (acceleration linear,
    speed quadratic in time) and A-stable where there is. Zero slip is a root of the quadratic and overload a root of the linear
    function; with drag or shafts the shortened step is solved again until its end meets the root. An energy is the product of mean
    torque and mean slip. With these energies the trapezoidal rule satisfies work = kinetic + spring energy + losses to rounding,
    for any step, and no loss can become negative. Compared with the exact integrals they are of second order in the step.
    """
    noinline()
    n = minv.shape[0]
    m = w.shape[0]
    s = sh.shape[0]
    at = places(n, m, s, int(0) if loss is None else loss.shape[0])
    op, oh, orr, of, oa, odf, odv, orate = at.p, at.h, at.r, at.force, at.accel, at.dforce, at.dv, at.rate
    ost, ocand, oforce, olossy = at.state, at.candidate, at.side, at.lossy
    os0, os1, ol0, ol1 = at.slip0, at.slip1, at.torque0, at.torque1
    if loss is not None:
        for f in range(m):
            work[olossy + f] = 0.0
        for k in range(loss.shape[0]):
            work[olossy + int(loss[k, OWN])] = 1.0
            loss[k, BEFORE] = loss[k, LAST]
        put_losses(loss, cap, int(0), int(LAST))
        put_losses(loss, cap, int(1), int(LAST))
    work[FIRST] = 0.0
    made = 0
    joint = False
    vmax = 0.0
    for j in range(n):
        vmax = max(vmax, abs(v[j]))
    tol = 1e-12 * (1.0 + vmax)
    for f in range(m):
        mo = mode[f]
        work[oforce + f] = 0.0
        if not has_capacity(cap, f):
            if mo != OPEN:
                note(t, f, int(FREE), v, twist, events, count)
                made += 1
                mode[f] = OPEN
        elif mo == OPEN or abs(mo) == 1:
            slip = 0.0
            for j in range(n):
                slip += w[f, j] * v[j]
            if mo == OPEN:
                if abs(slip) <= tol:
                    work[ocand + f] = 1.0
                    joint = True
                else:
                    mode[f] = FORWARD if slip > 0.0 else BACKWARD
                    note(t, f, int(CLOSE), v, twist, events, count)
                    made += 1
            elif mo * slip < -tol:
                if mo * slip < -1e-6 * (1.0 + vmax):
                    # a capped step has left this mode, or the caller has set another speed
                    mode[f] = -mo
                    note(t, f, int(CROSS), v, twist, events, count)
                    made += 1
                else:
                    work[ocand + f] = 1.0
                    joint = True
        elif mo != STUCK:
            joint = True
    tl = 0.0
    passes = 0
    stalls = 0
    undecided = 0
    jams = int(-1)  # element of a mesh that jams at this moment
    while True:
        if loss is not None and jams >= 0:
            # the only call of stop, because each call is compiled with the passing of all these arrays
            made += stop(t + tl, jams, minv, w, sh, cap, loss, v, twist, mode, el, events, count, work)
            jams = int(-1)
            joint = True
        if joint:
            for f in range(m):
                if abs(mode[f]) >= 2:
                    work[ocand + f] = 1.0
                elif mode[f] != OPEN:
                    slip = 0.0
                    for j in range(n):
                        slip += w[f, j] * v[j]
                    if abs(slip) <= tol:
                        work[ocand + f] = 1.0
            # a joint decision that was reversed at once was one between equal choices: decide with the inputs of a later instant
            ahead = (h - tl) * min(1e-3, 10.0 ** (stalls - 10)) if stalls > 1 else 0.0
            capped = count[N_CAPPED]
            losses = cap[:0] if loss is None else loss
            decided = resolve((tl + ahead) / h, t + tl, minv, w, sh, kc, q, cap, losses, v, twist, mode, el, events, count, work)
            if decided < 0:
                jams = -1 - decided
                continue
            made += decided
            joint = False
            if count[N_CAPPED] != capped:
                undecided += 1
        passes += 1
        watch = passes <= 6 * m + 12 and undecided <= UNDECIDED
        if passes == 6 * m + 13:
            count[N_CAPPED] += 1
        xa = tl / h
        left = h - tl
        if left <= 0.0:
            break
        # forces at the start of the sub-step; put_losses sets the capacities under losses at both ends
        if loss is not None:
            put_losses(loss, cap, int(0), int(LAST))
            put_losses(loss, cap, int(1), int(LAST))
        pattern = 1.0
        bit = 1.0
        for j in range(n):
            work[of + j] = lin(q[0, j], q[1, j], xa)
        for a in range(s):
            rate = 0.0
            for j in range(n):
                rate += sh[a, j] * v[j]
            work[orate + a] = rate
            torque = kc[0, a] * twist[a] + kc[1, a] * rate
            for j in range(n):
                work[of + j] -= sh[a, j] * torque
        for f in range(m):
            mo = mode[f]
            slip = 0.0
            for j in range(n):
                slip += w[f, j] * v[j]
            work[os0 + f] = slip
            torque = 0.0
            if mo == FORWARD or mo == BACKWARD:
                torque = mo * lin(cap[KIN0, f], cap[KIN1, f], xa)
            elif mo == STUCK:
                pattern += bit
            elif mo == LOCKED_HIGH:
                torque = high(cap, f, xa)
            elif mo == LOCKED_LOW:
                torque = low(cap, f, xa)
            bit *= 2.0
            work[ol0 + f] = torque
            torque += cap[VISC, f] * slip
            for j in range(n):
                work[of + j] -= w[f, j] * torque
        if work[0] != pattern:
            for f in range(m):
                work[ost + f] = mode[f]
            project(minv, w, ost, work)
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += work[op + i * n + j] * work[of + j]
            work[oa + i] = total
        for f in range(m):
            if mode[f] == STUCK:
                total = 0.0
                for j in range(n):
                    total += work[orr + f * n + j] * work[of + j]
                work[ol0 + f] = total
        d = left
        hit = -1
        side = 0
        below = 0.0
        above = left
        tries = 0
        missed = False
        shorter = False
        while True:
            if stale(d, pattern, cap, work):
                implicit(d, w, sh, kc, cap, work)
            xb = 1.0 if d == left else (tl + d) / h
            if loss is not None:
                put_losses(loss, cap, int(1), int(-1))
            for j in range(n):
                work[odf + j] = lin(q[0, j], q[1, j], xb) - lin(q[0, j], q[1, j], xa)
            for f in range(m):
                mo = mode[f]
                if mo == OPEN:
                    work[ol1 + f] = 0.0
                elif mo != STUCK:
                    xe = xb if loss is None or work[olossy + f] == 0.0 else 1.0
                    if mo == LOCKED_HIGH:
                        torque = high(cap, f, xe)
                    elif mo == LOCKED_LOW:
                        torque = low(cap, f, xe)
                    else:
                        torque = mo * lin(cap[KIN0, f], cap[KIN1, f], xe)
                    work[ol1 + f] = torque
                    torque -= work[ol0 + f]
                    for j in range(n):
                        work[odf + j] -= w[f, j] * torque
            # spring force grows by k d (rate at the start) before anything implicit
            for a in range(s):
                torque = kc[0, a] * d * work[orate + a]
                for j in range(n):
                    work[odf + j] -= sh[a, j] * torque
            if loss is not None and loss.shape[0] > 0:
                if not end_losses(d, w, sh, kc, cap, loss, v, mode, work):
                    # a mesh jams in this sub-step; halve it until it ends just before that
                    if watch:
                        for f in range(m):
                            work[ost + f] = mode[f]
                        jams = jammed(minv, w, loss, ost, op, at.fall, work)
                    if jams >= 0:
                        if d <= JAM * h:
                            break
                        shorter = True
                        hit, side, tries, below = -1, 0, 0, 0.0
                        d *= 0.5
                        above = d
                        jams = int(-1)
                        continue
                    count[N_CAPPED] += 1
                put_losses(loss, cap, int(1), int(NEXT))
                for k in range(loss.shape[0]):
                    f = int(loss[k, ON])
                    torque = brakes(loss[k, FACTOR], mode[f]) * loss[k, NEXT]
                    work[ol1 + f] += torque
                    for j in range(n):
                        work[odf + j] -= w[f, j] * torque
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += work[oh + i * n + j] * (work[of + j] + 0.5 * work[odf + j])
                work[odv + i] = d * total
            for a in range(s):
                gain = 0.0
                for j in range(n):
                    gain += sh[a, j] * work[odv + j]
                torque = (kc[1, a] + 0.5 * d * kc[0, a]) * gain
                for j in range(n):
                    work[odf + j] -= sh[a, j] * torque
            for f in range(m):
                gain = 0.0
                for j in range(n):
                    gain += w[f, j] * work[odv + j]
                work[os1 + f] = work[os0 + f] + gain
                torque = cap[VISC, f] * gain
                for j in range(n):
                    work[odf + j] -= w[f, j] * torque
            for f in range(m):
                if mode[f] == STUCK:
                    total = 0.0
                    for j in range(n):
                        total += work[orr + f * n + j] * (work[of + j] + work[odf + j])
                    work[ol1 + f] = total
            if not watch:
                break
            first = np.inf
            who = -1
            way = 0
            gap = 0.0
            again = np.inf
            for f in range(m):
                mo = mode[f]
                if mo == FORWARD or mo == BACKWARD:
                    y0 = mo * work[os0 + f]
                    y1 = mo * work[os1 + f]
                    speeding = 0.0
                    for j in range(n):
                        speeding += w[f, j] * work[oa + j]
                    if f == hit:
                        gap = y1
                        # if the sub-step ends before the root, this time lies beyond that end
                        fall = 2.0 * (y1 - y0) / d - mo * speeding
                        if y1 <= 0.0:
                            again = first_down(y0, mo * speeding, y1, d, tol)
                        elif fall < 0.0:
                            again = d - y1 / fall
                        continue
                    te = first_down(y0, mo * speeding, y1, d, tol)
                    if te < first:
                        first = te
                        who = f
                        way = 0
                elif mo == STUCK:
                    l0 = work[ol0 + f]
                    l1 = work[ol1 + f]
                    lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
                    xs = xa
                    xe = xb
                    if loss is not None and work[olossy + f] != 0.0:
                        xs = 0.0
                        xe = 1.0
                    for sign in (1, -1):
                        if sign > 0:
                            y0 = high(cap, f, xs) - l0
                            y1 = high(cap, f, xe) - l1
                        else:
                            y0 = l0 - low(cap, f, xs)
                            y1 = l1 - low(cap, f, xe)
                        te = d * y0 / (y0 - y1) if y0 > 0.0 and y1 < y0 else 0.0
                        if f == hit and sign == side:
                            gap = y1
                            again = te
                        elif (y1 < -lim or y0 < -4.0 * lim) and te < first:
                            first = te
                            who = f
                            way = sign
            if hit < 0:
                if who < 0:
                    break
                hit = who
                side = way
                if first >= d * (1.0 - 1e-12):
                    break
                if first <= 1e-12 * h:
                    d = 0.0
                    break
                d = first
            else:
                # in a linear problem the shortened step ends at the root; with drag, shafts or losses it does not end exactly there
                tries += 1
                if (work[3] == 0.0 and (loss is None or loss.shape[0] == 0)) or tries > 60:
                    break
                if first < d * (1.0 - 1e-9):
                    hit = who
                    side = way
                    below = 0.0
                    above = d
                    if first <= 1e-12 * h:
                        d = 0.0
                        break
                    d = first
                    continue
                if abs(gap) <= 1e-13 * (1.0 + vmax) or again == d:
                    break
                if gap > 0.0:
                    below = d
                else:
                    above = d
                if above - below <= 1e-15 * h:
                    # the slip reached zero only in the longer sub-step
                    missed = gap > 1e-9 * (1.0 + vmax)
                    break
                d = again if below < again < above else 0.5 * (below + above)
        if jams >= 0:
            continue
        if d > 0.0:
            if 0.0 <= work[FIRST] <= 1e-9 * h:
                work[FIRST] = tl + d
            if loss is not None:
                for k in range(loss.shape[0]):
                    loss[k, LAST] = loss[k, NEXT]
            stuck = False
            for f in range(m):
                work[oforce + f] = 0.0
                lam = 0.5 * (work[ol0 + f] + work[ol1 + f])
                slip = 0.5 * (work[os0 + f] + work[os1 + f])
                el[LAM, f] = work[ol1 + f]
                el[IMPULSE, f] += d * lam
                if mode[f] == STUCK:
                    stuck = True
                elif mode[f] != OPEN:
                    el[E_FRIC, f] += d * lam * slip  # of rounding size for a locked element
                el[E_VISC, f] += d * cap[VISC, f] * slip * slip
            for j in range(n):
                force = 0.5 * (lin(q[0, j], q[1, j], xa) + lin(q[0, j], q[1, j], xb))
                e_in[j] += d * force * (v[j] + 0.5 * work[odv + j])
                if twist.shape[0] > s:
                    twist[s + j] += d * (v[j] + 0.5 * work[odv + j])
                v[j] += work[odv + j]
            for a in range(s):
                gain = 0.0
                for j in range(n):
                    gain += sh[a, j] * work[odv + j]
                rate = work[orate + a] + 0.5 * gain
                twist[a] += d * rate
                shaft[E_SHAFT, a] += d * kc[1, a] * rate * rate
                shaft[TAU, a] = kc[0, a] * twist[a] + kc[1, a] * (work[orate + a] + gain)
            if stuck:
                # without this, a locked clutch would creep by rounding over millions of steps
                for f in range(m):
                    if mode[f] == STUCK:
                        slip = 0.0
                        for j in range(n):
                            slip += w[f, j] * v[j]
                        work[os1 + f] = slip
                for f in range(m):
                    if mode[f] == STUCK:
                        for j in range(n):
                            v[j] -= work[orr + f * n + j] * work[os1 + f]
            tl = h if d == left else tl + d
        if hit < 0:
            if shorter:
                continue
            break
        stalls = 0 if d > 0.0 else stalls + 1
        if missed:
            continue
        work[ocand + hit] = 1.0
        work[oforce + hit] = side
        joint = True
    return made
