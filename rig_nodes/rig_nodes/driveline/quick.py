# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of a driveline with laws, lossy meshes or inputs over time, in which no mode changes.

With shafts it is taken only where their tables are the only laws, by driveline/bent_shafts.py; the rest is for drivelines without.
The engine calls it before driveline/driven.py, which takes the steps that this one leaves. The equations are those of
driveline/law_steps.py. Where that module repeats a step, this one uses Newton's method: the slope of every law over the
step is in the matrix, also where a law acts on other speeds than those that it depends on. A law that stays on one straight piece
of its table is met at once (driveline/quick_laws.py), and the matrix is kept as long as no slope changes.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit, types
from rig_nodes.driveline.algebra import (
    BACKWARD,
    E_FRIC,
    E_VISC,
    FORWARD,
    HI0,
    HI1,
    IMPULSE,
    KIN0,
    KIN1,
    LAM,
    LO0,
    LO1,
    OPEN,
    STUCK,
    TAU,
    VISC,
    eliminate,
    has_capacity,
    noinline,
    places,
    rate_of,
    short_loops,
    sum_at,
)
from rig_nodes.driveline.bent_shafts import only_shafts, shaft_part
from rig_nodes.driveline.calls import address_of
from rig_nodes.driveline.driven import FACTOR, LIMIT
from rig_nodes.driveline.inputs import SAME
from rig_nodes.driveline.law_steps import jumped
from rig_nodes.driveline.laws import CAPACITY, FRICTION, INERTIA, Moving
from rig_nodes.driveline.losses import BEFORE, LAST, NEXT, ON, OWN, brakes, end_losses, put_losses
from rig_nodes.driveline.losses import FACTOR as PER_LOSS
from rig_nodes.driveline.motion import work_over
from rig_nodes.driveline.quick_laws import (
    ACCEL,
    CURVED,
    DAMP_MADE,
    DRAG_MADE,
    DV,
    EXTRA,
    FINAL,
    FORCE,
    GAINED,
    MADE,
    PUSH0,
    PUSH1,
    SLIP0,
    SPARE,
    STIFF_MADE,
    TORQUE0,
    TORQUE1,
    TURN,
    TURNED,
    Quick,
    are_met,
    dot,
    implicit_parts,
    leave_laws,
    push_speeds,
    put_lines,
    start_laws,
    takes,
)
from rig_nodes.driveline.record import (
    before_at,
    laws_at,
    loads_at,
    loss_at,
    outcome_at,
    over_time_at,
    own_at,
    room_at,
    state_at,
    structure_at,
)
from rig_nodes.driveline.state import Loads, Structure
from rig_nodes.driveline.stuck import is_held, project
from rig_nodes.driveline.tables import line, piece

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.record import Before, Outcome, OverTime

TRIES = 6  # most Newton steps; a step that needs more is left to driven_step


@njit(**INLINED)
def make_matrix(q: Quick) -> None:
    """Compute H = (I + h/2 P B)^-1 P of the work buffer, with room for a matrix beside it.

    B has the drag, the shafts, and the slopes EXTRA of laws that act on other speeds than those that they depend on.
    """
    w, sh, kc, work, laws, h, op = q.structure.w, q.structure.sh, q.structure.kc, q.state.work, q.laws, q.h, q.op
    oh, oa, spare = q.at.h, q.at.a, q.by_speed[SPARE]
    n = w.shape[1]
    for i in range(n):
        for j in range(n):
            work[oh + i * n + j] = work[op + i * n + j]
            work[oa + i * n + j] = 1.0 if i == j else 0.0
    for f in range(w.shape[0]):
        if q.cap[VISC, f] != 0.0:
            for i in range(n):
                share = sum_at(work, op + i * n, w, f)
                share *= 0.5 * h * q.cap[VISC, f]
                for j in range(n):
                    work[oa + i * n + j] += share * w[f, j]
    for a in range(sh.shape[0]):
        for i in range(n):
            share = sum_at(work, op + i * n, sh, a)
            share *= 0.5 * h * (kc[1, a] + 0.5 * h * kc[0, a])
            for j in range(n):
                work[oa + i * n + j] += share * sh[a, j]
    for k in range(laws.kind.shape[0]):
        if q.by_law[EXTRA, k] != 0.0:
            for j in range(n):
                spare[j] = w[laws.element[k], j] if laws.kind[k] == CAPACITY else laws.on[k, j]
            for i in range(n):
                share = 0.0
                for j in range(n):
                    share += work[op + i * n + j] * spare[j]
                share *= 0.5 * h * q.by_law[EXTRA, k]
                for j in range(n):
                    work[oa + i * n + j] += share * laws.of[k, j]
    eliminate(work, oa, oh, n, n)


@njit(**INLINED)
def put_inputs(over_time: OverTime, h: float, t: float, loads: Loads, by_input: Floats) -> bool:
    """Set factors, capacities and forces to the inputs over time at both ends of a step; return False where a point is inside."""
    short_loops()
    q, cap, stick, tables = loads.q, loads.cap, over_time.stick, over_time.tables
    for k in range(over_time.default.shape[0]):
        by_input[0, k] = by_input[1, k] = over_time.default[k]
    for k in range(over_time.kind.shape[0]):
        a, b, place = 0.0, 0.0, over_time.place[k]
        if tables.first[k + 1] - tables.first[k] == 1:
            a = b = tables.y[tables.first[k]]
        else:
            _, until, height, point, rise = line(tables, k, piece(tables, k, t + SAME * h))
            if until - t < h - SAME * h:
                return False
            a, b = height + rise * (t - point), height + rise * (t + h - point)
        if over_time.kind[k] == FACTOR:
            by_input[0, place], by_input[1, place] = a, b
        elif over_time.kind[k] == LIMIT:
            cap[KIN0, place], cap[KIN1, place] = a, b
            cap[HI0, place], cap[HI1, place] = stick[0, place] * a, stick[0, place] * b
            cap[LO0, place], cap[LO1, place] = -stick[1, place] * a, -stick[1, place] * b
        else:
            for j in range(q.shape[1]):
                q[0, j] += a * over_time.on[k, j]
                q[1, j] += b * over_time.on[k, j]
    return True


@njit(**INLINED)
def start_elements(q: Quick, tol: float) -> tuple[bool, bool, bool]:
    """Set slips, and rates of the rows among the shafts, at the start.

    Returns
    -------
    able : bool
        Whether no event is possible.
    stuck, slipping : bool
        Whether elements stick, and whether some slip.
    """
    short_loops()
    w, sh, mode, by_element, by_slot = q.structure.w, q.structure.sh, q.state.mode, q.by_element, q.by_slot
    stuck = slipping = False
    for f in range(mode.shape[0]):
        by_element[SLIP0, f] = dot(w, f, q.by_speed, DV)
        by_element[CURVED, f] = 0.0
        if mode[f] == STUCK:
            stuck = True
        elif mode[f] == FORWARD or mode[f] == BACKWARD:
            slipping = True
            if mode[f] * by_element[SLIP0, f] < -tol:
                return False, stuck, slipping
        elif mode[f] != OPEN:
            return False, stuck, slipping
    for a in range(sh.shape[0]):
        by_slot[TURN, a] = dot(sh, a, q.by_speed, DV)
    return True, stuck, slipping


@njit(**INLINED)
def is_same(q: Quick, before: bool) -> bool:
    """Return whether the matrix that was made before is that of the present slopes, which are kept for the next comparison."""
    short_loops()
    kc, same = q.structure.kc, before
    for f in range(q.state.mode.shape[0]):
        same = same and q.by_element[DRAG_MADE, f] == q.cap[VISC, f]
        q.by_element[DRAG_MADE, f] = q.cap[VISC, f]
    for a in range(kc.shape[1]):
        same = same and q.by_slot[STIFF_MADE, a] == kc[0, a] and q.by_slot[DAMP_MADE, a] == kc[1, a]
        q.by_slot[STIFF_MADE, a], q.by_slot[DAMP_MADE, a] = kc[0, a], kc[1, a]
    for k in range(q.laws.kind.shape[0]):
        same = same and q.by_law[MADE, k] == q.by_law[EXTRA, k]
        q.by_law[MADE, k] = q.by_law[EXTRA, k]
    return same


@njit(**INLINED)
def put_forces(q: Quick) -> bool:
    """Set the forces at both ends, those at the end without the implicit parts; return False where an element opens or closes."""
    short_loops()
    w, sh, kc, mode, by_element, by_speed = q.structure.w, q.structure.sh, q.structure.kc, q.state.mode, q.by_element, q.by_speed
    for j in range(by_speed.shape[1]):
        by_speed[FORCE, j], by_speed[FINAL, j] = q.loads.q[0, j], q.loads.q[1, j]
    for a in range(sh.shape[0]):
        turn = q.by_slot[TURN, a]
        torque = kc[1, a] * turn
        push_speeds(by_speed, sh, a, -torque, -(torque + kc[0, a] * q.h * turn))
    for f in range(mode.shape[0]):
        mo = mode[f]
        if (mo != OPEN) != has_capacity(q.cap, f):
            return False
        torque = final = 0.0
        if mo == FORWARD or mo == BACKWARD:
            torque, final = mo * q.cap[KIN0, f], mo * q.cap[KIN1, f]
        by_element[TORQUE0, f], by_element[TORQUE1, f] = torque, final
        drag = q.cap[VISC, f] * by_element[SLIP0, f]
        torque += drag
        final += drag
        if torque != 0.0 or final != 0.0:
            push_speeds(by_speed, w, f, -torque, -final)
    for k in range(q.laws.kind.shape[0]):
        if q.by_law[PUSH0, k] != 0.0 or q.by_law[PUSH1, k] != 0.0:
            push_speeds(by_speed, q.laws.on, k, q.by_law[PUSH0, k], q.by_law[PUSH1, k])
    return True


@njit(**INLINED)
def put_end_losses(q: Quick) -> bool:
    """Add the losses by torque at the end; return False where they have no solution."""
    short_loops()
    by_speed, by_element, work, at, loss = q.by_speed, q.by_element, q.state.work, q.at, q.loss
    n = by_speed.shape[1]
    for i in range(n):
        work[at.accel + i] = accelerated(q, i, FORCE)
        work[at.force + i] = by_speed[FORCE, i]
        work[at.dforce + i] = by_speed[FINAL, i] - by_speed[FORCE, i]
    for f in range(q.state.mode.shape[0]):
        work[at.torque1 + f] = by_element[TORQUE1, f]
    if not end_losses(q.h, q.structure, q.cap, loss, q.state):
        return False
    put_losses(loss, q.cap, int(1), int(NEXT))
    for k in range(loss.shape[0]):
        f = int(loss[k, ON])
        more = brakes(loss[k, PER_LOSS], q.state.mode[f]) * loss[k, NEXT]
        by_element[TORQUE1, f] += more
        for j in range(n):
            by_speed[FINAL, j] -= q.structure.w[f, j] * more
    return True


@njit(**INLINED)
def accelerated(q: Quick, i: int, row: int) -> float:
    """Return the acceleration of speed i by the forces in a row of by_speed."""
    return sum_at(q.state.work, q.op + i * q.by_speed.shape[1], q.by_speed, row)


@njit(**INLINED)
def solve(q: Quick, before: bool) -> bool:
    """Find the change of the speeds over the step by Newton's method; return False where an event is possible or it is not found.

    ``before`` tells whether the matrix of the last step may still be that of this one.
    """
    cap, loss, work, by_speed = q.cap, q.loss, q.state.work, q.by_speed
    n = by_speed.shape[1]
    for _ in range(TRIES):
        put_lines(q)
        for k in range(loss.shape[0]):
            loss[k, NEXT] = loss[k, LAST]
        put_losses(loss, cap, int(0), int(LAST))
        put_losses(loss, cap, int(1), int(-1))
        if not is_same(q, before and not q.heavy):
            make_matrix(q)
            before = True
        if not put_forces(q):
            return False
        if loss.shape[0] > 0 and not put_end_losses(q):
            return False
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += work[q.at.h + i * n + j] * (by_speed[FORCE, j] + by_speed[FINAL, j])
            by_speed[DV, i] = 0.5 * q.h * total
        if are_met(q):
            return True
    return False


@njit(**INLINED)
def finish_forces(q: Quick) -> None:
    """Add what shafts and drag change at the end by the change of the speeds."""
    short_loops()
    kc, h, n = q.structure.kc, q.h, q.by_speed.shape[1]
    for a in range(kc.shape[1]):
        q.by_slot[TURNED, a] = gain = dot(q.structure.sh, a, q.by_speed, DV)
        push = (kc[1, a] + 0.5 * h * kc[0, a]) * gain
        for j in range(n):
            q.by_speed[FINAL, j] -= q.structure.sh[a, j] * push
    for f in range(q.state.mode.shape[0]):
        q.by_element[GAINED, f] = gain = dot(q.structure.w, f, q.by_speed, DV)
        push = q.cap[VISC, f] * gain
        if push != 0.0:
            for j in range(n):
                q.by_speed[FINAL, j] -= q.structure.w[f, j] * push


@njit(**INLINED)
def is_quiet(q: Quick, tol: float, slipping: bool) -> bool:
    """Return whether no event is possible in the step; the torques of stuck elements are set."""
    short_loops()
    cap, by_element, by_speed, work = q.cap, q.by_element, q.by_speed, q.state.work
    n = by_speed.shape[1]
    if slipping:
        for i in range(n):
            by_speed[ACCEL, i] = accelerated(q, i, FORCE)
    for f in range(q.state.mode.shape[0]):
        mo = q.state.mode[f]
        if mo == STUCK:
            l0 = l1 = 0.0
            for j in range(n):
                l0 += work[q.orr + f * n + j] * by_speed[FORCE, j]
                l1 += work[q.orr + f * n + j] * by_speed[FINAL, j]
            by_element[TORQUE0, f], by_element[TORQUE1, f] = l0, l1
            lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
            if max(cap[HI1, f], cap[KIN1, f]) - l1 < -lim or max(cap[HI0, f], cap[KIN0, f]) - l0 < -4.0 * lim:
                return False
            if l1 - min(cap[LO1, f], -cap[KIN1, f]) < -lim or l0 - min(cap[LO0, f], -cap[KIN0, f]) < -4.0 * lim:
                return False
        elif mo != OPEN:
            y0 = mo * by_element[SLIP0, f]
            speeding = mo * dot(q.structure.w, f, by_speed, ACCEL)
            if not (y0 > tol and y0 + mo * by_element[GAINED, f] > 0.0 and (speeding >= 0.0 or y0 + speeding * q.h > 0.0)):
                return False
    return True


@njit(**INLINED)
def take(q: Quick, loads: Loads, outcome: Outcome, stuck: bool) -> None:
    """Move speeds, elements and shafts to the end of the step; loads are those of the rig's parts."""
    short_loops()
    state, h, cap, by_element, by_speed = q.state, q.h, loads.cap, q.by_element, q.by_speed
    v, mode, el, slots = state.v, state.mode, state.el, q.structure.sh.shape[0]
    for k in range(q.loss.shape[0]):
        q.loss[k, BEFORE] = q.loss[k, LAST]
        q.loss[k, LAST] = q.loss[k, NEXT]
    put_losses(q.loss, cap, int(1), int(LAST))
    for j in range(v.shape[0]):
        turned = h * (v[j] + 0.5 * by_speed[DV, j])
        state.e_in[j] += 0.5 * (q.loads.q[0, j] + q.loads.q[1, j]) * turned
        outcome.part_work[0] += 0.5 * (loads.q[0, j] + loads.q[1, j]) * turned
        state.twist[slots + j] += turned
        v[j] += by_speed[DV, j]
    for f in range(mode.shape[0]):
        torque = 0.5 * (by_element[TORQUE0, f] + by_element[TORQUE1, f])
        slip = by_element[SLIP0, f] + 0.5 * by_element[GAINED, f]
        # friction over slip was counted as drag
        more = q.cap[VISC, f] - cap[VISC, f]
        torque += more * slip
        el[LAM, f] = by_element[TORQUE1, f] + more * (by_element[SLIP0, f] + by_element[GAINED, f])
        el[IMPULSE, f] += h * torque
        if mode[f] == FORWARD or mode[f] == BACKWARD:
            el[E_FRIC, f] += h * torque * slip
        el[E_VISC, f] += h * cap[VISC, f] * slip * slip
    if stuck:
        for j in range(v.shape[0]):
            by_speed[SPARE, j] = v[j]
        for f in range(mode.shape[0]):
            if mode[f] == STUCK:
                slip = dot(q.structure.w, f, by_speed, SPARE)
                for j in range(v.shape[0]):
                    v[j] -= state.work[q.orr + f * v.shape[0] + j] * slip


@njit(**INLINED)
def accelerate(q: Quick, cap: Floats, accel: Floats) -> None:
    """Set the accelerations at the step's end, from the forces of inputs and laws, and of elements."""
    short_loops()
    structure, state, by_element, by_speed, n = q.structure, q.state, q.by_element, q.by_speed, q.by_speed.shape[1]
    for f in range(state.mode.shape[0]):
        torque = state.el[LAM, f] + cap[VISC, f] * (by_element[SLIP0, f] + by_element[GAINED, f])
        for j in range(n):
            by_speed[FORCE, j] -= torque * structure.w[f, j]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += (state.work[q.op + i * n + j] if q.heavy else structure.minv[i, j]) * by_speed[FORCE, j]
        accel[i] = total


@njit(**INLINED)
def start(layout: Ints, h: float, t: float, q: Quick, before: Before) -> float:
    """Set torques, capacities and inputs of laws at both ends; return 1 plus the largest speed, 0 where an event is possible."""
    parts, loss, over_time = loads_at(layout), q.loss, over_time_at(layout)
    q_now, cap_given, kc = q.loads.q, q.loads.cap, structure_at(layout).kc
    scale = 0.0
    for j in range(q_now.shape[1]):
        scale = max(scale, abs(q.state.v[j]))
        q_now[0, j], q_now[1, j] = parts.q[0, j], parts.q[1, j]
        q.by_speed[DV, j] = q.state.v[j]
    for row in range(7):
        for f in range(cap_given.shape[1]):
            cap_given[row, f] = parts.cap[row, f]
    for k in range(loss.shape[0]):
        for row in range(VISC):
            cap_given[row, int(loss[k, OWN])] = 0.0
    for a in range(kc.shape[1]):
        q.structure.kc[0, a], q.structure.kc[1, a] = kc[0, a], kc[1, a]
    if not put_inputs(over_time, h, t, q.loads, q.by_input):
        return 0.0
    # where inputs have jumped, the losses are solved again
    if loss.shape[0] > 0 and jumped(q_now, before.q, cap_given, before.cap):
        return 0.0
    return 1.0 + scale


@njit(**INLINED)
def quick_of(layout: Ints, h: float) -> Quick:
    """Return the arrays of the record in the form that the quick step needs."""
    given, room, laws, loss = structure_at(layout), room_at(layout), laws_at(layout), loss_at(layout)
    n, m, slots, losses = layout[0], layout[1], layout[2], layout[3]
    at = places(n, m, slots, losses)
    heavy, bent = False, losses > 0
    for k in range(laws.kind.shape[0]):
        heavy = heavy or laws.kind[k] == INERTIA
        bent = bent or laws.kind[k] == CAPACITY or laws.kind[k] == FRICTION
    return Quick(
        Structure(given.minv, given.w, given.sh, room.kc_now),
        Loads(room.q_now, room.cap_given),
        room.cap_now if bent else room.cap_given,
        loss,
        state_at(layout),
        laws,
        own_at(layout),
        room.by_law,
        room.by_element,
        room.by_slot,
        room.by_speed,
        room.by_input,
        at,
        at.b if heavy else at.p,
        at.wm if heavy else at.r,
        h,
        heavy,
        bent,
    )


@njit(**INNER)
def quick_shafts(layout: Ints, h: float, t: float) -> int:
    """Take a step like :func:`quick_step` of a driveline without losses that has shafts, and no laws but their tables."""
    noinline()
    short_loops()
    given, parts, state, room = structure_at(layout), loads_at(layout), state_at(layout), room_at(layout)
    loads, turned, n, slots = Loads(room.q_now, room.cap_given), room.by_speed, layout[0], layout[2]
    for j in range(n):
        loads.q[0, j], loads.q[1, j], turned[0, j] = parts.q[0, j], parts.q[1, j], state.twist[slots + j]
    for f in range(state.mode.shape[0]):
        for row in range(7):
            loads.cap[row, f] = parts.cap[row, f]
    if not put_inputs(over_time_at(layout), h, t, loads, room.by_input):
        return int(0)
    moving = Moving(loss_at(layout), state, own_at(layout))
    if shaft_part(h, 0.0, True, given, laws_at(layout), loads, moving) < h:
        return int(0)
    before, outcome, at = before_at(layout), outcome_at(layout), places(n, state.mode.shape[0], slots, int(0))
    for j in range(n):
        before.q[j] = turned[1, j] = loads.q[1, j]
        outcome.part_work[0] += work_over(parts.q, j, state.twist[slots + j] - turned[0, j], state.work[at.lag + j])
    for f in range(state.mode.shape[0]):
        push = state.el[LAM, f] + loads.cap[VISC, f] * rate_of(given.w, f, state.v)
        for j in range(n):
            turned[1, j] -= given.w[f, j] * push
    for a in range(slots):
        for j in range(n):
            turned[1, j] -= given.sh[a, j] * state.shaft[TAU, a]
    for i in range(n):
        outcome.accel[i] = dot(given.minv, i, turned, int(1))
    room.made[0] = 1.0
    return int(1)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def quick_step(layout: Ints, h: float, t: float) -> int:
    """Take a step h from t like `driven_step` on a driveline's record, if no event can happen in it.

    Parameters
    ----------
    layout : (count,) array of int64
        Field ``layout`` of the record (driveline.record).
    h, t : float
        Length of the step, and time at its start [s].

    Returns
    -------
    int
        1 when the step is done. 0 with shafts beside laws or losses, and when an event is possible: a change of mode, a point of
        an input over time, a prescribed motion. Then no state has changed, and `driven_step` has to be called.
    """
    short_loops()
    before, made, loads, outcome = before_at(layout), room_at(layout).made, loads_at(layout), outcome_at(layout)
    ready = made[0] > 0.0
    made[0] = 0.0
    if before.begun[0] == 0.0:
        return int(0)
    if layout[2] > 0 and only_shafts(laws_at(layout), loss_at(layout)):
        return quick_shafts(layout, h, t)
    if not takes(laws_at(layout), layout[2]):
        return int(0)
    q = quick_of(layout, h)
    if q.heavy and q.loss.shape[0] > 0:
        return int(0)
    work, at, n = q.state.work, q.at, q.by_speed.shape[1]
    tol = 1e-12 * start(layout, h, t, q, before)
    if tol == 0.0:
        return int(0)
    able, stuck, slipping = start_elements(q, tol)
    if not able:
        return int(0)
    start_laws(q)
    if not is_held(q.state.mode, int(0), q.state.mode.shape[0], work) or (q.heavy and not ready):
        for f in range(q.state.mode.shape[0]):
            work[at.state + f] = q.state.mode[f]
        project(q.structure.minv, q.structure.w, at.state, work)
        ready = False
    ready = ready and made[1] == h and made[2] == work[0]
    made[1], made[2] = h, work[0]
    work[1] = -1.0  # H becomes that of this step, which has slopes of laws in it
    if not solve(q, ready):
        return int(0)
    implicit_parts(q)
    finish_forces(q)
    if not is_quiet(q, tol, slipping):
        return int(0)
    # the step is done: energies and states
    made[0] = 1.0
    take(q, loads, outcome, stuck)
    for j in range(n):
        q.by_speed[FORCE, j] = before.q[j] = q.loads.q[1, j]
    leave_laws(q)
    accelerate(q, loads.cap, outcome.accel)
    if q.loss.shape[0] > 0:
        for row in range(7):
            for f in range(q.state.mode.shape[0]):
                before.cap[row, f] = q.loads.cap[row, f]
    return int(1)


@cache
def quick_address() -> int:
    """Return the address of `quick_step`."""
    return address_of(quick_step, quick_types())


@cache
def quick_types() -> tuple:
    """Return the types of the arguments of `quick_step`."""
    return types.Array(types.int64, 1, "C"), types.float64, types.float64
