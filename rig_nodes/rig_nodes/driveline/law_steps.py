# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The step of a driveline with laws, which replaces the bare step where a description has them.

driveline/run.py and driveline/driven.py, for the engine of a rig, use it. In a step a law is replaced by the straight
line with the law's mean over the change of its argument (driveline/lines.py), and the slope of this line is in the implicit matrix
of driveline/kernel.py. The change is not known in advance: the step is repeated until the change equals the one for which the
lines were made, which in most steps is so at once. Where repeating does not help, the step is halved.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import ALLOCATES, INLINED, INNER, njit, types
from rig_nodes.driveline.algebra import FIRST, HI0, IMPULSE, KIN0, LO0, N_CAPPED, WORST, noinline, places, short_loops
from rig_nodes.driveline.arrays import address, borrowed, floats, whole
from rig_nodes.driveline.bends import bend_inside, lets_go, longest_part
from rig_nodes.driveline.bent_shafts import only_shafts, shaft_part
from rig_nodes.driveline.calls import address_of, bare_step, call_of, step_types
from rig_nodes.driveline.collocation import are_made
from rig_nodes.driveline.joint import JAMMED
from rig_nodes.driveline.laws import GEARING, MOTION, SHAFT, Given, Laws, LawState, Model, Moving, law_state, laws_of
from rig_nodes.driveline.lines import Lines, Part, expect, leave_lines, make_lines, worst_law
from rig_nodes.driveline.losses import LAST
from rig_nodes.driveline.motion import (
    Turned,
    accelerations_of,
    drive,
    hold,
    impulse_of,
    invert,
    mobility_of,
    moved_by,
    product,
    work_of,
    work_over,
)
from rig_nodes.driveline.state import Loads, State, Structure, copied, put, put_row, restore
from rig_nodes.driveline.variators import own_speed

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.state import Rows

TRIES, HALVINGS, FAILURES = 30, 12, 16


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
def shafts_until(model: Model, given: Given, moving: Moving, h: float, done: float) -> float:
    """Take a part of a step like `shaft_part`, of any length; it is compiled once for both callers."""
    noinline()
    return shaft_part(h, done, False, model.structure, model.laws, given.loads, moving)


class Room(NamedTuple):
    """What the parts of a step need beside the driveline.

    Parameters
    ----------
    loss : (k, loss_width(n, m)) array
        Losses by torque at the start of a part.
    before : State
        State there.
    lines : Lines
        Lines of the laws.
    pushes, gains : (2, n) arrays
        Forces without those of motions, and accelerations of prescribed speeds, at both ends.
    moved, lag, turned : (n,) arrays
        Which speeds are prescribed; integral of the speeds times the share of the step, and their integrals before a part [rad].
    mass, inverse : (n, n) arrays
        Mass matrix with the inertias of laws, and its inverse with the prescribed speeds.
    """

    loss: Floats
    before: State
    lines: Lines
    pushes: Floats
    gains: Floats
    moved: Floats
    lag: Floats
    turned: Floats
    mass: Floats
    inverse: Floats


@njit(**INNER)
def size_of(n: int, m: int, slots: int, laws: int, loss: int) -> int:
    """Return the numbers of a room for n speeds, m elements, rows of shafts, and laws; ``loss`` is the size of the losses."""
    return loss + 2 * n + (slots + n) + 6 * m + 2 * slots + 3 + 7 * laws + 2 * n + 7 * m + 2 * slots + m * n + 7 * n + 3 * n * n


@njit(**INLINED)
def room_at(o: int, state: State, loss: Floats, laws: int) -> Room:
    """Return a room at an address, with :func:`size_of` numbers."""
    n, m, slots, (k, width) = state.v.shape[0], state.mode.shape[0], state.shaft.shape[1], loss.shape
    losses, o = floats(o, k, width), o + 8 * k * width
    v, e_in, o = floats(o, n), floats(o + 8 * n, n), o + 16 * n
    twist, o = floats(o, state.twist.shape[0]), o + 8 * state.twist.shape[0]
    mode, el, o = whole(o, m), floats(o + 8 * m, 4, m), o + 40 * m
    shaft, count, o = floats(o, 2, slots), whole(o + 16 * slots, 3), o + 16 * slots + 24
    before = State(v, twist, mode, el, shaft, e_in, state.events, count, state.work)
    row = 8 * laws
    start, way, slope = floats(o, laws), floats(o + row, laws), floats(o + 2 * row, laws)
    torque, other, push = floats(o + 3 * row, laws), floats(o + 4 * row, laws), floats(o + 5 * row, 2, laws)
    o += 7 * row
    loads, o = Loads(floats(o, 2, n), floats(o + 16 * n, 7, m)), o + 16 * n + 56 * m
    kc, w, o = floats(o, 2, slots), floats(o + 16 * slots, m, n), o + 16 * slots + 8 * m * n
    held, mass, inverse, o = floats(o, n, n), floats(o + 8 * n * n, n, n), floats(o + 16 * n * n, n, n), o + 24 * n * n
    lines = Lines(start, way, slope, torque, other, push, loads, kc, held, w)
    moved, lag, turned = floats(o + 32 * n, n), floats(o + 40 * n, n), floats(o + 48 * n, n)
    return Room(losses, before, lines, floats(o, 2, n), floats(o + 16 * n, 2, n), moved, lag, turned, mass, inverse)


@njit(**ALLOCATES)
def law_step(model: Model, given: Given, moving: Moving, h: float, t: float, done: float) -> bool:
    """Take what is left of a step of h from t like `driveline_step`, with laws; return False where a law was not met."""
    noinline()
    model, given, moving = borrowed(model), borrowed(given), borrowed(moving)
    state, loss, laws = moving.state, moving.loss, model.laws.kind.shape[0]
    memory = np.empty(size_of(state.v.shape[0], state.mode.shape[0], state.shaft.shape[1], laws, loss.size))
    room = room_at(address(memory), state, loss, laws)
    return take_parts(model, given, moving, room, h, t, done, memory)


@njit(**INNER)
def take_parts(model: Model, given: Given, moving: Moving, room: Room, h: float, t: float, done: float, _memory: Floats) -> bool:
    """Do what :func:`law_step` does in a room; ``_memory`` keeps what it is made of."""
    noinline()
    short_loops()
    met = True
    state, n, slots = moving.state, moving.state.v.shape[0], model.structure.sh.shape[0]
    lag, turned = room.lag, room.turned
    for j in range(n):
        lag[j] = 0.0
    at = places(n, state.mode.shape[0], slots, moving.loss.shape[0])
    size, cuts, most, failed = h, 0, 6 * moving.state.mode.shape[0] + 12, 0
    # at the start of the step the shafts alone have been tried already
    plain, tried = slots > 0 and only_shafts(model.laws, moving.loss), done == 0.0
    if done > 0.0:
        for j in range(n):
            lag[j] = state.work[at.lag + j]
    while done < h:
        reached = shafts_until(model, given, moving, h, done) if plain and not tried else done
        tried = False
        if reached > done:
            for j in range(n):
                lag[j] += state.work[at.lag + j]
            done = reached
            continue
        left = h - done
        d = min(size, resolved(model.laws, moving.own, model.structure.minv, moving.state.v, left, h))
        if d >= left * (1.0 - 1e-9):
            d = left
        end = 1.0 if d == left else (done + d) / h
        # once halving has not helped, the rest of the step is taken even if the laws are not met
        last = not met or d <= h * 0.5**HALVINGS or failed >= FAILURES
        for j in range(n):
            turned[j] = state.twist[slots + j]
        part = Part(d, t + done, done / h, end)
        reached = try_step(model, given, moving, part, room, last, cuts < most and d > 1e-9 * h)
        if 0.0 < reached < d:
            size = reached
            cuts += 1
        elif reached == d or last:
            met = met and reached == d
            for j in range(n):
                middle, turn = 0.5 * (done / h + end - 1.0), state.twist[slots + j] - turned[j]
                lag[j] += middle * turn + (end - done / h) * state.work[at.lag + j]
            done = h if d == left else done + d
            size = h if cuts > 0 or not met else 2.0 * d
        else:
            size = 0.5 * d
            failed += 1
    for j in range(n):
        state.work[at.lag + j] = lag[j]
    return met


@njit(**INLINED)
def prescribe(part: Part, laws: Laws, factors: Floats, v: Floats, lines: Lines, moved: Floats, gains: Floats) -> bool:
    """Set which speeds are prescribed (n,), and their accelerations (2, n) at both ends of a part; return if a ratio varies."""
    geared = False
    for k in range(laws.kind.shape[0]):
        if laws.kind[k] == MOTION:
            j = moved_by(laws.on[k])
            moved[j] = 1.0
            speed = laws.on[k, j] * v[j]
            first, final = accelerations_of(factors, laws.factor[k], part.begin, part.end, part.d, speed)
            gains[0, j], gains[1, j] = first / laws.on[k, j], final / laws.on[k, j]
        elif laws.kind[k] == GEARING:
            j = own_speed(lines.w[laws.element[k]])
            moved[j] = 1.0
            gains[0, j], gains[1, j] = lines.slope[k], lines.torque[k]
            geared = True
    return geared


@njit(**INLINED)
def first_bend(since: float, d: float, laws: Laws, lines: Lines, inverse: Floats, before: Floats, after: Floats) -> float:
    """Return the time of the first bend that a shaft passes, at most ``since``; with the speeds at both ends of a part of d."""
    for k in range(laws.kind.shape[0]):
        if laws.kind[k] == SHAFT:
            first, final = product(laws.of[k], before), product(laws.of[k], after)
            mobility = mobility_of(laws.of[k], inverse)
            since = min(since, bend_inside(laws, k, lines.start[k], lines.way[k], first, final, d, mobility))
            since = min(since, lets_go(laws, k, lines.start[k], lines.way[k], first, final, d))
    return since


@njit(**ALLOCATES)
def leave_motions(
    d: float, broken: bool, mass: Floats, structure: Structure, loads: Loads, laws: Laws, moving: Moving, before: State
) -> None:
    """Set the torques of motions, and the work from outside, after a part of d of a step.

    Parameters
    ----------
    d : float
        Length of the part [s].
    broken : bool
        Whether modes have changed inside it.
    mass : (n, n) array
        Mass matrix with the inertias of laws.
    structure, loads : Structure, Loads
        As the bare step had them, but the forces of motions are not in q.
    laws, moving : Laws, Moving
        The driveline after the part.
    before : State
        The state before it.
    """
    state, own, n, slots = moving.state, moving.own, moving.state.v.shape[0], structure.sh.shape[0]
    gained, turned, twist0, twisted, swing = np.empty(n), np.empty(n), before.twist[:slots].copy(), np.empty(slots), np.empty(slots)
    at = places(n, state.mode.shape[0], slots, moving.loss.shape[0])
    others = 0.0
    for j in range(n):
        gained[j], turned[j] = state.v[j] - before.v[j], state.twist[slots + j] - before.twist[slots + j]
        work = work_over(loads.q, j, turned[j], state.work[at.lag + j])
        others += work
        state.e_in[j] = before.e_in[j] + work
    for k in range(laws.kind.shape[0]):
        if laws.slot[k] >= 0:
            twist0[laws.slot[k]] = 0.0
    for a in range(slots):
        twisted[a], swing[a] = state.twist[a] - twist0[a], state.work[at.swing + a]
    for k in range(laws.kind.shape[0]):
        if laws.kind[k] == MOTION or laws.kind[k] == GEARING:
            j = moved_by(laws.on[k]) if laws.kind[k] == MOTION else own_speed(structure.w[laws.element[k]])
            part = Turned(gained, turned, state.el[IMPULSE] - before.el[IMPULSE], twisted, swing)
            impulse = impulse_of(j, d, mass, structure, loads, part)
            if laws.kind[k] == MOTION:
                own.torque[k] = impulse / d / laws.on[k, j]
            if not broken and slots == 0:
                own.work[0] += impulse / d * turned[j]
    # with shafts a torque that varies in the part has another work than that of its mean
    if broken or slots > 0:
        own.work[0] += work_of(mass, structure.kc, before, state, twist0, others)


@njit(**INLINED)
def begin_part(room: Room, model: Model, moving: Moving) -> None:
    """Keep what a part of a step starts from, and clear the lines."""
    lines = room.lines
    put(room.loss, moving.loss)
    restore(room.before, moving.state)
    put(lines.w, model.structure.w)
    for k in range(lines.slope.shape[0]):
        lines.slope[k] = lines.torque[k] = lines.other[k] = 0.0


@njit(**INNER)
def try_step(model: Model, given: Given, moving: Moving, part: Part, room: Room, keep: bool, cut: bool) -> float:
    """Take a part of a step and return its length d if the laws are met.

    Otherwise it returns 0, and nothing has changed unless keep is true. With cut true it also returns less than d, and nothing has
    changed, where a shaft passes a bend, or where modes change during a prescribed motion: the next part then has the returned
    length, so that a bend lies at an end of a part, and that the work of the motion is computed over a part without a change of
    modes.
    """
    laws, loss, state, d = model.laws, moving.loss, moving.state, part.d
    sh, work, n = model.structure.sh, moving.state.work, moving.state.v.shape[0]
    at = places(n, state.mode.shape[0], sh.shape[0], loss.shape[0])
    before, lines, moved, gains = room.before, room.lines, room.moved, room.gains
    pushes, mass, inverse = lines.loads.q, model.mass, model.structure.minv
    begin_part(room, model, moving)
    heavy, driven = expect(part, laws, given.factors, moving.own, before.v, lines)
    if driven:
        pushes, inverse = room.pushes, room.inverse
        for j in range(n):
            moved[j] = gains[0, j] = gains[1, j] = 0.0
    met, worst = False, int(-1)
    for attempt in range(TRIES):
        if attempt > 0:
            put(loss, room.loss)
            restore(state, before)
        make_lines(part, attempt, heavy, model, given, moving, lines)
        if driven:
            put(pushes, lines.loads.q)
            if heavy:
                mass = room.mass
                put(mass, lines.held)
            if prescribe(part, laws, given.factors, before.v, lines, moved, gains):
                work[0] = -1.0
            if not heavy and attempt == 0:
                hold(mass, moved, inverse)
            drive(mass, moved, gains, lines.loads.q)
        if heavy:
            inverse = room.inverse
            if driven:
                hold(lines.held, moved, inverse)
            else:
                invert(lines.held, inverse)
            work[0] = -1.0
        if heavy or driven or not are_made(lines.kc, work, at):
            work[1] = -1.0
        bare_step(model.bare, d, part.t, Structure(inverse, lines.w, sh, lines.kc), lines.loads, loss, state)
        worst = worst_law(part, model, given, moving, before, lines)
        met = worst < 0
        # where the kernel could not decide which elements stick, more attempts at the same part take long and do not help
        if met or (attempt >= 3 and state.count[N_CAPPED] > before.count[N_CAPPED]):
            break
    since = work[FIRST]
    # where an impulse has acted, the work of a motion follows from the balance of energy only, however short the step
    struck = since == JAMMED
    inside = 1e-9 * d < since < d * (1.0 - 1e-9)
    bends = False
    if cut and met:
        at_bend = first_bend(since, d, laws, lines, inverse, before.v, state.v)
        bends = at_bend < since and 1e-9 * d < at_bend < d * (1.0 - 1e-9)
        since = at_bend
        inside = inside or bends
    if (met and cut and inside and (driven or bends)) or not (met or keep):
        put(loss, room.loss)
        restore(state, before)
        return since if met else 0.0
    if driven:
        structure = Structure(inverse, lines.w, sh, lines.kc)
        leave_motions(d, inside or struck, mass, structure, Loads(pushes, lines.loads.cap), laws, moving, before)
    leave_lines(part, laws, given, moving, before, lines)
    if not met:
        if state.count[N_CAPPED] == before.count[N_CAPPED]:
            state.count[WORST] = state.mode.shape[0] + worst
        state.count[N_CAPPED] += 1
        return 0.0
    return d


@njit(**ALLOCATES)
def settle(model: Model, given: Given, moving: Moving, d: float, t: float) -> None:
    """Set the losses by torque to those that belong to the inputs at the start of a step, where these have jumped."""
    state, own, loads = moving.state, moving.own, Loads(given.loads.q.copy(), given.loads.cap.copy())
    factors = given.factors.copy()
    put(loads.q[1], given.loads.q[0])
    put(factors[1], given.factors[0])
    for row in (KIN0, LO0, HI0):
        put(loads.cap[row + 1], given.loads.cap[row])
    for k in range(moving.loss.shape[0]):
        moving.loss[k, LAST] = 0.0
    state.work[1] = -1.0
    x = copied(state)
    aside = State(x.v, x.twist, x.mode, x.el, x.shaft, x.e_in, np.zeros((0, 3)), np.zeros(3, np.int64), x.work)
    copy = LawState(own.at.copy(), own.torque.copy(), own.spring.copy(), own.way.copy(), own.work.copy())
    law_step(model, Given(loads, factors), Moving(moving.loss, aside, copy), d, t, 0.0)
    state.work[1] = -1.0


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


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def settled_step(model: Model, given: Given, moving: Moving, h: float, t: float, fresh: bool) -> int:
    """Take a step like `law_step`; where inputs have jumped (fresh), recompute the losses by torque before it.

    It counts a step as capped at most once.
    """
    short_loops()
    model, given, moving = borrowed(model), borrowed(given), borrowed(moving)
    if moving.loss.shape[0] > 0 and fresh:
        settle(model, given, moving, 1e-6 * h, t)
    plain = model.structure.sh.shape[0] > 0 and only_shafts(model.laws, moving.loss)
    done = shafts_until(model, given, moving, h, 0.0) if plain else 0.0
    if done == h:
        return int(0)
    count = moving.state.count
    capped = count[N_CAPPED] + 1
    law_step(model, given, moving, h, t, done)
    count[N_CAPPED] = min(count[N_CAPPED], capped)
    return int(0)


@cache
def settled_types() -> tuple:
    """Return the types of the arguments of `settled_step`."""
    from numba import typeof

    structure, loads, loss, state = step_types()
    laws, own = typeof(laws_of([], 1)), typeof(law_state([]))
    return (
        types.NamedTuple((types.int64, structure, loss, laws), Model),
        types.NamedTuple((loads, loss), Given),
        types.NamedTuple((loss, state, own), Moving),
        types.float64,
        types.float64,
        types.boolean,
    )


@cache
def settled_address() -> int:
    """Return the address of `settled_step`."""
    return address_of(settled_step, settled_types())


settled_step_at = call_of(lambda _: settled_types())


class LawRows(NamedTuple):
    """State of the laws at the end of each of k steps, (k, ...) arrays of what `LawState` has."""

    torque: Floats
    at: Floats
    spring: Floats
    work: Floats


@njit(cache=True, error_model="numpy", nogil=True)
def run_laws(settled: int, model: Model, given: Given, moving: Moving, t: Floats, h: Floats, rows: Rows, law_rows: LawRows) -> None:
    """Take a step of each length h from each time t and record the state after it; settled is an address."""
    given, moving, rows, law_rows = borrowed(given), borrowed(moving), borrowed(rows), borrowed(law_rows)
    q, cap, own = given.loads.q, given.loads.cap, moving.own
    for i in range(q.shape[0]):
        fresh = moving.loss.shape[0] > 0 and (i == 0 or jumped(q[i], q[i - 1, 1], cap[i], cap[i - 1]))
        now = Given(Loads(q[i], cap[i]), given.factors[i])
        settled_step_at(settled, model, now, moving, h[i], t[i], fresh)
        put_row(rows, i, moving.state)
        put(law_rows.torque[i], own.torque)
        put(law_rows.at[i], own.at)
        put(law_rows.spring[i], own.spring)
        put(law_rows.work[i], own.work)
