# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a description of a driveline has collected, and the checks of each thing that is added to it.

Used by driveline/assembly.py, which makes arrays of it, and so by driveline/builder.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from rig_nodes.base import RigError, brief
from rig_nodes.driveline.described import is_number
from rig_nodes.driveline.laws import ANGLE, GEARING, INERTIA, INPUT, MOTION, RATIO, SPEED, TIME, TORQUE
from rig_nodes.driveline.losses import LEAST_LOSS
from rig_nodes.driveline.picture import Body, Link
from rig_nodes.driveline.tables import Grid, Table, grid_of, table_of, value_at
from rig_nodes.driveline.ties import GROUND

if TYPE_CHECKING:
    from rig_nodes.base import Floats

Points = tuple[Sequence[float], Sequence[float]]
Surface = tuple[Sequence[float], Sequence[float], Sequence[Sequence[float]] | np.ndarray]
Of = str | tuple[str, str]  # a body, an element or an input, or two of these for the ratio of their speeds
Efficiency = float | Points | Surface
READS = {"speed": SPEED, "angle": ANGLE, "ratio": RATIO, "input": INPUT, "time": TIME, "state": SPEED}
_ACTS = {TORQUE: "torque", MOTION: "motion", INERTIA: "varying inertia"}  # words in pictures


class Reading(NamedTuple):
    """One argument of a law: its kind (driveline.laws), bodies with coefficients, those of a ratio's second speed, its input."""

    by: int
    of: dict[str, float]
    under: Mapping[str, float] = MappingProxyType({})
    given: str = ""
    start: float = 0.0


class Description:
    """Bodies and what joins them, by name; :class:`driveline.builder.Driveline` adds them."""

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
        self._variators: dict[str, tuple[str, str, float]] = {}  # gears whose ratio varies: bodies, and ratio at the start
        self._teeth: dict[str, tuple[Grid, float]] = {}  # meshes and sets whose efficiency is a table, with its least torque
        self._states: set[str] = set()  # bodies that are states
        self._heats: list[tuple[str, str, float]] = []  # states, what loses power, share that the state gets
        self._arguments: dict[str, str] = {}  # inputs that laws read, with the first law of each

    def _new_name(self, name: str) -> None:
        if name == GROUND or any(
            name in parts
            for parts in (
                *(self._inertia, self._shafts, self._elements, self._ties, self._acts, self._mesh_elements()),
                self._arguments,
            )
        ):
            raise RigError(f"driveline: the name '{name}' is already taken; every part needs its own")

    def _exist(self, where: str, *names: str, read: bool = False) -> None:
        for name in names:
            if (name != GROUND and name not in self._inertia) or (name == GROUND and where.startswith("gear")):
                known = ", ".join(self._inertia) or "none"
                raise RigError(f"driveline: {where} names the body '{name}', which does not exist; bodies are: {known}")
        flows = read or (where.startswith(("shaft", "torque")) and self._states.issuperset({*names} - {GROUND}))
        if not flows and not self._states.isdisjoint(names):
            name = next(name for name in names if name in self._states)
            raise RigError(
                f"driveline: {where} names the state '{name}', which is no body; it takes torques and shafts that join no bodies"
            )

    def _read_by(self, what: str, of: str) -> dict[str, float]:
        """Return the bodies whose speeds a law reads, with coefficients: one body or state, or both bodies of an element's slip."""
        if of in self._elements:
            a, b, ca, cb, *_ = self._elements[of]
            return {a: ca, b: -cb}
        self._exist(what, of, read=True)
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

    def _efficiencies(
        self, what: str, name: str, a: str, b: str, efficiency: Efficiency, back: Efficiency | None
    ) -> tuple[float, float]:
        """Return the shares of the power that arrive from a at b, and from b at a; of tables those at rest."""
        back = efficiency if back is None else back
        if not (is_number(efficiency) and is_number(back)):
            tables = [_efficiency_table(f"efficiency of {what}", one) for one in (efficiency, back)]
            for table in tables:
                for one in table[2].flat:
                    self._efficiencies(what, name, a, b, *((one, one) if table is tables[0] else (1.0, one)))
            self._teeth[name] = found = _both_ways(what, *tables)
            grid, least = found
            there, back = (value_at(grid.curves[round(value_at(grid.rows, one))], 0.0) for one in (least, -least))
            return there, back
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

    def _soft_shaft(
        self, name: str, table: Points, damping: float, twist: float, backlash: float, springs: tuple
    ) -> tuple[float, float]:
        """Add the characteristic of a shaft that is no straight line, and return its stiffness and damping at the start."""
        found = table_of(f"shaft '{name}'", table, "straight")
        if len(found.x) < 2 or np.any(np.diff(found.y) < 0.0) or np.any(np.diff(found.x) == 0.0):
            raise RigError(f"driveline: the table of shaft '{name}' needs two points or more, twists rising, torques not falling")
        if backlash > 0.0:
            if abs(value_at(found, 0.0)) > 0.0:
                raise RigError(
                    f"driveline: the table of shaft '{name}' has {value_at(found, 0.0):g} Nm at twist 0; "
                    "with backlash it must be 0 there"
                )
            found = _apart(found, 0.5 * backlash)
        self._soft[name] = found, 0.5 * backlash, float(damping), springs
        stiffness = (value_at(found, twist + 1e-9) - value_at(found, twist - 1e-9)) / 2e-9 + sum(k for k, _ in springs)
        return stiffness, 0.0 if abs(twist) < 0.5 * backlash else damping

    def _rubbing(self, shaft: str, table: Table, share: float) -> None:
        """Add the friction of a shaft, whose capacity is a share of the size of its torque over the twist."""
        a, b, ca, cb, *_, twist = self._shafts[shaft]
        rubbing = f"{shaft} friction"
        self._element(rubbing, (a, b, ca, cb), 1.0, 0.0, False)
        x, y = table.x, table.y
        turns = np.flatnonzero(y[:-1] * y[1:] < 0.0)
        zeros = x[turns] - y[turns] * (x[turns + 1] - x[turns]) / (y[turns + 1] - y[turns])
        size = Table(np.insert(x, turns + 1, zeros), share * np.abs(np.insert(y, turns + 1, 0.0)), table.beyond)
        self._capacities[rubbing] = (Reading(ANGLE, {a: ca, b: -cb}, start=twist),), size

    def _element(
        self,
        name: str,
        joint: tuple[str, str, float, float],
        stick: float | tuple[float, float],
        drag: float,
        one_way: bool,
        friction: Points | None = None,
    ) -> None:
        a, b, ca, cb = joint
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

    def _reading(self, what: str, by: str, of: Of | None, own: dict[str, float], angle: float) -> Reading:
        """Return one argument of a law; `own` are the bodies that it reads without `of`."""
        if by in ("speed", "angle", "state"):
            if of is not None and not isinstance(of, str):
                raise RigError(f"driveline: {what} by {by} is of {brief(of)}; the name of a body, clutch or brake is needed")
            found = own if of is None else self._read_by(what, of)
            if self._states.issuperset({*found} - {GROUND}) != (by == "state"):
                joined = " and ".join(f"'{name}'" for name in found)
                raise RigError(f"driveline: {what} is by {by} and of {joined}; a state is read by state, a body by speed or angle")
            return Reading(READS[by], found, start=angle * (by == "angle"))
        if by == "ratio":
            if isinstance(of, str) or not isinstance(of, Sequence) or len(of) != 2 or not all(isinstance(one, str) for one in of):
                raise RigError(f"driveline: {what} by ratio is of {brief(of)}; two names are needed, whose speeds are divided")
            return Reading(RATIO, self._read_by(what, of[0]), self._read_by(what, of[1]))
        if by == "time":
            return Reading(TIME, {})
        if by != "input":
            raise RigError(f"driveline: {what} is by {brief(by)}; {', '.join(READS)} are possible")
        if not isinstance(of, str) or not of:
            raise RigError(f"driveline: {what} by input is of {brief(of)}; a name for the input is needed")
        if of not in self._arguments:
            self._new_name(of)
            self._arguments[of] = what
        return Reading(INPUT, {}, given=of)

    def _follows(
        self,
        what: str,
        table: Points | Surface,
        by: str | tuple[str, str],
        of: Of | tuple[Of | None, Of | None] | None,
        own: dict[str, float],
        period: float | None,
        angle: float,
    ) -> tuple[tuple[Reading, ...], Table | Grid]:
        """Return the one or two arguments of a law, and its table; the first of two is a speed or an angle."""
        if not math.isfinite(angle):
            raise RigError(f"driveline: angle of {what} is {angle}; a finite number is needed")
        if isinstance(by, str):
            found = self._law_table(what, table, by, period)
            return (self._reading(what, by, of, own, angle),), found
        if not isinstance(by, Sequence) or len(by) != 2:
            raise RigError(f"driveline: {what} is by {brief(by)}; one quantity or two are possible, of {', '.join(READS)}")
        both = of if isinstance(of, Sequence) and not isinstance(of, str) else (None, None)
        if len(both) != 2:
            raise RigError(f"driveline: {what} is of {brief(of)}; one for each of the two quantities is needed")
        readings = tuple(self._reading(what, one, which, own, angle) for one, which in zip(by, both))
        if period is not None and "angle" not in by:
            raise RigError(f"driveline: {what} has a period and is by {by[0]} and {by[1]}; only a table over an angle repeats")
        grid = grid_of(what, table, tuple(period if one == "angle" else None for one in by))
        if readings[0].by in (SPEED, ANGLE):
            return readings, grid
        if readings[1].by not in (SPEED, ANGLE):
            raise RigError(f"driveline: {what} is by {by[0]} and {by[1]}; one of the two must be a speed, an angle or a state")
        # a ratio, an input or the time is the second one of a law
        second, first, values = cast("Surface", table)
        return readings[::-1], grid_of(what, (first, second, np.asarray(values).T), (period if by[1] == "angle" else None, None))

    @staticmethod
    def _law_table(what: str, table: Points, by: str, period: float | None) -> Table:
        if by not in ("speed", "angle", "state"):
            raise RigError(f"driveline: {what} is by '{by}'; by speed, by angle and by state are possible")
        if period is not None and by != "angle":
            raise RigError(f"driveline: {what} has a period and is by {by}; only a table over an angle repeats")
        found = table_of(what, table, "flat", period)
        if by != "angle" and np.any(np.diff(found.x) == 0.0):
            at = f"{found.x[1:][np.diff(found.x) == 0.0][0]:g}{' rad/s' if by == 'speed' else ''}"
            raise RigError(
                f"driveline: the table of {what} jumps at {at}; over a {by} it cannot: give two points between which it changes, "
                "or use a clutch where it is friction"
            )
        return found

    def _mesh_rows(self) -> dict[str, dict[str, float]]:
        """Return the coefficients of the two friction elements of each lossy mesh and planetary set, and of variators, by name.

        One is a clutch that never slips. The other one brakes the output side of power from a, which is b or the ring; its slip is
        scaled to the speed of a or the sun, so that its torque is that at a. In a set all speeds are relative to the carrier. A
        variator has no loss, and its row is that at the start.
        """
        out = {}
        for name, (a, b, ratio, *_) in self._meshes.items():
            out[name], out[f"{name} loss"] = {a: 1.0, b: -ratio}, {b: ratio}
        for name, (sun, ring, carrier, ratio, *_) in self._lossy_sets.items():
            out[name], out[f"{name} loss"] = {sun: 1.0, ring: ratio, carrier: -1.0 - ratio}, {ring: -ratio, carrier: ratio}
        return out | {name: {a: 1.0, b: -ratio} for name, (a, b, ratio) in self._variators.items()}

    def _mesh_elements(self) -> dict[str, tuple[str, str, float, float, tuple[float, float], float, bool]]:
        """Return the friction elements of meshes and sets with losses and of variators, with the coefficients of `_mesh_rows`."""
        return {name: (next(iter(row)), GROUND, 1.0, 1.0, (1.0, 1.0), 0.0, False) for name, row in self._mesh_rows().items()}

    def _drawn(self) -> tuple[list[Body], list[Link]]:
        """Return the bodies and what joins them as a picture shows them; states are not in it."""
        bodies = {name: Body(name, j) for name, j in self._inertia.items() if name not in self._states}
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
        links = [one for one in links if self._states.isdisjoint((one.a, one.b))]
        for link in links:
            if GROUND in (link.a, link.b):
                body = bodies[link.b if link.a == GROUND else link.a]
                if link.kind == "clutch":
                    body.brake = ", ".join(filter(None, (body.brake, link.text)))
                elif link.kind == "freewheel":
                    body.one_way.append((link.text, "not backwards" if link.a == GROUND else "not forwards"))
                else:
                    body.notes.append(f"{link.text}, to the ground")
        return list(bodies.values()), [one for one in links if one.a in bodies and one.b in bodies]


def _efficiency_table(what: str, given: Efficiency) -> tuple[Floats, Floats, Floats]:
    """Return speeds (p,) from 0 on, torques (r,) above 0 and efficiencies (p, r)."""
    if is_number(given):
        return np.zeros(1), np.ones(1), np.full((1, 1), float(given))
    try:
        speeds, *torques, values = (np.array(one, float) for one in cast("Surface", given))
        torques = torques[0] if torques else np.ones(1)
        values = values.reshape(len(speeds), -1) if values.ndim == 1 and len(torques) == 1 else values
    except (TypeError, ValueError, IndexError):
        speeds, torques, values = np.zeros(0), np.zeros(0), np.zeros((0, 0))
    rising = all(one.ndim == 1 and len(one) and np.isfinite(one).all() and np.all(np.diff(one) > 0.0) for one in (speeds, torques))
    if not rising or values.shape != (len(speeds), len(torques)) or speeds[0] < 0.0 or torques[0] <= 0.0:
        raise RigError(
            f"driveline: {what} is {brief(given)}; a number is needed, or rising speeds from 0 on and a value for each, or these, "
            "rising torques above 0 and as many rows of values as speeds, with as many columns as torques"
        )
    return speeds, torques, values


def _both_ways(what: str, there: tuple[Floats, Floats, Floats], back: tuple[Floats, Floats, Floats]) -> tuple[Grid, float]:
    """Return the table of both directions over speed and torque, which is below 0 for power from b, and its least torque."""
    least, speeds = min(there[1][0], back[1][0]), np.union1d(np.union1d(there[0], back[0]), [0.0, 1.0])
    torques, columns = [], []
    for sign, (own, loads, values) in ((-1.0, back), (1.0, there)):
        whole = np.union1d(loads, [least, 2.0 * least])
        over = [[np.interp(load, loads, row) for load in whole] for row in values]
        columns.append(np.array([np.interp(speeds, own, column) for column in zip(*over)])[:: int(sign)])
        torques.append(sign * whole[:: int(sign)])
    return grid_of(what, (speeds, np.concatenate(torques), np.concatenate(columns).T), (None, None)), float(least)


def losses_of(there: float, back: float) -> tuple[float, float]:
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
