# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prescribed motion inside a step: its acceleration is imposed exactly, its torque is a result.

Used by driveline/law_steps.py. A prescribed speed is one of the generalised speeds (driveline/ties.py chooses them
so). In the kernel its inertia is 1 / HELD, so large that no torque changes the speed, and a force on it produces its
acceleration. The other speeds have the inverse of their own part of the mass matrix. The kernel thus finds every event under an
acceleration that varies in the step as it does under any other torque. A speed over time is taken as a parabola in each step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.base import ALLOCATES, INNER, njit
from rig_nodes.driveline.algebra import E_FRIC, E_SHAFT, E_VISC, HELD, VISC, lin, noinline

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.state import Loads, State, Structure

NOISE = 1e-13  # share of a speed: a smaller change is rounding, which would push a clutch that joins two prescribed bodies


@njit(**INNER)
def product(row: Floats, v: Floats) -> float:
    """Return the sum of row (n,) times v (n,)."""
    noinline()
    total = 0.0
    for j in range(row.shape[0]):
        total += row[j] * v[j]
    return total


@njit(**INNER)
def mobility_of(of: Floats, inverse: Floats) -> float:
    """Return the acceleration of a twist with the coefficients `of` (n,) by a torque [1/(kg m2)]."""
    noinline()
    total = 0.0
    for i in range(of.shape[0]):
        total += of[i] * product(inverse[i], of)
    return total


@njit(**INNER)
def invert(a: Floats, out: Floats) -> None:
    """Invert a symmetric positive definite matrix a into out, by Gauss and Jordan; a is overwritten."""
    noinline()
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    for col in range(n):
        scale = 1.0 / a[col, col]
        for j in range(n):
            a[col, j] *= scale
            out[col, j] *= scale
        for i in range(n):
            share = a[i, col]
            if i != col and share != 0.0:
                for j in range(n):
                    a[i, j] -= share * a[col, j]
                    out[i, j] -= share * out[col, j]


@njit(**INNER)
def moved_by(on: Floats) -> int:
    """Return the number of the one speed that a motion with the coefficients `on` (n,) prescribes."""
    noinline()
    for j in range(on.shape[0]):
        if on[j] != 0.0:
            return j
    return int(0)


@njit(**INNER)
def accelerations_of(given: Floats, k: int, begin: float, end: float, d: float, speed: float) -> tuple[float, float]:
    """Return the accelerations at both ends of a part of a step that bring a prescribed speed to its value at the part's end.

    Parameters
    ----------
    given : (3, inputs) array
        Inputs at both ends of the step, and by how much they are above the mean of these in its middle.
    k : int
        Number of the input.
    begin, end : float
        Shares of the step at which the part begins and ends.
    d : float
        Length of the part [s].
    speed : float
        Speed at its beginning [rad/s].

    Returns
    -------
    tuple of float
        The accelerations [rad/s2].
    """
    noinline()
    target = lin(given[0, k], given[1, k], end) + 4.0 * given[2, k] * end * (1.0 - end)
    gain = target - speed
    above = 4.0 * given[2, k] * (end - begin) * (end - begin)
    least = NOISE * (1.0 + abs(target))
    if abs(gain) <= least:
        gain = 0.0
    if abs(above) <= least:
        above = 0.0
    return (gain + above) / d, (gain - above) / d


@njit(**ALLOCATES)
def hold(mass: Floats, moved: Floats, inverse: Floats) -> None:
    """Set `inverse` to the inverse of a mass matrix in which the speeds with moved (n,) above 0 are prescribed."""
    noinline()
    n = mass.shape[0]
    free = mass.copy()
    for j in range(n):
        if moved[j] > 0.0:
            for i in range(n):
                free[i, j] = free[j, i] = 0.0
            free[j, j] = 1.0
    invert(free, inverse)
    for j in range(n):
        if moved[j] > 0.0:
            inverse[j, j] = HELD


@njit(**INNER)
def drive(mass: Floats, moved: Floats, gains: Floats, q: Floats) -> None:
    """Add to the forces q (2, n) those that produce the accelerations gains (2, n) of the prescribed speeds."""
    noinline()
    for j in range(mass.shape[0]):
        if moved[j] > 0.0:
            for end in range(2):
                for i in range(mass.shape[0]):
                    if moved[i] == 0.0:
                        q[end, i] -= mass[i, j] * gains[end, j]
                q[end, j] = gains[end, j] / HELD


class Turned(NamedTuple):
    """What a part of a step has changed.

    Parameters
    ----------
    gained, turned : (n,) arrays
        Change [rad/s] and integral [rad] of the speeds.
    impulse : (m,) array
        Impulse of each friction element without its drag [Nm s].
    twisted, swing : (s,) arrays
        Changes [rad] and integrals [rad s] of the twists of the shafts.
    """

    gained: Floats
    turned: Floats
    impulse: Floats
    twisted: Floats
    swing: Floats


@njit(**INNER)
def impulse_of(j: int, d: float, mass: Floats, structure: Structure, loads: Loads, part: Turned) -> float:
    """Return the impulse that a prescribed motion has put on speed j in a part of a step without an event inside.

    Parameters
    ----------
    j : int
        Number of the speed.
    d : float
        Length of the part [s].
    mass : (n, n) array
        Mass matrix.
    structure, loads : Structure, Loads
        As those of the bare step, but the forces of motions are not in q.
    part : Turned
        What the part has changed.

    Returns
    -------
    float
        The impulse [Nm s].
    """
    noinline()
    w, sh, kc = structure.w, structure.sh, structure.kc
    total = product(mass[j], part.gained) - 0.5 * d * (loads.q[0, j] + loads.q[1, j])
    for f in range(w.shape[0]):
        if w[f, j] != 0.0:
            total += w[f, j] * (part.impulse[f] + loads.cap[VISC, f] * product(w[f], part.turned))
    for a in range(sh.shape[0]):
        total += sh[a, j] * (kc[0, a] * part.swing[a] + kc[1, a] * part.twisted[a])
    return total


@njit(**INNER)
def work_over(q: Floats, j: int, turned: float, lag: float) -> float:
    """Return the work of force j of q (2, n), linear over a step in which its speed has turned by an angle and has a lag [J].

    The lag is the integral of the speed times the share of the step, from -1/2 to 1/2, in the work buffer of the bare step [rad].
    """
    noinline()
    return 0.5 * (q[0, j] + q[1, j]) * turned + (q[1, j] - q[0, j]) * lag


@njit(**INNER)
def work_of(mass: Floats, kc: Floats, before: State, after: State, twist0: Floats, others: float) -> float:
    """Return the work of prescribed motions in a part of a step in which modes change, as the remainder of the energy balance.

    Parameters
    ----------
    mass, kc : arrays
        As those of the bare step.
    before, after : State
        The state before and after the part.
    twist0 : (s,) array
        Twists before it, 0 for those of laws [rad].
    others : float
        Work of all other torques [J].

    Returns
    -------
    float
        The work [J].
    """
    noinline()
    v0, v, el0, el, shaft0, shaft = before.v, after.v, before.el, after.el, before.shaft, after.shaft
    total = -others
    for i in range(v.shape[0]):
        total += 0.5 * (v[i] - v0[i]) * (product(mass[i], v) + product(mass[i], v0))
    for f in range(el.shape[1]):
        total += el[E_FRIC, f] - el0[E_FRIC, f] + el[E_VISC, f] - el0[E_VISC, f]
    for a in range(shaft.shape[1]):
        total += shaft[E_SHAFT, a] - shaft0[E_SHAFT, a] + 0.5 * kc[0, a] * (after.twist[a] ** 2 - twist0[a] ** 2)
    return total
