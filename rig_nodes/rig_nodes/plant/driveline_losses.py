# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Losses of gears that grow with the torque they pass on, solved with the torques that they change.

Used by plant/driveline_kernel.py, plant/driveline_quiet.py and plant/driveline_joint.py. A loss is friction whose capacity depends on a torque of
the same instant: carried by clutches, or felt by a meter behind an inertia. With modes that stand, that torque falls
linearly by the loss, t = y - S g, and the loss is a parabola of it, g = p(|t|); two such losses are solved together. A quiet
step foretells them and holds the torques that it ends with against them.
"""

from __future__ import annotations

from numba import njit

from rig_nodes.plant.driveline_algebra import HI0, KIN0, LO0, OPEN, STUCK, apart

# columns of `loss`, one row for each of the two losses: the parabola; the element whose other capacity, BASE, is given
# here, and the one that the loss brakes, by FACTOR times the parabola; the speed that says which way power flows; what
# the parabola was last, a step before that, and would be next; then the weights of m friction torques and n
# accelerations in its torque.
CONSTANT, SHARE, SQUARE, OWN, ON, FACTOR, WAY, BASE, LAST, BEFORE, NEXT, WEIGHTS = range(12)
STEEPEST = 0.5  # of what flows backwards: two losses of a path take no more than comes, as no mesh locks itself
MOST = 1e15  # Nm, above which no loss is looked for
CLOSE = 1e-5  # Nm, of Newton's last step; the parabolas leave a hundred-thousandth of that
FORETOLD = 1e-3  # Nm, by which a loss may miss the one that its torque asks for where it was foretold and not solved


def loss_width(n, m):
    """Columns of `loss` for n speeds and m friction elements."""
    return WEIGHTS + m + n


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def put_losses(loss, cap, end, column):
    """Capacities at one end (0 or 1) of the elements that are braked by losses: BASE, and what stands in ``column``.

    ``column``: LAST or NEXT; -1 for BASE alone.
    """
    if loss.shape[0] > 0:
        put_on(loss, cap, end, column, int(loss[0, OWN]), int(loss[1, OWN]))


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def put_on(loss, cap, end, column, first, second):
    """:func:`put_losses` on two elements that are known, the OWN of both losses: no loss brakes any other."""
    torque0 = loss[0, BASE]
    torque1 = loss[1, BASE]
    if column >= 0:
        for k in range(2):
            if loss[k, ON] == first:
                torque0 += loss[k, FACTOR] * loss[k, column]
            else:
                torque1 += loss[k, FACTOR] * loss[k, column]
    cap[KIN0 + end, first] = torque0
    cap[HI0 + end, first] = torque0
    cap[LO0 + end, first] = -torque0
    cap[KIN0 + end, second] = torque1
    cap[HI0 + end, second] = torque1
    cap[LO0 + end, second] = -torque1


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def brakes(factor, mode):
    """Torque on an element per loss: against its slip or the way it is loaded, none while it sticks or is open."""
    if mode == STUCK or mode == OPEN:
        return 0.0
    return factor if mode > 0 else -factor


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def parabola(loss, k, x):
    """(loss, its slope over x) at a torque x, positive where power goes from the drive to the load.

    Behind the top of a parabola that falls there the loss stays; it never drives. Backwards it grows by no more than
    STEEPEST: what comes from the load's inertia can be lost, and no more than that.
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


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def foretell_losses(loss):
    """Leaves in NEXT the two losses as they have been going."""
    for k in range(2):
        loss[k, NEXT] = max(0.0, 2.0 * loss[k, LAST] - loss[k, BEFORE])


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def loss_at(loss, k, torque, speed):
    """The loss that a torque asks for at the speed of its WAY."""
    return parabola(loss, k, torque if speed >= 0.0 else -torque)[0]


@njit(cache=True, error_model="numpy", nogil=True, forceinline=True)
def solve_losses(loss, y0, y1, s00, s01, s10, s11, v):
    """Leaves in NEXT the two losses at torques y less S times the losses; False where there are none.

    Newton from the last ones, which meets parabolas at once; where that does not settle, bisection. 1 + p' S is
    positive throughout (the slopes are bounded backwards, and what inertia makes of a loss is less than the loss), so
    there is one solution, and both find it.
    """
    way0 = 1.0 if v[int(loss[0, WAY])] >= 0.0 else -1.0
    way1 = 1.0 if v[int(loss[1, WAY])] >= 0.0 else -1.0
    y0 *= way0
    s00 *= way0
    s01 *= way0
    y1 *= way1
    s10 *= way1
    s11 *= way1
    g0 = loss[0, LAST]
    g1 = loss[1, LAST]
    for _ in range(8):
        p0, d0 = parabola(loss, 0, y0 - s00 * g0 - s01 * g1)
        p1, d1 = parabola(loss, 1, y1 - s10 * g0 - s11 * g1)
        f0 = g0 - p0
        f1 = g1 - p1
        a = 1.0 + d0 * s00
        b = d0 * s01
        c = d1 * s10
        d = 1.0 + d1 * s11
        scale = 1.0 / (a * d - b * c)
        e0 = scale * (d * f0 - b * f1)
        e1 = scale * (a * f1 - c * f0)
        g0 -= e0
        g1 -= e1
        if abs(e0) + abs(e1) <= CLOSE:
            loss[0, NEXT] = max(0.0, g0)
            loss[1, NEXT] = max(0.0, g1)
            return True
    return bisect_losses(loss, y0, y1, s00, s01, s10, s11)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def _second(loss, y, s):
    """The second loss g = p(y - s g) of its own torque alone."""
    low, high = 0.0, 1.0
    while not high - parabola(loss, 1, y - s * high)[0] >= 0.0:
        high *= 2.0
        if not high < MOST:
            return high
    for _ in range(100):
        g = 0.5 * (low + high)
        if g - parabola(loss, 1, y - s * g)[0] < 0.0:
            low = g
        else:
            high = g
    return high


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def bisect_losses(loss, y0, y1, s00, s01, s10, s11):
    """As :func:`solve_losses`, torques and S with the sign of the power's way: the first by bisection, the second for
    each of its values."""
    apart()
    low, high = 0.0, 1.0
    while True:
        other = _second(loss, y1 - s10 * high, s11)
        if high - parabola(loss, 0, y0 - s00 * high - s01 * other)[0] >= 0.0:
            break
        high *= 2.0
        if not high < MOST:
            return False
    for _ in range(100):
        g = 0.5 * (low + high)
        other = _second(loss, y1 - s10 * g, s11)
        if g - parabola(loss, 0, y0 - s00 * g - s01 * other)[0] < 0.0:
            low = g
        else:
            high = g
    loss[0, NEXT] = high
    loss[1, NEXT] = _second(loss, y1 - s10 * high, s11)
    return loss[1, NEXT] < MOST
