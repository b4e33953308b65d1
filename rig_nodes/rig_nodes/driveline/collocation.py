# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A part of a step of a driveline with shafts: collocation at the four Gauss points, of order 8.

Used by driveline/kernel.py, which divides a step so that no part covers more than PHASE of the fastest oscillation.
With u the change of the speeds in the part, f the force at its start and df the change of it by all but u,

u' = P (f + df t / d - C u - K int u dt), C = W^T visc W + S^T c S, K = S^T k S,

is met at the nodes. With the eigenvalues l of the method's matrix (Hairer and Wanner, Solving Ordinary Differential Equations II,
IV.8) this takes one matrix for each pair of them, z = d (I + l d P C + l^2 d^2 P K)^-1 P (f + l df), and every value that is needed
is a sum of the real and imaginary parts of the two z. The nodes have positive weights, at which the method keeps every quadratic
balance: work = kinetic + spring energy + losses to rounding, for any part, and no loss can become negative.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import (
    E_FRIC,
    E_SHAFT,
    E_VISC,
    HEAD,
    IMPULSE,
    LAM,
    OPEN,
    STUCK,
    TAU,
    VISC,
    eliminate,
    lin,
    noinline,
    places,
    short_loops,
    sum_at,
    sum_of,
)
from rig_nodes.driveline.losses import FACTOR, ON, brakes, solve_losses
from rig_nodes.driveline.losses import WEIGHTS as OF_TORQUES
from rig_nodes.driveline.stuck import keep_drag
from rig_nodes.driveline.wide import WIDE, factorise, push_along, solve_band, sum_along

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.algebra import Places
    from rig_nodes.driveline.state import Loads, State, Structure

PHASE = 0.5  # rad of the fastest oscillation that a part covers; the frequency of the method is then off by 4e-11
MOST_PARTS = 256  # most parts of a step; beyond these an oscillation is damped or shifted, but remains bounded

# Eigenvalues of the method's matrix with positive imaginary part (real, imaginary), whose inverses are the poles of the diagonal
# Pade approximation of order 8 to the exponential; weights of the nodes; and how much of the real and imaginary parts of both z are
# in the change of the speeds at each of the four nodes (rows 0 to 3) and in the rows below.
EIGENVALUES = ((0.158433759734282364, 0.047441012571108437), (0.091566240265717636, 0.115662613013127607))
NODES = 4
WEIGHTS = (0.173927422568726929, 0.326072577431273071, 0.326072577431273071, 0.173927422568726929)
END, MEAN, TWICE, MOMENT = 4, 5, 6, 7  # at the end; its mean; mean of its integral; mean of it times the share of time
SHARES = (
    (0.125613810086554023, -0.131455918759062652, -0.05618196588358031, -0.052828690893078704),
    (0.140484707461871665, 0.158920145982265467, 0.189524770745700202, 0.063133660368542166),
    (1.127970725167079767, 0.946957244089429335, -0.457980203374651635, 0.369574233988340145),
    (2.18407248022149778, 6.493153974288330987, -1.253504324424471492, -0.919185436748287408),
    (2.178127029509099192, 9.912045206050477078, -1.178127029509099192, -1.793575708154845424),
    (0.815326315689626575, 1.467070036862334361, -0.315326315689626575, -0.027965733533244723),
    (0.198774501666490473, 0.193753515741424753, -0.032107834999823806, 0.033910748548552464),
    (0.616551814023136102, 1.273316521120909608, -0.283218480689802769, -0.061876482081797186),
)


def highest_resolved(h: float) -> float:
    """Return the highest frequency that the parts of a step h resolve [Hz]."""
    return MOST_PARTS * PHASE / (2.0 * math.pi * h)


@njit(**INNER)
def add_rates(factor: float, row: Floats, a: int, work: Floats, op: int, to: int, spare: int) -> None:
    """Add factor P x x^T to the (n, n) matrix at ``to``, with row a of an array as x; there is room for (n,) at ``spare``."""
    noinline()
    short_loops()
    n = row.shape[1]
    for i in range(n):
        work[spare + i] = sum_at(work, op + i * n, row, a)
    for i in range(n):
        share = factor * work[spare + i]
        if share != 0.0:
            for j in range(n):
                work[to + i * n + j] += share * row[a, j]


@njit(**INNER)
def fastest_rate(structure: Structure, cap: Floats, work: Floats) -> float:
    """Return a bound of the fastest rate of an oscillation or a decay [1/s].

    It is the square root of the largest sum of a row of sqrt(k_a k_b) S_a P S_b, plus the same sum with c, plus visc W_f P W_f.
    """
    noinline()
    w, sh, kc = structure.w, structure.sh, structure.kc
    m, n = w.shape
    s = sh.shape[0]
    at = places(n, m, s, int(0))
    stiff = damped = drag = 0.0
    for a in range(s):
        for i in range(n):
            work[at.z + i] = sum_along(work, at.p + i * n, sh, a, at.sh_ends)
        by_k = by_c = 0.0
        for b in range(s):
            along = abs(sum_along(work, at.z, sh, b, at.sh_ends))
            by_k += along * math.sqrt(abs(kc[0, a] * kc[0, b]))
            by_c += along * math.sqrt(abs(kc[1, a] * kc[1, b]))
        stiff, damped = max(stiff, by_k), max(damped, by_c)
    for f in range(m):
        if cap[VISC, f] != 0.0:
            for i in range(n):
                work[at.z + i] = sum_at(work, at.p + i * n, w, f)
            drag += abs(cap[VISC, f] * sum_at(work, at.z, w, f))
    return math.sqrt(stiff) + damped + drag


@njit(**INLINED)
def part_of(h: float, rate: float) -> float:
    """Return the length of equal parts of a step h in which the fastest rate covers at most PHASE."""
    return h / min(MOST_PARTS, max(1.0, math.ceil(h * rate / PHASE)))


@njit(**INNER)
def make_bands(d: float, structure: Structure, cap: Floats, work: Floats, at: Places) -> bool:
    """Compute the factors of M + l d C + l^2 d^2 K for both eigenvalues l, where that is quicker than what `make_nodes` computes.

    That is where many speeds, none of them held by a stuck element, each have a mass of their own. Each row of the factors begins
    at the first speed with which a shaft or a drag joins it, so that a chain takes a time in proportion to its length. No row needs
    to be exchanged: l has a positive imaginary part and C and K no negative values, so that no leading part is singular.

    Returns
    -------
    bool
        False where the matrices have to be made.
    """
    noinline()
    minv, w, sh, kc = structure.minv, structure.w, structure.sh, structure.kc
    m, n = w.shape
    able = n >= WIDE
    for f in range(m):
        able = able and work[HEAD + 2 * m + f] == 0.0
    for i in range(n if able else 0):
        work[at.band + i] = i
        for j in range(i):
            able = able and minv[i, j] == 0.0
    for k in range(m + sh.shape[0] if able else 0):
        if k >= m:
            able = able and kc[0, k - m] >= 0.0 and kc[1, k - m] >= 0.0
        elif cap[VISC, k] == 0.0:
            continue
        else:
            able = able and cap[VISC, k] > 0.0
        first, behind = int(work[at.w_ends + 2 * k]), int(work[at.w_ends + 2 * k + 1])
        for i in range(first, behind):
            work[at.band + i] = min(work[at.band + i], float(first))
    if not able:
        return False
    for p in range(2):
        root = d * complex(EIGENVALUES[p][0], EIGENVALUES[p][1])
        top = at.nodes + p * 2 * n * n
        for i in range(n):
            for j in range(int(work[at.band + i]), i):
                work[top + i * n + j] = work[top + (n + i) * n + j] = 0.0
            work[top + i * n + i], work[top + (n + i) * n + i] = 1.0 / minv[i, i], 0.0
        for k in range(m + sh.shape[0]):
            factor = root * cap[VISC, k] if k < m else root * kc[1, k - m] + root * root * kc[0, k - m]
            if factor == 0.0:
                continue
            first, behind = int(work[at.w_ends + 2 * k]), int(work[at.w_ends + 2 * k + 1])
            for i in range(first, behind):
                for j in range(first, i + 1):
                    share = factor * (w[k, i] * w[k, j] if k < m else sh[k - m, i] * sh[k - m, j])
                    work[top + i * n + j] += share.real
                    work[top + (n + i) * n + j] += share.imag
        factorise(work, top, at.band, n)
    return True


@njit(**INLINED)
def are_made(kc: Floats, work: Floats, at: Places) -> bool:
    """Return whether the last matrices were made for this stiffness and damping of the shafts."""
    same = True
    for a in range(kc.shape[1]):
        same = same and work[at.made + 2 * a] == kc[0, a] and work[at.made + 2 * a + 1] == kc[1, a]
    return same


@njit(**INNER)
def make_nodes(d: float, structure: Structure, cap: Floats, work: Floats) -> None:
    """Compute (I + l d P C + l^2 d^2 P K)^-1 P for both eigenvalues l, the real parts above the imaginary ones."""
    noinline()
    w, sh, kc = structure.w, structure.sh, structure.kc
    m, n = w.shape
    at = places(n, m, sh.shape[0], int(0))
    keep_drag(d, w, cap, work, at)
    work[1], work[2], work[3] = work[0], d, 1.0
    for a in range(sh.shape[0]):
        work[at.made + 2 * a], work[at.made + 2 * a + 1] = kc[0, a], kc[1, a]
    if make_bands(d, structure, cap, work, at):
        return
    work[at.band] = -1.0
    for i in range(n * n):
        work[at.a + i] = work[at.b + i] = 0.0
    for f in range(m):
        if cap[VISC, f] != 0.0:
            add_rates(d * cap[VISC, f], w, f, work, at.p, at.a, at.z)
    for a in range(sh.shape[0]):
        add_rates(d * kc[1, a], sh, a, work, at.p, at.a, at.z)
        add_rates(d * d * kc[0, a], sh, a, work, at.p, at.b, at.z)
    for p in range(2):
        re, im = EIGENVALUES[p]
        to = at.nodes + p * 2 * n * n
        for i in range(n):
            for j in range(n):
                one, two = work[at.a + i * n + j], work[at.b + i * n + j]
                real = re * one + (re * re - im * im) * two + (1.0 if i == j else 0.0)
                imaginary = im * one + 2.0 * re * im * two
                work[at.solve + 2 * n * i + j] = work[at.solve + 2 * n * (n + i) + n + j] = real
                work[at.solve + 2 * n * i + n + j] = -imaginary
                work[at.solve + 2 * n * (n + i) + j] = imaginary
                work[to + i * n + j] = work[at.p + i * n + j]
                work[to + (n + i) * n + j] = 0.0
        eliminate(work, at.solve, to, 2 * n, n)


@njit(**INNER)
def put_sum(row: int, factor: float, to: int, work: Floats, at: Places, n: int) -> None:
    """Write a row of SHARES of both z, times a factor, to (n,) of the work buffer."""
    for j in range(n):
        total = 0.0
        for q in range(NODES):
            total += SHARES[row][q] * work[at.z + q * n + j]
        work[to + j] = factor * total


@njit(**INNER)
def solve_wide(d: float, force: int, dforce: int, work: Floats, at: Places, n: int) -> None:
    """Set both z as :func:`solve_nodes` does, by factors, or by rows in place of the equal columns as `algebra.multiply_wide`."""
    noinline()
    for p in range(2):
        (re, im), z, nodes = EIGENVALUES[p], at.z + 2 * p * n, at.nodes + p * 2 * n * n
        real, imaginary = work[z : z + n], work[z + n : z + 2 * n]
        if work[at.band] == 0.0:
            for i in range(n):
                real[i], imaginary[i] = d * (work[force + i] + re * work[dforce + i]), d * im * work[dforce + i]
            solve_band(work, nodes, at.band, z, n)
            continue
        for i in range(n):
            real[i] = imaginary[i] = 0.0
        for j in range(n):
            x, y = d * (work[force + j] + re * work[dforce + j]), d * im * work[dforce + j]
            top = nodes + j * n
            one, two = work[top : top + n], work[top + n * n : top + (n + 1) * n]
            for i in range(n):
                real[i] += one[i] * x - two[i] * y
                imaginary[i] += one[i] * y + two[i] * x


@njit(**INNER)
def solve_nodes(d: float, force: int, dforce: int, work: Floats, at: Places, n: int) -> None:
    """Set both z, and the change of the speeds over a part d and its mean, for the forces at two places of the work buffer."""
    noinline()
    short_loops()
    if n >= WIDE:
        solve_wide(d, force, dforce, work, at, n)
    else:
        for p in range(2):
            re, im = EIGENVALUES[p]
            for i in range(n):
                real = imaginary = 0.0
                top = at.nodes + p * 2 * n * n + i * n
                low = top + n * n
                for j in range(n):
                    x, y = work[force + j] + re * work[dforce + j], im * work[dforce + j]
                    real += work[top + j] * x - work[low + j] * y
                    imaginary += work[top + j] * y + work[low + j] * x
                work[at.z + 2 * p * n + i], work[at.z + (2 * p + 1) * n + i] = d * real, d * imaginary
    put_sum(END, 1.0, at.dv, work, at, n)
    put_sum(MEAN, 1.0, at.mean, work, at, n)


@njit(**INNER)
def push_back(
    gain: int, twist: int, factor: float, to: int, structure: Structure, cap: Floats, work: Floats, of: tuple[int, int]
) -> None:
    """Subtract from the forces at ``to`` what dampers take by a gain of the speeds, and springs by factor times ``twist``.

    The ends of the rows of elements and shafts are at ``of``.
    """
    noinline()
    short_loops()
    w, sh, kc = structure.w, structure.sh, structure.kc
    for a in range(sh.shape[0]):
        torque = kc[1, a] * sum_along(work, gain, sh, a, of[1]) + kc[0, a] * factor * sum_along(work, twist, sh, a, of[1])
        push_along(work, to, sh, a, torque, of[1])
    for f in range(w.shape[0]):
        if cap[VISC, f] != 0.0:
            push_along(work, to, w, f, cap[VISC, f] * sum_along(work, gain, w, f, of[0]), of[0])


@njit(**INLINED)
def forces_by_nodes(d: float, structure: Structure, cap: Floats, work: Floats, at: Places) -> None:
    """Add to the change of the forces over a part d what follows from that of the speeds, and set the mean forces."""
    n = structure.w.shape[1]
    put_sum(TWICE, d, at.twice, work, at, n)
    put_sum(MOMENT, 1.0, at.moment, work, at, n)
    for j in range(n):
        work[at.during + j] = work[at.force + j] + 0.5 * work[at.dforce + j]
    push_back(at.mean, at.twice, 1.0, at.during, structure, cap, work, (at.w_ends, at.sh_ends))
    push_back(at.dv, at.mean, d, at.dforce, structure, cap, work, (at.w_ends, at.sh_ends))


@njit(**INLINED)
def elements_by_nodes(w: Floats, mode: Ints, work: Floats, at: Places) -> None:
    """Set slips and torques of the elements at the end of a part, and their mean torques."""
    n = w.shape[1]
    for f in range(w.shape[0]):
        work[at.slip1 + f] = work[at.slip0 + f] + sum_along(work, at.dv, w, f, at.w_ends)
        if mode[f] == STUCK:
            total = 0.0
            for j in range(n):
                total += work[at.r + f * n + j] * (work[at.force + j] + work[at.dforce + j])
            work[at.torque1 + f] = total
            work[at.between + f] = sum_of(work, at.r + f * n, at.during, n)
        else:
            work[at.between + f] = 0.5 * (work[at.torque0 + f] + work[at.torque1 + f])


@njit(**INNER)
def losses_by_nodes(d: float, structure: Structure, cap: Floats, loss: Floats, state: State) -> bool:
    """Set NEXT to the losses at the end of a part d, from its forces without them; return False where there is no solution."""
    noinline()
    short_loops()
    w, mode, work, count = structure.w, state.mode, state.work, loss.shape[0]
    m, n = w.shape
    at = places(n, m, structure.sh.shape[0], count)
    solve_nodes(d, at.force, at.dforce, work, at, n)
    for j in range(n):
        work[at.during + j] = work[at.force + j] + work[at.dforce + j]
        work[at.moment + j] = 0.0
    push_back(at.dv, at.mean, d, at.during, structure, cap, work, (at.w_ends, at.sh_ends))
    for a in range(count):
        # the torque by the forces at the end: that of stuck elements, and that of accelerations
        torque = 0.0
        for j in range(n):
            row = 0.0
            for f in range(m):
                if mode[f] == STUCK:
                    row += loss[a, OF_TORQUES + f] * work[at.r + f * n + j]
            for i in range(n):
                row += loss[a, OF_TORQUES + m + i] * work[at.p + i * n + j]
            work[at.rho + a * n + j] = row
            torque += row * work[at.during + j]
        for f in range(m):
            if mode[f] != STUCK:
                torque += loss[a, OF_TORQUES + f] * work[at.torque1 + f]
        work[at.given + a] = torque
    for b in range(count):
        on = int(loss[b, ON])
        by = brakes(loss[b, FACTOR], mode[on])
        for j in range(n):
            work[at.row + j] = work[at.during + j] = w[on, j]
        solve_nodes(d, at.moment, at.row, work, at, n)
        push_back(at.dv, at.mean, d, at.during, structure, cap, work, (at.w_ends, at.sh_ends))
        for a in range(count):
            fall = sum_of(work, at.rho + a * n, at.during, n) - loss[a, OF_TORQUES + on]
            work[at.fall + a * count + b] = by * fall
    return solve_losses(loss, state.v, work, at.given, at.fall, at.newton)


@njit(**INNER)
def squared(start: float, rows: Floats, a: int, work: Floats, z: int, ends: int) -> float:
    """Return the mean square over a part of a rate that is ``start`` at its beginning and changes by row a times the speeds."""
    noinline()
    short_loops()
    n, total = rows.shape[1], 0.0
    re0, im0 = sum_along(work, z, rows, a, ends), sum_along(work, z + n, rows, a, ends)
    re1, im1 = sum_along(work, z + 2 * n, rows, a, ends), sum_along(work, z + 3 * n, rows, a, ends)
    for i in range(NODES):
        share = SHARES[i]
        rate = start + share[0] * re0 + share[1] * im0 + share[2] * re1 + share[3] * im1
        total += WEIGHTS[i] * rate * rate
    return total


@njit(**INLINED)
def take_by_nodes(d: float, xa: float, xb: float, structure: Structure, loads: Loads, state: State, at: Places) -> None:
    """Move shafts and friction elements by a sub-step of d, from share xa to xb of the step, and add the work of the forces.

    A torque that is linear in time has the work of its mean, and that of its change by the moment of the speed.
    """
    w, sh, kc, cap, q = structure.w, structure.sh, structure.kc, loads.cap, loads.q
    mode, twist, el, shaft, work, n = state.mode, state.twist, state.el, state.shaft, state.work, state.v.shape[0]
    for j in range(n):
        # from here on the moment about the middle of the sub-step
        work[at.moment + j] -= 0.5 * work[at.mean + j]
    for f in range(mode.shape[0]):
        lam, change = work[at.between + f], work[at.torque1 + f] - work[at.torque0 + f]
        el[LAM, f] = work[at.torque1 + f]
        el[IMPULSE, f] += d * lam
        if mode[f] != STUCK and mode[f] != OPEN:
            slip = work[at.slip0 + f] + sum_along(work, at.mean, w, f, at.w_ends)
            el[E_FRIC, f] += d * (lam * slip + change * sum_along(work, at.moment, w, f, at.w_ends))
        if cap[VISC, f] != 0.0:
            el[E_VISC, f] += d * cap[VISC, f] * squared(work[at.slip0 + f], w, f, work, at.z, at.w_ends)
    for j in range(n):
        first, final = lin(q[0, j], q[1, j], xa), lin(q[0, j], q[1, j], xb)
        turned = state.v[j] + work[at.mean + j]
        state.e_in[j] += d * (0.5 * (first + final) * turned + (final - first) * work[at.moment + j])
        work[at.lag + j] += d * (xb - xa) * work[at.moment + j]
    for a in range(sh.shape[0]):
        rate, was = work[at.rate + a], twist[a]
        work[at.swing + a] += d * (was + 0.5 * d * rate + sum_along(work, at.twice, sh, a, at.sh_ends))
        twist[a] += d * (rate + sum_along(work, at.mean, sh, a, at.sh_ends))
        if kc[1, a] != 0.0:
            shaft[E_SHAFT, a] += d * kc[1, a] * squared(rate, sh, a, work, at.z, at.sh_ends)
        shaft[TAU, a] = kc[0, a] * twist[a] + kc[1, a] * (rate + sum_along(work, at.dv, sh, a, at.sh_ends))
