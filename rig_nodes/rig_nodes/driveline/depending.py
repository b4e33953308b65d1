# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What depends on the motion itself in the description of a driveline: torques, capacities, motions, ratios, inertias, states.

Used by driveline/builder.py, whose `Driveline` has these methods.
"""

from __future__ import annotations

import math

import numpy as np

from rig_nodes.base import RigError
from rig_nodes.driveline.assembly import Assembly
from rig_nodes.driveline.described import checks_arguments
from rig_nodes.driveline.description import Of, Points, Reading, Surface
from rig_nodes.driveline.laws import ANGLE, GEARING, INERTIA, MOTION, SPEED, TORQUE
from rig_nodes.driveline.tables import Table, table_of, value_at
from rig_nodes.driveline.ties import GROUND

_CRANK_POINTS = 3601


@checks_arguments
class Depending(Assembly):
    """Methods that add what depends on the motion to a description."""

    def torque(
        self,
        name: str,
        a: str,
        b: str = GROUND,
        *,
        table: Points | Surface,
        by: str | tuple[str, str] = "speed",
        of: Of | tuple[Of | None, Of | None] | None = None,
        period: float | None = None,
        angle: float = 0.0,
    ) -> None:
        """Add a torque on a, with its opposite on b, that follows a table over the speed w_a - w_b or over its angle.

        An input with the name of the torque multiplies it; without that input the factor is 1. A table over two quantities is
        linear between the points of its grid; one of the two must be a speed or an angle.

        Parameters
        ----------
        name : str
            Name of the torque.
        a, b : str
            The bodies on which it acts; b is the ground by default.
        table : pair of sequences of float, or (points (p,), points (r,), torques (p, r))
            Speeds [rad/s] or angles [rad], and torques [Nm]; of two quantities the points of both and the torque at each pair.
            Beyond its ends the table is flat. In a table over an angle alone, one may be given twice where the torque jumps.
        by : str or (str, str)
            "speed", "angle" or "state", or two of these, "ratio", "input" and "time".
        of : str, optional
            Body whose speed or angle is used instead, clutch or brake whose slip is used, or the state. Of two quantities one for
            each: of a ratio the two whose speeds are divided, of an input the name that it gets (0 without that input), of the
            time None.
        period : float, optional
            Length after which the table repeats itself.
        angle : float
            Angle at the start [rad].

        Raises
        ------
        RigError
            When a name does not exist or is taken, or the table is not valid.
        """
        what, on = f"torque '{name}'", {a: 1.0, b: -1.0}
        self._known(what, a, b)
        follows = self._follows(what, table, by, of, on, period, angle)
        self._new_name(name)
        self._acts[name] = TORQUE, on, *follows

    def capacity(
        self,
        element: str,
        of: Of | tuple[Of | None, Of | None],
        *,
        table: Points | Surface,
        by: str | tuple[str, str] = "speed",
        period: float | None = None,
        angle: float = 0.0,
    ) -> None:
        """Let the capacity of a clutch or brake follow a table over a speed, an angle or another element's slip, or over two.

        The input of the clutch or brake then multiplies the table; without that input the factor is 1.

        Parameters
        ----------
        element : str
            The clutch or brake.
        of : str
            Body whose speed or angle is used, element whose slip is used, or the state; of two quantities one for each, as that
            of a torque.
        table : pair of sequences of float, or (points (p,), points (r,), capacities (p, r))
            Speeds [rad/s] or angles [rad], and capacities [Nm]. A value below 0 counts as 0.
        by : str or (str, str)
            "speed", "angle" or "state", or two quantities as those of a torque.
        period : float, optional
            Length after which the table repeats itself.
        angle : float
            Angle at the start [rad].

        Raises
        ------
        RigError
            When there is no such clutch or brake, its capacity follows a table already, or the table is not valid.
        """
        what = f"capacity of '{element}'"
        if element not in self._elements or self._elements[element][6]:
            raise RigError(f"driveline: {what}: there is no clutch or brake of that name")
        if element in self._capacities:
            raise RigError(f"driveline: {what} follows another table already; one is allowed")
        a, b, ca, cb, *_ = self._elements[element]
        self._capacities[element] = self._follows(what, table, by, of, {a: ca, b: -cb}, period, angle)

    def motion(self, name: str, body: str) -> None:
        """Prescribe the speed of a body by the input with the name of the motion.

        Without that input the speed stays at its initial value. The torque of the motion is computed and is a result. A speed that
        jumps is reached within a step. Of bodies that gears tie to each other only one can have a prescribed speed.

        Parameters
        ----------
        name : str
            Name of the motion and of its input [rad/s].
        body : str
            The body that moves.

        Raises
        ------
        RigError
            When the body does not exist or the name is taken.
        """
        self._new_name(name)
        self._turns(f"motion '{name}'", body)
        self._acts[name] = MOTION, {body: 1.0}, (Reading(SPEED, {body: 1.0}),), Table(np.zeros(1), np.zeros(1))

    def variator(
        self,
        name: str,
        a: str,
        b: str,
        ratio: float = 1.0,
        *,
        table: Points | None = None,
        of: str | None = None,
        period: float | None = None,
        angle: float = 0.0,
    ) -> None:
        """Add a rigid gear with w_a = r w_b whose ratio r varies: the input `name`, times a table over an angle if there is one.

        It takes no power at any ratio, beside shafts to second order in the step: the torque on b is -r times that on a. A ratio
        that jumps is reached within a step, with a torque as large as that takes.

        Parameters
        ----------
        name : str
            Name of the variator and of its input.
        a, b : str
            The bodies that it joins.
        ratio : float
            The value of the input where it is not given.
        table : pair of sequences of float, optional
            Angles [rad] and ratios, without jumps. Beyond its ends the table is flat.
        of : str, optional
            Body whose angle is used, or clutch or brake whose slip is; without it that of b.
        period : float, optional
            Angle after which the table repeats itself [rad].
        angle : float
            Angle at the start [rad].

        Raises
        ------
        RigError
            When a body does not exist or is the ground, the name is taken, or the table is not valid.
        """
        what = f"variator '{name}'"
        self._known(what, a, b)
        if GROUND in (a, b):
            raise RigError(f"driveline: {what} names the {GROUND}; two bodies that turn are needed")
        if not math.isfinite(ratio) or not math.isfinite(angle):
            raise RigError(f"driveline: ratio and angle of {what} are {ratio} and {angle}; finite numbers are needed")
        self._new_name(name)
        found = Table(np.zeros(1), np.ones(1)) if table is None else self._law_table(what, table, "angle", period)
        if np.any(np.diff(found.x) == 0.0):
            raise RigError(f"driveline: the table of {what} jumps; a ratio over an angle cannot")
        read = self._reading(what, "angle", of, {b: 1.0}, float(angle))
        self._variators[name] = a, b, float(ratio) * value_at(found, angle)
        self._acts[name] = GEARING, {b: 1.0}, (read,), found, float(ratio)

    def varying_inertia(self, name: str, body: str, *, table: Points, period: float | None = None, angle: float = 0.0) -> None:
        """Add an inertia on a body, beside its own, that follows a table over the angle of the body.

        Parameters
        ----------
        name : str
            Name of the inertia.
        body : str
            The body that carries it.
        table : pair of sequences of float
            Angles [rad] and inertias [kg m2] of at least 0, without jumps.
        period : float, optional
            Angle after which the table repeats itself [rad].
        angle : float
            Angle of the body at the start [rad].

        Raises
        ------
        RigError
            When the body does not exist, the name is taken or the table is not valid.
        """
        self._new_name(name)
        what = f"varying inertia '{name}'"
        self._turns(what, body)
        table = table_of(what, table, "flat", period)
        if np.any(np.diff(table.x) == 0.0):
            raise RigError(f"driveline: the table of {what} jumps; an inertia cannot")
        if table.y.min() < 0.0:
            raise RigError(f"driveline: the table of {what} falls to {table.y.min():g} kg m2; it must be at least 0")
        if not math.isfinite(angle):
            raise RigError(f"driveline: angle of {what} is {angle}; a finite number is needed")
        self._acts[name] = INERTIA, {body: 1.0}, (Reading(ANGLE, {body: 1.0}, start=float(angle)),), table

    def slider_crank(self, name: str, body: str, *, mass: float, radius: float, rod: float, angle: float = 0.0) -> None:
        """Add a slider that a body moves by a crank and a rod without mass.

        Parameters
        ----------
        name : str
            Name of the slider-crank.
        body : str
            The body that carries the crank.
        mass : float
            Mass of the slider [kg].
        radius : float
            Radius of the crank [m].
        rod : float
            Length of the rod [m], greater than the radius.
        angle : float
            Angle of the crank at the start [rad], 0 where the slider is farthest from the shaft.

        Raises
        ------
        RigError
            When the body does not exist, the name is taken or a number is out of its range.
        """
        what = f"slider-crank '{name}'"
        for of, number in (("mass", mass), ("radius", radius), ("rod", rod)):
            self._positive(f"{of} of {what}", number)
        if rod <= radius:
            raise RigError(f"driveline: rod of {what} is {rod:g} m, its radius {radius:g} m; the rod must be longer")
        at = np.linspace(0.0, 2.0 * math.pi, _CRANK_POINTS)
        across = radius * np.sin(at)
        moved = -across - across * radius * np.cos(at) / np.sqrt(rod**2 - across**2)
        self.varying_inertia(name, body, table=(at, mass * moved**2), period=2.0 * math.pi, angle=angle)

    def state(self, name: str, capacity: float, start: float = 0.0) -> None:
        """Add a state on which laws may depend, as a temperature: capacity times its rate is the sum of what flows into it.

        Flows are what `heat` names, torques by tables, an input with the name of the state, and shafts with a damping between
        states or to the "ground", at which the state is 0. A state is read by "state"; it has no part in the balance of energy.

        Parameters
        ----------
        name : str
            Name of the state.
        capacity : float
            What it holds per unit, as a thermal capacity [J/K].
        start : float
            Its value at the start, as a temperature [K].

        Raises
        ------
        RigError
            When the name is taken, the capacity is not above 0 or the start is not finite.
        """
        self._positive(f"capacity of state '{name}'", capacity)
        self._new_name(name)
        if not math.isfinite(start):
            raise RigError(f"driveline: state '{name}' starts at {start}; a finite number is needed")
        self._inertia[name], self._speed[name] = float(capacity), float(start)
        self._states.add(name)

    def heat(self, state: str, of: str, share: float = 1.0) -> None:
        """Let what an element loses flow into a state.

        Parameters
        ----------
        state : str
            The state.
        of : str
            A clutch, brake, free-wheel, shaft, mesh or set with losses, or a torque, whose power out of the bodies it is.
        share : float
            Share of the loss that the state gets.

        Raises
        ------
        RigError
            When there is no such state or element, or the share is not finite.
        """
        torques = (name for name, (kind, on, *_) in self._acts.items() if kind == TORQUE and self._states.isdisjoint(on))
        losing = (*self._elements, *self._shafts, *self._meshes, *self._lossy_sets, *torques)
        if state not in self._states or of not in losing:
            known, wanted = (self._states, f"state '{state}'") if state not in self._states else (losing, f"'{of}' that can lose")
            raise RigError(f"driveline: heat of '{of}': there is no {wanted}; there are: {', '.join(sorted(known)) or 'none'}")
        if not math.isfinite(share):
            raise RigError(f"driveline: share of '{of}' in state '{state}' is {share}; a finite number is needed")
        self._heats.append((state, of, float(share)))
