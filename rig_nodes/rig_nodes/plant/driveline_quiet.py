# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of a driveline of two speeds in which nothing happens: most steps of a rig, at a fraction of the cost.

Called by the engine before plant/driveline_kernel.py, which does what this one leaves.
"""

from numba import njit

from rig_nodes.plant.driveline_algebra import (
    BACKWARD, E_FRIC, E_VISC, FORWARD, HEAD, HI0, HI1, IMPULSE, KIN0, KIN1, LAM, LO0, LO1, OPEN, STUCK, VISC,
    has_capacity, implicit_pair, places)
from rig_nodes.plant.driveline_losses import (
    BEFORE, FORETOLD, LAST, NEXT, WAY, WEIGHTS, foretell_losses, loss_at, put_on)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def quiet_step(h, minv, w, q, cap, loss, v, mode, el, e_in, work, first):
    """As `driveline_step` for two speeds without shafts, where a look shows that nothing happens.

    True if it is done; False if something may happen (a change of mode, a root, a limit, another set of stuck elements
    than in the last step, not two speeds, a loss by torque that does not go on as it went): then nothing has changed,
    and `driveline_step` has to be called, which solves the losses that are foretold here.

    first: element of the first of two losses, which that of the second one follows; as a constant of the caller, so that
    the compiler sees which capacities are which. It says nothing without losses.
    """
    m = w.shape[0]
    if minv.shape[0] != 2:
        return False
    at = places(2, m, 0)
    op, oh, orr, os0, os1, ol0, ol1 = at.p, at.h, at.r, at.slip0, at.slip1, at.torque0, at.torque1
    if loss.shape[0] > 0:
        foretell_losses(loss)
        put_on(loss, cap, 0, LAST, first, first + 1)
        put_on(loss, cap, 1, NEXT, first, first + 1)
    vmax = max(max(0.0, abs(v[0])), abs(v[1]))
    tol = 1e-12 * (1.0 + vmax)
    pattern = 1.0
    bit = 1.0
    f0 = q[0, 0]
    f1 = q[0, 1]
    same = True
    for f in range(m):
        mo = mode[f]
        slip = 0.0 + w[f, 0] * v[0]
        slip += w[f, 1] * v[1]
        if has_capacity(cap, f):
            if mo == STUCK:
                pattern += bit
            elif mo != FORWARD and mo != BACKWARD or mo * slip < -tol:
                return False
        elif mo != OPEN:
            return False
        bit *= 2.0
        torque = mo * cap[KIN0, f] if mo == FORWARD or mo == BACKWARD else 0.0
        work[os0 + f] = slip
        work[ol0 + f] = torque
        torque += cap[VISC, f] * slip
        f0 -= w[f, 0] * torque
        f1 -= w[f, 1] * torque
        same = same and work[HEAD + f] == cap[VISC, f]
    if work[0] != pattern:
        return False
    if not same or work[1] != pattern or (work[3] != 0.0 and work[2] != h):
        implicit_pair(h, w, cap, work)
    # acceleration at the start, without what is implicit
    a0 = 0.0 + work[op] * f0 + work[op + 1] * f1
    a1 = 0.0 + work[op + 2] * f0 + work[op + 3] * f1
    d0 = q[1, 0] - q[0, 0]
    d1 = q[1, 1] - q[0, 1]
    for f in range(m):
        mo = mode[f]
        if mo == STUCK:
            work[ol0 + f] = 0.0 + work[orr + 2 * f] * f0 + work[orr + 2 * f + 1] * f1
        else:
            torque = mo * cap[KIN1, f] if mo != OPEN else 0.0
            work[ol1 + f] = torque
            torque -= work[ol0 + f]
            d0 -= w[f, 0] * torque
            d1 -= w[f, 1] * torque
    x0 = f0 + 0.5 * d0
    x1 = f1 + 0.5 * d1
    dv0 = h * (0.0 + work[oh] * x0 + work[oh + 1] * x1)
    dv1 = h * (0.0 + work[oh + 2] * x0 + work[oh + 3] * x1)
    for f in range(m):
        gain = 0.0 + w[f, 0] * dv0
        gain += w[f, 1] * dv1
        work[os1 + f] = work[os0 + f] + gain
        torque = cap[VISC, f] * gain
        d0 -= w[f, 0] * torque
        d1 -= w[f, 1] * torque
    for f in range(m):
        mo = mode[f]
        if mo == STUCK:
            l0 = work[ol0 + f]
            l1 = 0.0 + work[orr + 2 * f] * (f0 + d0) + work[orr + 2 * f + 1] * (f1 + d1)
            work[ol1 + f] = l1
            lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
            if max(cap[HI1, f], cap[KIN1, f]) - l1 < -lim or max(cap[HI0, f], cap[KIN0, f]) - l0 < -4.0 * lim:
                return False
            if l1 - min(cap[LO1, f], -cap[KIN1, f]) < -lim or l0 - min(cap[LO0, f], -cap[KIN0, f]) < -4.0 * lim:
                return False
        elif mo != OPEN:
            y0 = mo * work[os0 + f]
            speeding = mo * (0.0 + w[f, 0] * a0 + w[f, 1] * a1)
            if not (y0 > tol and mo * work[os1 + f] > 0.0 and (speeding >= 0.0 or y0 + speeding * h > 0.0)):
                return False
    if loss.shape[0] > 0:
        # accelerations at the end, by the trapezoidal rule
        end0 = 2.0 * dv0 / h - a0
        end1 = 2.0 * dv1 / h - a1
        g0 = loss[0, WEIGHTS + m] * end0 + loss[0, WEIGHTS + m + 1] * end1
        g1 = loss[1, WEIGHTS + m] * end0 + loss[1, WEIGHTS + m + 1] * end1
        for f in range(m):
            g0 += loss[0, WEIGHTS + f] * work[ol1 + f]
            g1 += loss[1, WEIGHTS + f] * work[ol1 + f]
        g0 = loss_at(loss, 0, g0, v[int(loss[0, WAY])])
        g1 = loss_at(loss, 1, g1, v[int(loss[1, WAY])])
        if not (abs(g0 - loss[0, NEXT]) <= FORETOLD and abs(g1 - loss[1, NEXT]) <= FORETOLD):
            return False
        loss[0, BEFORE] = loss[0, LAST]
        loss[1, BEFORE] = loss[1, LAST]
        loss[0, LAST] = g0
        loss[1, LAST] = g1
    stuck = False
    for f in range(m):
        mo = mode[f]
        lam = 0.5 * (work[ol0 + f] + work[ol1 + f])
        slip = 0.5 * (work[os0 + f] + work[os1 + f])
        el[LAM, f] = work[ol1 + f]
        el[IMPULSE, f] += h * lam
        if mo == STUCK:
            stuck = True
        elif mo != OPEN:
            el[E_FRIC, f] += h * lam * slip
        el[E_VISC, f] += h * cap[VISC, f] * slip * slip
    e_in[0] += h * (0.5 * (q[0, 0] + q[1, 0])) * (v[0] + 0.5 * dv0)
    e_in[1] += h * (0.5 * (q[0, 1] + q[1, 1])) * (v[1] + 0.5 * dv1)
    v0 = v[0] + dv0
    v1 = v[1] + dv1
    if stuck:
        for f in range(m):
            if mode[f] == STUCK:
                work[os1 + f] = 0.0 + w[f, 0] * v0 + w[f, 1] * v1
        for f in range(m):
            if mode[f] == STUCK:
                v0 -= work[orr + 2 * f] * work[os1 + f]
                v1 -= work[orr + 2 * f + 1] * work[os1 + f]
    v[0] = v0
    v[1] = v1
    return True
