# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a step of the driveline does with its stuck elements: the matrices by which they hold speeds and share torques.

Used by driveline/joint.py, driveline/kernel.py and the quick and quiet steps; with the linear algebra of driveline/algebra.py.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import HEAD, HELD, STUCK, VISC, WEAK, eliminate, noinline, places, sum_at

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.algebra import Places

APART = 1e4  # ratio of what stuck elements give way to a torque, from which each is counted by its own
NULL = 1e-12  # share of the largest eigenvalue up to which one counts as 0: the elements that it is of depend on each other
MANY, SURE = 5, 1e-8  # stuck elements from which factors are tried; least pivot over the largest, far above NULL
UNSEEN = 1e-12  # share of a speed's change in a step that a change of drag may cause before H is computed again
REFUSED = 1e15  # Nm per rad/s2 of a slip that stuck elements cannot prevent
NUMBERS = 7  # work[7]: numbers that sets of stuck elements have had


@njit(**INNER)
def pseudo_inverse(work: Floats, og: int, ov: int, oi: int, nc: int, m: int) -> None:
    """Compute the least-norm inverse of the symmetric nc x nc matrix at og (stride m) into oi, by cyclic Jacobi."""
    noinline()
    for i in range(nc):
        for j in range(nc):
            work[ov + i * m + j] = 1.0 if i == j else 0.0
    for _ in range(40):
        off = 0.0
        top = 0.0
        for i in range(nc):
            top = max(top, abs(work[og + i * m + i]))
            for j in range(i):
                off = max(off, abs(work[og + i * m + j]))
        if off <= 1e-17 * top:
            break
        for p in range(nc - 1):
            for r in range(p + 1, nc):
                apr = work[og + p * m + r]
                if apr == 0.0:
                    continue
                theta = (work[og + r * m + r] - work[og + p * m + p]) / (2.0 * apr)
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                cs = 1.0 / math.sqrt(t * t + 1.0)
                sn = t * cs
                for i in range(nc):
                    x = work[og + i * m + p]
                    y = work[og + i * m + r]
                    work[og + i * m + p] = cs * x - sn * y
                    work[og + i * m + r] = sn * x + cs * y
                for i in range(nc):
                    x = work[og + p * m + i]
                    y = work[og + r * m + i]
                    work[og + p * m + i] = cs * x - sn * y
                    work[og + r * m + i] = sn * x + cs * y
                    x = work[ov + i * m + p]
                    y = work[ov + i * m + r]
                    work[ov + i * m + p] = cs * x - sn * y
                    work[ov + i * m + r] = sn * x + cs * y
    top = 0.0
    for i in range(nc):
        top = max(top, work[og + i * m + i])
    for i in range(nc):
        for j in range(nc):
            total = 0.0
            for p in range(nc):
                e = work[og + p * m + p]
                if e > max(NULL * top, WEAK):
                    total += work[ov + i * m + p] * work[ov + j * m + p] / e
            work[oi + i * m + j] = total


@njit(**INNER)
def invert_many(work: Floats, og: int, ov: int, oi: int, nc: int, m: int) -> bool:
    """Compute the inverse of the symmetric nc x nc matrix at og (stride m) into oi, by factors L D L^T, of which a band is at ov.

    Returns False, so that :func:`pseudo_inverse` has to compute it, unless it is sure that the matrix has an inverse.
    """
    noinline()
    top = trace = 0.0
    for i in range(nc):
        top = max(top, work[og + i * m + i])
    # above the diagonal, row 0 has the first column of each row of L
    for i in range(nc):
        first = int(0)
        while first < i and work[og + i * m + first] == 0.0:
            first += 1
        own = work[og + i * m + i]
        for j in range(first, i):
            value = work[og + i * m + j]
            for k in range(max(first, int(work[ov + j]) if j > 0 else int(0)), j):
                value -= work[ov + i * m + k] * work[ov + j * m + k]
            work[ov + i * m + j] = value
        for j in range(first, i):
            value = work[ov + i * m + j]
            work[ov + i * m + j] = value / work[ov + j * m + j]
            own -= value * work[ov + i * m + j]
        if not own > max(SURE * top, WEAK):
            return False
        work[ov + i * m + i] = own
        if i > 0:
            work[ov + i] = first
    for c in range(nc):
        x = oi + c * m
        for i in range(nc):
            work[x + i] = 0.0
        work[x + c] = 1.0
        for i in range(c + 1, nc):
            for j in range(max(c, int(work[ov + i])), i):
                work[x + i] -= work[ov + i * m + j] * work[x + j]
        for i in range(c, nc):
            work[x + i] /= work[ov + i * m + i]
        for i in range(nc - 1, 0, -1):
            for j in range(int(work[ov + i]), i):
                work[x + j] -= work[ov + i * m + j] * work[x + i]
        trace += work[x + c]
    return trace * top * SURE < 1.0


@njit(**INNER)
def refuse(minv: Floats, w: Floats, ost: int, work: Floats, nc: int) -> None:
    """Add to R the torques of nc stuck elements that cannot all stick while prescribed speeds change.

    Where no free speed can compensate an acceleration of the slips, the torque of these elements against it is set far above any
    capacity (REFUSED), so that one of them breaks away. It uses the eigenvectors that `pseudo_inverse` has just computed.
    """
    noinline()
    m, n = w.shape
    at = places(n, m, int(0), int(0))
    top = 0.0
    for p in range(nc):
        top = max(top, work[at.g + p * m + p])
    for u in range(n):
        if minv[u, u] != HELD:
            continue
        for p in range(nc):
            if work[at.g + p * m + p] > max(NULL * top, WEAK):
                continue
            slip, size, row = 0.0, 0.0, 0
            for f in range(m):
                if work[ost + f] == STUCK:
                    slip += work[at.vectors + row * m + p] * w[f, u]
                    size = max(size, abs(w[f, u]))
                    row += 1
            if abs(slip) <= 1e-9 * size:
                continue
            row = 0
            for f in range(m):
                if work[ost + f] == STUCK:
                    work[at.r + f * n + u] += REFUSED * HELD * work[at.vectors + row * m + p] * slip
                    row += 1


@njit(**INLINED)
def far_apart(minv: Floats, work: Floats, og: int, nc: int, m: int) -> bool:
    """Return whether stuck elements move inertias so different that rounding of one hides another, and no speed is prescribed."""
    least, most = np.inf, 0.0
    for i in range(nc):
        least, most = min(least, work[og + i * m + i]), max(most, work[og + i * m + i])
    for j in range(minv.shape[0]):
        if minv[j, j] == HELD:
            return False
    return most > APART * least > 0.0


@njit(**INNER)
def even(work: Floats, og: int, owm: int, nc: int, m: int, n: int) -> None:
    """Divide the rows of W M^-1, and rows and columns of G, by the roots of G's diagonal, so that each element counts alike."""
    noinline()
    for i in range(nc):
        own = 1.0 / math.sqrt(work[og + i * m + i])
        for j in range(n):
            work[owm + i * n + j] *= own
        for j in range(nc):
            if j != i:
                work[og + i * m + j] *= own
                work[og + j * m + i] *= own
    for i in range(nc):
        work[og + i * m + i] = 1.0


@njit(**INNER)
def undo_even(w: Floats, ost: int, work: Floats, nc: int) -> None:
    """Give R and the inverse of G back the size of each of nc stuck elements that :func:`even` took."""
    noinline()
    m, n = w.shape
    at, row = places(n, m, int(0), int(0)), 0
    for f in range(m):
        if work[ost + f] == STUCK:
            size = 1.0 / sum_at(work, at.wm + row * n, w, f)
            for j in range(n):
                work[at.r + f * n + j] *= size
            for i in range(nc):
                work[at.inverse + row * m + i] *= size
                work[at.inverse + i * m + row] *= size
            row += 1


@njit(**INLINED)
def is_held(state: Ints | Floats, first: int, m: int, work: Floats) -> bool:
    """Return whether P and R are those of the stuck ones of m elements, whose modes are in ``state`` from ``first`` on."""
    same = work[0] > 0.0
    for f in range(m):
        same &= (state[first + f] == STUCK) == (work[HEAD + 2 * m + f] != 0.0)
    return same


@njit(**INNER)
def project(minv: Floats, w: Floats, ost: int, work: Floats) -> None:
    """Compute R (stuck torque = R f) and P (acceleration = P f) for the elements whose flag at ost is STUCK.

    G = W_c M^-1 W_c^T, R = G^+ W_c M^-1, P = M^-1 - R^T W_c M^-1.
    """
    noinline()
    n = minv.shape[0]
    m = w.shape[0]
    at = places(n, m, int(0), int(0))
    op, orr, owm, og, ov, oi = at.p, at.r, at.wm, at.g, at.vectors, at.inverse
    nc = int(0)  # not a literal, which would make numba compile pseudo_inverse once more
    for f in range(m):
        work[HEAD + 2 * m + f] = 0.0
        if work[ost + f] == STUCK:
            work[HEAD + 2 * m + f] = 1.0
            for j in range(n):
                work[owm + nc * n + j] = 0.0
            for i in range(n):
                if w[f, i] != 0.0:
                    for j in range(n):
                        work[owm + nc * n + j] += w[f, i] * minv[i, j]
            nc += 1
        for j in range(n):
            work[orr + f * n + j] = 0.0
    row = 0
    for f in range(m):
        if work[ost + f] == STUCK:
            for i in range(nc):
                work[og + row * m + i] = sum_at(work, owm + i * n, w, f)
            row += 1
    apart = far_apart(minv, work, og, nc, m)
    if apart:
        even(work, og, owm, nc, m, n)
    if nc < MANY or not invert_many(work, og, ov, oi, nc, m):
        pseudo_inverse(work, og, ov, oi, nc, m)
    for i in range(n):
        for j in range(n):
            work[op + i * n + j] = minv[i, j]
    row = 0
    for f in range(m):
        if work[ost + f] == STUCK:
            for i in range(nc):
                for j in range(n):
                    work[orr + f * n + j] += work[oi + row * m + i] * work[owm + i * n + j]
            for i in range(n):
                if work[orr + f * n + i] != 0.0:
                    for j in range(n):
                        work[op + i * n + j] -= work[orr + f * n + i] * work[owm + row * n + j]
            row += 1
    if apart:
        undo_even(w, ost, work, nc)
    for j in range(n):
        if minv[j, j] == HELD:
            refuse(minv, w, ost, work, nc)
            break
    # with the same stuck elements as H, it has the number of H, so that H need not be made again
    same = work[1] > 0.0
    for f in range(m):
        same &= work[HEAD + 2 * m + f] == work[HEAD + 3 * m + f]
    if not same:
        work[NUMBERS] += 1.0
    work[0] = work[1] if same else work[NUMBERS]


@njit(**INLINED)
def stale(d: float, cap: Floats, work: Floats) -> bool:
    """Return whether :func:`implicit` has to compute H again: other stuck elements, another step, or too large a change of drag.

    Plates that turn in oil heat it, so their drag changes a little in every step; this is too little to affect a step.
    """
    gone = work[1] != work[0] or (work[3] != 0.0 and work[2] != d)
    m = cap.shape[1]
    for f in range(m):
        gone |= not abs(work[HEAD + f] - cap[VISC, f]) <= work[HEAD + m + f]
    return gone


@njit(**INNER)
def keep_drag(d: float, w: Floats, cap: Floats, work: Floats, at: Places) -> bool:
    """Keep the drags for which H is computed for a step d, and how far they may move; return whether there are any."""
    m, n = w.shape
    found = False
    for f in range(m):
        moved = 0.0
        for i in range(n):
            if w[f, i] != 0.0:
                for j in range(n):
                    moved += w[f, i] * work[at.p + i * n + j] * w[f, j]
        work[HEAD + m + f] = UNSEEN / max(0.5 * d * moved, UNSEEN * UNSEEN)
        work[HEAD + f], work[HEAD + 3 * m + f] = cap[VISC, f], work[HEAD + 2 * m + f]
        if cap[VISC, f] != 0.0:
            found = True
    return found


@njit(**INNER)
def implicit(d: float, w: Floats, cap: Floats, work: Floats) -> None:
    """Compute H = (I + d/2 P B)^-1 P with B = W^T visc W; H = P where there is no drag."""
    noinline()
    m, n = w.shape
    at = places(n, m, int(0), int(0))
    op, oh, ob, oa = at.p, at.h, at.b, at.a
    coupled = keep_drag(d, w, cap, work, at)
    for i in range(n * n):
        work[oh + i] = work[op + i]
    work[1] = work[0]
    work[2] = d
    work[3] = 1.0 if coupled else 0.0
    if not coupled:
        for f in range(m):
            # a step of another length keeps this H, and a drag without effect in this step may have one there
            work[HEAD + m + f] = 0.0
        return
    for i in range(n):
        for j in range(n):
            total = 0.0
            for f in range(m):
                total += cap[VISC, f] * w[f, i] * w[f, j]
            work[ob + i * n + j] = total
    for i in range(n):
        for j in range(n):
            total = 1.0 if i == j else 0.0
            for p in range(n):
                total += 0.5 * d * work[op + i * n + p] * work[ob + p * n + j]
            work[oa + i * n + j] = total
    eliminate(work, oa, oh, n, n)
