# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of a driveline with laws, lossy meshes or inputs over time in which no mode changes: most steps of such a rig.

The engine calls it before driveline/driven.py, which takes the steps that this one leaves. The equations are those of
driveline/law_steps.py. Where that module repeats a step, this one uses Newton's method: the slope of every law over the
step is in the matrix, also where a law acts on other speeds than those that it depends on. A law that stays on one straight piece
of its table is met at once, and the matrix is kept as long as no slope changes.

It is compiled once for all rigs. Instead of some seventy arrays, each of seven machine words, it is given the address of the
driveline's record and the places of the fields in it.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.compiled import INLINED, INNER, intrinsic, njit, types
from rig_nodes.driveline.algebra import (
    BACKWARD,
    E_FRIC,
    E_SHAFT,
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
    has_capacity,
    noinline,
    places,
    project,
)
from rig_nodes.driveline.bends import longest_part
from rig_nodes.driveline.calls import address_of
from rig_nodes.driveline.driven import FACTOR, LIMIT
from rig_nodes.driveline.inputs import SAME
from rig_nodes.driveline.kernel import end_losses
from rig_nodes.driveline.law_steps import CLOSE, contact_damping, differ, mobility_of, spring_with_friction
from rig_nodes.driveline.laws import CAPACITY, FRICTION, INERTIA, MOTION, SHAFT, TORQUE
from rig_nodes.driveline.losses import BEFORE, LAST, NEXT, ON, OWN, WEIGHTS, brakes, put_losses
from rig_nodes.driveline.losses import FACTOR as PER_LOSS
from rig_nodes.driveline.tables import Tables, along, line, piece, value

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base.arrays import Floats, Ints

TRIES = 6  # most Newton steps; a step that needs more is left to driven_step

# rows of the work arrays for each law, friction element, row of shafts, and speed
(X, DX, RATE, TORQUE_, SLOPE, OTHER, EXTRA, AHEAD, PUSH0, PUSH1, GAIN, BEGIN, END, VALUE, RISE, MADE) = range(16)
(SLIP0, GAINED, TORQUE0, TORQUE1, CURVED, DRAG_MADE) = range(6)
(TURN, TWIST0, LEAD, TURNED, STIFF_MADE, DAMP_MADE) = range(6)
(FORCE, FINAL, DV, ACCEL, SPARE) = range(5)
ROOM = {"by_law": 16, "by_element": 6, "by_slot": 6, "by_speed": 5}

# fields of the driveline's record, in the order of their places in `layout`, after its SIZES: speeds, elements, rows of shafts,
# losses, laws, inputs over time, and inputs of laws
SIZES = 7
FIELDS = (
    "minv",
    "w",
    "sh",
    "kc",
    "q",
    "cap",
    "loss",
    "v",
    "twist",
    "mode",
    "el",
    "shaft",
    "e_in",
    "work",
    "kind",
    "angle",
    "slot",
    "element",
    "factor",
    "of",
    "on",
    "gap",
    "damping",
    "first_spring",
    "springs",
    "first_point",
    "x",
    "y",
    "ends",
    "period",
    "at",
    "law_torque",
    "spring",
    "way",
    "law_work",
    "part_work",
    "accel",
    "given_kind",
    "given_place",
    "given_on",
    "given_first",
    "given_x",
    "given_y",
    "stick",
    "default",
    "q_before",
    "cap_before",
    "begun",
    "made",
    "q_now",
    "cap_given",
    "cap_now",
    "kc_now",
    "given_ends",
    "given_period",
    "by_law",
    "by_element",
    "by_slot",
    "by_speed",
    "by_input",
)
(
    _MINV,
    _W,
    _SH,
    _KC,
    _Q,
    _CAP,
    _LOSS,
    _V,
    _TWIST,
    _MODE,
    _EL,
    _SHAFT,
    _E_IN,
    _WORK,
    _KIND,
    _ANGLE,
    _SLOT,
    _ELEMENT,
    _FACTOR,
    _OF,
    _ON,
    _GAP,
    _DAMPING,
    _FIRST_SPRING,
    _SPRINGS,
    _FIRST_POINT,
    _X,
    _Y,
    _ENDS,
    _PERIOD,
    _AT,
    _LAW_TORQUE,
    _SPRING,
    _WAY,
    _LAW_WORK,
    _PART_WORK,
    _ACCEL,
    _GIVEN_KIND,
    _GIVEN_PLACE,
    _GIVEN_ON,
    _GIVEN_FIRST,
    _GIVEN_X,
    _GIVEN_Y,
    _STICK,
    _DEFAULT,
    _Q_BEFORE,
    _CAP_BEFORE,
    _BEGUN,
    _MADE,
    _Q_NOW,
    _CAP_GIVEN,
    _CAP_NOW,
    _KC_NOW,
    _GIVEN_ENDS,
    _GIVEN_PERIOD,
    _BY_LAW,
    _BY_ELEMENT,
    _BY_SLOT,
    _BY_SPEED,
    _BY_INPUT,
) = range(SIZES, SIZES + len(FIELDS))


def quick_arrays(n: int, m: int, slots: int, laws: int, inputs: int, factors: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes, by name, of the work arrays of a quick step; no result depends on what they contain before it.

    Parameters
    ----------
    n, m, slots, laws, inputs, factors : int
        Numbers of speeds, friction elements, rows of shafts, laws, inputs over time, and inputs of laws.

    Returns
    -------
    dict of str to tuple of int
        The shapes.
    """
    return {
        "made": (3,),
        "q_now": (2, n),
        "cap_given": (7, m),
        "cap_now": (7, m),
        "kc_now": (2, slots),
        "given_ends": (inputs, 2),
        "given_period": (inputs,),
        "by_law": (ROOM["by_law"], laws),
        "by_element": (ROOM["by_element"], m),
        "by_slot": (ROOM["by_slot"], slots),
        "by_speed": (ROOM["by_speed"], n),
        "by_input": (2, factors),
    }


def layout_of(dtype: np.dtype) -> np.ndarray:
    """Return the sizes of a driveline's record and the places of its fields [bytes], as `quick_step` reads them."""

    def shape(name: str) -> tuple[int, ...]:
        return dtype[name].shape

    (m, n), laws = shape("w"), shape("kind")[0]
    sizes = [n, m, shape("sh")[0], shape("loss")[0], laws, shape("given_kind")[0], shape("default")[0]]
    return np.array([*sizes, *(dtype.fields[name][1] for name in FIELDS)], np.int64)


def _array(context: BaseContext, builder: ir.IRBuilder, made: types.Array, given: Sequence[ir.Value]) -> ir.Value:
    array = context.make_array(made)(context, builder)
    shape, strides, size = list(given[1:]), [], context.get_constant(types.intp, 8)
    for length in reversed(shape):
        strides.insert(0, size)
        size = builder.mul(size, length)
    context.populate_array(
        array,
        data=builder.inttoptr(given[0], array.data.type),
        shape=shape,
        strides=strides,
        itemsize=context.get_constant(types.intp, 8),
        meminfo=None,
    )
    return array._getvalue()


@intrinsic
def floats(_context: TypingContext, address: types.Type, count: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the array of floats that begins at an address."""
    made = types.Array(types.float64, 1, "C")
    return made(types.int64, types.int64), lambda context, builder, _signature, given: _array(context, builder, made, given)


@intrinsic
def grid(
    _context: TypingContext, address: types.Type, rows: types.Type, columns: types.Type
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the array of floats with rows and columns that begins at an address."""
    made = types.Array(types.float64, 2, "C")
    return made(types.int64, types.int64, types.int64), lambda context, builder, _signature, given: _array(
        context, builder, made, given
    )


@intrinsic
def whole(_context: TypingContext, address: types.Type, count: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the array of whole numbers that begins at an address."""
    made = types.Array(types.int64, 1, "C")
    return made(types.int64, types.int64), lambda context, builder, _signature, given: _array(context, builder, made, given)


@intrinsic
def short_loops(_context: TypingContext) -> tuple[Signature, Callable[..., None]]:
    """Keep the compiler from vectorising the loops of the calling function, which have too few turns for that to save time."""

    def mark(_target: BaseContext, builder: ir.IRBuilder, _signature: Signature, _arguments: Sequence[ir.Value]) -> None:
        builder.function.attributes.add("optsize")

    return types.void(), mark


@njit(**INLINED)
def dot(rows: Floats, k: int, v: Floats, i: int) -> float:
    """Return the sum of row k of an array times row i of another one."""
    total = 0.0
    for j in range(v.shape[1]):
        total += rows[k, j] * v[i, j]
    return total


@njit(**INNER)
def make_matrix(
    h: float,
    op: int,
    oh: int,
    oa: int,
    work: Floats,
    w: Floats,
    sh: Floats,
    cap: Floats,
    kc: Floats,
    on: Floats,
    of: Floats,
    kind: Ints,
    element: Ints,
    by_law: Floats,
    by_speed: Floats,
) -> None:
    """Compute H = (I + h/2 P B)^-1 P at `oh` of the work buffer, from P at `op`, with room for a matrix at `oa`.

    B has the drag, the shafts, and the slopes EXTRA of laws that act on other speeds than those that they depend on.
    """
    noinline()
    short_loops()
    m, n = w.shape
    for i in range(n):
        for j in range(n):
            work[oh + i * n + j] = work[op + i * n + j]
            work[oa + i * n + j] = 1.0 if i == j else 0.0
    for f in range(m):
        if cap[VISC, f] != 0.0:
            for i in range(n):
                share = 0.0
                for j in range(n):
                    share += work[op + i * n + j] * w[f, j]
                share *= 0.5 * h * cap[VISC, f]
                for j in range(n):
                    work[oa + i * n + j] += share * w[f, j]
    for a in range(sh.shape[0]):
        for i in range(n):
            share = 0.0
            for j in range(n):
                share += work[op + i * n + j] * sh[a, j]
            share *= 0.5 * h * (kc[1, a] + 0.5 * h * kc[0, a])
            for j in range(n):
                work[oa + i * n + j] += share * sh[a, j]
    for k in range(kind.shape[0]):
        if by_law[EXTRA, k] != 0.0:
            for j in range(n):
                by_speed[SPARE, j] = w[element[k], j] if kind[k] == CAPACITY else on[k, j]
            for i in range(n):
                share = 0.0
                for j in range(n):
                    share += work[op + i * n + j] * by_speed[SPARE, j]
                share *= 0.5 * h * by_law[EXTRA, k]
                for j in range(n):
                    work[oa + i * n + j] += share * of[k, j]
    for col in range(n):
        piv = col
        for i in range(col + 1, n):
            if abs(work[oa + i * n + col]) > abs(work[oa + piv * n + col]):
                piv = i
        if piv != col:
            for j in range(n):
                x = work[oa + col * n + j]
                work[oa + col * n + j] = work[oa + piv * n + j]
                work[oa + piv * n + j] = x
                x = work[oh + col * n + j]
                work[oh + col * n + j] = work[oh + piv * n + j]
                work[oh + piv * n + j] = x
        scale = 1.0 / work[oa + col * n + col]
        for j in range(n):
            work[oa + col * n + j] *= scale
            work[oh + col * n + j] *= scale
        for i in range(n):
            x = work[oa + i * n + col]
            if i != col and x != 0.0:
                for j in range(n):
                    work[oa + i * n + j] -= x * work[oa + col * n + j]
                    work[oh + i * n + j] -= x * work[oh + col * n + j]


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


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def quick_step(base: int, layout: Ints, h: float, t: float) -> int:
    """Take a step h from t like `driven_step` on the driveline's record at an address, if no event can happen in it.

    Returns 1 when the step is done. Returns 0 when an event is possible: a change of mode, a bend that a shaft passes, a point of
    an input over time, a prescribed motion. Then no state has changed, and `driven_step` has to be called.
    """
    short_loops()
    n, m, slots, losses, laws, inputs, factors = layout[0], layout[1], layout[2], layout[3], layout[4], layout[5], layout[6]
    minv = grid(base + layout[_MINV], n, n)
    w = grid(base + layout[_W], m, n)
    sh = grid(base + layout[_SH], slots, n)
    kc = grid(base + layout[_KC], 2, slots)
    q = grid(base + layout[_Q], 2, n)
    cap = grid(base + layout[_CAP], 7, m)
    loss = grid(base + layout[_LOSS], losses, WEIGHTS + m + n)
    v = floats(base + layout[_V], n)
    twist = floats(base + layout[_TWIST], slots + n)
    mode = whole(base + layout[_MODE], m)
    el = grid(base + layout[_EL], 4, m)
    shaft = grid(base + layout[_SHAFT], 2, slots)
    e_in = floats(base + layout[_E_IN], n)
    work = floats(base + layout[_WORK], 1)
    kind = whole(base + layout[_KIND], laws)
    angle = whole(base + layout[_ANGLE], laws)
    slot = whole(base + layout[_SLOT], laws)
    element = whole(base + layout[_ELEMENT], laws)
    factor = whole(base + layout[_FACTOR], laws)
    of = grid(base + layout[_OF], laws, n)
    on = grid(base + layout[_ON], laws, n)
    gap = floats(base + layout[_GAP], laws)
    damping = floats(base + layout[_DAMPING], laws)
    first_spring = whole(base + layout[_FIRST_SPRING], laws)
    springs = grid(base + layout[_SPRINGS], 1, 2)
    first_point = whole(base + layout[_FIRST_POINT], laws)
    x = floats(base + layout[_X], 1)
    y = floats(base + layout[_Y], 1)
    ends = grid(base + layout[_ENDS], laws, 2)
    period = floats(base + layout[_PERIOD], laws)
    at = floats(base + layout[_AT], laws)
    law_torque = floats(base + layout[_LAW_TORQUE], laws)
    spring = floats(base + layout[_SPRING], 1)
    way = floats(base + layout[_WAY], laws)
    law_work = floats(base + layout[_LAW_WORK], 1)
    part_work = floats(base + layout[_PART_WORK], 1)
    accel = floats(base + layout[_ACCEL], n)
    given_kind = whole(base + layout[_GIVEN_KIND], inputs)
    given_place = whole(base + layout[_GIVEN_PLACE], inputs)
    given_on = grid(base + layout[_GIVEN_ON], inputs, n)
    given_first = whole(base + layout[_GIVEN_FIRST], inputs)
    given_x = floats(base + layout[_GIVEN_X], 1)
    given_y = floats(base + layout[_GIVEN_Y], 1)
    stick = grid(base + layout[_STICK], 2, m)
    default = floats(base + layout[_DEFAULT], factors)
    q_before = floats(base + layout[_Q_BEFORE], n)
    cap_before = grid(base + layout[_CAP_BEFORE], 7, m)
    begun = floats(base + layout[_BEGUN], 1)
    made = floats(base + layout[_MADE], 3)
    q_now = grid(base + layout[_Q_NOW], 2, n)
    cap_given = grid(base + layout[_CAP_GIVEN], 7, m)
    cap_now = grid(base + layout[_CAP_NOW], 7, m)
    kc_now = grid(base + layout[_KC_NOW], 2, slots)
    given_ends = grid(base + layout[_GIVEN_ENDS], inputs, 2)
    given_period = floats(base + layout[_GIVEN_PERIOD], inputs)
    by_law = grid(base + layout[_BY_LAW], 16, laws)
    by_element = grid(base + layout[_BY_ELEMENT], 6, m)
    by_slot = grid(base + layout[_BY_SLOT], 6, slots)
    by_speed = grid(base + layout[_BY_SPEED], 5, n)
    by_input = grid(base + layout[_BY_INPUT], 2, factors)
    before = made[0] > 0.0
    made[0] = 0.0
    if begun[0] == 0.0:
        return int(0)
    at_ = places(n, m, slots, losses)
    tables = Tables(first_point, x, y, ends, period)
    vmax = 0.0
    for j in range(n):
        vmax = max(vmax, abs(v[j]))
        q_now[0, j], q_now[1, j] = q[0, j], q[1, j]
        by_speed[DV, j] = v[j]
    tol = 1e-12 * (1.0 + vmax)
    # torques, capacities and inputs of the laws at both ends
    for row in range(7):
        for f in range(m):
            cap_given[row, f] = cap[row, f]
    for k in range(losses):
        for row in range(VISC):
            cap_given[row, int(loss[k, OWN])] = 0.0
    for k in range(factors):
        by_input[0, k] = by_input[1, k] = default[k]
    for k in range(inputs):
        a, b, place = 0.0, 0.0, given_place[k]
        if given_first[k + 1] - given_first[k] == 1:
            a = b = given_y[given_first[k]]
        else:
            over_time = Tables(given_first, given_x, given_y, given_ends, given_period)
            _, until, height, point, rise = line(over_time, k, piece(over_time, k, t + SAME * h))
            if until - t < h - SAME * h:
                return int(0)
            a, b = height + rise * (t - point), height + rise * (t + h - point)
        if given_kind[k] == FACTOR:
            by_input[0, place], by_input[1, place] = a, b
        elif given_kind[k] == LIMIT:
            cap_given[KIN0, place], cap_given[KIN1, place] = a, b
            cap_given[HI0, place], cap_given[HI1, place] = stick[0, place] * a, stick[0, place] * b
            cap_given[LO0, place], cap_given[LO1, place] = -stick[1, place] * a, -stick[1, place] * b
        else:
            for j in range(n):
                q_now[0, j] += a * given_on[k, j]
                q_now[1, j] += b * given_on[k, j]
    if losses > 0:
        # where inputs have jumped, the losses are solved again
        for j in range(n):
            if differ(q_now[0, j], q_before[j]):
                return int(0)
        for f in range(m):
            for row in (KIN0, LO0, HI0):
                if differ(cap_given[row, f], cap_before[row + 1, f]):
                    return int(0)
    pattern, bit, stuck, slipping = 1.0, 1.0, False, False
    for f in range(m):
        by_element[SLIP0, f] = dot(w, f, by_speed, DV)
        by_element[CURVED, f] = 0.0
        if mode[f] == STUCK:
            pattern += bit
            stuck = True
        elif mode[f] == FORWARD or mode[f] == BACKWARD:
            slipping = True
            if mode[f] * by_element[SLIP0, f] < -tol:
                return int(0)
        elif mode[f] != OPEN:
            return int(0)
        bit *= 2.0
    for a in range(slots):
        by_slot[TURN, a] = dot(sh, a, by_speed, DV)
        by_slot[TWIST0, a] = twist[a]
        by_slot[LEAD, a] = 0.0
        kc_now[0, a], kc_now[1, a] = kc[0, a], kc[1, a]
    # the arguments of the laws, and their expected changes
    heavy, bent = False, losses > 0
    for k in range(laws):
        rate = dot(of, k, by_speed, DV)
        by_law[RATE, k] = by_law[X, k] = rate
        by_law[DX, k] = way[k] * h
        by_law[AHEAD, k] = 1.0
        by_law[PUSH0, k] = by_law[PUSH1, k] = by_law[EXTRA, k] = by_law[TORQUE_, k] = 0.0
        if angle[k]:
            by_law[X, k] = at[k]
            by_law[DX, k] = h * rate + way[k] * h * h
            by_law[AHEAD, k] = 0.5 * h
        here = by_law[X, k]
        if kind[k] == MOTION:
            return int(0)
        if kind[k] == CAPACITY:
            bent = True
        elif kind[k] == FRICTION:
            bent = True
            by_element[CURVED, element[k]] = 1.0
            here = abs(here)
        elif kind[k] == INERTIA:
            heavy = True
            by_law[SLOPE, k] = rate + 2.0 * way[k] * h
        elif slot[k] >= 0:
            by_slot[TWIST0, slot[k]] = 0.0
        begin, end, height, point, rise = line(tables, k, piece(tables, k, here))
        if here == begin:
            # at a bend the pieces before and behind it are equally close
            begin = np.inf if by_law[DX, k] < 0.0 else begin
        by_law[BEGIN, k], by_law[END, k], by_law[RISE, k] = begin, end, rise
        by_law[VALUE, k] = height + rise * (here - point)
        if kind[k] == SHAFT and first_point[k + 1] - first_point[k] > 2:
            stiffness = 0.0
            for i in range(first_spring[k], first_spring[k + 1]):
                stiffness += springs[i, 0]
            if longest_part(tables, k, here, rate, stiffness, mobility_of(of[k], minv), h) < h:
                return int(0)
    if heavy and losses > 0:
        return int(0)
    if work[0] != pattern or (heavy and not before):
        for f in range(m):
            work[at_.state + f] = mode[f]
        project(minv, w, at_.state, work)
        before = False
    before = before and made[1] == h and made[2] == pattern
    made[1], made[2] = h, pattern
    op, orr = (at_.b, at_.wm) if heavy else (at_.p, at_.r)
    cc = cap_now if bent else cap_given
    met = False
    for _ in range(TRIES):
        # the straight lines that replace the laws in this step
        if bent:
            for row in range(7):
                for f in range(m):
                    cc[row, f] = cap_given[row, f]
        if heavy:
            for i in range(n * n):
                work[op + i] = work[at_.p + i]
            for i in range(m * n):
                work[orr + i] = work[at_.r + i]
        for k in range(laws):
            place, f, here, dx = slot[k], element[k], by_law[X, k], by_law[DX, k]
            rest = h * by_law[RATE, k] if angle[k] else 0.0
            if kind[k] == CAPACITY:
                start, final, rise = max(0.0, by_law[VALUE, k]), by_law[VALUE, k] + by_law[RISE, k] * dx, by_law[RISE, k]
                if not by_law[BEGIN, k] <= here + dx <= by_law[END, k]:
                    _, _, height, point, rise = line(tables, k, piece(tables, k, here + dx))
                    final = height + rise * (here + dx - point)
                by_law[EXTRA, k] = by_law[SLOPE, k] = 0.0
                by_law[OTHER, k] = limit = kinetic = max(0.0, final)
                if (mode[f] == FORWARD or mode[f] == BACKWARD) and final > 0.0 and losses == 0 and by_element[CURVED, f] == 0.0:
                    by_law[SLOPE, k] = rise
                    by_law[EXTRA, k] = mode[f] * cc[KIN1, f] * rise * by_law[AHEAD, k]
                    kinetic = final + rise * (rest - dx)
                for row in (KIN0, LO0, HI0):
                    cc[row, f] *= start
                    cc[row + 1, f] *= kinetic if row == KIN0 else limit
            elif kind[k] == FRICTION:
                a0, a1 = abs(here), abs(here + dx)
                if by_law[BEGIN, k] <= a1 <= by_law[END, k]:
                    rise = by_law[RISE, k]
                elif abs(a1 - a0) > 1e-9 * (1.0 + a0):
                    rise = (value(tables, k, a1) - by_law[VALUE, k]) / (a1 - a0)
                else:
                    rise = along(tables, k, a0, 1e-9)[1]
                by_law[SLOPE, k] = rise
                by_law[OTHER, k] = mean = 0.5 * (cc[KIN0, f] + cc[KIN1, f])
                at_rest = value(tables, k, 0.0)
                for row in (KIN0, KIN1):
                    cc[row, f] = cc[row, f] * by_law[VALUE, k] - mean * rise * a0
                    cc[LO0 - KIN0 + row, f] *= at_rest
                    cc[HI0 - KIN0 + row, f] *= at_rest
                cc[VISC, f] += mean * rise
            elif kind[k] == INERTIA:
                # SLOPE is the speed that is expected at the end
                bend = by_law[RISE, k]
                j1 = by_law[VALUE, k] + bend * dx
                if not by_law[BEGIN, k] <= here + dx <= by_law[END, k]:
                    j1 = value(tables, k, here + dx)
                    if abs(dx) > 1e-9:
                        bend = (j1 - by_law[VALUE, k]) / dx
                w0, w1 = by_law[RATE, k], by_law[SLOPE, k]
                by_law[EXTRA, k] = bend * w1
                by_law[TORQUE_, k] = 0.25 * bend * (w0 * w0 + w1 * w1) - 0.5 * bend * w1 * (w1 - w0)
                by_law[PUSH0, k] = by_law[PUSH1, k] = -by_law[TORQUE_, k]
                by_law[OTHER, k] = inertia = 0.5 * (by_law[VALUE, k] + j1)
                if inertia > 0.0:
                    add_inertia(inertia, on, k, op, orr, m, work, by_speed)
            else:
                start, rise = by_law[VALUE, k], by_law[RISE, k]
                if not by_law[BEGIN, k] <= here + dx <= by_law[END, k]:
                    start, rise = along(tables, k, here, dx)
                if kind[k] == SHAFT:
                    by_law[OTHER, k] = contact_damping(damping[k], gap[k], here, dx, start, rise, dx / h)
                    for i in range(first_spring[k], first_spring[k + 1]):
                        start += spring[i]
                        rise += spring_with_friction(springs[i, 0], springs[i, 1], spring[i], dx)[0]
                    kc_now[0, place], kc_now[1, place] = rise, by_law[OTHER, k]
                    by_slot[LEAD, place] = start
                else:
                    a, b = by_input[0, factor[k]], by_input[1, factor[k]]
                    if place >= 0:
                        steep, shift = 0.5 * (a + b) * rise, 0.0
                        kc_now[0, place] = kc_now[1, place] = 0.0
                        if angle[k]:
                            kc_now[0, place] = -steep
                        else:
                            kc_now[1, place] = -steep
                            shift = steep * here
                        by_law[PUSH0, k], by_law[PUSH1, k] = a * start - shift, b * start - shift
                    else:
                        by_law[EXTRA, k] = 0.0 if losses > 0 else -b * rise * by_law[AHEAD, k]
                        by_law[PUSH0, k], by_law[PUSH1, k] = a * start, b * (start + rise * (dx if losses > 0 else rest))
                by_law[TORQUE_, k], by_law[SLOPE, k] = start, rise
        for k in range(losses):
            loss[k, NEXT] = loss[k, LAST]
        put_losses(loss, cc, int(0), int(LAST))
        put_losses(loss, cc, int(1), int(-1))
        # the matrix, where a slope has changed
        same = before and not heavy
        for f in range(m):
            same = same and by_element[DRAG_MADE, f] == cc[VISC, f]
            by_element[DRAG_MADE, f] = cc[VISC, f]
        for a in range(slots):
            same = same and by_slot[STIFF_MADE, a] == kc_now[0, a] and by_slot[DAMP_MADE, a] == kc_now[1, a]
            by_slot[STIFF_MADE, a], by_slot[DAMP_MADE, a] = kc_now[0, a], kc_now[1, a]
        for k in range(laws):
            same = same and by_law[MADE, k] == by_law[EXTRA, k]
            by_law[MADE, k] = by_law[EXTRA, k]
        if not same:
            make_matrix(h, op, at_.h, at_.a, work, w, sh, cc, kc_now, on, of, kind, element, by_law, by_speed)
            before = True
        # forces at both ends, those at the end without the implicit parts
        for j in range(n):
            by_speed[FORCE, j], by_speed[FINAL, j] = q_now[0, j], q_now[1, j]
        for a in range(slots):
            torque = by_slot[LEAD, a] + kc_now[0, a] * by_slot[TWIST0, a] + kc_now[1, a] * by_slot[TURN, a]
            final = torque + kc_now[0, a] * h * by_slot[TURN, a]
            for j in range(n):
                by_speed[FORCE, j] -= sh[a, j] * torque
                by_speed[FINAL, j] -= sh[a, j] * final
        for f in range(m):
            mo = mode[f]
            if (mo != OPEN) != has_capacity(cc, f):
                return int(0)
            torque = final = 0.0
            if mo == FORWARD or mo == BACKWARD:
                torque, final = mo * cc[KIN0, f], mo * cc[KIN1, f]
            by_element[TORQUE0, f], by_element[TORQUE1, f] = torque, final
            drag = cc[VISC, f] * by_element[SLIP0, f]
            torque += drag
            final += drag
            if torque != 0.0 or final != 0.0:
                for j in range(n):
                    by_speed[FORCE, j] -= w[f, j] * torque
                    by_speed[FINAL, j] -= w[f, j] * final
        for k in range(laws):
            if by_law[PUSH0, k] != 0.0 or by_law[PUSH1, k] != 0.0:
                for j in range(n):
                    by_speed[FORCE, j] += on[k, j] * by_law[PUSH0, k]
                    by_speed[FINAL, j] += on[k, j] * by_law[PUSH1, k]
        if losses > 0:
            for i in range(n):
                accel_ = 0.0
                for j in range(n):
                    accel_ += work[op + i * n + j] * by_speed[FORCE, j]
                work[at_.accel + i] = accel_
                work[at_.force + i] = by_speed[FORCE, i]
                work[at_.dforce + i] = by_speed[FINAL, i] - by_speed[FORCE, i]
            for f in range(m):
                work[at_.torque1 + f] = by_element[TORQUE1, f]
            if not end_losses(h, w, sh, kc_now, cc, loss, v, mode, work):
                return int(0)
            put_losses(loss, cc, int(1), int(NEXT))
            for k in range(losses):
                f = int(loss[k, ON])
                more = brakes(loss[k, PER_LOSS], mode[f]) * loss[k, NEXT]
                by_element[TORQUE1, f] += more
                for j in range(n):
                    by_speed[FINAL, j] -= w[f, j] * more
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += work[at_.h + i * n + j] * (by_speed[FORCE, j] + by_speed[FINAL, j])
            by_speed[DV, i] = 0.5 * h * total
        # how far each law is from its line
        met = True
        for k in range(laws):
            f, here, dx, rate = element[k], by_law[X, k], by_law[DX, k], by_law[RATE, k]
            gain = dot(of, k, by_speed, DV)
            moved = h * rate + 0.5 * h * gain if angle[k] else gain
            within = by_law[BEGIN, k] <= here + moved <= by_law[END, k]
            error, scale = 0.0, 1.0
            if kind[k] == CAPACITY:
                asked = by_law[VALUE, k] + by_law[RISE, k] * moved if within else value(tables, k, here + moved)
                asked = max(0.0, asked)
                if mode[f] == FORWARD or mode[f] == BACKWARD:
                    error, scale = abs(asked - (by_law[OTHER, k] + by_law[SLOPE, k] * (moved - dx))), asked
                for row in (LO1, HI1):
                    cc[row, f] = cap_given[row, f] * asked
            elif kind[k] == FRICTION:
                a0, a1 = abs(here), abs(here + moved)
                if not by_law[BEGIN, k] <= a1 <= by_law[END, k]:
                    error = abs(value(tables, k, a1) - by_law[VALUE, k] - by_law[SLOPE, k] * (a1 - a0))
                elif by_law[SLOPE, k] != by_law[RISE, k]:
                    error = abs((by_law[RISE, k] - by_law[SLOPE, k]) * (a1 - a0))
                error, scale = error * by_law[OTHER, k], 1.0 + by_law[OTHER, k]
            elif kind[k] == INERTIA:
                w1, bend = rate + gain, by_law[RISE, k]
                torque = by_law[TORQUE_, k] + 0.5 * by_law[EXTRA, k] * gain
                j1 = by_law[VALUE, k] + bend * moved
                if not within:
                    j1 = value(tables, k, here + moved)
                    if abs(moved) > 1e-9:
                        bend = (j1 - by_law[VALUE, k]) / moved
                error = abs(0.25 * bend * (rate * rate + w1 * w1) - torque)
                error += abs(0.5 * (by_law[VALUE, k] + j1) - by_law[OTHER, k]) * abs(gain) / h
                scale = 1.0 + abs(torque)
                by_law[SLOPE, k] = w1
            else:
                start, asked = by_law[VALUE, k], by_law[RISE, k]
                if not within:
                    start, asked = along(tables, k, here, moved)
                if kind[k] == SHAFT:
                    damped = contact_damping(damping[k], gap[k], here, moved, start, asked, moved / h)
                    error = abs((damped - by_law[OTHER, k]) * moved / h)
                    for i in range(first_spring[k], first_spring[k + 1]):
                        asked += spring_with_friction(springs[i, 0], springs[i, 1], spring[i], moved)[0]
                error += abs(asked * moved - by_law[SLOPE, k] * (dx if slot[k] < 0 and losses > 0 else moved))
                scale = 1.0 + abs(by_law[TORQUE_, k]) + abs(asked * moved)
            met = met and error <= CLOSE * scale
            by_law[DX, k], by_law[GAIN, k] = moved, gain
        if met:
            break
    if not met:
        return int(0)
    for k in range(laws):
        if kind[k] == SHAFT and first_point[k + 1] - first_point[k] > 2:
            here = by_law[X, k]
            if not (by_law[BEGIN, k] < here < by_law[END, k] and by_law[BEGIN, k] <= here + by_law[DX, k] <= by_law[END, k]):
                return int(0)
        # the implicit parts
        gain = by_law[GAIN, k]
        if kind[k] == CAPACITY:
            push = by_law[EXTRA, k] * gain
            by_element[TORQUE1, element[k]] += push
            for j in range(n):
                by_speed[FINAL, j] -= w[element[k], j] * push
        elif kind[k] == INERTIA:
            push = 0.5 * by_law[EXTRA, k] * gain
            by_law[TORQUE_, k] += push
            for j in range(n):
                by_speed[FORCE, j] -= on[k, j] * push
                by_speed[FINAL, j] -= on[k, j] * push
        elif by_law[EXTRA, k] != 0.0:
            push = -by_law[EXTRA, k] * gain
            by_law[PUSH1, k] += push
            for j in range(n):
                by_speed[FINAL, j] += on[k, j] * push
    for a in range(slots):
        by_slot[TURNED, a] = gain = dot(sh, a, by_speed, DV)
        push = (kc_now[1, a] + 0.5 * h * kc_now[0, a]) * gain
        for j in range(n):
            by_speed[FINAL, j] -= sh[a, j] * push
    for f in range(m):
        by_element[GAINED, f] = gain = dot(w, f, by_speed, DV)
        push = cc[VISC, f] * gain
        if push != 0.0:
            for j in range(n):
                by_speed[FINAL, j] -= w[f, j] * push
    # whether an event is possible
    if slipping:
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += work[op + i * n + j] * by_speed[FORCE, j]
            by_speed[ACCEL, i] = total
    for f in range(m):
        mo = mode[f]
        if mo == STUCK:
            l0 = l1 = 0.0
            for j in range(n):
                l0 += work[orr + f * n + j] * by_speed[FORCE, j]
                l1 += work[orr + f * n + j] * by_speed[FINAL, j]
            by_element[TORQUE0, f], by_element[TORQUE1, f] = l0, l1
            lim = 1e-11 * (1.0 + abs(l0) + abs(l1))
            if max(cc[HI1, f], cc[KIN1, f]) - l1 < -lim or max(cc[HI0, f], cc[KIN0, f]) - l0 < -4.0 * lim:
                return int(0)
            if l1 - min(cc[LO1, f], -cc[KIN1, f]) < -lim or l0 - min(cc[LO0, f], -cc[KIN0, f]) < -4.0 * lim:
                return int(0)
        elif mo != OPEN:
            y0 = mo * by_element[SLIP0, f]
            speeding = mo * dot(w, f, by_speed, ACCEL)
            if not (y0 > tol and y0 + mo * by_element[GAINED, f] > 0.0 and (speeding >= 0.0 or y0 + speeding * h > 0.0)):
                return int(0)
    # the step is done: energies and states
    made[0] = 1.0
    for k in range(losses):
        loss[k, BEFORE] = loss[k, LAST]
        loss[k, LAST] = loss[k, NEXT]
    put_losses(loss, cap, int(1), int(LAST))
    for j in range(n):
        turned = h * (v[j] + 0.5 * by_speed[DV, j])
        e_in[j] += 0.5 * (q_now[0, j] + q_now[1, j]) * turned
        part_work[0] += 0.5 * (q[0, j] + q[1, j]) * turned
        twist[slots + j] += turned
        v[j] += by_speed[DV, j]
    for f in range(m):
        torque = 0.5 * (by_element[TORQUE0, f] + by_element[TORQUE1, f])
        slip = by_element[SLIP0, f] + 0.5 * by_element[GAINED, f]
        # friction over slip was counted as drag
        torque += (cc[VISC, f] - cap[VISC, f]) * slip
        el[LAM, f] = by_element[TORQUE1, f] + (cc[VISC, f] - cap[VISC, f]) * (by_element[SLIP0, f] + by_element[GAINED, f])
        el[IMPULSE, f] += h * torque
        if mode[f] == FORWARD or mode[f] == BACKWARD:
            el[E_FRIC, f] += h * torque * slip
        el[E_VISC, f] += h * cap[VISC, f] * slip * slip
    for a in range(slots):
        rate = by_slot[TURN, a] + 0.5 * by_slot[TURNED, a]
        twist[a] = by_slot[TWIST0, a] + h * rate
        shaft[E_SHAFT, a] += h * kc_now[1, a] * rate * rate
        shaft[TAU, a] = kc_now[0, a] * twist[a] + kc_now[1, a] * (by_slot[TURN, a] + by_slot[TURNED, a])
    if stuck:
        for j in range(n):
            by_speed[SPARE, j] = v[j]
        for f in range(m):
            if mode[f] == STUCK:
                slip = dot(w, f, by_speed, SPARE)
                for j in range(n):
                    v[j] -= work[orr + f * n + j] * slip
    # states of the laws, and the accelerations at the end
    for j in range(n):
        by_speed[FORCE, j] = q_before[j] = q_now[1, j]
    straight = slots
    if heavy:
        for i in range(n):
            for j in range(n):
                work[op + i * n + j] = minv[i, j]
    for k in range(laws):
        place, dx, rate = slot[k], by_law[DX, k], by_law[RATE, k]
        here, turned = by_law[X, k] + dx, rate + by_law[GAIN, k]
        reads = abs(here) if kind[k] == FRICTION else here
        now = by_law[VALUE, k] + by_law[RISE, k] * (reads - abs(by_law[X, k]) if kind[k] == FRICTION else dx)
        if not by_law[BEGIN, k] <= reads <= by_law[END, k]:
            now = value(tables, k, reads)
        if angle[k]:
            at[k] = here
            way[k] = by_law[GAIN, k] / (2.0 * h)
        else:
            way[k] = dx / h
        push = 0.0
        if kind[k] == SHAFT:
            damped = contact_damping(damping[k], gap[k], here, 0.0, now, 0.0, turned)
            for i in range(first_spring[k], first_spring[k + 1]):
                stiffness, was = springs[i, 0], spring[i]
                by, spring[i] = spring_with_friction(stiffness, springs[i, 1], was, dx)
                shaft[E_SHAFT, place] += (was + 0.5 * by * dx) * dx - 0.5 * (spring[i] ** 2 - was**2) / stiffness
                now += spring[i]
            shaft[TAU, place] = now + damped * turned
            twist[place] = here
        elif kind[k] == TORQUE:
            push = now = by_input[1, factor[k]] * now
            moved = 0.0
            for j in range(n):
                moved += on[k, j] * (v[j] - 0.5 * by_speed[DV, j])
            law_work[0] += 0.5 * h * (by_law[PUSH0, k] + by_law[PUSH1, k]) * moved
            if place >= 0:
                straight -= 1
                mid = by_slot[TURN, place] + 0.5 * by_slot[TURNED, place]
                law_work[0] -= 0.5 * kc_now[0, place] * dx * dx + h * kc_now[1, place] * mid * mid
        elif kind[k] == INERTIA:
            bend = by_law[RISE, k]
            if not by_law[BEGIN, k] <= here < by_law[END, k]:
                bend = along(tables, k, here, 1e-9)[1]
            push = -0.5 * bend * turned * turned
            if now > 0.0:
                add_inertia(now, on, k, op, orr, int(0), work, by_speed)
        law_torque[k] = now
        if push != 0.0:
            for j in range(n):
                by_speed[FORCE, j] += push * on[k, j]
    for f in range(m):
        torque = el[LAM, f] + cap[VISC, f] * (by_element[SLIP0, f] + by_element[GAINED, f])
        for j in range(n):
            by_speed[FORCE, j] -= torque * w[f, j]
    for a in range(straight):
        for j in range(n):
            by_speed[FORCE, j] -= shaft[TAU, a] * sh[a, j]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += (work[op + i * n + j] if heavy else minv[i, j]) * by_speed[FORCE, j]
        accel[i] = total
    if losses > 0:
        for row in range(7):
            for f in range(m):
                cap_before[row, f] = cap_given[row, f]
    return int(1)


QUICK = (types.int64, types.Array(types.int64, 1, "C"), types.float64, types.float64)


@cache
def quick_address() -> int:
    """Return the address of `quick_step`."""
    return address_of(quick_step, QUICK)
