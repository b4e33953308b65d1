# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""General driveline: inertias, rigid gears, planetary sets, shafts, clutches, brakes and free-wheels in any arrangement.

Describe it with `Driveline`, turn the description into arrays with `build`, and run it alone with driveline/run.py
or pass the arrays to driveline/kernel.py inside a larger kernel. The drive train of every rig is such a description.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.atomic_write import atomic_write
from rig_nodes.base.errors import RigError
from rig_nodes.driveline.described import checks_arguments
from rig_nodes.driveline.laws import CAPACITY, FRICTION, INERTIA, MOTION, SHAFT, TORQUE, Law
from rig_nodes.driveline.motions import locks_itself, rank
from rig_nodes.driveline.picture import Body, Link, svg
from rig_nodes.driveline.system import LEAST_LOSS, Mesh, System
from rig_nodes.driveline.tables import Table, table_of, value_at
from rig_nodes.driveline.ties import GROUND, bodies_from_speeds, move_nothing, start_speeds

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base.arrays import Floats

_MAX_ELEMENTS = 50
_CRANK_POINTS = 3601
_ACTS = {TORQUE: "torque", MOTION: "motion", INERTIA: "varying inertia"}  # words in pictures

Points = tuple[Sequence[float], Sequence[float]]


@checks_arguments
class Driveline:
    """Description of a driveline: add the bodies first, then what joins them; `build` returns the arrays.

    The slip of a joint a-b, and the rate of a shaft's twist, is ca w_a - cb w_b; the coefficients are 1 by default. A positive
    torque of a joint slows a and drives b. All methods raise a RigError with one sentence when the description is wrong.
    """

    def __init__(self) -> None:
        self._inertia: dict[str, float] = {}
        self._speed: dict[str, float | None] = {}
        self._gears: list[tuple[str, str, float]] = []
        self._relations: dict[str, dict[str, float]] = {}  # coefficients by the name that messages use
        self._ties: dict[str, dict[str, float]] = {}  # coefficients of gears, sets and relations by name
        self._shafts: dict[str, tuple] = {}
        self._elements: dict[str, tuple] = {}
        self._meshes: dict[str, tuple[str, str, float, float, float]] = {}
        self._lossy_sets: dict[str, tuple[str, str, str, float, float, float]] = {}
        self._soft: dict[str, tuple] = {}  # characteristics of shafts that are not straight lines
        self._friction: dict[str, Table] = {}
        self._capacities: dict[str, tuple] = {}
        self._acts: dict[str, tuple] = {}  # torques, motions and inertias that follow the motion itself

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
        if table is None:
            self._not_negative(f"stiffness of shaft '{name}'", stiffness)
            table = ([-1.0, 1.0], [-stiffness, stiffness])
            soft = backlash > 0.0 or bool(springs)
        else:
            soft = True
        if soft:
            table = table_of(f"shaft '{name}'", table, "straight")
            if len(table.x) < 2 or np.any(np.diff(table.y) < 0.0) or np.any(np.diff(table.x) == 0.0):
                raise RigError(
                    f"driveline: the table of shaft '{name}' needs two points or more, twists rising, torques not falling"
                )
            if backlash > 0.0:
                if abs(value_at(table, 0.0)) > 0.0:
                    raise RigError(
                        f"driveline: the table of shaft '{name}' has {value_at(table, 0.0):g} Nm at twist 0; "
                        "with backlash it must be 0 there"
                    )
                table = _apart(table, 0.5 * backlash)
            stiffness = (value_at(table, twist + 1e-9) - value_at(table, twist - 1e-9)) / 2e-9 + sum(k for k, _ in springs)
            if abs(twist) < 0.5 * backlash:
                damping, damped = 0.0, damping
            else:
                damped = damping
            self._soft[name] = table, 0.5 * backlash, float(damped), springs
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
        self._element(name, a, b, ca, cb, stick, drag, False, friction)

    def brake(
        self, name: str, a: str, *, stick: float | tuple[float, float] = 1.0, drag: float = 0.0, friction: Points | None = None
    ) -> None:
        """Add a brake: a clutch between body a and the ground, whose slip is w_a; arguments and errors as those of `clutch`."""
        self._element(name, a, GROUND, 1.0, 1.0, stick, drag, False, friction)

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
        self._element(name, a, b, 1.0, 1.0, 1.0, drag, True)

    def torque(
        self,
        name: str,
        a: str,
        b: str = GROUND,
        *,
        table: Points,
        by: str = "speed",
        of: str | None = None,
        period: float | None = None,
        angle: float = 0.0,
    ) -> None:
        """Add a torque on a, with its opposite on b, that follows a table over the speed w_a - w_b or over its angle.

        An input with the name of the torque multiplies it; without that input the factor is 1.

        Parameters
        ----------
        name : str
            Name of the torque.
        a, b : str
            The bodies on which it acts; b is the ground by default.
        table : pair of sequences of float
            Speeds [rad/s] or angles [rad], and torques [Nm]. Beyond its ends the table is flat. An angle may be given twice where
            the torque jumps.
        by : str
            "speed" or "angle".
        of : str, optional
            Body whose speed or angle is used instead, or clutch or brake whose slip is used.
        period : float, optional
            Length after which the table repeats itself.
        angle : float
            Angle at the start [rad].

        Raises
        ------
        RigError
            When a name does not exist or is taken, or the table is not valid.
        """
        self._new_name(name)
        what = f"torque '{name}'"
        self._known(what, a, b)
        table = self._law_table(what, table, by, period)
        self._acts[name] = (
            TORQUE,
            {a: 1.0, b: -1.0},
            {a: 1.0, b: -1.0} if of is None else self._read_by(what, of),
            by,
            table,
            float(angle),
        )

    def capacity(
        self, element: str, of: str, *, table: Points, by: str = "speed", period: float | None = None, angle: float = 0.0
    ) -> None:
        """Let the capacity of a clutch or brake follow a table over a speed, an angle or another element's slip.

        The input of the clutch or brake then multiplies the table; without that input the factor is 1.

        Parameters
        ----------
        element : str
            The clutch or brake.
        of : str
            Body whose speed or angle is used, or element whose slip is used.
        table : pair of sequences of float
            Speeds [rad/s] or angles [rad], and capacities [Nm]. A value below 0 counts as 0.
        by : str
            "speed" or "angle".
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
        self._capacities[element] = self._read_by(what, of), by, self._law_table(what, table, by, period), float(angle)

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
        self._acts[name] = MOTION, {body: 1.0}, {body: 1.0}, "speed", Table(np.zeros(1), np.zeros(1)), 0.0

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
        self._acts[name] = INERTIA, {body: 1.0}, {body: 1.0}, "angle", table, float(angle)

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
        related = [name for name, ties in self._ties.items() if any(ties is one for one in self._relations.values())]
        for name in related:
            first, *others = self._ties[name].items()
            links += [Link(first[0], other, "set", f"{name} ({c / first[1]:.3g})") for other, c in others]
        for name, (kind, pushes, *_) in self._acts.items():
            on = [body for body in pushes if body in bodies]
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

    def build(self) -> System:
        """Eliminate the gears and relations and return the arrays.

        Returns
        -------
        System
            The driveline as arrays.

        Raises
        ------
        RigError
            When the description contradicts itself or has no body with inertia.
        """
        bodies = tuple(self._inertia)
        inertia = np.array([self._inertia[name] for name in bodies])
        if not inertia.any():
            raise RigError("driveline: no body with inertia; at least one is needed")
        elements, rows = self._elements | self._mesh_elements(), self._mesh_rows()
        if len(elements) > _MAX_ELEMENTS:
            raise RigError(
                f"driveline: {len(elements)} friction elements, two for each mesh or set with losses; at most {_MAX_ELEMENTS} work"
            )
        prescribed = [next(iter(on)) for kind, on, *_ in self._acts.values() if kind == MOTION]
        balances, balanced = self._balances(bodies)
        relations = self._relations | balances
        speeds, t = bodies_from_speeds(self._inertia, self._gears, relations, prescribed)
        heavy = inertia > 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            mass = t[heavy].T @ (inertia[heavy, None] * t[heavy])
        if not np.isfinite(mass).all():
            raise RigError(
                "driveline: reduced by the ratios, an inertia is no finite number; inertias and ratios nearer to 1 are needed"
            )
        row = {name: t[i] for i, name in enumerate(bodies)}
        row[GROUND] = np.zeros(len(speeds))
        w = np.zeros((len(elements), len(speeds)))
        for f, (name, (a, b, ca, cb, *_)) in enumerate(elements.items()):
            joint = rows.get(name)
            w[f] = ca * row[a] - cb * row[b] if joint is None else sum(c * row[body] for body, c in joint.items())
            self._moves(name, w[f])
        sh = np.zeros((len(self._shafts), len(speeds)))
        for i, (name, (a, b, ca, cb, *_)) in enumerate(self._shafts.items()):
            sh[i] = ca * row[a] - cb * row[b]
            self._moves(name, sh[i])
        given = {name: speed for name, speed in self._speed.items() if speed is not None}
        v_start = self._start(given, bodies, speeds, t, relations)
        e = list(elements.values())
        one_way = np.array([x[6] for x in e], dtype=bool)
        for f, name in enumerate(elements):
            if one_way[f] and w[f] @ v_start > 1e-9 * (1.0 + np.abs(v_start).max()):
                raise RigError(
                    f"driveline: free-wheel '{name}' starts with its driving side faster by "
                    f"{w[f] @ v_start:g} rad/s; give initial speeds with a at most as fast as b"
                )
        k = list(self._shafts.values())
        return System(
            bodies,
            tuple(elements),
            tuple(self._shafts),
            speeds,
            inertia,
            t,
            mass,
            np.ascontiguousarray(np.linalg.inv(mass)),
            w,
            sh,
            np.array([[x[4] for x in k], [x[5] for x in k]], dtype=float).reshape(2, len(k)),
            np.array([x[4] for x in e], dtype=float).reshape(len(e), 2).T,
            np.array([x[5] for x in e], dtype=float),
            one_way,
            v_start,
            np.array([x[6] for x in k], dtype=float),
            _rows(bodies, (rows.get(name, {a: ca, b: -cb}) for name, (a, b, ca, cb, *_) in elements.items())),
            _rows(bodies, ({a: ca, b: -cb} for a, b, ca, cb, *_ in k)),
            tuple(self._ties),
            _rows(bodies, self._ties.values()),
            tuple(self._mesh_of(name, tuple(elements)) for name in (*self._meshes, *self._lossy_sets)),
            *self._laws_of(bodies, speeds, t, w, sh, v_start),
            balanced,
        )

    def _balances(self, bodies: tuple[str, ...]) -> tuple[dict[str, dict[str, float]], tuple[str, ...]]:
        """Return the relations for bodies without inertia between shafts, and these bodies with those that gears tie to them.

        At such a body the torques of its shafts, k (x + b dx/dt) with the same b for all, balance at all times. So the rates of
        their twists, each times its stiffness, balance too, which is a relation between speeds. The torques stay in balance if
        they are so at the start. Where no shaft has a stiffness, the rates are multiplied by the dampings instead.
        """
        found = move_nothing(self._inertia, self._gears, self._relations)
        balances, balanced = {}, np.zeros(len(bodies), bool)
        if not found:
            return balances, ()
        elements, rows, shafts = self._elements | self._mesh_elements(), self._mesh_rows(), self._shafts
        acting = {name: rows.get(name, {a: ca, b: -cb}) for name, (a, b, ca, cb, *_) in elements.items()}
        acting |= {name: on for name, (_, on, *_) in self._acts.items()}
        acting |= {name: {a: ca, b: -cb} for name, (a, b, ca, cb, *_) in shafts.items() if name in self._soft}
        twisting = _rows(bodies, ({a: ca, b: -cb} for a, b, ca, cb, *_ in shafts.values()))
        values = np.array([shaft[4:7] for shaft in shafts.values()], float).reshape(-1, 3)
        for name, moves in found.items():
            for one, row in zip(acting, _rows(bodies, acting.values()) @ moves):
                if abs(row) > 1e-12:
                    raise RigError(
                        f"driveline: body '{name}' has no inertia, and '{one}' acts on it; without inertia it may have straight "
                        "shafts only: give it one; a billionth of its neighbours' acts as none"
                    )
            share = twisting @ moves
            on = np.abs(share) > 1e-12
            if on.sum() < 2 or not values[on, :2].any():
                continue
            stiffness, damping, twist = values[on].T
            weights = stiffness if stiffness.any() else damping
            if np.abs(damping * weights.max() - damping[np.argmax(weights)] * weights).max() > 1e-9 * weights.max() * damping.max():
                raise RigError(
                    f"driveline: body '{name}' has no inertia, and the damping of its shafts is not in the same proportion to "
                    "their stiffness; make it so, or give the body an inertia; a billionth of its neighbours' acts as none"
                )
            torques = share[on] * stiffness * twist
            if abs(torques.sum()) > 1e-9 * np.abs(torques).max():
                raise RigError(
                    f"driveline: at the start the twists of its shafts put {-torques.sum():g} Nm on body '{name}', which has no "
                    "inertia; give twists whose torques balance"
                )
            row = (share[on] * weights) @ twisting[on]
            balances[f"the balance of torques at '{name}'"] = {body: c for body, c in zip(bodies, row) if c != 0.0}
            balanced |= moves != 0.0
        return balances, tuple(body for body, one in zip(bodies, balanced) if one)

    def _mesh_rows(self) -> dict[str, dict[str, float]]:
        """Return the coefficients of the two friction elements of each mesh and planetary set with losses, by name.

        One is a clutch that never slips. The other one brakes the output side of power from a, which is b or the ring; its slip is
        scaled to the speed of a or the sun, so that its torque is that at a. In a set all speeds are relative to the carrier.
        """
        out = {}
        for name, (a, b, ratio, *_) in self._meshes.items():
            out[name], out[f"{name} loss"] = {a: 1.0, b: -ratio}, {b: ratio}
        for name, (sun, ring, carrier, ratio, *_) in self._lossy_sets.items():
            out[name], out[f"{name} loss"] = {sun: 1.0, ring: ratio, carrier: -1.0 - ratio}, {ring: -ratio, carrier: ratio}
        return out

    def _mesh_elements(self) -> dict[str, tuple[str, str, float, float, tuple[float, float], float, bool]]:
        """Return the two friction elements of each mesh and set with losses, by name; `_mesh_rows` has their coefficients."""
        return {name: (next(iter(row)), GROUND, 1.0, 1.0, (1.0, 1.0), 0.0, False) for name, row in self._mesh_rows().items()}

    def _mesh_of(self, name: str, elements: tuple[str, ...]) -> Mesh:
        """Return the mesh with the coefficients of its loss.

        Of a power x from a, (1 - efficiency) x is lost, and of a power x from b, (1 - back) x. With a torque t into the mesh at a,
        and t - loss out of it, both losses are `share` times |t - before * loss|, because t is greater than before * loss where a
        drives and smaller where b drives.
        """
        there, back = (self._meshes.get(name) or self._lossy_sets[name])[-2:]
        ahead, behind = _losses(there, back)
        before = (behind - ahead * (1.0 - behind)) / (2.0 * ahead * behind)
        return Mesh(name, elements.index(name), elements.index(f"{name} loss"), ahead / (1.0 - before * ahead), before)

    def _start(
        self,
        given: Mapping[str, float],
        bodies: tuple[str, ...],
        speeds: tuple[str, ...],
        t: Floats,
        relations: Mapping[str, Mapping[str, float]],
    ) -> Floats:
        if not self._meshes and not self._lossy_sets:
            return start_speeds(given, bodies, t)
        rows = self._mesh_rows()
        meshes = {f"mesh '{name}'": rows[name] for name in self._meshes}
        meshes |= {f"planetary set '{name}'": rows[name] for name in self._lossy_sets}
        _, tied = bodies_from_speeds(self._inertia, self._gears, {**relations, **meshes})
        at_start = dict(zip(bodies, tied @ start_speeds(given, bodies, tied)))
        return np.array([at_start[name] for name in speeds])

    def _laws_of(
        self, bodies: tuple[str, ...], speeds: tuple[str, ...], t: Floats, w: Floats, sh: Floats, v_start: Floats
    ) -> tuple[tuple[Law, ...], Floats, dict[str, float]]:
        """Return the laws, the rows of the shafts and of the laws that need one, and the inputs of the laws with their defaults."""
        laws, slots, factors = [], list(sh), {}
        nothing = np.zeros(len(bodies))
        elements, shafts = list(self._elements), list(self._shafts)
        for name, (reads, by, table, angle) in self._capacities.items():
            of = _rows(bodies, [reads])[0] @ t
            f = elements.index(name)
            laws.append(Law(name, CAPACITY, by == "angle", of, 0.0 * of, nothing, table, element=f, start=angle))
        for name, table in self._friction.items():
            f = elements.index(name)
            laws.append(Law(name, FRICTION, False, w[f], 0.0 * w[f], nothing, table, element=f))
        for name, (table, gap, damping, springs) in self._soft.items():
            i = shafts.index(name)
            laws.append(
                Law(
                    name,
                    SHAFT,
                    True,
                    sh[i],
                    0.0 * sh[i],
                    nothing,
                    table,
                    slot=i,
                    start=self._shafts[name][6],
                    gap=gap,
                    damping=damping,
                    springs=springs,
                )
            )
        for name, (kind, on, of, by, table, angle) in self._acts.items():
            acts = _rows(bodies, [on])[0]
            on, of = acts @ t, _rows(bodies, [of])[0] @ t
            self._moves(name, on)
            slot = factor = -1
            if kind == TORQUE and np.array_equal(on, of):
                slot = len(slots)
                slots.append(on)
            if kind in (TORQUE, MOTION):
                factor = len(factors)
                factors[name] = 1.0 if kind == TORQUE else float(on @ v_start)
            laws.append(Law(name, kind, by == "angle", of, on, acts, table, slot, -1, factor, angle))
        held = np.array([law.on for law in laws if law.kind == MOTION]).reshape(-1, len(speeds))
        if rank(held) < len(held):
            raise RigError("driveline: motions prescribe the speeds of bodies that gears or relations tie together; one is enough")
        if len(held):
            self._left_free(held.any(axis=0), w)
        return tuple(sorted(laws, key=lambda law: law.kind)), np.array(slots).reshape(-1, len(speeds)), factors

    def _left_free(self, held: npt.NDArray[np.bool_], w: Floats) -> None:
        """Raise a RigError for elements that could hold the prescribed speeds `held` (n,); `w` (m, n) are the slips."""
        elements = self._elements | self._mesh_elements()
        rigid = [f for f, (name, one) in enumerate(elements.items()) if one[6] or name in self._meshes or name in self._lossy_sets]
        if rank(w[np.ix_(rigid, ~held)]) < rank(w[rigid]):
            names = ", ".join(f"'{list(elements)[f]}'" for f in rigid)
            raise RigError(
                f"driveline: motions prescribe speeds that the meshes and free-wheels ({names}) can hold against them; "
                "leave out one of those that do"
            )
        joints = []
        for name, (*_, there, back) in (self._meshes | self._lossy_sets).items():
            gear, loss = (w[list(elements).index(one)] for one in (name, f"{name} loss"))
            joints.append((gear, loss, *_losses(there, back)))
        others = [f for f in rigid if list(elements.values())[f][6]]
        if joints and locks_itself(joints, w[others], held):
            names = ", ".join(f"'{name}'" for name in (*self._meshes, *self._lossy_sets))
            raise RigError(
                f"driveline: motions prescribe speeds that meshes ({names}) can hold by their losses, because they lock "
                "themselves; leave out a motion, or raise an efficiency until power gets through"
            )

    def _new_name(self, name: str) -> None:
        if name == GROUND or any(
            name in parts for parts in (self._inertia, self._shafts, self._elements, self._ties, self._acts, self._mesh_elements())
        ):
            raise RigError(f"driveline: the name '{name}' is already taken; every part needs its own")

    def _exist(self, where: str, *names: str) -> None:
        for name in names:
            if (name != GROUND and name not in self._inertia) or (name == GROUND and where.startswith("gear")):
                known = ", ".join(self._inertia) or "none"
                raise RigError(f"driveline: {where} names the body '{name}', which does not exist; bodies are: {known}")

    def _read_by(self, what: str, of: str) -> dict[str, float]:
        """Return the bodies whose speeds a law reads, with coefficients: one body, or the two bodies of an element's slip."""
        if of in self._elements:
            a, b, ca, cb, *_ = self._elements[of]
            return {a: ca, b: -cb}
        self._exist(what, of)
        return {of: 1.0}

    def _known(self, where: str, *names: str) -> None:
        self._exist(where, *names)
        if names[0] == names[1]:
            raise RigError(f"driveline: {where} joins '{names[0]}' with itself; two bodies are needed")

    def _turns(self, what: str, body: str) -> None:
        self._exist(what, body)
        if body == GROUND:
            raise RigError(f"driveline: {what} names the {GROUND}, which stands still; a body that turns is needed")

    @staticmethod
    def _positive(what: str, value: float) -> None:
        if not (math.isfinite(value) and value > 0.0):
            raise RigError(f"driveline: {what} is {value}; a finite number above 0 is needed")

    @staticmethod
    def _not_negative(what: str, value: float) -> None:
        if not (math.isfinite(value) and value >= 0.0):
            raise RigError(f"driveline: {what} is {value}; a finite number of at least 0 is needed")

    @staticmethod
    def _moves(name: str, row: Floats) -> None:
        if not np.any(np.abs(row) > 1e-12):
            raise RigError(f"driveline: '{name}' joins bodies that gears or relations already tie together; its slip is always 0")

    @staticmethod
    def _efficiencies(what: str, a: str, b: str, efficiency: float, back: float | None) -> tuple[float, float]:
        """Return the shares of the power that arrive from a at b, and from b at a."""
        back = efficiency if back is None else back
        if not 0.0 < efficiency <= 1.0:
            raise RigError(f"driveline: efficiency of {what} is {efficiency}; a number above 0, at most 1, is needed")
        if not (math.isfinite(back) and back <= 1.0):
            raise RigError(f"driveline: efficiency of {what} from {b} back to {a} is {back}; at most 1 is possible")
        return float(efficiency), float(back)

    def _relate(self, kind: str, name: str, coefficients: dict[str, float], least: int) -> None:
        self._new_name(name)
        what = f"{kind} '{name}'"
        if len(coefficients) < least:
            raise RigError(
                f"driveline: {what} joins {' and '.join(map(repr, coefficients)) or 'nothing'}; "
                f"{'two' if least == 2 else 'three'} different bodies are needed"
            )
        self._exist(what, *coefficients)
        for body, c in coefficients.items():
            if not math.isfinite(c) or c == 0.0:
                raise RigError(f"driveline: coefficient of '{body}' in {what} is {c}; a finite number other than 0 is needed")
        self._relations[what] = self._ties[name] = coefficients

    def _element(
        self,
        name: str,
        a: str,
        b: str,
        ca: float,
        cb: float,
        stick: float | tuple[float, float],
        drag: float,
        one_way: bool,
        friction: Points | None = None,
    ) -> None:
        self._new_name(name)
        self._known(f"'{name}'", a, b)
        both = stick if isinstance(stick, tuple) else (stick, stick)
        if len(both) != 2 or not all(math.isfinite(one) and one >= 1.0 for one in both):
            raise RigError(
                f"driveline: stick ratio of '{name}' is {stick}; "
                "a finite number of at least 1 is needed, or two for the two directions"
            )
        self._coefficients(name, ca, cb)
        self._not_negative(f"drag of '{name}'", drag)
        if friction is not None:
            table = table_of(f"friction of '{name}'", friction)
            if table.x[0] != 0.0 or table.y.min() <= 0.0 or np.any(np.diff(table.x) == 0.0):
                raise RigError(f"driveline: the table of friction of '{name}' needs slips that rise from 0 and factors above 0")
            self._friction[name] = table
        self._elements[name] = (a, b, float(ca), float(cb), tuple(map(float, both)), float(drag), one_way)

    @staticmethod
    def _coefficients(name: str, ca: float, cb: float) -> None:
        if not (math.isfinite(ca) and math.isfinite(cb) and ca != 0.0 and cb != 0.0):
            raise RigError(f"driveline: coefficients of '{name}' are {ca} and {cb}; finite numbers other than 0 are needed")

    @staticmethod
    def _law_table(what: str, table: Points, by: str, period: float | None) -> Table:
        if by not in ("speed", "angle"):
            raise RigError(f"driveline: {what} is by '{by}'; by speed and by angle are possible")
        if period is not None and by == "speed":
            raise RigError(f"driveline: {what} has a period and is by speed; only a table over an angle repeats")
        found = table_of(what, table, "flat", period)
        if by == "speed" and np.any(np.diff(found.x) == 0.0):
            at = found.x[1:][np.diff(found.x) == 0.0][0]
            raise RigError(
                f"driveline: the table of {what} jumps at {at:g} rad/s; over a speed it cannot: give two speeds "
                "between which it changes, or use a clutch where it is friction"
            )
        return found


def _losses(there: float, back: float) -> tuple[float, float]:
    """Return the shares of power that a mesh loses in its two directions, from its efficiencies."""
    return max(1.0 - there, LEAST_LOSS), max(1.0 - back, LEAST_LOSS)


def _apart(table: Table, gap: float) -> Table:
    """Split a table that goes through 0 at 0 there, and move each half outwards by `gap`."""
    left, right = table.x < 0.0, table.x > 0.0
    return Table(
        np.concatenate([table.x[left] - gap, [-gap, gap], table.x[right] + gap]),
        np.concatenate([table.y[left], [0.0, 0.0], table.y[right]]),
        table.beyond,
    )


def _rows(bodies: tuple[str, ...], joints: Iterable[Mapping[str, float]]) -> Floats:
    """Return the coefficients (joints, bodies) of joints, each of which maps bodies to coefficients."""
    joints = list(joints)
    out = np.zeros((len(joints), len(bodies)))
    for row, joint in zip(out, joints):
        for body, c in joint.items():
            if body != GROUND:
                row[bodies.index(body)] += c
    return out
