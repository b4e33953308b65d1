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

import numpy as np

from rig_nodes.base import RigError, atomic_write
from rig_nodes.driveline.assembly import Assembly
from rig_nodes.driveline.described import checks_arguments
from rig_nodes.driveline.description import Of, Points, Reading, Surface
from rig_nodes.driveline.laws import ANGLE, GEARING, INERTIA, MOTION, SPEED, TORQUE
from rig_nodes.driveline.picture import Body, Link, svg
from rig_nodes.driveline.tables import Table, table_of, value_at
from rig_nodes.driveline.ties import GROUND

_CRANK_POINTS = 3601
_ACTS = {TORQUE: "torque", MOTION: "motion", INERTIA: "varying inertia"}  # words in pictures


@checks_arguments
class Driveline(Assembly):
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

    def mesh(self, name: str, a: str, b: str, ratio: float, efficiency: float, back: float | None = None) -> None:
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
        efficiency : float
            Share of the power from a that reaches b, above 0 and at most 1.
        back : float, optional
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
        there, back = self._efficiencies(f"mesh '{name}'", a, b, efficiency, back)
        self._meshes[name] = a, b, float(ratio), there, back

    def planetary(
        self, name: str, sun: str, ring: str, carrier: str, ratio: float, efficiency: float | None = None, back: float | None = None
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
        efficiency : float, optional
            Share of the power from the sun that reaches the ring while the carrier stands, above 0 and at most 1.
        back : float, optional
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
            there, back = self._efficiencies(what, sun, ring, efficiency, back)
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
        soft = table is not None or backlash > 0.0 or bool(springs)
        if table is None:
            self._not_negative(f"stiffness of shaft '{name}'", stiffness)
            table = ([-1.0, 1.0], [-stiffness, stiffness])
        if soft:
            stiffness, damping = self._soft_shaft(name, table, damping, twist, backlash, springs)
        self._shafts[name] = (a, b, float(ca), float(cb), float(stiffness), float(damping), float(twist))

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
            "speed" or "angle", or two of these, "ratio", "input" and "time".
        of : str, optional
            Body whose speed or angle is used instead, or clutch or brake whose slip is used. Of two quantities one for each: of a
            ratio the two whose speeds are divided, of an input the name that it gets (0 without that input), of the time None.
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
            Body whose speed or angle is used, or element whose slip is used; of two quantities one for each, as that of a torque.
        table : pair of sequences of float, or (points (p,), points (r,), capacities (p, r))
            Speeds [rad/s] or angles [rad], and capacities [Nm]. A value below 0 counts as 0.
        by : str or (str, str)
            "speed" or "angle", or two quantities as those of a torque.
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
        bodies = {name: Body(name, j) for name, j in self._inertia.items()}
        links = [Link(a, b, "mesh", f"{ratio:.4g}") for a, b, ratio in self._gears]
        links += [
            Link(a, b, "mesh", f"{name}: {ratio:.4g}, efficiency {there:.3g}" + (f" and {back:.3g}" if back != there else ""))
            for name, (a, b, ratio, there, back) in self._meshes.items()
        ]
        for name, (sun, ring, carrier, ratio, there, back) in self._lossy_sets.items():
            losing = f"efficiency {there:.3g}" + (f" and {back:.3g}" if back != there else "")
            links += [Link(sun, ring, "set", f"{name} ({ratio:.3g})"), Link(sun, carrier, "set", f"{name}: {losing}")]
        links += [Link(a, b, "shaft", name) for name, (a, b, *_) in self._shafts.items()]
        links += [
            Link(a, b, "freewheel" if one_way else "clutch", name)
            for name, (a, b, _ca, _cb, _stick, _drag, one_way, *_) in self._elements.items()
        ]
        links += [Link(a, b, "mesh", f"{name}: from {ratio:.4g}") for name, (a, b, ratio) in self._variators.items()]
        related = [name for name, ties in self._ties.items() if any(ties is one for one in self._relations.values())]
        for name in related:
            first, *others = self._ties[name].items()
            links += [Link(first[0], other, "set", f"{name} ({c / first[1]:.3g})") for other, c in others]
        for name, (kind, pushes, *_) in self._acts.items():
            on = [body for body in pushes if body in bodies and kind != GEARING]
            if len(on) == 2:
                links.append(Link(on[0], on[1], "torque", name))
            for body in on if len(on) == 1 else ():
                bodies[body].notes.append(f"{name}: {_ACTS[kind]}")
        for link in links:
            if GROUND in (link.a, link.b):
                body = bodies[link.b if link.a == GROUND else link.a]
                if link.kind == "clutch":
                    body.brake = ", ".join(filter(None, (body.brake, link.text)))
                elif link.kind == "freewheel":
                    body.one_way.append((link.text, "not backwards" if link.a == GROUND else "not forwards"))
                else:
                    body.notes.append(f"{link.text}, to the ground")
        atomic_write(Path(file), svg(title, list(bodies.values()), [one for one in links if one.a in bodies and one.b in bodies]))
