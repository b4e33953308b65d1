# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of a driveline in a quick step: their lines, how far these are from the laws, and the state of the laws after it.

Used by driveline/quick.py. The equations are those of driveline/lines.py; here a line has a slope by the change of the speeds
wherever the law has one, for Newton's method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import BACKWARD, FORWARD, HI0, HI1, KIN0, KIN1, LO0, LO1, VISC, Places, noinline, short_loops
from rig_nodes.driveline.laws import CAPACITY, FRICTION, GEARING, INERTIA, MOTION, SHAFT, TORQUE, Laws, LawState
from rig_nodes.driveline.lines import CLOSE
from rig_nodes.driveline.state import Loads, State, Structure
from rig_nodes.driveline.tables import along, line, piece, value

if TYPE_CHECKING:
    from rig_nodes.base import Floats

# rows of the work arrays for each law, friction element, row of shafts, and speed
(X, DX, RATE, TORQUE_, SLOPE, OTHER, EXTRA, AHEAD, PUSH0, PUSH1, GAIN, BEGIN, END, VALUE, RISE, MADE) = range(16)
(SLIP0, GAINED, TORQUE0, TORQUE1, CURVED, DRAG_MADE) = range(6)
(TURN, TURNED, STIFF_MADE, DAMP_MADE) = range(4)
(FORCE, FINAL, DV, ACCEL, SPARE) = range(5)


class Quick(NamedTuple):
    """A quick step.

    Parameters
    ----------
    structure : Structure
        The driveline; kc has the slopes of laws in their rows.
    loads : Loads
        Forces and capacities at both ends, with the inputs over time and without laws.
    cap : (7, m) array
        The capacities with laws; those of `loads` where no law changes them.
    loss : (k, loss_width(n, m)) array
        Losses by torque.
    state : State
        State of the driveline.
    laws, own : Laws, LawState
        The laws and their state.
    by_law : (16, laws) array
        Argument X, its expected change DX and the rate at the start; torque, slope and other value of the line; slope EXTRA by the
        change of the speeds, of which AHEAD gives that of the argument; pushes at both ends; change GAIN of the rate; the straight
        piece of the table (BEGIN, END, VALUE at X, RISE); EXTRA for which the matrix was made.
    by_element : (6, m) array
        Slip at the start and its change, torque at both ends, whether there is FRICTION, drag for which the matrix was made.
    by_slot : (4, s) array
        Of the rows of torques among the shafts: rate at the start and its change; stiffness and damping for which the matrix was
        made.
    by_speed : (5, n) array
        Forces at both ends, change of the speeds, accelerations at the start, and room.
    by_input : (2, factors) array
        Inputs of the laws at both ends.
    at : Places
        Places in the work buffer.
    op, orr : int
        Places of P and R, with the inertias of laws.
    h : float
        Length of the step [s].
    heavy, bent : bool
        Whether there are inertias among the laws, and whether `cap` is changed by laws or losses.
    """

    structure: Structure
    loads: Loads
    cap: Floats
    loss: Floats
    state: State
    laws: Laws
    own: LawState
    by_law: Floats
    by_element: Floats
    by_slot: Floats
    by_speed: Floats
    by_input: Floats
    at: Places
    op: int
    orr: int
    h: float
    heavy: bool
    bent: bool


@njit(**INLINED)
def dot(rows: Floats, k: int, v: Floats, i: int) -> float:
    """Return the sum of row k of an array times row i of another one."""
    short_loops()
    total = 0.0
    for j in range(v.shape[1]):
        total += rows[k, j] * v[i, j]
    return total


@njit(**INLINED)
def push_speeds(by_speed: Floats, rows: Floats, k: int, begin: float, end: float) -> None:
    """Add a torque that acts on the speeds by row k to the forces at both ends."""
    short_loops()
    for j in range(by_speed.shape[1]):
        by_speed[FORCE, j] += rows[k, j] * begin
        by_speed[FINAL, j] += rows[k, j] * end


@njit(**INNER)
def add_inertia(inertia: float, on: Floats, k: int, op: int, orr: int, m: int, work: Floats, by_speed: Floats) -> None:
    """Add to P at `op` and R at `orr` of the work buffer the effect of an inertia that turns with row k of `on`.

    (M + J u u^T)^-1 = M^-1 - M^-1 u u^T M^-1 / (1 / J + u^T M^-1 u), and the same for P; m is the number of rows of R.
    """
    noinline()
    short_loops()
    n = on.shape[1]
    along_ = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += work[op + i * n + j] * on[k, j]
        by_speed[SPARE, i] = total
        along_ += on[k, i] * total
    share = 1.0 / (1.0 / inertia + along_)
    for f in range(m):
        torque = 0.0
        for j in range(n):
            torque += work[orr + f * n + j] * on[k, j]
        if torque != 0.0:
            for j in range(n):
                work[orr + f * n + j] -= share * torque * by_speed[SPARE, j]
    for i in range(n):
        for j in range(n):
            work[op + i * n + j] -= share * by_speed[SPARE, i] * by_speed[SPARE, j]


@njit(**INLINED)
def takes(laws: Laws, slots: int) -> bool:
    """Return whether a quick step takes a driveline's laws: none but torques, capacities, friction and inertias, without shafts."""
    short_loops()
    shafts = slots
    for k in range(laws.kind.shape[0]):
        kind = laws.kind[k]
        if kind == MOTION or kind == SHAFT or kind >= GEARING:
            return False
        if kind != FRICTION and kind != INERTIA and laws.slot[k] >= 0:
            shafts -= 1
    return shafts == 0


@njit(**INLINED)
def start_laws(q: Quick) -> None:
    """Set the arguments of the laws and their expected changes."""
    short_loops()
    laws, own, by_law, h = q.laws, q.own, q.by_law, q.h
    for k in range(laws.kind.shape[0]):
        kind, rate = laws.kind[k], dot(laws.of, k, q.by_speed, DV)
        by_law[RATE, k] = by_law[X, k] = rate
        by_law[DX, k] = own.way[k] * h
        by_law[AHEAD, k] = 1.0
        by_law[PUSH0, k] = by_law[PUSH1, k] = by_law[EXTRA, k] = by_law[TORQUE_, k] = 0.0
        if laws.by[k]:
            by_law[X, k] = own.at[k]
            by_law[DX, k] = h * rate + own.way[k] * h * h
            by_law[AHEAD, k] = 0.5 * h
        here = by_law[X, k]
        if kind == FRICTION:
            q.by_element[CURVED, laws.element[k]] = 1.0
            here = abs(here)
        elif kind == INERTIA:
            by_law[SLOPE, k] = rate + 2.0 * own.way[k] * h
        begin, end, height, point, rise = line(laws.tables, k, piece(laws.tables, k, here))
        if here == begin:
            # at a bend the pieces before and behind it are equally close
            begin = np.inf if by_law[DX, k] < 0.0 else begin
        by_law[BEGIN, k], by_law[END, k], by_law[RISE, k] = begin, end, rise
        by_law[VALUE, k] = height + rise * (here - point)


@njit(**INLINED)
def on_piece(k: int, x: float, by_law: Floats) -> bool:
    """Return whether x is on the straight piece of the table of law k on which the step begins."""
    return by_law[BEGIN, k] <= x <= by_law[END, k]


@njit(**INLINED)
def put_lines(q: Quick) -> None:
    """Set the straight lines that replace the laws in the step, for the expected changes of their arguments."""
    work = q.state.work
    if q.bent:
        for row in range(7):
            for f in range(q.cap.shape[1]):
                q.cap[row, f] = q.loads.cap[row, f]
    if q.heavy:
        n, m = q.by_speed.shape[1], q.by_element.shape[1]
        for i in range(n * n):
            work[q.op + i] = work[q.at.p + i]
        for i in range(m * n):
            work[q.orr + i] = work[q.at.r + i]
    for k in range(q.laws.kind.shape[0]):
        kind = q.laws.kind[k]
        if kind == CAPACITY:
            put_capacity(k, q)
        elif kind == FRICTION:
            put_friction(k, q)
        elif kind == INERTIA:
            put_inertia(k, q)
        else:
            put_torque(k, q)


@njit(**INLINED)
def put_capacity(k: int, q: Quick) -> None:
    """Set the line of a CAPACITY."""
    short_loops()
    laws, by_law, cap, mode = q.laws, q.by_law, q.cap, q.state.mode
    f, here, dx = laws.element[k], by_law[X, k], by_law[DX, k]
    start, final, rise = max(0.0, by_law[VALUE, k]), by_law[VALUE, k] + by_law[RISE, k] * dx, by_law[RISE, k]
    if not on_piece(k, here + dx, by_law):
        _, _, height, point, rise = line(laws.tables, k, piece(laws.tables, k, here + dx))
        final = height + rise * (here + dx - point)
    by_law[EXTRA, k] = by_law[SLOPE, k] = 0.0
    by_law[OTHER, k] = limit = kinetic = max(0.0, final)
    slips = mode[f] == FORWARD or mode[f] == BACKWARD
    if slips and final > 0.0 and q.loss.shape[0] == 0 and q.by_element[CURVED, f] == 0.0:
        by_law[SLOPE, k] = rise
        by_law[EXTRA, k] = mode[f] * cap[KIN1, f] * rise * by_law[AHEAD, k]
        kinetic = final + rise * ((q.h * by_law[RATE, k] if laws.by[k] else 0.0) - dx)
    for row in (KIN0, LO0, HI0):
        cap[row, f] *= start
        cap[row + 1, f] *= kinetic if row == KIN0 else limit


@njit(**INLINED)
def put_friction(k: int, q: Quick) -> None:
    """Set the line of FRICTION."""
    short_loops()
    by_law, cap, tables, f = q.by_law, q.cap, q.laws.tables, q.laws.element[k]
    a0, a1 = abs(by_law[X, k]), abs(by_law[X, k] + by_law[DX, k])
    if on_piece(k, a1, by_law):
        rise = by_law[RISE, k]
    elif abs(a1 - a0) > 1e-9 * (1.0 + a0):
        rise = (value(tables, k, a1) - by_law[VALUE, k]) / (a1 - a0)
    else:
        rise = along(tables, k, a0, 1e-9)[1]
    by_law[SLOPE, k] = rise
    by_law[OTHER, k] = mean = 0.5 * (cap[KIN0, f] + cap[KIN1, f])
    at_rest = value(tables, k, 0.0)
    for row in (KIN0, KIN1):
        cap[row, f] = cap[row, f] * by_law[VALUE, k] - mean * rise * a0
        cap[LO0 - KIN0 + row, f] *= at_rest
        cap[HI0 - KIN0 + row, f] *= at_rest
    cap[VISC, f] += mean * rise


@njit(**INLINED)
def put_inertia(k: int, q: Quick) -> None:
    """Set the line of an INERTIA; SLOPE is the speed that is expected at the end."""
    by_law, tables, here, dx, bend = q.by_law, q.laws.tables, q.by_law[X, k], q.by_law[DX, k], q.by_law[RISE, k]
    j1 = by_law[VALUE, k] + bend * dx
    if not on_piece(k, here + dx, by_law):
        j1 = value(tables, k, here + dx)
        if abs(dx) > 1e-9:
            bend = (j1 - by_law[VALUE, k]) / dx
    w0, w1 = by_law[RATE, k], by_law[SLOPE, k]
    by_law[EXTRA, k] = bend * w1
    by_law[TORQUE_, k] = 0.25 * bend * (w0 * w0 + w1 * w1) - 0.5 * bend * w1 * (w1 - w0)
    by_law[PUSH0, k] = by_law[PUSH1, k] = -by_law[TORQUE_, k]
    by_law[OTHER, k] = inertia = 0.5 * (by_law[VALUE, k] + j1)
    if inertia > 0.0:
        add_inertia(inertia, q.laws.on, k, q.op, q.orr, q.by_element.shape[1], q.state.work, q.by_speed)


@njit(**INLINED)
def put_torque(k: int, q: Quick) -> None:
    """Set the line of a TORQUE."""
    short_loops()
    laws, by_law, kc = q.laws, q.by_law, q.structure.kc
    place, here, dx = laws.slot[k], by_law[X, k], by_law[DX, k]
    start, rise = by_law[VALUE, k], by_law[RISE, k]
    if not on_piece(k, here + dx, by_law):
        start, rise = along(laws.tables, k, here, dx)
    a, b = q.by_input[0, laws.factor[k]], q.by_input[1, laws.factor[k]]
    if place >= 0:
        steep, shift = 0.5 * (a + b) * rise, 0.0
        kc[0, place] = kc[1, place] = 0.0
        if laws.by[k]:
            kc[0, place] = -steep
        else:
            kc[1, place] = -steep
            shift = steep * here
        by_law[PUSH0, k], by_law[PUSH1, k] = a * start - shift, b * start - shift
    else:
        lossy = q.loss.shape[0] > 0
        rest = q.h * by_law[RATE, k] if laws.by[k] else 0.0
        by_law[EXTRA, k] = 0.0 if lossy else -b * rise * by_law[AHEAD, k]
        by_law[PUSH0, k], by_law[PUSH1, k] = a * start, b * (start + rise * (dx if lossy else rest))
    by_law[TORQUE_, k], by_law[SLOPE, k] = start, rise


@njit(**INLINED)
def capacity_error(k: int, moved: float, q: Quick) -> tuple[float, float]:
    """Return (error, scale) of a CAPACITY whose argument has moved, and set the limits at the end to it."""
    short_loops()
    by_law, f = q.by_law, q.laws.element[k]
    asked = by_law[VALUE, k] + by_law[RISE, k] * moved
    if not on_piece(k, by_law[X, k] + moved, by_law):
        asked = value(q.laws.tables, k, by_law[X, k] + moved)
    asked = max(0.0, asked)
    error, scale = 0.0, 1.0
    if q.state.mode[f] == FORWARD or q.state.mode[f] == BACKWARD:
        error, scale = abs(asked - (by_law[OTHER, k] + by_law[SLOPE, k] * (moved - by_law[DX, k]))), asked
    for row in (LO1, HI1):
        q.cap[row, f] = q.loads.cap[row, f] * asked
    return error, scale


@njit(**INLINED)
def friction_error(k: int, moved: float, q: Quick) -> tuple[float, float]:
    """Return (error, scale) of FRICTION whose slip has changed."""
    by_law = q.by_law
    a0, a1, error = abs(by_law[X, k]), abs(by_law[X, k] + moved), 0.0
    if not on_piece(k, a1, by_law):
        error = abs(value(q.laws.tables, k, a1) - by_law[VALUE, k] - by_law[SLOPE, k] * (a1 - a0))
    elif by_law[SLOPE, k] != by_law[RISE, k]:
        error = abs((by_law[RISE, k] - by_law[SLOPE, k]) * (a1 - a0))
    return error * by_law[OTHER, k], 1.0 + by_law[OTHER, k]


@njit(**INLINED)
def inertia_error(k: int, moved: float, gain: float, q: Quick) -> tuple[float, float]:
    """Return (error, scale) of an INERTIA that has turned and gained speed."""
    by_law, rate = q.by_law, q.by_law[RATE, k]
    w1, bend = rate + gain, by_law[RISE, k]
    torque = by_law[TORQUE_, k] + 0.5 * by_law[EXTRA, k] * gain
    j1 = by_law[VALUE, k] + bend * moved
    if not on_piece(k, by_law[X, k] + moved, by_law):
        j1 = value(q.laws.tables, k, by_law[X, k] + moved)
        if abs(moved) > 1e-9:
            bend = (j1 - by_law[VALUE, k]) / moved
    error = abs(0.25 * bend * (rate * rate + w1 * w1) - torque)
    error += abs(0.5 * (by_law[VALUE, k] + j1) - by_law[OTHER, k]) * abs(gain) / q.h
    by_law[SLOPE, k] = w1
    return error, 1.0 + abs(torque)


@njit(**INLINED)
def torque_error(k: int, moved: float, q: Quick) -> tuple[float, float]:
    """Return (error, scale) of a TORQUE whose argument has moved."""
    laws, by_law, asked = q.laws, q.by_law, q.by_law[RISE, k]
    if not on_piece(k, by_law[X, k] + moved, by_law):
        asked = along(laws.tables, k, by_law[X, k], moved)[1]
    explicit = laws.slot[k] < 0 and q.loss.shape[0] > 0
    error = abs(asked * moved - by_law[SLOPE, k] * (by_law[DX, k] if explicit else moved))
    return error, 1.0 + abs(by_law[TORQUE_, k]) + abs(asked * moved)


@njit(**INLINED)
def are_met(q: Quick) -> bool:
    """Return whether the lines are those for the changes of the arguments, which are expected from now on."""
    met, h = True, q.h
    for k in range(q.laws.kind.shape[0]):
        kind, gain = q.laws.kind[k], dot(q.laws.of, k, q.by_speed, DV)
        moved = h * q.by_law[RATE, k] + 0.5 * h * gain if q.laws.by[k] else gain
        if kind == CAPACITY:
            error, scale = capacity_error(k, moved, q)
        elif kind == FRICTION:
            error, scale = friction_error(k, moved, q)
        elif kind == INERTIA:
            error, scale = inertia_error(k, moved, gain, q)
        else:
            error, scale = torque_error(k, moved, q)
        met = met and error <= CLOSE * scale
        q.by_law[DX, k], q.by_law[GAIN, k] = moved, gain
    return met


@njit(**INLINED)
def implicit_parts(q: Quick) -> None:
    """Add to the forces what follows from the slopes EXTRA."""
    short_loops()
    laws, by_law, by_speed, n = q.laws, q.by_law, q.by_speed, q.by_speed.shape[1]
    for k in range(laws.kind.shape[0]):
        kind, f, gain = laws.kind[k], laws.element[k], by_law[GAIN, k]
        if kind == CAPACITY:
            push = by_law[EXTRA, k] * gain
            q.by_element[TORQUE1, f] += push
            for j in range(n):
                by_speed[FINAL, j] -= q.structure.w[f, j] * push
        elif kind == INERTIA:
            push = 0.5 * by_law[EXTRA, k] * gain
            by_law[TORQUE_, k] += push
            push_speeds(by_speed, laws.on, k, -push, -push)
        elif by_law[EXTRA, k] != 0.0:
            push = -by_law[EXTRA, k] * gain
            by_law[PUSH1, k] += push
            for j in range(n):
                by_speed[FINAL, j] += laws.on[k, j] * push


@njit(**INLINED)
def leave_torque(k: int, q: Quick) -> None:
    """Add the work of a torque over the step."""
    short_loops()
    place, dx, work, kc, on = q.laws.slot[k], q.by_law[DX, k], q.own.work, q.structure.kc, q.laws.on
    moved = 0.0
    for j in range(on.shape[1]):
        moved += on[k, j] * (q.state.v[j] - 0.5 * q.by_speed[DV, j])
    work[0] += 0.5 * q.h * (q.by_law[PUSH0, k] + q.by_law[PUSH1, k]) * moved
    if place >= 0:
        mid = q.by_slot[TURN, place] + 0.5 * q.by_slot[TURNED, place]
        work[0] -= 0.5 * kc[0, place] * dx * dx + q.h * kc[1, place] * mid * mid


@njit(**INLINED)
def leave_laws(q: Quick) -> None:
    """Set the state of the laws at the step's end and add their torques then to the forces.

    With inertias P is set to that without stuck elements.
    """
    laws, own, by_law, h, n = q.laws, q.own, q.by_law, q.h, q.by_speed.shape[1]
    if q.heavy:
        for i in range(n):
            for j in range(n):
                q.state.work[q.op + i * n + j] = q.structure.minv[i, j]
    for k in range(laws.kind.shape[0]):
        kind, dx = laws.kind[k], by_law[DX, k]
        here, turned = by_law[X, k] + dx, by_law[RATE, k] + by_law[GAIN, k]
        reads = abs(here) if kind == FRICTION else here
        now = by_law[VALUE, k] + by_law[RISE, k] * (reads - abs(by_law[X, k]) if kind == FRICTION else dx)
        if not on_piece(k, reads, by_law):
            now = value(laws.tables, k, reads)
        if laws.by[k]:
            own.at[k] = here
            own.way[k] = by_law[GAIN, k] / (2.0 * h)
        else:
            own.way[k] = dx / h
        push = 0.0
        if kind == TORQUE:
            push = now = q.by_input[1, laws.factor[k]] * now
            leave_torque(k, q)
        elif kind == INERTIA:
            bend = by_law[RISE, k]
            if not by_law[BEGIN, k] <= here < by_law[END, k]:
                bend = along(laws.tables, k, here, 1e-9)[1]
            push = -0.5 * bend * turned * turned
            if now > 0.0:
                add_inertia(now, laws.on, k, q.op, q.orr, int(0), q.state.work, q.by_speed)
        own.torque[k] = now
        if push != 0.0:
            for j in range(n):
                q.by_speed[FORCE, j] += push * laws.on[k, j]
