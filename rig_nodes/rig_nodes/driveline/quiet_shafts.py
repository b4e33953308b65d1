# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of a driveline with straight shafts in which no event happens, by the equations of driveline/collocation.py.

The engine calls it before driveline/kernel.py, as it calls driveline/quiet.py for a driveline without shafts. The general step
makes the matrices of the method; this one leaves to it each step that needs others or several parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.base import INLINED, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    E_FRIC,
    E_SHAFT,
    E_VISC,
    FORWARD,
    HEAD,
    IMPULSE,
    LAM,
    OPEN,
    RATE,
    RATE_OF,
    STUCK,
    TAU,
    VISC,
    places,
)
from rig_nodes.driveline.collocation import EIGENVALUES, END, MEAN, MOMENT, NODES, PHASE, SHARES, TWICE
from rig_nodes.driveline.collocation import WEIGHTS as OF_NODES
from rig_nodes.driveline.losses import PREDICTED, predict_losses, put_predicted
from rig_nodes.driveline.quiet import (
    ATTEMPTS,
    CORRECTED,
    DONE,
    EVENT,
    NEAR,
    borne,
    fitting,
    held,
    holds,
    losses_met,
    rounding,
    shares_hold,
)
from rig_nodes.driveline.small_vectors import add, dot, product, put, room, scaled, vector
from rig_nodes.driveline.wide import WIDE

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Record

NEARBY = 1e4  # times the change of drag that the general step keeps its matrices for: 1e-8 of the speeds' change in a step


@njit(**INLINED)
def mixed(row: int, z: tuple[tuple[float, ...], ...]) -> tuple[float, ...]:
    """Return the sum of the real and imaginary parts of both z, by a row of SHARES."""
    share = SHARES[row]
    return add(add(add(scaled(share[0], z[0]), share[1], z[1]), share[2], z[2]), share[3], z[3])


@njit(**INLINED)
def mean_square(start: float, along: tuple[float, ...], z: tuple[tuple[float, ...], ...]) -> float:
    """Return the mean square over a step of a rate that is ``start`` at its beginning and changes by ``along`` times the speeds."""
    a, b, c, d = dot(along, z[0]), dot(along, z[1]), dot(along, z[2]), dot(along, z[3])
    total = 0.0
    for i in range(NODES):
        share = SHARES[i]
        rate = start + share[0] * a + share[1] * b + share[2] * c + share[3] * d
        total += OF_NODES[i] * rate * rate
    return total


@njit(**INLINED)
def solved(
    h: float, force: tuple[float, ...], change: tuple[float, ...], work: Floats, nodes: int
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Return real and imaginary parts of both z, for the force at a step's start and its change by all but the speeds."""
    square = len(force) * len(force)
    (re0, im0), (re1, im1) = EIGENVALUES
    x, y = add(force, re0, change), scaled(im0, change)
    r0 = scaled(h, add(product(work, nodes, x), -1.0, product(work, nodes + square, y)))
    i0 = scaled(h, add(product(work, nodes, y), 1.0, product(work, nodes + square, x)))
    x, y, nodes = add(force, re1, change), scaled(im1, change), nodes + 2 * square
    r1 = scaled(h, add(product(work, nodes, x), -1.0, product(work, nodes + square, y)))
    i1 = scaled(h, add(product(work, nodes, y), 1.0, product(work, nodes + square, x)))
    return r0, i0, r1, i1


class Solved(NamedTuple):
    """What a step has been found to do.

    Parameters
    ----------
    slip, torque0, torque1 : (m,) arrays
        Slips at the start [rad/s], and torques at both ends [Nm].
    rates : (s,) array
        Rates of the twists at the start [rad/s].
    speed, dv, mean, moment, during : (n,) vectors
        Speeds at the start, their change, its mean and its moment about the middle of the step [rad/s], and the mean forces [Nm].
    z : (4, n) vectors
        Real and imaginary parts of both z.
    """

    slip: Floats
    torque0: Floats
    torque1: Floats
    rates: Floats
    speed: tuple[float, ...]
    dv: tuple[float, ...]
    mean: tuple[float, ...]
    moment: tuple[float, ...]
    during: tuple[float, ...]
    z: tuple[tuple[float, ...], ...]


@njit(**INLINED)
def take(h: float, line: Record, of: Solved, orr: int) -> None:
    """Move a driveline's record by a step, and add its works and heats; R begins at orr in the work buffer."""
    w, q, cap, v, sh, kc = line.w, line.q, line.cap, line.v, line.sh, line.kc
    mode, el, e_in, work, twist, shaft = line.mode, line.el, line.e_in, line.work, line.twist, line.shaft
    m, n = w.shape
    stuck = False
    for f in range(m):
        mo, along = mode[f], vector(w, f * n, v)
        middle = of.slip[f] + dot(along, of.mean)
        lam = 0.5 * (of.torque0[f] + of.torque1[f])
        if mo == STUCK:
            stuck = True
            lam = dot(vector(work, orr + f * n, v), of.during)
        elif mo != OPEN:
            el[E_FRIC, f] += h * (lam * middle + (of.torque1[f] - of.torque0[f]) * dot(along, of.moment))
        el[LAM, f] = of.torque1[f]
        el[IMPULSE, f] += h * lam
        if cap[VISC, f] != 0.0:
            # the change of the slip is braked by the drag of the matrices, what it was at the start by that of this step
            kept = work[HEAD + f]
            el[E_VISC, f] += h * (kept * mean_square(of.slip[f], along, of.z) + (cap[VISC, f] - kept) * of.slip[f] * middle)
    for j in range(n):
        e_in[j] += h * (0.5 * (q[0, j] + q[1, j]) * (of.speed[j] + of.mean[j]) + (q[1, j] - q[0, j]) * of.moment[j])
    for a in range(sh.shape[0]):
        along, rate = vector(sh, a * n, v), of.rates[a]
        twist[a] += h * (rate + dot(along, of.mean))
        if kc[1, a] != 0.0:
            shaft[E_SHAFT, a] += h * kc[1, a] * mean_square(rate, along, of.z)
        shaft[TAU, a] = kc[0, a] * twist[a] + kc[1, a] * (rate + dot(along, of.dv))
    speed = add(of.speed, 1.0, of.dv)
    put(v, 0, held(speed, mode, w, work, orr, v) if stuck else speed)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True, _nrt=False)
def attempt(h: float, line: Record, before: int) -> int:
    """Take the step of :func:`quiet_shafts_step` with predicted losses, or with those that the attempts ``before`` corrected.

    Returns as `driveline.quiet.attempt` does.
    """
    w, q, cap, loss, v, sh, kc = line.w, line.q, line.cap, line.loss, line.v, line.sh, line.kc
    mode, work, own, twist = line.mode, line.work, line.own.shape, line.twist
    m, n = w.shape
    at = places(n, m, sh.shape[0], loss.shape[0])
    slip0, slip1, torque0, torque1, rates = room(mode), room(mode), room(mode), room(mode), room(twist)
    speed, force = vector(v, 0, v), vector(q, 0, v)
    if before == 0:
        predict_losses(loss)
    for k in range(loss.shape[0]):
        put_predicted(loss, cap, own[k], k)
    tol = rounding(v)
    for f in range(m):
        if not abs(work[HEAD + f] - cap[VISC, f]) <= NEARBY * work[HEAD + m + f]:
            return EVENT
        along = vector(w, f * n, v)
        slip0[f], torque0[f] = dot(along, speed), borne(cap, f, mode[f], int(0))
        force = add(force, -(torque0[f] + cap[VISC, f] * slip0[f]), along)
    fits, shared = fitting(mode, cap, slip0, tol, work)
    if not fits or work[1] != work[0] or work[2] != h or work[RATE_OF] != work[0] or h * work[RATE] > PHASE:
        return EVENT
    for a in range(sh.shape[0]):
        along = vector(sh, a * n, v)
        rates[a] = dot(along, speed)
        force = add(force, -(kc[0, a] * twist[a] + kc[1, a] * rates[a]), along)
    accel = product(work, at.p, force)
    for f in range(m):
        if mode[f] == STUCK:
            torque0[f] = dot(vector(work, at.r + f * n, v), force)
    if shared:
        if not shares_hold(mode, torque0, w, at.r, work):
            return EVENT
        speed = held(speed, mode, w, work, at.r, v)
    change = add(vector(q, n, v), -1.0, vector(q, 0, v))
    for f in range(m):
        if mode[f] != STUCK:
            torque1[f] = borne(cap, f, mode[f], int(1))
            change = add(change, torque0[f] - torque1[f], vector(w, f * n, v))
    for a in range(sh.shape[0]):
        change = add(change, -h * kc[0, a] * rates[a], vector(sh, a * n, v))
    z = solved(h, force, change, work, at.nodes)
    dv, mean, twice = mixed(END, z), mixed(MEAN, z), scaled(h, mixed(TWICE, z))
    end, during = add(force, 1.0, change), add(force, 0.5, change)
    for a in range(sh.shape[0]):
        along = vector(sh, a * n, v)
        by_mean = dot(along, mean)
        end = add(end, -(kc[1, a] * dot(along, dv) + kc[0, a] * h * by_mean), along)
        during = add(during, -(kc[1, a] * by_mean + kc[0, a] * dot(along, twice)), along)
    for f in range(m):
        along = vector(w, f * n, v)
        gain = dot(along, dv)
        slip1[f] = slip0[f] + gain
        end = add(end, -work[HEAD + f] * gain, along)
        during = add(during, -work[HEAD + f] * dot(along, mean), along)
    for f in range(m):
        mo = mode[f]
        if mo == STUCK:
            torque1[f] = dot(vector(work, at.r + f * n, v), end)
            if not holds(torque0[f], torque1[f], cap, f):
                return EVENT
        elif mo == FORWARD or mo == BACKWARD:
            y0 = mo * slip0[f]
            speeding = mo * dot(vector(w, f * n, v), accel)
            if not (y0 > tol and mo * slip1[f] > 0.0 and (speeding >= 0.0 or y0 + speeding * h > 0.0)):
                return EVENT
    if loss.shape[0] > 0 and not losses_met(loss, torque1, product(work, at.p, end), NEAR if shared else PREDICTED, v):
        return CORRECTED
    take(h, line, Solved(slip0, torque0, torque1, rates, speed, dv, mean, add(mixed(MOMENT, z), -0.5, mean), during, z), at.r)
    return DONE


@njit(**INLINED)
def quiet_shafts_step(h: float, line: Record) -> bool:
    """Take a step like `driveline_step` on the record of a driveline with shafts if no event can happen in it.

    Returns as `driveline.quiet.quiet_step` does.
    """
    how, before = EVENT if line.v.shape[0] >= WIDE else CORRECTED, int(0)  # many speeds cost the other step less
    while how == CORRECTED and before < ATTEMPTS:
        how = attempt(h, line, before)
        before += 1
    return how == DONE
