# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a run of a driveline gives: its events, its state at one time, and its course, with values picked by name.

driveline/run.py makes all of them; runs/joint_torques.py makes a `Result` of the rig's present state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import RigError
from rig_nodes.driveline import algebra
from rig_nodes.driveline.laws import GEARING, INERTIA, MOTION, TORQUE, Law
from rig_nodes.driveline.system import System
from rig_nodes.driveline.tables import slope_at

if TYPE_CHECKING:
    from rig_nodes.base import Floats

EVENT_NAMES = {algebra.LOCK: "lock", algebra.BREAK: "break", algebra.CROSS: "cross", algebra.FREE: "free", algebra.CLOSE: "close"}


class Event(NamedTuple):
    """A change of state of a friction element.

    Parameters
    ----------
    t : float
        Time [s].
    element : str
        Name of the element.
    kind : str
        "lock", "break", "cross", "free" or "close".
    """

    t: float
    element: str
    kind: str


@dataclass(frozen=True)
class Moment:
    """State of the driveline at one time, as a controller receives it; the methods pick values by name.

    Parameters
    ----------
    system : System
        The driveline.
    t : float
        Time [s].
    speeds, angles : (b,) array of float
        Speeds [rad/s] and angles [rad] of the bodies.
    slips, modes, torques : (m,) array
        Slips [rad/s], modes and torques [Nm] of the friction elements.
    """

    system: System
    t: float
    speeds: np.ndarray
    angles: np.ndarray
    slips: np.ndarray
    modes: np.ndarray
    torques: np.ndarray

    def speed(self, body: str) -> float:
        """Return the speed of a body [rad/s]; raise RigError when there is no such body."""
        return float(self.speeds[_place(self.system.bodies, "body", body)])

    def state(self, name: str) -> float:
        """Return the value of a state; raise RigError when there is no such state."""
        return self.speed(self.system.states[_place(self.system.states, "state", name)])

    def angle(self, body: str) -> float:
        """Return the angle of a body [rad]; raise RigError when there is no such body."""
        return float(self.angles[_place(self.system.bodies, "body", body)])

    def slip(self, element: str) -> float:
        """Return the slip of a friction element [rad/s]; raise RigError when there is no such element."""
        return float(self.slips[_place(self.system.elements, "friction element", element)])

    def locked(self, element: str) -> bool:
        """Return whether a friction element does not slip; raise RigError when there is no such element."""
        return abs(int(self.modes[_place(self.system.elements, "friction element", element)])) >= 2

    def torque(self, element: str) -> float:
        """Return the torque of a friction element without its drag [Nm]; raise RigError when there is no such element."""
        return float(self.torques[_place(self.system.elements, "friction element", element)])


@dataclass(frozen=True)
class Result:
    """Result of a run: r rows, one for the start and one for each end of a step.

    The methods pick values by name and raise RigError for a name that does not exist. Where a torque jumps at a row, the row has
    the value before the jump; row 0 is the exception.

    Parameters
    ----------
    system : System
        The driveline, with b bodies, m friction elements, s shafts and l laws.
    t : (r,) array of float
        Time [s].
    speeds, angles : (r, b) array of float
        Speeds [rad/s] and angles [rad] of the bodies; the angles are 0 at the start.
    slips, modes, torques : (r, m) array
        Slips [rad/s], modes and friction torques [Nm] of the friction elements.
    twists, shaft_torques : (r, s) array of float
        Twists [rad] and torques [Nm] of the shafts.
    pushes : (r, b) array of float
        Torques on the bodies from outside [Nm].
    laws : (r, l) array of float
        Torque of each law of the system, or its factor, or, for an inertia over an angle, its value.
    law_angles : (r, l) array of float
        Angle of each law [rad].
    stored, e_in : (r,) array of float
        Stored energy, and work of the torques from outside since the start [J].
    e_fric, e_visc : (r, m) array of float
        Losses of the friction elements since the start, by friction and by drag [J].
    e_shaft : (r, s) array of float
        Losses of the shafts since the start [J].
    impulse : (r, m) array of float
        Impulse of each friction torque [Nm s].
    events : list of Event
        The e events of the run.
    event_speeds, event_angles : (e, b) array of float
        Speeds [rad/s] and angles [rad] of the bodies at each event.
    capped : int
        Number of steps that reached the limit on events or whose laws were not met.
    """

    system: System
    t: np.ndarray
    speeds: np.ndarray
    angles: np.ndarray
    slips: np.ndarray
    modes: np.ndarray
    torques: np.ndarray
    twists: np.ndarray
    shaft_torques: np.ndarray
    pushes: np.ndarray
    laws: np.ndarray
    law_angles: np.ndarray
    stored: np.ndarray
    e_in: np.ndarray
    e_fric: np.ndarray
    e_visc: np.ndarray
    e_shaft: np.ndarray
    impulse: np.ndarray
    events: list[Event]
    event_speeds: np.ndarray
    event_angles: np.ndarray
    capped: int

    def speed(self, body: str) -> np.ndarray:
        """Return the speed (r,) of a body [rad/s]."""
        return self.speeds[:, _place(self.system.bodies, "body", body)]

    def state(self, name: str) -> np.ndarray:
        """Return the value (r,) of a state."""
        return self.speed(self.system.states[_place(self.system.states, "state", name)])

    def angle(self, body: str) -> np.ndarray:
        """Return the angle (r,) of a body [rad]."""
        return self.angles[:, _place(self.system.bodies, "body", body)]

    def slip(self, element: str) -> np.ndarray:
        """Return the slip (r,) of a friction element [rad/s]."""
        return self.slips[:, _place(self.system.elements, "friction element", element)]

    def mode(self, element: str) -> np.ndarray:
        """Return the mode (r,) of a friction element, with the numbers of driveline.algebra."""
        return self.modes[:, _place(self.system.elements, "friction element", element)]

    def torque(self, name: str, body: str | None = None) -> np.ndarray:
        """Return a torque over time.

        Parameters
        ----------
        name : str
            A clutch, brake or free-wheel (torque without its drag), a shaft, a torque or motion of the description (for a motion
            the mean of the last step), a slider-crank or varying inertia, a gear, mesh, variator, planetary set or relation.
        body : str, optional
            The body on which the gear, mesh, variator, planetary set or relation acts; needed for these.

        Returns
        -------
        (r,) array of float
            The torque [Nm].

        Raises
        ------
        RigError
            When there is no such name, or the body is not one that it joins.
        """
        s = self.system
        meshes = {mesh.name: mesh for mesh in s.meshes}
        if name in meshes and body is not None:
            pair = [meshes[name].gear, meshes[name].brake]
            joined = [b for b, c in zip(s.bodies, s.element_bodies[pair[0]]) if c != 0.0]
            if body in joined:
                return -self.torques[:, pair] @ s.element_bodies[pair, s.bodies.index(body)]
            raise RigError(f"driveline: '{name}' puts torques on {' and '.join(joined)}; name one of them")
        for k, law in enumerate(s.laws):
            if law.kind == GEARING and law.name == name and body is not None:
                joined = [b for b, c in zip(s.bodies, s.element_bodies[law.element]) if c != 0.0]
                if body not in joined:
                    raise RigError(f"driveline: '{name}' puts torques on {' and '.join(joined)}; name one of them")
                turns = law.bodies[s.bodies.index(body)] != 0.0
                return self.torques[:, law.element] * (self.laws[:, k] if turns else -1.0)
        if name in s.elements:
            return self.torques[:, s.elements.index(name)]
        if name in s.shafts:
            return self.shaft_torques[:, s.shafts.index(name)]
        for k, law in self._inertias():
            if law.name == name:
                return -self.laws[:, k] * (self.accelerations() @ law.bodies) - self._bending(k, law)
        acting = {law.name: k for k, law in enumerate(s.laws) if law.kind in (TORQUE, MOTION)}
        if name in acting:
            return self.laws[:, acting[name]]
        k = _place(
            s.ties,
            "clutch, shaft, gear or set",
            name,
            (*s.elements, *s.shafts, *acting, *(law.name for _, law in self._inertias()), *s.ties),
        )
        joined = [b for b, c in zip(s.bodies, s.tie_rows[k]) if c != 0.0]
        if body not in joined:
            raise RigError(f"driveline: '{name}' puts torques on {' and '.join(joined)}; name one of them")
        return self._by_ties[:, k] * s.tie_rows[k, s.bodies.index(body)]

    def accelerations(self) -> np.ndarray:
        """Return the accelerations (r, b) of the bodies [rad/s2]."""
        s = self.system
        forces, mass = self._on_speeds(), np.repeat(s.mass[None], len(self.t), axis=0)
        for k, law in self._inertias():
            mass += self.laws[:, k, None, None] * np.outer(law.on, law.on)
            forces -= self._bending(k, law)[:, None] * law.on
        return np.linalg.solve(mass, forces[:, :, None])[:, :, 0] @ s.bodies_from_speeds.T

    def residual(self) -> np.ndarray:
        """Return work in - change of stored energy - losses [J] for every row (r,); only rounding is left."""
        losses = self.e_fric.sum(axis=1) + self.e_visc.sum(axis=1) + self.e_shaft.sum(axis=1)
        return self.e_in - (self.stored - self.stored[0]) - losses

    def _on_speeds(self) -> Floats:
        s = self.system
        pushes = self.pushes + self._by_ratios
        return pushes @ s.bodies_from_speeds - (self.torques + s.drag * self.slips) @ s.w - self.shaft_torques @ s.sh

    @cached_property
    def _by_ratios(self) -> Floats:
        """Return the torques (r, b) of variators on bodies beyond those at their ratios at the start."""
        laws = [(k, law) for k, law in enumerate(self.system.laws) if law.kind == GEARING]
        more = [((self.laws[:, k] - law.gap) * self.torques[:, law.element])[:, None] * law.bodies for k, law in laws]
        return sum(more, np.zeros_like(self.pushes))

    def _inertias(self) -> list[tuple[int, Law]]:
        return [(k, law) for k, law in enumerate(self.system.laws) if law.kind == INERTIA]

    def _bending(self, k: int, law: Law) -> Floats:
        """Return the torque that an inertia over an angle needs to turn at constant speed."""
        return 0.5 * slope_at(law.table, self.law_angles[:, k]) * (self.speeds @ law.bodies) ** 2

    @cached_property
    def _by_ties(self) -> Floats:
        """Return for each gear and relation the factor (r, ties) on its coefficients.

        Where several could share a torque, the factors are the least ones.
        """
        s = self.system
        joints = (self.torques + s.drag * self.slips) @ s.element_bodies + self.shaft_torques @ s.shaft_bodies
        gains = self.accelerations()
        missing = gains * s.inertia - self.pushes - self._by_ratios + joints
        for k, law in self._inertias():
            missing += (self.laws[:, k] * (gains @ law.bodies) + self._bending(k, law))[:, None] * law.bodies
        return missing @ np.linalg.pinv(s.tie_rows)


def _place(names: Sequence[str], kind: str, name: str, known: Sequence[str] | None = None) -> int:
    if name not in names:
        raise RigError(f"driveline: there is no {kind} '{name}'; there are: {', '.join(known or names) or 'none'}")
    return names.index(name)
