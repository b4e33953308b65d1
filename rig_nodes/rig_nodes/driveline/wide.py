# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What lets a step of a long chain take a time in proportion to its length: rows without their zeros, and factors within a band.

Used by driveline/kernel.py, driveline/collocation.py and driveline/bent_shafts.py for drivelines of WIDE speeds or more; below
that, whole rows and inverses are quicker.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import STUCK, noinline, rate_of, sum_at

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.algebra import Places

WIDE = 16  # speeds


@njit(**INLINED)
def know_ends(w: Floats, sh: Floats, work: Floats, at: Places) -> None:
    """Note on which speeds elements and shafts act, where that is not known or may have changed.

    So what a step does with a row takes no longer in a long chain than in a short one.
    """
    m, n = w.shape
    count = m + sh.shape[0]
    if n < WIDE or count == 0 or (work[1] > 0.0 and work[at.w_ends + 1] != 0.0):
        return
    for k in range(count):
        first, last = n, int(0)
        for j in range(n):
            if (w[k, j] if k < m else sh[k - m, j]) != 0.0:
                first, last = min(first, j), j + 1
        work[at.w_ends + 2 * k], work[at.w_ends + 2 * k + 1] = min(first, n - 1), max(last, 1)


@njit(**INLINED)
def rate_along(rows: Floats, k: int, v: Floats, work: Floats, ends: int) -> float:
    """Return what :func:`rate_of` does; of many speeds only those count on which row k acts, which are at ``ends``."""
    if v.shape[0] < WIDE:
        return rate_of(rows, k, v)
    total = 0.0
    for j in range(int(work[ends + 2 * k]), int(work[ends + 2 * k + 1])):
        total += rows[k, j] * v[j]
    return total


@njit(**INLINED)
def sum_along(work: Floats, begin: int, rows: Floats, k: int, ends: int) -> float:
    """Return what :func:`sum_at` does, as :func:`rate_along`."""
    if rows.shape[1] < WIDE:
        return sum_at(work, begin, rows, k)
    total = 0.0
    for j in range(int(work[ends + 2 * k]), int(work[ends + 2 * k + 1])):
        total += work[begin + j] * rows[k, j]
    return total


@njit(**INLINED)
def push_along(work: Floats, to: int, rows: Floats, k: int, torque: float, ends: int) -> None:
    """Subtract from the forces at a place what a torque along row k exerts, as :func:`rate_along`."""
    if rows.shape[1] < WIDE:
        for j in range(rows.shape[1]):
            work[to + j] -= rows[k, j] * torque
    else:
        for j in range(int(work[ends + 2 * k]), int(work[ends + 2 * k + 1])):
            work[to + j] -= rows[k, j] * torque


@njit(**INNER)
def find_ranges(work: Floats, at: Places, n: int) -> None:
    """Note in which rows the columns of P are not zero: the bodies that turn with one, where elements slip between others."""
    noinline()
    for j in range(n):
        first, behind = j, j + 1
        for i in range(n):
            if work[at.p + j * n + i] != 0.0:
                first, behind = min(first, i), max(behind, i + 1)
        work[at.ranges + 1 + 2 * j], work[at.ranges + 2 + 2 * j] = first, behind
    work[at.ranges] = work[0]


@njit(**INNER)
def multiply_wide(work: Floats, matrix: int, ranges: int, vector: int, to: int, n: int) -> None:
    """Do what :func:`multiply` does for many speeds and a symmetric matrix, whose rows are taken for its columns.

    Only the numbers of the vector that are not zero count, with what is not zero of their columns, by ``ranges``, or all of it
    where that is 0. The numbers of a column belong to different sums, so that the processor takes several at once, if numba need
    not ask whether a place is negative: hence the slices.
    """
    noinline()
    product = work[to : to + n]
    for i in range(n):
        product[i] = 0.0
    for j in range(n):
        factor = work[vector + j]
        if factor != 0.0:
            first, behind = (int(work[ranges + 1 + 2 * j]), int(work[ranges + 2 + 2 * j])) if ranges > 0 else (int(0), n)
            column, sums = work[matrix + j * n + first : matrix + j * n + behind], work[to + first : to + behind]
            for i in range(behind - first):
                sums[i] += column[i] * factor


@njit(**INNER)
def hold_wide(work: Floats, orr: int, vector: int, to: int, mode: Ints, n: int) -> None:
    """Add to the torques of the stuck elements those by the force (n,) at a place, for many speeds; R begins at orr."""
    noinline()
    for j in range(n):
        force = work[vector + j]
        if force != 0.0:
            for f in range(mode.shape[0]):
                if mode[f] == STUCK:
                    work[to + f] += work[orr + f * n + j] * force


@njit(**INNER)
def factorise(work: Floats, top: int, band: int, n: int) -> None:
    """Factorise a symmetric (n, n) matrix into L D L^T within its band; on the diagonal is 1 / D then."""
    noinline()
    low = top + n * n
    for i in range(n):
        first = int(work[band + i])
        own = complex(work[top + i * n + i], work[low + i * n + i])
        for j in range(first, i):
            value = complex(work[top + i * n + j], work[low + i * n + j])
            for k in range(max(first, int(work[band + j])), j):
                value -= complex(work[top + i * n + k], work[low + i * n + k]) * complex(
                    work[top + j * n + k], work[low + j * n + k]
                )
            work[top + i * n + j], work[low + i * n + j] = value.real, value.imag
        for j in range(first, i):
            value = complex(work[top + i * n + j], work[low + i * n + j])
            scaled = value * complex(work[top + j * n + j], work[low + j * n + j])
            own -= value * scaled
            work[top + i * n + j], work[low + i * n + j] = scaled.real, scaled.imag
        own = 1.0 / own
        work[top + i * n + i], work[low + i * n + i] = own.real, own.imag


@njit(**INNER)
def solve_band(work: Floats, top: int, band: int, z: int, n: int) -> None:
    """Solve with the factors at a place for the complex vector at z, whose imaginary parts follow its real ones, in place."""
    noinline()
    low = top + n * n
    for i in range(n):
        value = complex(work[z + i], work[z + n + i])
        for j in range(int(work[band + i]), i):
            value -= complex(work[top + i * n + j], work[low + i * n + j]) * complex(work[z + j], work[z + n + j])
        work[z + i], work[z + n + i] = value.real, value.imag
    for i in range(n):
        value = complex(work[z + i], work[z + n + i]) * complex(work[top + i * n + i], work[low + i * n + i])
        work[z + i], work[z + n + i] = value.real, value.imag
    for i in range(n - 1, -1, -1):
        value = complex(work[z + i], work[z + n + i])
        for j in range(int(work[band + i]), i):
            share = complex(work[top + i * n + j], work[low + i * n + j]) * value
            work[z + j] -= share.real
            work[z + n + j] -= share.imag
