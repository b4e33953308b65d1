# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural frequencies, damping and mode shapes of a driveline, with some of its friction elements locked.

It works on the arrays of `Driveline.build`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from rig_nodes.base import RigError, brief
from rig_nodes.driveline.laws import ANGLE, ARGUMENT, INERTIA, INPUT, MOTION, RATIO, TORQUE, Law
from rig_nodes.driveline.system import System, check_built
from rig_nodes.driveline.tables import slope_at, value_at

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base import Floats

_STILL = 1e-7  # share of the highest pole: a slower pole belongs to a motion in which all bodies turn as one


@dataclass(frozen=True)
class Modes:
    """The k modes of a driveline, slowest first.

    Parameters
    ----------
    bodies : tuple of str
        Names of the b bodies.
    frequencies : (k,) array of float
        Undamped natural frequency [Hz]; 0 where bodies turn as one and no shaft between them twists.
    damping : (k,) array of float
        Damping as a share of the critical one; 1 for a motion that only decays, at the rate of 2 pi times its frequency.
    shapes : (k, b) array of float or complex
        Amplitudes of the bodies, the largest of each row 1; complex where damping shifts the phases of the bodies.
    """

    bodies: tuple[str, ...]
    frequencies: np.ndarray
    damping: np.ndarray
    shapes: np.ndarray


def modes(system: System, locked: Sequence[str] = ()) -> Modes:
    """Return the modes of a driveline with some friction elements locked and all others open.

    Open elements keep their drag. Elements that depend on the motion are linearised at the start: a torque has the slope of its
    table (a damping over a speed, a stiffness over an angle), an inertia its value. Bodies with a prescribed motion, and states,
    are held.

    Parameters
    ----------
    system : System
        The driveline.
    locked : sequence of str
        Names of the clutches, brakes and free-wheels that are locked.

    Returns
    -------
    Modes
        The modes.

    Raises
    ------
    RigError
        When there is no friction element of a name.
    """
    found = _found(system, locked)
    if found is None:
        return Modes(system.bodies, np.zeros(0), np.zeros(0), np.zeros((0, len(system.bodies))))
    shapes = found.shapes @ found.at_bodies.T
    shapes = shapes / np.take_along_axis(shapes, np.abs(shapes).argmax(axis=1)[:, None], 1)
    return Modes(system.bodies, found.frequencies / (2.0 * math.pi), found.damping, shapes)


@dataclass(frozen=True)
class Sensitivities:
    """How each of the k modes of a driveline depends on its inertias and stiffnesses.

    Parameters
    ----------
    bodies, shafts : tuple of str
        Names of the bodies with inertia (b) and of the shafts with stiffness (s).
    inertia : (k, b) array of float
        d ln f / d ln J; not a number for modes at 0 Hz.
    stiffness : (k, s) array of float
        d ln f / d ln k; not a number for modes at 0 Hz.
    """

    bodies: tuple[str, ...]
    shafts: tuple[str, ...]
    inertia: np.ndarray
    stiffness: np.ndarray


def sensitivities(system: System, locked: Sequence[str] = ()) -> Sensitivities:
    """Return the relative change of each natural frequency per relative change of an inertia or a stiffness.

    With a pole p of (p^2 M + p D + K) x = 0 and its left and right shapes y and x,
    d p = -y (p^2 dM + p dD + dK) x / y (2 p M + D) x, and the frequency is |p|. Without damping these are -J x_J^2 / 2 and
    k x_k^2 / (2 p^2) of a shape with the modal mass 1.

    Parameters
    ----------
    system : System
        The driveline.
    locked : sequence of str
        Names of what is locked, as for :func:`modes`, whose order the modes have.

    Returns
    -------
    Sensitivities
        The sensitivities, of the inertias of bodies and of the stiffnesses of shafts.

    Raises
    ------
    RigError
        When there is no friction element of a name.
    """
    found = _found(system, locked)
    heavy = [i for i, j in enumerate(system.inertia) if j > 0.0]
    stiff = [i for i, k in enumerate(system.kc[0]) if k > 0.0]
    names = tuple(system.bodies[i] for i in heavy), tuple(system.shafts[i] for i in stiff)
    if found is None:
        return Sensitivities(*names, np.zeros((0, len(heavy))), np.zeros((0, len(stiff))))
    by_inertia, by_stiffness = (np.full((len(found.frequencies), len(one)), np.nan) for one in (heavy, stiff))
    twists = system.sh @ found.free
    for k, (w, damping, right) in enumerate(zip(found.frequencies, found.damping, found.shapes)):
        if w == 0.0:
            continue
        pole = w * (-damping + 1j * math.sqrt(max(0.0, 1.0 - damping**2)))
        left = right
        if not (all(np.allclose(one, one.T, rtol=1e-12, atol=1e-12 * np.abs(one).max()) for one in (found.stiffness, found.drag))):
            left = np.linalg.svd((pole**2 * found.mass + pole * found.drag + found.stiffness).T)[2][-1].conj()
        slope = left @ (2.0 * pole * found.mass + found.drag) @ right * pole
        for i, body in enumerate(heavy):
            row = found.at_bodies[body]
            by_inertia[k, i] = (-(pole**2) * system.inertia[body] * (left @ row) * (row @ right) / slope).real
        for i, shaft in enumerate(stiff):
            by_stiffness[k, i] = (-system.kc[0, shaft] * (left @ twists[shaft]) * (twists[shaft] @ right) / slope).real
    return Sensitivities(*names, by_inertia, by_stiffness)


@dataclass(frozen=True)
class Response:
    """Steady response of a driveline to a harmonic torque of 1 Nm on one body, at n frequencies.

    Parameters
    ----------
    bodies, shafts : tuple of str
        Names of the bodies (b) and of the shafts (s).
    frequencies : (n,) array of float
        Frequencies of the torque [Hz].
    speeds : (n, b) array of complex
        Amplitudes of the bodies' speeds [rad/s per Nm].
    torques : (n, s) array of complex
        Amplitudes of the shafts' torques [Nm per Nm].
    """

    bodies: tuple[str, ...]
    shafts: tuple[str, ...]
    frequencies: np.ndarray
    speeds: np.ndarray
    torques: np.ndarray


def response(system: System, body: str, frequencies: Floats, locked: Sequence[str] = ()) -> Response:
    """Return the steady response to a harmonic torque of 1 Nm on a body: (K - w^2 M + i w D) x = torque.

    Parameters
    ----------
    system : System
        The driveline.
    body : str
        The body on which the torque acts.
    frequencies : (n,) array of float
        Frequencies of the torque [Hz], above 0.
    locked : sequence of str
        Names of what is locked, as for :func:`modes`.

    Returns
    -------
    Response
        The response; all 0 where nothing can turn.

    Raises
    ------
    RigError
        When there is no body or no friction element of a name, or a frequency is not above 0.
    """
    frequencies = np.asarray(frequencies, float)
    if body not in system.bodies:
        raise RigError(f"driveline: there is no body '{body}'; there are: {', '.join(system.bodies)}")
    if not np.all(frequencies > 0.0) or not np.isfinite(frequencies).all():
        raise RigError("driveline: frequencies of a response are to be above 0 Hz")
    found = _found(system, locked)
    speeds = np.zeros((len(frequencies), len(system.bodies)), complex)
    torques = np.zeros((len(frequencies), len(system.shafts)), complex)
    if found is None:
        return Response(system.bodies, system.shafts, frequencies, speeds, torques)
    acts, twists = found.at_bodies[system.bodies.index(body)], system.sh @ found.free
    for k, w in enumerate(2.0 * math.pi * frequencies):
        x = np.linalg.solve(found.stiffness - w**2 * found.mass + 1j * w * found.drag, acts.astype(complex))
        speeds[k] = 1j * w * (found.at_bodies @ x)
        torques[k] = (system.kc[0] + 1j * w * system.kc[1]) * (twists @ x)
    return Response(system.bodies, system.shafts, frequencies, speeds, torques)


@dataclass(frozen=True)
class _Found:
    """Matrices and modes of what can turn: r speeds, the free ones of the system's n, b bodies, k modes.

    ``free`` (n, r) gives the system's speeds and ``at_bodies`` (b, r) those of the bodies; mass, stiffness and drag are (r, r),
    frequencies [rad/s] and damping (k,), shapes (k, r), slowest first.
    """

    free: np.ndarray
    at_bodies: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    drag: np.ndarray
    frequencies: np.ndarray
    damping: np.ndarray
    shapes: np.ndarray


def _found(system: System, locked: Sequence[str]) -> _Found | None:
    """The matrices and modes with these elements locked; None when nothing can turn. RigError as of :func:`modes`."""
    check_built(system)
    if isinstance(locked, str) or not all(isinstance(name, str) for name in locked):
        raise RigError(f"driveline: locked is {brief(locked)}; a list of names is needed")
    for name in locked:
        if name not in system.elements:
            raise RigError(f"driveline: there is no friction element '{name}'; there are: {', '.join(system.elements) or 'none'}")
    held = np.array([name in locked for name in system.elements], bool)
    for mesh in system.meshes:
        held[mesh.gear] = True
    held[system.variators] = True
    still = [system.w[held], *(law.on[None] for law in system.laws if law.kind == MOTION)]
    still += [np.eye(len(system.speeds))[np.flatnonzero(system.w[f])[-1:]] for f in system.variators]
    still.append(np.eye(len(system.speeds))[system.state_speeds])
    free = linalg.null_space(np.concatenate(still)) if any(map(len, still)) else np.eye(len(system.speeds))
    if free.shape[1] == 0:
        return None
    w, sh = system.w[~held], system.sh
    mass, stiffness, drag = _of_laws(system)
    # a torque over an angle may have a negative stiffness, or act on another body than the one whose angle it depends on
    pushes = stiffness.any()
    mass = free.T @ (mass + system.mass) @ free
    stiffness = free.T @ (stiffness + sh.T @ (system.kc[0][:, None] * sh)) @ free
    drag = free.T @ (drag + sh.T @ (system.kc[1][:, None] * sh) + w.T @ (system.drag[~held][:, None] * w)) @ free
    if drag.any() or pushes:
        frequencies, damping, shapes = _damped(mass, stiffness, drag)
    else:
        squares, shapes = linalg.eigh(stiffness, mass)
        squares[np.abs(squares) <= _STILL**2 * max(squares.max(), np.finfo(float).tiny)] = 0.0
        frequencies, damping, shapes = np.sqrt(squares), np.zeros(len(squares)), shapes.T
    order = np.argsort(frequencies, kind="stable")
    at_bodies = system.bodies_from_speeds @ free
    return _Found(free, at_bodies, mass, stiffness, drag, frequencies[order], damping[order], shapes[order])


def _of_laws(system: System) -> tuple[Floats, Floats, Floats]:
    """Return mass, stiffness and damping (n, n) of the laws of a system at its start."""
    mass, stiffness, drag = np.zeros((3, *system.mass.shape))
    factors = list(system.factors.values())
    seconds = {law.name: law for law in system.laws if law.kind == ARGUMENT}
    for law in system.laws:
        if law.kind == INERTIA:
            mass += value_at(law.table, law.start) * np.outer(law.on, law.on)
        elif law.kind == TORQUE:
            for by, slope, of in _slopes_of(system, law, seconds.get(law.name)):
                (stiffness if by == ANGLE else drag)[:] -= slope * factors[law.factor] * np.outer(law.on, of)
    return mass, stiffness, drag


def _slopes_of(system: System, law: Law, second: Law | None) -> list[tuple[int, float, Floats]]:
    """Return for each argument of a torque its kind, the slope of the table over it at the start, and its row of the speeds."""
    v = system.v_start
    x = law.start if law.by == ANGLE else law.of @ v
    if second is None:
        return [(law.by, slope_at(law.table, [x])[0], law.of)]
    row, under = second.of, second.on @ v
    u = second.start if second.by == ANGLE else row @ v
    if second.by == INPUT:
        u = list(system.factors.values())[second.factor]
    elif second.by == RATIO and under != 0.0:
        u /= under
        row = (row - u * second.on) / under
    at, rise = value_at(second.table, u), slope_at(second.table, [u])[0]
    curve, other = (second.curves[i] for i in (int(at), min(int(at) + 1, len(second.curves) - 1)))
    slope, steeper = slope_at(curve, [x])[0], slope_at(other, [x])[0]
    across = rise * (value_at(other, x) - value_at(curve, x))
    return [(law.by, slope + (at % 1.0) * (steeper - slope), law.of), (second.by, across, row)]


def _damped(mass: Floats, stiffness: Floats, drag: Floats) -> tuple[Floats, Floats, Floats | npt.NDArray[np.complex128]]:
    """Return natural angular frequencies, damping and shapes from the poles of speeds and angles.

    The angles are in a unit that makes them about as large as the speeds.
    """
    n = len(mass)
    inverse = np.linalg.inv(mass)
    fast = math.sqrt(np.linalg.norm(inverse @ stiffness)) or 1.0
    poles, vectors = linalg.eig(np.block([[np.zeros((n, n)), fast * np.eye(n)], [-inverse @ stiffness / fast, -inverse @ drag]]))
    still = np.abs(poles) <= _STILL * np.abs(poles).max()
    # a motion of all bodies as one has a free angle, hence a pole at 0
    rigid = linalg.null_space(stiffness, rcond=_STILL**2)
    rows = [(0.0, 0.0, shape) for shape in rigid.T]
    for pole, vector in zip(poles[~still], vectors[n:, ~still].T):
        if pole.imag > 1e-9 * abs(pole):
            rows.append((abs(pole), -pole.real / abs(pole), vector))
        elif abs(pole.imag) <= 1e-9 * abs(pole):
            rows.append((abs(pole), math.copysign(1.0, -pole.real), vector.real))
    frequencies, damping, shapes = zip(*rows)
    return np.array(frequencies), np.array(damping), np.array(shapes)
