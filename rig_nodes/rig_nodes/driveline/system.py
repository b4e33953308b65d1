# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A driveline as arrays: what a description becomes, and the state that a step moves.

driveline/builder.py makes a `System`; driveline/run.py, the engine and the analysis of modes use it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rig_nodes.base import RigError
from rig_nodes.driveline import algebra
from rig_nodes.driveline.algebra import work_size
from rig_nodes.driveline.laws import GEARING, Law
from rig_nodes.driveline.losses import BASE, FACTOR, LEAST_LOSS, ON, OWN, SHARE, WEIGHTS, loss_width
from rig_nodes.driveline.state import State, Structure


@dataclass(frozen=True)
class Mesh:
    """A gear mesh with losses, or a planetary set with losses.

    The loss is `share` times (torque into the mesh - `before` times the loss). This is one straight line for both directions of
    power.

    Parameters
    ----------
    name : str
        Name of the mesh.
    gear : int
        Number of the friction element that holds the two wheels, or the three members, together.
    brake : int
        Number of the friction element that brakes with the loss torque.
    share : float
        Share of the torque that is lost.
    before : float
        Share of the loss that is subtracted from the torque first.
    """

    name: str
    gear: int
    brake: int
    share: float
    before: float


@dataclass(frozen=True)
class System:
    """A driveline as arrays, made by `Driveline.build`.

    It has n generalised speeds v, b bodies, m friction elements and s shafts. The speeds of the bodies are `bodies_from_speeds`
    times v. Torques on the bodies act on the generalised speeds through its transpose. The kinetic energy is v mass v / 2.

    Parameters
    ----------
    bodies, elements, shafts, speeds : tuple of str
        Names of the bodies (b), of the friction elements (m), of the shafts (s) and of the bodies whose speeds are v (n), which
        those of variators (driveline.variators) follow.
    inertia : (b,) array of float
        Inertia of each body [kg m2].
    bodies_from_speeds : (b, n) array of float
        Speeds of all bodies by the generalised speeds.
    mass : (n, n) array of float
        Mass matrix of the generalised speeds.
    minv, w, sh, kc : arrays of float
        As those of driveline.state.Structure, without the rows of laws.
    stick : (2, m) array of float
        Ratio of break-away to kinetic torque, forwards and backwards.
    drag : (m,) array of float
        Drag on the slip of each friction element [Nm s/rad].
    one_way : (m,) array of bool
        True for a free-wheel.
    v_start : (n,) array of float
        Generalised speeds at the start [rad/s].
    twist_start : (s,) array of float
        Twist of each shaft at the start [rad].
    element_bodies, shaft_bodies : (m, b) and (s, b) arrays of float
        Coefficients by which the speeds of the bodies give the slips and the rates of the twists.
    ties : tuple of str
        Names of the gears, planetary sets and relations.
    tie_rows : (ties, b) array of float
        Coefficients of the ties.
    meshes : tuple of Mesh
        Gear meshes and planetary sets with losses.
    laws : tuple of Law
        Laws of the driveline, sorted by kind.
    slots : (s and more, n) array of float
        Rows of the shafts, followed by those of the laws that need one.
    factors : dict of str to float
        Inputs that the laws read, by name, with their defaults.
    balanced : tuple of str
        Bodies without inertia whose speeds follow from the balance of torques of their shafts; no torque may act on them.
    states : tuple of str
        Bodies that are no bodies but states, as temperatures; their "speeds" are the values, their "inertias" the capacities.
    """

    bodies: tuple[str, ...]
    elements: tuple[str, ...]
    shafts: tuple[str, ...]
    speeds: tuple[str, ...]
    inertia: np.ndarray
    bodies_from_speeds: np.ndarray
    mass: np.ndarray
    minv: np.ndarray
    w: np.ndarray
    sh: np.ndarray
    kc: np.ndarray
    stick: np.ndarray
    drag: np.ndarray
    one_way: np.ndarray
    v_start: np.ndarray
    twist_start: np.ndarray
    element_bodies: np.ndarray
    shaft_bodies: np.ndarray
    ties: tuple[str, ...]
    tie_rows: np.ndarray
    meshes: tuple[Mesh, ...]
    laws: tuple[Law, ...]
    slots: np.ndarray
    factors: dict[str, float]
    balanced: tuple[str, ...]
    states: tuple[str, ...]

    @cached_property
    def structure(self) -> Structure:
        """The structure that the compiled steps take; rows of laws among the shafts have neither stiffness nor damping."""
        kc = np.zeros((2, len(self.slots)))
        kc[:, : len(self.shafts)] = self.kc
        return Structure(self.minv, self.w, self.slots, kc)

    @cached_property
    def state_speeds(self) -> np.ndarray:
        """Which of the generalised speeds (n,) are states."""
        return np.isin(self.speeds, self.states)

    @cached_property
    def conductors(self) -> np.ndarray:
        """Which of the shafts (s,) conduct between states."""
        return (self.sh[:, self.state_speeds] != 0.0).any(axis=1)

    @property
    def variators(self) -> list[int]:
        """Numbers of the friction elements that are gears whose ratio varies."""
        return [law.element for law in self.laws if law.kind == GEARING]

    def state(self, max_events: int = 256, recorded: bool = False) -> State:
        """Return the initial state: each free-wheel overruns or is locked, everything else is open.

        Parameters
        ----------
        max_events : int
            Number of events for which there is room.
        recorded : bool
            Adds room for the angles of the speeds after the twists of the shafts, and for speeds and angles after each event.

        Returns
        -------
        State
            A new state.
        """
        n, m, s = len(self.speeds), len(self.elements), len(self.slots)
        mode = np.zeros(m, np.int64)
        slip = self.w @ self.v_start
        for f in np.flatnonzero(self.one_way):
            if slip[f] < 0.0:
                mode[f] = algebra.BACKWARD
        for mesh in self.meshes:
            mode[mesh.gear] = algebra.STUCK
        mode[self.variators] = algebra.STUCK
        extra = n if recorded else 0
        twist = np.zeros(s + extra)
        twist[: len(self.shafts)] = self.twist_start
        return State(
            self.v_start.copy(),
            twist,
            mode,
            np.zeros((4, m)),
            np.zeros((2, s)),
            np.zeros(n),
            np.zeros((max_events, 3 + 2 * extra)),
            np.zeros(3, np.int64),
            np.zeros(work_size(n, m, s, len(self.meshes))),
        )

    def losses(self) -> np.ndarray:
        """Return new rows (meshes, loss_width) of the meshes' losses, with the columns of driveline.losses."""
        loss = np.zeros((len(self.meshes), loss_width(len(self.speeds), len(self.elements))))
        for row, mesh in zip(loss, self.meshes):
            row[SHARE], row[OWN], row[ON], row[FACTOR], row[BASE] = mesh.share, mesh.brake, mesh.brake, 1.0, LEAST_LOSS
            row[WEIGHTS + mesh.gear], row[WEIGHTS + mesh.brake] = 1.0, -mesh.before
        return loss

    def limits(self) -> np.ndarray:
        """Return a new `cap` (7, m) for the kernel in which drag, free-wheels and gears are set and everything else is open."""
        cap = np.zeros((7, len(self.elements)))
        cap[algebra.VISC] = self.drag
        cap[algebra.HI0, self.one_way] = np.inf
        cap[algebra.HI1, self.one_way] = np.inf
        for gear in (*(mesh.gear for mesh in self.meshes), *self.variators):
            cap[[algebra.HI0, algebra.HI1], gear], cap[[algebra.LO0, algebra.LO1], gear] = np.inf, -np.inf
        return cap


def check_built(system: object) -> None:
    """Raise a RigError for anything but a built driveline; most likely it is the description itself."""
    if not isinstance(system, System):
        raise RigError(f"driveline: a {type(system).__name__} cannot be run; a description becomes a System by its build()")


def torque_refused(body: str, by: str) -> RigError:
    """Return the error for a torque on one of the bodies `System.balanced`; ``by`` is what puts it there."""
    return RigError(
        f"driveline: body '{body}' has no inertia and stands between shafts, so that no torque but theirs may act on it, "
        f"and {by} does; give it an inertia"
    )
