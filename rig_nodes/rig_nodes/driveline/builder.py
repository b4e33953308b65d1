# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""General driveline: inertias, rigid gears, planetary sets, shafts, clutches, brakes and free-wheels in any arrangement.

Describe it with `Driveline`, turn the description into arrays with `build`, and run it alone with driveline/run.py
or pass the arrays to driveline/kernel.py inside a larger kernel. The drive train of every rig is such a description.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from rig_nodes.base import RigError, atomic_write
from rig_nodes.driveline.depending import Depending
from rig_nodes.driveline.described import checks_arguments
from rig_nodes.driveline.description import Efficiency, Points
from rig_nodes.driveline.picture import svg
from rig_nodes.driveline.tables import table_of
from rig_nodes.driveline.ties import GROUND


@checks_arguments
class Driveline(Depending):
    """Description of a driveline: add the bodies first, then what joins them; `build` returns the arrays.

    The slip of a joint a-b, and the rate of a shaft's twist, is ca w_a - cb w_b; the coefficients are 1 by default. A positive
    torque of a joint slows a and drives b. All methods raise a RigError with one sentence when the description is wrong.
    """

    def inertia(self, name: str, j: float, speed: float | None = None) -> None:
        """Add a body.

        Parameters
        ----------
        name : str
            Name of the body.
        j : float
            Inertia [kg m2]. It may be 0 for a body that gears or relations tie to bodies with inertia, so that its speed follows
            from theirs, and for one on which only shafts act whose dampings are in the same proportion to their stiffnesses.
        speed : float, optional
            Initial speed [rad/s]. Without it the speed follows from the bodies that are tied to this one, or is 0.

        Raises
        ------
        RigError
            When the name is taken, the inertia is negative or the speed is not finite.
        """
        self._new_name(name)
        self._not_negative(f"inertia of '{name}'", j)
        if speed is not None and not math.isfinite(speed):
            raise RigError(f"driveline: initial speed of '{name}' is {speed}; a finite number is needed")
        self._inertia[name] = float(j)
        self._speed[name] = None if speed is None else float(speed)

    def gear(self, a: str, b: str, ratio: float, name: str | None = None) -> None:
        """Add a rigid gear with w_a = ratio w_b.

        Parameters
        ----------
        a, b : str
            The bodies that it joins.
        ratio : float
            Speed of a over speed of b; a negative ratio reverses the direction.
        name : str, optional
            Name of the gear. Without it the gear is called "a-b".

        Raises
        ------
        RigError
            When a body does not exist, the name is taken or the ratio is 0 or not finite.
        """
        self._known(f"gear {a}-{b}", a, b)
        if name is None:
            alike = sum({a, b} == {one, other} for one, other, _ in self._gears)
            name = f"{a}-{b}" if alike == 0 else f"{a}-{b}-{alike + 1}"
        self._new_name(name)
        if not math.isfinite(ratio) or ratio == 0.0:
            raise RigError(f"driveline: ratio of gear {a}-{b} is {ratio}; a finite number other than 0 is needed")
        self._gears.append((a, b, float(ratio)))
        self._ties[name] = {a: 1.0, b: -float(ratio)}

    def mesh(self, name: str, a: str, b: str, ratio: float, efficiency: Efficiency, back: Efficiency | None = None) -> None:
        """Add a gear w_a = ratio w_b whose teeth lose power.

        Its loss is the friction element "`name` loss". Both sides need inertia, either their own or that of bodies tied to them.

        Parameters
        ----------
        name : str
            Name of the mesh.
        a, b : str
            The bodies that it joins.
        ratio : float
            Speed of a over speed of b.
        efficiency : float, (speeds (p,), values (p,)) or (speeds (p,), torques (r,), values (p, r))
            Share of the power from a that reaches b, above 0 and at most 1; or a table of it over the size of the speed of a
            [rad/s], or over this and the size of the torque at a [Nm], linear between its points and flat beyond its ends.
        back : the same, optional
            Share of the power from b that reaches a; without it the same as `efficiency`. At 0 the mesh is at the limit of
            self-locking against b. Below 0 it locks itself with a margin, and may jam when b drives it while it turns: an impulse
            then stops it. 2 - 1 / efficiency means the same friction between the teeth in both directions.

        Raises
        ------
        RigError
            When a body does not exist or is the ground, the name is taken, or a number is out of its range.
        """
        self._new_name(name)
        self._known(f"mesh '{name}'", a, b)
        if GROUND in (a, b):
            raise RigError(f"driveline: mesh '{name}' names the {GROUND}; two bodies that turn are needed")
        if not math.isfinite(ratio) or ratio == 0.0:
            raise RigError(f"driveline: ratio of mesh '{name}' is {ratio}; a finite number other than 0 is needed")
        there, back = self._efficiencies(f"mesh '{name}'", name, a, b, efficiency, back)
        self._meshes[name] = a, b, float(ratio), there, back

    def planetary(
        self,
        name: str,
        sun: str,
        ring: str,
        carrier: str,
        ratio: float,
        efficiency: Efficiency | None = None,
        back: Efficiency | None = None,
    ) -> None:
        """Add a planetary set: w_sun + ratio w_ring = (1 + ratio) w_carrier (Willis).

        One of the three members may be the ground. The planets have no inertia of their own. With an efficiency its teeth lose
        power: the power through the teeth, in either direction, is the sun's torque times the speed of the sun relative to the
        carrier (Müller, Die Umlaufgetriebe, 1998). Its loss is then the friction element "`name` loss", and all members that turn
        need inertia, either their own or that of bodies tied to them.

        Parameters
        ----------
        name : str
            Name of the set.
        sun, ring, carrier : str
            The bodies of its three members.
        ratio : float
            Teeth of the ring over teeth of the sun, above 0.
        efficiency : float or table, optional
            Share of the power from the sun that reaches the ring while the carrier stands, above 0 and at most 1; or a table as
            that of a mesh, over speed and torque of the sun relative to the carrier.
        back : float or table, optional
            Share of the power from the ring that reaches the sun; without it the same as `efficiency`, below 0 as of a mesh.

        Raises
        ------
        RigError
            When a body does not exist, the name is taken or a number is out of its range.
        """
        what = f"planetary set '{name}'"
        self._positive(f"ratio of {what}", ratio)
        if efficiency is not None:
            self._new_name(name)
            if len({sun, ring, carrier}) < 3:
                raise RigError(f"driveline: {what} joins '{sun}', '{ring}' and '{carrier}'; three different bodies are needed")
            self._exist(what, sun, ring, carrier)
            there, back = self._efficiencies(what, name, sun, ring, efficiency, back)
            self._lossy_sets[name] = sun, ring, carrier, float(ratio), there, back
            return
        if back is not None:
            raise RigError(f"driveline: {what} has an efficiency back and none there; give both, or none of them")
        self._relate("planetary set", name, {sun: 1.0, ring: float(ratio), carrier: -1.0 - ratio}, 3)

    def relation(self, name: str, coefficients: Mapping[str, float]) -> None:
        """Add a linear relation between the speeds of two or more bodies.

        Parameters
        ----------
        name : str
            Name of the relation.
        coefficients : mapping of str to float
            Coefficient of each body. The sum of all coefficients times speeds is 0. The ground may be one of the bodies.

        Raises
        ------
        RigError
            When a body does not exist, there are fewer than two, the name is taken or a coefficient is 0 or not finite.
        """
        self._relate("relation", name, {body: float(c) for body, c in coefficients.items()}, 2)

    def shaft(
        self,
        name: str,
        a: str,
        b: str,
        ca: float = 1.0,
        cb: float = 1.0,
        *,
        stiffness: float | None = None,
        damping: float = 0.0,
        twist: float = 0.0,
        table: Points | None = None,
        backlash: float = 0.0,
        hysteresis: Sequence[tuple[float, float]] = (),
        friction: float = 0.0,
    ) -> None:
        """Add a compliant shaft: torque = stiffness * twist + damping * rate of the twist, with the rate ca w_a - cb w_b.

        The torque acts on a times ca and on b times cb.

        Parameters
        ----------
        name : str
            Name of the shaft.
        a, b : str
            The bodies that it joins.
        ca, cb : float
            Coefficients of the speeds of a and b.
        stiffness : float, optional
            Stiffness [Nm/rad]. Either this or `table` is needed.
        damping : float
            Damping [Nm s/rad].
        twist : float
            Twist at the start [rad].
        table : pair of sequences of float, optional
            Twists [rad] and torques [Nm] in place of a stiffness. Beyond its ends the table goes on in a straight line.
        backlash : float
            Angle from contact to contact [rad]. Its middle is at twist 0, and there is neither torque nor damping within it. A
            contact pushes and never pulls.
        hysteresis : sequence of (float, float)
            Springs in parallel with the shaft, each (stiffness [Nm/rad], torque [Nm]), each of which slides at its torque.
        friction : float
            Share of the torque of its stiffness or table with which the shaft rubs in itself, as stacked springs and belts do. This
            is the friction element "`name` friction".

        Raises
        ------
        RigError
            When a body does not exist, the name is taken, both or neither of stiffness and table are given, or a number is out of
            its range.
        """
        self._new_name(name)
        self._known(f"shaft '{name}'", a, b)
        self._coefficients(name, ca, cb)
        if (stiffness is None) == (table is None):
            raise RigError(f"driveline: shaft '{name}' needs a stiffness or a table, one of them")
        self._not_negative(f"damping of shaft '{name}'", damping)
        self._not_negative(f"backlash of shaft '{name}'", backlash)
        if not math.isfinite(twist):
            raise RigError(f"driveline: twist of shaft '{name}' is {twist}; a finite number is needed")
        springs = tuple((float(k), float(limit)) for k, limit in hysteresis)
        for k, limit in springs:
            self._positive(f"stiffness in the hysteresis of shaft '{name}'", k)
            self._positive(f"torque in the hysteresis of shaft '{name}'", limit)
        self._not_negative(f"friction of shaft '{name}'", friction)
        soft = table is not None or backlash > 0.0 or bool(springs)
        if not self._states.isdisjoint((a, b)) and (soft or stiffness or friction):
            raise RigError(f"driveline: shaft '{name}' joins states; it can have a damping only, with the stiffness 0")
        if table is None:
            self._not_negative(f"stiffness of shaft '{name}'", stiffness)
            table = ([-1.0, 1.0], [-stiffness, stiffness])
        if soft:
            stiffness, damping = self._soft_shaft(name, table, damping, twist, backlash, springs)
        self._shafts[name] = (a, b, float(ca), float(cb), float(stiffness), float(damping), float(twist))
        if friction > 0.0:
            self._rubbing(name, self._soft[name][0] if soft else table_of(name, table, "straight"), friction)

    def clutch(
        self,
        name: str,
        a: str,
        b: str,
        ca: float = 1.0,
        cb: float = 1.0,
        *,
        stick: float | tuple[float, float] = 1.0,
        drag: float = 0.0,
        friction: Points | None = None,
    ) -> None:
        """Add a friction clutch with slip = ca w_a - cb w_b.

        Its capacity (kinetic torque [Nm]) is an input of the run.

        Parameters
        ----------
        name : str
            Name of the clutch.
        a, b : str
            The bodies that it joins.
        ca, cb : float
            Coefficients of the speeds of a and b, for a clutch that sits on wheels geared to a and b.
        stick : float or (float, float)
            Break-away over kinetic torque, at least 1; for both directions or for (a ahead of b, b ahead of a).
        drag : float
            Drag on the slip [Nm s/rad], which acts at all times.
        friction : pair of sequences of float, optional
            Sizes of the slip [rad/s], from 0 on, and factors above 0 that multiply the capacity. The first factor is that at rest.

        Raises
        ------
        RigError
            When a body does not exist, the name is taken or a number is out of its range.
        """
        self._element(name, (a, b, ca, cb), stick, drag, False, friction)

    def brake(
        self, name: str, a: str, *, stick: float | tuple[float, float] = 1.0, drag: float = 0.0, friction: Points | None = None
    ) -> None:
        """Add a brake: a clutch between body a and the ground, whose slip is w_a; arguments and errors as those of `clutch`."""
        self._element(name, (a, GROUND, 1.0, 1.0), stick, drag, False, friction)

    def freewheel(self, name: str, a: str, b: str = GROUND, *, drag: float = 0.0) -> None:
        """Add a one-way clutch: a cannot turn faster than b, and the clutch overruns without torque while a is slower.

        Parameters
        ----------
        name : str
            Name of the free-wheel.
        a, b : str
            The bodies that it joins; b is the ground by default.
        drag : float
            Drag on the slip [Nm s/rad].

        Raises
        ------
        RigError
            When a body does not exist, the name is taken or the drag is negative.
        """
        self._element(name, (a, b, 1.0, 1.0), 1.0, drag, True)

    def draw(self, file: str | Path, title: str = "driveline") -> None:
        """Write the description as a picture (SVG) of the bodies, what joins them and what acts on them.

        Parameters
        ----------
        file : str or Path
            The file to write.
        title : str
            Text above the picture.

        Raises
        ------
        RigError
            When there is no body to draw or the file cannot be written.
        """
        if not self._inertia:
            raise RigError("driveline: there is no body to draw")
        atomic_write(Path(file), svg(title, *self._drawn()))
