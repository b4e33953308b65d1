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

from rig_nodes.errors import RigError
from rig_nodes.plant.driveline import System, check_built
from rig_nodes.plant.driveline_laws import INERTIA, MOTION, TORQUE
from rig_nodes.plant.driveline_tables import slope_at, value_at

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.arrays import Floats

_STILL = 1e-7  # share of the highest pole: a pole this slow belongs to a driveline which turns as one


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

    Open elements keep their drag. What depends on the motion is taken at the start: a torque with the slope of its table (a damping
    over a speed, a stiffness over an angle), an inertia with its value. What a prescribed motion moves is held.

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
    check_built(system)
    if isinstance(locked, str):
        raise RigError(f"driveline: locked is {locked!r}; a list of names is needed")
    for name in locked:
        if name not in system.elements:
            raise RigError(f"driveline: there is no friction element '{name}'; there are: {', '.join(system.elements) or 'none'}")
    held = np.array([name in locked for name in system.elements], bool)
    for mesh in system.meshes:
        held[mesh.gear] = True
    still = [system.w[held], *(law.on[None] for law in system.laws if law.kind == MOTION)]
    free = linalg.null_space(np.concatenate(still)) if held.any() or len(still) > 1 else np.eye(len(system.speeds))
    if free.shape[1] == 0:
        return Modes(system.bodies, np.zeros(0), np.zeros(0), np.zeros((0, len(system.bodies))))
    w, sh = system.w[~held], system.sh
    mass, stiffness, drag = _of_laws(system)
    pushes = (
        stiffness.any()
    )  # a torque over an angle may push away from it, or act on another body than the one whose angle it reads
    mass = free.T @ (mass + system.mass) @ free
    stiffness = free.T @ (stiffness + sh.T @ (system.kc[0][:, None] * sh)) @ free
    drag = free.T @ (drag + sh.T @ (system.kc[1][:, None] * sh) + w.T @ (system.drag[~held][:, None] * w)) @ free
    if drag.any() or pushes:
        frequencies, damping, shapes = _damped(mass, stiffness, drag)
    else:
        squares, shapes = linalg.eigh(stiffness, mass)
        squares[np.abs(squares) <= _STILL**2 * max(squares.max(), np.finfo(float).tiny)] = 0.0
        frequencies, damping, shapes = np.sqrt(squares), np.zeros(len(squares)), shapes.T
    shapes = shapes @ (system.bodies_from_speeds @ free).T
    shapes = shapes / np.take_along_axis(shapes, np.abs(shapes).argmax(axis=1)[:, None], 1)
    order = np.argsort(frequencies, kind="stable")
    return Modes(system.bodies, frequencies[order] / (2.0 * math.pi), damping[order], shapes[order])


def _of_laws(system: System) -> tuple[Floats, Floats, Floats]:
    """Return mass, stiffness and damping (n, n) of the laws of a system at its start."""
    mass, stiffness, drag = np.zeros((3, *system.mass.shape))
    factors = list(system.factors.values())
    for law in system.laws:
        if law.kind == INERTIA:
            mass += value_at(law.table, law.start) * np.outer(law.on, law.on)
        elif law.kind == TORQUE:
            at = law.start if law.angle else law.of @ system.v_start
            slope = slope_at(law.table, [at])[0] * (factors[law.factor] if law.factor >= 0 else 1.0)
            (stiffness if law.angle else drag)[:] -= slope * np.outer(law.on, law.of)
    return mass, stiffness, drag


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
