# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Losses of gears that grow with the torque that the gears pass on, solved together with the torques that they change.

Used by driveline/kernel.py, driveline/quiet.py and driveline/joint.py. A loss is friction whose capacity depends
on a torque at the same instant: that of clutches, or that at a meter behind an inertia. While the modes
stay, this torque falls linearly with the losses, t = y - S g, and each loss is a parabola of its own, g = p(|t|); all are solved
together. A quiet step predicts the losses and compares them with those that the torques at its end demand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import HI0, KIN0, LO0, OPEN, STUCK, VISC, noinline, places, sum_at

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.state import State, Structure

# Columns of `loss`, one row for each loss: the parabola (CONSTANT, SHARE, SQUARE); the element that the loss owns (OWN), whose
# other capacity is BASE; the element that it brakes (ON), its own or that of another loss, by FACTOR times the parabola; the
# speed that gives the direction of power (WAY); the value of the parabola in the last step, in the step before that and in the
# next one; then the weights of m friction torques and n accelerations in its torque.
CONSTANT, SHARE, SQUARE, OWN, ON, FACTOR, WAY, BASE, LAST, BEFORE, NEXT, WEIGHTS = range(12)
STEEPEST = 0.5  # largest slope where power flows backwards: two losses in a path then take at most all of it, without self-locking
MOST = 1e15  # Nm, above which the search for a loss ends
CLOSE = 1e-5  # Nm, largest last Newton step; with parabolas the remaining error is a hundred-thousandth of that
LEAST_LOSS = 1e-9  # least loss of a mesh [Nm] and as a share, so that its brake always exists
PREDICTED = 1e-3  # Nm, largest difference of a predicted loss, which is not solved, from the one that its torque demands


def loss_width(n: int, m: int) -> int:
    """Return the number of columns of `loss` for n speeds and m friction elements."""
    return WEIGHTS + m + n


@njit(**INLINED)
def loss_share(there: float, back: float) -> tuple[float, float]:
    """Return (share, before) of the loss of a mesh from its efficiencies, for driveline.system.Mesh.

    Of a power x from a, (1 - there) x is lost, and of a power x from b, (1 - back) x. With a torque t into the mesh at a, and
    t - loss out of it, both losses are `share` times |t - before * loss|, because t is greater than before * loss where a drives
    and smaller where b drives.
    """
    ahead, behind = max(1.0 - there, LEAST_LOSS), max(1.0 - back, LEAST_LOSS)
    before = (behind - ahead * (1.0 - behind)) / (2.0 * ahead * behind)
    return ahead / (1.0 - before * ahead), before


@njit(**INLINED)
def put_losses(loss: Floats, cap: Floats, end: int, column: int) -> None:
    """Set the capacities at one end (0 or 1) of the elements that losses own to BASE plus the losses in ``column``.

    ``column`` is LAST or NEXT, or -1 for BASE alone. Only the check whether there are losses is inlined, because this function is
    called in a dozen places.
    """
    if loss.shape[0] > 0:
        put_all_losses(loss, cap, end, column)


@njit(**INLINED)
def put_last(loss: Floats, cap: Floats) -> None:
    """Set the capacities of the elements that losses own to BASE plus the last losses, at both ends of a step."""
    put_losses(loss, cap, int(0), int(LAST))
    put_losses(loss, cap, int(1), int(LAST))


@njit(**INNER)
def put_all_losses(loss: Floats, cap: Floats, end: int, column: int) -> None:
    """Do the work of :func:`put_losses` where there are losses."""
    noinline()
    for k in range(loss.shape[0]):
        own = int(loss[k, OWN])
        torque = loss[k, BASE]
        if column >= 0:
            for other in range(loss.shape[0]):
                if loss[other, ON] == own:
                    torque += loss[other, FACTOR] * loss[other, column]
        put_capacity(cap, end, own, torque)


@njit(**INLINED)
def put_predicted(loss: Floats, cap: Floats, own: int, k: int) -> None:
    """Set the capacities of loss k's own element to those of the last step at the beginning and those of NEXT at the end."""
    torque0 = torque1 = loss[k, BASE]
    for other in range(loss.shape[0]):
        if loss[other, ON] == own:
            torque0 += loss[other, FACTOR] * loss[other, LAST]
            torque1 += loss[other, FACTOR] * loss[other, NEXT]
    put_capacity(cap, int(0), own, torque0)
    put_capacity(cap, int(1), own, torque1)


@njit(**INLINED)
def put_capacity(cap: Floats, end: int, own: int, torque: float) -> None:
    """Set all capacities of an element at one end (0 or 1)."""
    cap[KIN0 + end, own] = torque
    cap[HI0 + end, own] = torque
    cap[LO0 + end, own] = -torque


@njit(**INLINED)
def brakes(factor: float, mode: float) -> float:
    """Return the torque on an element per loss.

    It acts against the slip or against the direction in which the element is loaded, and is 0 while the element sticks or is open.
    """
    if mode == STUCK or mode == OPEN:
        return 0.0
    return factor if mode > 0 else -factor


@njit(**INLINED)
def parabola(loss: Floats, k: int, x: float) -> tuple[float, float]:
    """Return (loss, its slope over x) at a torque x, which is positive where power goes from the drive to the load.

    Beyond its maximum a parabola stays constant, and it is never negative, so that a loss never drives. Where power flows backwards
    its slope is at most STEEPEST: a loss takes no more power than the inertia of the load delivers.
    """
    u = abs(x)
    share, square = loss[k, SHARE], loss[k, SQUARE]
    slope = share + 2.0 * square * u
    beyond = 0.0
    if square < 0.0:
        if slope < 0.0:
            u = max(0.0, -0.5 * share / square)
            slope = 0.0
    elif x < 0.0 and slope > STEEPEST and square > 0.0:
        knee = max(0.0, 0.5 * (STEEPEST - share) / square)
        beyond = STEEPEST * (u - knee)
        u = knee
        slope = STEEPEST
    g = loss[k, CONSTANT] + u * (share + square * u) + beyond
    if g <= 0.0:
        return 0.0, 0.0
    return g, slope if x >= 0.0 else -slope


@njit(**INLINED)
def predict_losses(loss: Floats) -> None:
    """Set NEXT to the losses that continue the course of the last two steps."""
    for k in range(loss.shape[0]):
        loss[k, NEXT] = max(0.0, 2.0 * loss[k, LAST] - loss[k, BEFORE])


@njit(**INLINED)
def loss_at(loss: Floats, k: int, torque: float, speed: float) -> float:
    """Return the loss that a torque demands at the speed of its WAY."""
    return parabola(loss, k, torque if speed >= 0.0 else -torque)[0]


@njit(**INNER)
def solve_losses(loss: Floats, v: Floats, work: Floats, oy: int, os: int, oe: int) -> bool:
    """Set NEXT to the losses at torques y less S times the losses; return False where there is no solution.

    y (k,) and S (k, k) stand in the work buffer at oy and os; at oe there is room for (k, k + 2). Newton's method starts from the
    last losses, from which parabolas converge quickly, and shortens each step until the residual falls. In most drivelines 1 + p' S
    is positive everywhere (the slopes are bounded for power that flows backwards, and the part of a loss that comes from inertia is
    less than the loss), so that there is one solution. A self-locking mesh may have a second solution, at which 1 + p' S is
    negative and which is therefore unstable; a search that would start near such a solution starts without a loss instead.
    """
    noinline()
    count = loss.shape[0]
    for k in range(count):
        loss[k, NEXT] = loss[k, LAST]
        if v[int(loss[k, WAY])] < 0.0:
            work[oy + k] = -work[oy + k]
            for i in range(count):
                work[os + k * count + i] = -work[os + k * count + i]
    missed = 0.0
    steep = True
    while steep:
        missed = equations(loss, work, oy, os, oe)
        steep = False
        for k in range(count):
            if work[oe + k * (count + 2) + k] <= 0.0 and loss[k, NEXT] > 0.0:
                loss[k, NEXT] = 0.0
                steep = True
    for _ in range(60):
        solve_equations(count, work, oe)
        size = 0.0
        for k in range(count):
            change = work[oe + k * (count + 2) + count + 1]
            loss[k, NEXT] -= change
            size += abs(change)
        if size <= CLOSE:
            for k in range(count):
                loss[k, NEXT] = max(0.0, loss[k, NEXT])
            return True
        before = missed
        missed = equations(loss, work, oy, os, oe)
        share = 1.0
        while not missed < before and share > 1e-6:
            share *= 0.5
            for k in range(count):
                loss[k, NEXT] += share * work[oe + k * (count + 2) + count + 1]
            missed = equations(loss, work, oy, os, oe)
        if not missed < MOST:
            return False
    return False


@njit(**INNER)
def worst_of(loss: Floats, work: Floats, oe: int) -> int:
    """Return the element that brakes with the loss of the largest residual after a search at ``oe``; -1 without losses."""
    noinline()
    count, worst, most = loss.shape[0], int(-1), -1.0
    for k in range(count):
        missed = abs(work[oe + k * (count + 2) + count])
        if not missed <= most:
            worst, most = int(loss[k, ON]), missed
    return worst


@njit(**INNER)
def equations(loss: Floats, work: Floats, oy: int, os: int, oe: int) -> float:
    """Write Newton's equations at the losses in NEXT to the rows at oe, matrix and right side.

    Returns the sum of the residuals.
    """
    count = loss.shape[0]
    missed = 0.0
    for k in range(count):
        row = oe + k * (count + 2)
        torque = work[oy + k]
        for i in range(count):
            torque -= work[os + k * count + i] * loss[i, NEXT]
        g, slope = parabola(loss, k, torque)
        for i in range(count):
            work[row + i] = slope * work[os + k * count + i]
        work[row + k] += 1.0
        work[row + count] = loss[k, NEXT] - g
        missed += abs(loss[k, NEXT] - g)
    return missed


@njit(**INNER)
def solve_equations(count: int, work: Floats, oe: int) -> None:
    """Solve the equations at oe into their last column, by elimination with the largest pivot of a column."""
    width = count + 2
    for col in range(count):
        pivot = col
        for k in range(col + 1, count):
            if abs(work[oe + k * width + col]) > abs(work[oe + pivot * width + col]):
                pivot = k
        for i in range(count + 1):
            x = work[oe + col * width + i]
            work[oe + col * width + i] = work[oe + pivot * width + i]
            work[oe + pivot * width + i] = x
        for k in range(count):
            if k != col:
                share = work[oe + k * width + col] / work[oe + col * width + col]
                for i in range(col, count + 1):
                    work[oe + k * width + i] -= share * work[oe + col * width + i]
    for k in range(count):
        work[oe + k * width + count + 1] = work[oe + k * width + count] / work[oe + k * width + k]


@njit(**INNER)
def end_losses(d: float, structure: Structure, cap: Floats, loss: Floats, state: State) -> bool:
    """Set NEXT to the losses at the end of a sub-step of d, from its forces without them; return False where there is no solution.

    A force F changes the speed reached by d H F / 2, the torque of a stuck element by R (1 - d B H / 2) F, and the acceleration at
    the end by H F: mean and end of the trapezoidal rule.
    """
    w, sh, kc, mode, work = structure.w, structure.sh, structure.kc, state.mode, state.work
    m, n = w.shape
    k = loss.shape[0]
    at = places(n, m, sh.shape[0], k)
    oh, orho, oz = at.h, at.rho, at.by_speed
    for a in range(k):
        for j in range(n):
            total = 0.0
            for f in range(m):
                if mode[f] == STUCK:
                    total += loss[a, WEIGHTS + f] * work[at.r + f * n + j]
            work[orho + a * n + j] = total
        for j in range(n):
            work[oz + a * n + j] = 0.0
        for f in range(m):
            along = sum_at(work, orho + a * n, w, f)
            for j in range(n):
                work[oz + a * n + j] += cap[VISC, f] * along * w[f, j]
        for i in range(sh.shape[0]):
            along = sum_at(work, orho + a * n, sh, i)
            for j in range(n):
                work[oz + a * n + j] += (kc[1, i] + 0.5 * d * kc[0, i]) * along * sh[i, j]
    for a in range(k):
        y = 0.0
        for f in range(m):
            if mode[f] != STUCK:
                y += loss[a, WEIGHTS + f] * work[at.torque1 + f]
        for j in range(n):
            mean = 0.0
            for i in range(n):
                mean += work[oh + j * n + i] * (work[at.force + i] + 0.5 * work[at.dforce + i])
            end = 2.0 * mean - work[at.accel + j]
            force = work[at.force + j] + work[at.dforce + j]
            y += work[orho + a * n + j] * force - work[oz + a * n + j] * d * mean + loss[a, WEIGHTS + m + j] * end
            row = work[orho + a * n + j]
            for i in range(n):
                row += (loss[a, WEIGHTS + m + i] - 0.5 * d * work[oz + a * n + i]) * work[oh + i * n + j]
            work[at.row + j] = row
        work[at.given + a] = y
        for b in range(k):
            on = int(loss[b, ON])
            by = brakes(loss[b, FACTOR], mode[on])
            fall = -loss[a, WEIGHTS + on] * by
            for j in range(n):
                fall += work[at.row + j] * w[on, j] * by
            work[at.fall + a * k + b] = fall
    return solve_losses(loss, state.v, work, at.given, at.fall, at.newton)
