# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constants, work buffer and linear algebra of the driveline step, on one flat work buffer.

Used by driveline/joint.py, driveline/kernel.py and driveline/quiet.py; this module does not depend on time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.base import INLINED, INNER, intrinsic, njit, types

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base import Floats, Ints

# Modes of a friction element. LOCKED_* carry their stick limit while other locked elements prevent their slip (a statically
# indeterminate system); they do not slip, like STUCK. abs(mode) >= 2 means no slip.
OPEN, FORWARD, BACKWARD, STUCK, LOCKED_HIGH, LOCKED_LOW = 0, 1, -1, 2, 3, -3

# Kinds of event. CLOSE: an open element gets capacity while it slips; FREE: an element loses all capacity.
LOCK, BREAK, CROSS, FREE, CLOSE = 1, 2, 3, 4, 5

# Rows of `cap`, `el`, `shaft`, `kc`, `q`; places in `count`.
KIN0, KIN1, LO0, LO1, HI0, HI1, VISC = 0, 1, 2, 3, 4, 5, 6
LAM, IMPULSE, E_FRIC, E_VISC = 0, 1, 2, 3
TAU, E_SHAFT = 0, 1
N_EVENTS, N_CAPPED, WORST = 0, 1, 2

RANK = 1e-10  # relative size below which a constraint counts as dependent on the others
CLEAR = 1e-9  # share of a torque by which an element at its limit must be overloaded for its mode to be certain
HELD = 2.0**-100  # 1 / (kg m2): inverse inertia of a prescribed speed, which no torque changes
WEAK = 1e10 * HELD  # below this no free speed takes part in the slip of an element
# work[0]: number of the stuck elements of P and R, [1]: that of H, [2]: step of H, [3]: 1 if anything is implicit, the rest by
# name. A number of 0 or less: not valid
HEAD = 8
FIRST = 4  # work[4]: time from the start of the last step to its first change of modes, or to its end [s]
RATE, RATE_OF = 5, 6  # work[5]: bound of the fastest rate of shafts and drag [1/s]; work[6]: the stuck elements of it


@intrinsic
def noinline(_context: TypingContext) -> tuple[Signature, Callable[..., None]]:
    """Keep the compiled function that calls it out of its callers, so that code that is seldom needed is compiled once."""

    def mark(_target: BaseContext, builder: ir.IRBuilder, _signature: Signature, _arguments: Sequence[ir.Value]) -> None:
        builder.function.attributes.add("noinline")

    return types.void(), mark


@intrinsic
def short_loops(_context: TypingContext) -> tuple[Signature, Callable[..., None]]:
    """Keep the compiler from vectorising the loops of the calling function, which have too few turns for that to save time."""

    def mark(_target: BaseContext, builder: ir.IRBuilder, _signature: Signature, _arguments: Sequence[ir.Value]) -> None:
        builder.function.attributes.add("optsize")

    return types.void(), mark


class Places(NamedTuple):
    """Places at which the parts of the work buffer begin.

    They follow HEAD, the drag for which H was made, the difference from that drag up to which H remains valid, and 1 for each stuck
    element, in P and R and then in H.
    """

    p: int  # (n, n) acceleration by a force, with the stuck elements held
    h: int  # (n, n) the same over a step, with the drag, without shafts
    r: int  # (m, n) torque of a stuck element by a force
    wm: int  # (m, n), and the next five: scratch of project and implicit
    g: int  # (m, m)
    vectors: int  # (m, m)
    inverse: int  # (m, m)
    b: int  # (n, n)
    a: int  # (n, n)
    force: int  # (n,) force at the start of the sub-step
    accel: int  # (n,) acceleration at its start
    dforce: int  # (n,) change of force over it
    dv: int  # (n,) change of speed over it
    rate: int  # (s,) rate of the shafts' twist at its start
    state: int  # (m,) modes of the set that is tried
    candidate: int  # (m,) 1 where stick or slip is to be decided
    side: int  # (m,) side on which an element has just been overloaded
    once: int  # (m,) 1 where an element has been released
    slip: int  # (m,) slip that a root leaves
    slip0: int  # (m,) slip at the start of the sub-step
    slip1: int  # (m,) slip at its end
    torque0: int  # (m,) friction torque at the start
    torque1: int  # (m,) friction torque at the end
    lossy: int  # (m,) 1 for an element whose capacity grows by a loss
    between: int  # (m,) mean friction torque over the sub-step
    lag: int  # (n,) integral of the speed times the share of the step, from -1/2 to 1/2 [rad]
    swing: int  # (s,) integral of the twists over the step [rad s]
    nodes: int  # (2, 2 n, n), and the rest up to `bent` with shafts only: in place of h for each pair of eigenvalues
    solve: int  # (2 n, 2 n) scratch of make_nodes
    z: int  # (4, n) real and imaginary parts of both z
    mean: int  # (n,) mean of the change of speed
    twice: int  # (n,) mean of its integral
    moment: int  # (n,) mean of it times the share of the time
    during: int  # (n,) mean force
    made: int  # (s, 2) stiffness and damping of each shaft for which `nodes` were made
    bent: int  # (s, 10) of each shaft that follows a table, by driveline.bent_shafts
    w_ends: int  # (m, 2) first speed on which each element acts, and the one behind the last
    sh_ends: int  # (s, 2) the same of each shaft
    band: int  # (n,) first column of each row of the factors that `nodes` then has; the first is -1 where they are inverses
    ranges: int  # (1 + 2 n,) number of P, then for each of its columns the first row that is not zero, and the one behind the last
    rho: int  # (k, n) torque of each loss by a force
    by_speed: int  # (k, n) the same by a speed, for elements with drag
    given: int  # (k,) torque on which each loss depends, without any loss
    fall: int  # (k, k) its decrease by each loss
    newton: int  # (k, k + 2) Newton's equations and their solution
    row: int  # (n,) torque of one loss by a force, with all that is implicit
    size: int  # total size


@njit(**INLINED)
def places(n: int, m: int, s: int, k: int) -> Places:
    """Return the places of the work buffer for n speeds, m friction elements, s shafts and k losses by torque."""
    p = HEAD + 4 * m
    wm = p + 2 * n * n + m * n
    g = wm + m * n
    b = g + 3 * m * m
    force = b + 2 * n * n
    rate = force + 4 * n
    state = rate + s
    slip0 = state + 5 * m
    lag = slip0 + 6 * m
    nodes = lag + n + s
    own = n if s > 0 else 0
    z = nodes + 8 * own * own
    made = z + 8 * own
    w_ends = made + 12 * s
    band = w_ends + 2 * (m + s)
    ranges = band + own
    rho = ranges + 1 + 2 * n
    given = rho + 2 * k * n
    row = given + k + k * k + k * (k + 2)
    return Places(
        p,
        p + n * n,
        p + 2 * n * n,
        wm,
        g,
        g + m * m,
        g + 2 * m * m,
        b,
        b + n * n,
        force,
        force + n,
        force + 2 * n,
        force + 3 * n,
        rate,
        state,
        state + m,
        state + 2 * m,
        state + 3 * m,
        state + 4 * m,
        slip0,
        slip0 + m,
        slip0 + 2 * m,
        slip0 + 3 * m,
        slip0 + 4 * m,
        slip0 + 5 * m,
        lag,
        lag + n,
        nodes,
        nodes + 4 * own * own,
        z,
        z + 4 * own,
        z + 5 * own,
        z + 6 * own,
        z + 7 * own,
        made,
        made + 2 * s,
        w_ends,
        w_ends + 2 * m,
        band,
        ranges,
        rho,
        rho + k * n,
        given,
        given + k,
        given + k + k * k,
        row,
        row + n,
    )


def work_size(n: int, m: int, s: int, k: int = 0) -> int:
    """Return the length of the float64 work buffer for n speeds, m friction elements, s shafts and k losses by torque.

    The buffer must start with zeros. Each driveline needs its own buffer, which must be set to zero when minv, w, sh or kc change.
    """
    return places.py_func(n, m, s, k).size


@njit(**INLINED)
def rate_of(rows: Floats, k: int, v: Floats) -> float:
    """Return the sum of row k (n,) times the speeds v (n,): the slip of an element, or the rate of a shaft's twist."""
    total = 0.0
    for j in range(v.shape[0]):
        total += rows[k, j] * v[j]
    return total


@njit(**INLINED)
def sum_at(work: Floats, begin: int, rows: Floats, k: int) -> float:
    """Return the sum of row k (n,) times the n numbers of the work buffer from a place on."""
    total = 0.0
    for j in range(rows.shape[1]):
        total += work[begin + j] * rows[k, j]
    return total


@njit(**INLINED)
def sum_of(work: Floats, one: int, other: int, n: int) -> float:
    """Return the sum of n numbers times n others of the work buffer, from two places on."""
    total = 0.0
    for j in range(n):
        total += work[one + j] * work[other + j]
    return total


@njit(**INLINED)
def multiply(work: Floats, matrix: int, vector: int, to: int, n: int) -> None:
    """Write the product of an (n, n) matrix and an (n,) vector of the work buffer to a third place of it."""
    for i in range(n):
        work[to + i] = sum_of(work, matrix + i * n, vector, n)


@njit(**INLINED)
def unslip(v: Floats, m: int, state: Ints | Floats, first: int, slip: int, orr: int, work: Floats) -> None:
    """Take the slips of the stuck ones of m elements off the speeds.

    The modes are in ``state`` from ``first`` on, the slips in the work buffer at ``slip`` and R at ``orr``.
    """
    n = v.shape[0]
    for f in range(m):
        if state[first + f] == STUCK and work[slip + f] != 0.0:
            for j in range(n):
                v[j] -= work[orr + f * n + j] * work[slip + f]


@njit(**INNER)
def swap(work: Floats, one: int, other: int, count: int) -> None:
    """Exchange count numbers of the work buffer from two places on."""
    for j in range(count):
        x = work[one + j]
        work[one + j] = work[other + j]
        work[other + j] = x


@njit(**INNER)
def eliminate(work: Floats, oa: int, oh: int, n: int, columns: int) -> None:
    """Multiply the (n, columns) matrix at oh by the inverse of the (n, n) at oa, which is overwritten, by Gauss and Jordan."""
    noinline()
    short_loops()
    for col in range(n):
        piv = col
        for i in range(col + 1, n):
            if abs(work[oa + i * n + col]) > abs(work[oa + piv * n + col]):
                piv = i
        if piv != col:
            swap(work, oa + col * n, oa + piv * n, n)
            swap(work, oh + col * columns, oh + piv * columns, columns)
        scale = 1.0 / work[oa + col * n + col]
        for j in range(n):
            work[oa + col * n + j] *= scale
        for j in range(columns):
            work[oh + col * columns + j] *= scale
        for i in range(n):
            x = work[oa + i * n + col]
            if i != col and x != 0.0:
                for j in range(n):
                    work[oa + i * n + j] -= x * work[oa + col * n + j]
                for j in range(columns):
                    work[oh + i * columns + j] -= x * work[oh + col * columns + j]


@njit(**INNER)
def lin(a: float, b: float, x: float) -> float:
    """Return the value at share x of the way from a to b, or the nearer end outside 0 to 1."""
    # a == b also keeps infinite limits out of inf - inf
    if x <= 0.0:
        return a
    if x >= 1.0 or a == b:
        return b
    return a + (b - a) * x


@njit(**INNER)
def high(cap: Floats, f: int, x: float) -> float:
    """Return the largest torque [Nm] that element f holds at share x of a step: the greater of stick limit and kinetic torque."""
    return max(lin(cap[HI0, f], cap[HI1, f], x), lin(cap[KIN0, f], cap[KIN1, f], x))


@njit(**INNER)
def low(cap: Floats, f: int, x: float) -> float:
    """Return the smallest torque [Nm], below 0, that element f holds at share x of a step."""
    return min(lin(cap[LO0, f], cap[LO1, f], x), -lin(cap[KIN0, f], cap[KIN1, f], x))


@njit(**INLINED)
def has_capacity(cap: Floats, f: int) -> bool:
    """Return whether element f can carry any torque at either end of a step."""
    return (
        cap[KIN0, f] > 0.0 or cap[KIN1, f] > 0.0 or cap[HI0, f] > 0.0 or cap[HI1, f] > 0.0 or cap[LO0, f] < 0.0 or cap[LO1, f] < 0.0
    )


@njit(**INLINED)
def if_stuck(f: int, state: Ints | Floats, first: int, torque: Floats, begin: int, w: Floats, orr: int, work: Floats) -> float:
    """Return the torque [Nm] that a locked element f, which carries its limit, would carry if it were STUCK.

    Stuck elements share a torque by least norm, as in R. The modes are in ``state`` from ``first`` on, the torques of the stuck
    elements in ``torque`` from ``begin`` on, and R in the work buffer at ``orr``.
    """
    m, n = w.shape
    total = 0.0
    for other in range(m):
        if state[first + other] == STUCK:
            total += sum_at(work, orr + other * n, w, f) * torque[begin + other]
    return total


@njit(**INLINED)
def beyond(limit: float, mode: float, torque: float) -> float:
    """Return how far a torque exceeds the limit that a locked element of this mode carries, less a margin for rounding [Nm]."""
    return (torque - limit if mode == LOCKED_HIGH else limit - torque) - CLEAR * (1.0 + abs(torque))
