# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of a driveline without shafts in which no event happens: most steps of a rig, at a fraction of the cost.

The engine calls it before driveline/kernel.py, which takes the steps that this one leaves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    E_FRIC,
    E_VISC,
    FORWARD,
    HEAD,
    HI0,
    HI1,
    IMPULSE,
    KIN0,
    KIN1,
    LAM,
    LO0,
    LO1,
    LOCKED_HIGH,
    LOCKED_LOW,
    OPEN,
    STUCK,
    VISC,
    beyond,
    has_capacity,
    if_stuck,
    places,
)
from rig_nodes.driveline.losses import BEFORE, LAST, NEXT, PREDICTED, WAY, WEIGHTS, loss_at, predict_losses, put_predicted
from rig_nodes.driveline.small_vectors import add, dot, product, put, room, scaled, vector
from rig_nodes.driveline.stuck import implicit, stale
from rig_nodes.driveline.wide import WIDE

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints, Record

EVENT, DONE, CORRECTED = 0, 1, 2  # outcomes of attempt
ATTEMPTS = 5  # most attempts at a step; each multiplies the error of a predicted loss by the slope of loss over torque
NEAR = 1e-9  # Nm, in place of PREDICTED where stuck elements share a torque, because their shares depend on the loss itself


@njit(**INLINED)
def borne(cap: Floats, f: int, mode: int, end: int) -> float:
    """Return the torque of an element at one end (0 or 1) of a step, by its limits; 0 where it is open or sticks."""
    if mode == FORWARD or mode == BACKWARD:
        return mode * cap[KIN0 + end, f]
    if mode == LOCKED_HIGH:
        return max(cap[HI0 + end, f], cap[KIN0 + end, f])
    if mode == LOCKED_LOW:
        return min(cap[LO0 + end, f], -cap[KIN0 + end, f])
    return 0.0


@njit(**INLINED)
def held(speed: tuple[float, ...], mode: Ints, w: Floats, work: Floats, orr: int, v: Floats) -> tuple[float, ...]:
    """Return the speeds without the slip that rounding leaves in stuck elements, which would add up over millions of steps.

    R, the torques of the stuck elements per force, begins at orr in the work buffer; v is passed for its length, the number of
    speeds.
    """
    kept = speed
    for f in range(mode.shape[0]):
        if mode[f] == STUCK:
            kept = add(kept, -dot(vector(w, f * v.shape[0], v), speed), vector(work, orr + f * v.shape[0], v))
    return kept


@njit(**INLINED)
def rounding(v: Floats) -> float:
    """Return up to which slip [rad/s] an element counts as without slip, at these speeds."""
    vmax = 0.0
    for j in range(v.shape[0]):
        vmax = max(vmax, abs(v[j]))
    return 1e-12 * (1.0 + vmax)


@njit(**INLINED)
def fitting(mode: Ints, cap: Floats, slip: Floats, tol: float, work: Floats) -> tuple[bool, bool]:
    """Return whether each mode (m,) is one of its capacity and slip (m,), and whether stuck elements prevent the slip of another.

    The latter carries its limit. Where a mode does not fit, an event is possible.
    """
    shared, fits, m = False, work[0] > 0.0, mode.shape[0]
    for f in range(m):
        mo = mode[f]
        fits &= (work[HEAD + 2 * m + f] != 0.0) == (mo == STUCK)
        if has_capacity(cap, f):
            if mo == LOCKED_HIGH or mo == LOCKED_LOW:
                shared = True
            elif mo != STUCK and ((mo != FORWARD and mo != BACKWARD) or mo * slip[f] < -tol):
                fits = False
        elif mo != OPEN:
            fits = False
    return fits, shared


@njit(**INLINED)
def shares_hold(mode: Ints, torque: Floats, w: Floats, orr: int, work: Floats) -> bool:
    """Return whether each element that carries its limit would exceed it by sticking too, at the torques (m,) of the start."""
    hold = True
    for f in range(mode.shape[0]):
        if mode[f] == LOCKED_HIGH or mode[f] == LOCKED_LOW:
            hold &= beyond(torque[f], mode[f], if_stuck(f, mode, int(0), torque, int(0), w, orr, work)) > 0.0
    return hold


@njit(**INLINED)
def holds(l0: float, l1: float, cap: Floats, f: int) -> bool:
    """Return whether a stuck element holds its torques at both ends of a step."""
    lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
    if max(cap[HI1, f], cap[KIN1, f]) - l1 < -lim or max(cap[HI0, f], cap[KIN0, f]) - l0 < -4.0 * lim:
        return False
    return not (l1 - min(cap[LO1, f], -cap[KIN1, f]) < -lim or l0 - min(cap[LO0, f], -cap[KIN0, f]) < -4.0 * lim)


@njit(**INLINED)
def losses_met(loss: Floats, torque: Floats, gained: tuple[float, ...], near: float, v: Floats) -> bool:
    """Return whether all losses are what the torques (m,) and accelerations at a step's end demand, and correct them if not.

    The losses of a step that meets them become those of the last step.
    """
    m, met = torque.shape[0], True
    for k in range(loss.shape[0]):
        total = dot(vector(loss, k * loss.shape[1] + WEIGHTS + m, v), gained)
        for f in range(m):
            total += loss[k, WEIGHTS + f] * torque[f]
        asked = loss_at(loss, k, total, v[int(loss[k, WAY])])
        met = met and abs(asked - loss[k, NEXT]) <= near
        loss[k, NEXT] = asked
    if met:
        for k in range(loss.shape[0]):
            loss[k, BEFORE] = loss[k, LAST]
            loss[k, LAST] = loss[k, NEXT]
    return met


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True, _nrt=False)
def attempt(h: float, line: Record, before: int) -> int:
    """Take the step of :func:`quiet_step` with predicted losses by torque, or with those that the attempts ``before`` corrected.

    Returns DONE; EVENT when an event is possible (a change of mode, a root, a limit, or another set of stuck elements than in the
    last step); or CORRECTED when a loss differs from its prediction. After EVENT and CORRECTED nothing has changed but this
    prediction. Where stuck elements share a torque with an element that carries its limit, as several brakes of a shaft at rest do,
    this element keeps its mode if its torque would exceed its limit by sticking too.

    The type of the record contains the sizes of the driveline and which elements the losses own, so that they are constants for the
    compiler.
    """
    w, q, cap, loss, v = line.w, line.q, line.cap, line.loss, line.v
    mode, el, e_in, work, own = line.mode, line.el, line.e_in, line.work, line.own.shape
    m, n = w.shape
    at = places(n, m, int(0), loss.shape[0])
    op, oh, orr = at.p, at.h, at.r
    slip0, slip1, torque0, torque1 = room(mode), room(mode), room(mode), room(mode)
    speed = vector(v, 0, v)
    force = vector(q, 0, v)
    if before == 0:
        predict_losses(loss)
    for k in range(loss.shape[0]):
        put_predicted(loss, cap, own[k], k)
    tol = rounding(v)
    for f in range(m):
        along = vector(w, f * n, v)
        slip0[f], torque0[f] = dot(along, speed), borne(cap, f, mode[f], int(0))
        force = add(force, -(torque0[f] + cap[VISC, f] * slip0[f]), along)
    fits, shared = fitting(mode, cap, slip0, tol, work)
    if not fits:
        return EVENT
    if stale(h, cap, work):
        implicit(h, w, cap, work)
    # acceleration at the start, without the implicit parts
    accel = product(work, op, force)
    for f in range(m):
        if mode[f] == STUCK:
            torque0[f] = dot(vector(work, orr + f * n, v), force)
    if shared:
        if not shares_hold(mode, torque0, w, orr, work):
            return EVENT
        speed = held(speed, mode, w, work, orr, v)  # as in the joint decision of such modes
    change = add(vector(q, n, v), -1.0, vector(q, 0, v))
    for f in range(m):
        if mode[f] != STUCK:
            torque1[f] = borne(cap, f, mode[f], int(1))
            change = add(change, torque0[f] - torque1[f], vector(w, f * n, v))
    dv = scaled(h, product(work, oh, add(force, 0.5, change)))
    for f in range(m):
        along = vector(w, f * n, v)
        gain = dot(along, dv)
        slip1[f] = slip0[f] + gain
        change = add(change, -cap[VISC, f] * gain, along)
    end = add(force, 1.0, change)
    for f in range(m):
        mo = mode[f]
        if mo == STUCK:
            torque1[f] = dot(vector(work, orr + f * n, v), end)
            if not holds(torque0[f], torque1[f], cap, f):
                return EVENT
        elif mo == FORWARD or mo == BACKWARD:
            y0 = mo * slip0[f]
            speeding = mo * dot(vector(w, f * n, v), accel)
            if not (y0 > tol and mo * slip1[f] > 0.0 and (speeding >= 0.0 or y0 + speeding * h > 0.0)):
                return EVENT
    if loss.shape[0] > 0:
        near = NEAR if shared else PREDICTED
        # accelerations at the end, by the trapezoidal rule
        gained = add(scaled(2.0 / h, dv), -1.0, accel)
        if not losses_met(loss, torque1, gained, near, v):
            return CORRECTED
    stuck = False
    for f in range(m):
        mo = mode[f]
        lam = 0.5 * (torque0[f] + torque1[f])
        slip = 0.5 * (slip0[f] + slip1[f])
        el[LAM, f] = torque1[f]
        el[IMPULSE, f] += h * lam
        if mo == STUCK:
            stuck = True
        elif mo != OPEN:
            el[E_FRIC, f] += h * lam * slip
        el[E_VISC, f] += h * cap[VISC, f] * slip * slip
    middle = add(speed, 0.5, dv)
    for j in range(n):
        e_in[j] += h * (0.5 * (q[0, j] + q[1, j])) * middle[j]
    speed = add(speed, 1.0, dv)
    put(v, 0, held(speed, mode, w, work, orr, v) if stuck else speed)
    return DONE


@njit(**INLINED)
def quiet_step(h: float, line: Record) -> bool:
    """Take a step like `driveline_step` on a driveline's record (plant.engine.world.driveline_dtype) if no event can happen in it.

    Returns True when the step is done. Returns False when an event is possible, or when a predicted loss by torque is still wrong
    after the last attempt. Then nothing has changed, and `driveline_step` has to be called; it solves the losses that are predicted
    here.
    """
    # many speeds cost the other step less; int(): a literal would make numba compile the step once more
    how, before = EVENT if line.v.shape[0] >= WIDE else CORRECTED, int(0)
    while how == CORRECTED and before < ATTEMPTS:  # a loop, so that the step is compiled once
        how = attempt(h, line, before)
        before += 1
    return how == DONE
