# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""General driveline: inertias, rigid gears, planetary sets, shafts, clutches, brakes and free-wheels in any arrangement.

Describe it with `Driveline`, turn it into arrays with `build`, run it alone with plant/driveline_run.py,
or hand the arrays to plant/driveline_kernel.py inside a larger kernel. Every rig's drive train is such a
description.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig_nodes.errors import RigError
from rig_nodes.plant import driveline_algebra as algebra
from rig_nodes.plant.driveline_algebra import work_size
from rig_nodes.plant.driveline_losses import loss_width
from rig_nodes.plant.driveline_ties import GROUND, bodies_from_speeds, start_speeds

_MAX_ELEMENTS = 50


@dataclass
class State:
    """Everything a step changes, as the kernel wants it; shapes as in `driveline_step`."""

    loss: np.ndarray
    v: np.ndarray
    twist: np.ndarray
    mode: np.ndarray
    el: np.ndarray
    shaft: np.ndarray
    e_in: np.ndarray
    events: np.ndarray
    count: np.ndarray
    work: np.ndarray


@dataclass(frozen=True)
class System:
    """A driveline as arrays, made by `Driveline.build`.

    n generalised speeds, b bodies, m friction elements, s shafts. Body speeds are `bodies_from_speeds`
    (b, n) times v; torques on bodies act on the speeds through its transpose; kinetic energy is
    v mass v / 2. `stick` (m,) is the ratio of break-away to kinetic torque, `one_way` (m,) marks
    free-wheels, `minv`, `w`, `sh`, `kc` go into the kernel as they are. Slips and twists by the speeds of the bodies are
    `element_bodies` (m, b) and `shaft_bodies` (s, b); gears, sets and relations are `ties`, their coefficients `tie_rows`.
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

    def state(self, max_events: int = 256, recorded: bool = False) -> State:
        """Initial state, without losses by torque. Free-wheels start overrunning or locked, everything else open.

        recorded: with places for the angles of the speeds behind the shafts' twists, and for the speeds behind each event.
        """
        n, m, s = len(self.speeds), len(self.elements), len(self.shafts)
        mode = np.zeros(m, np.int64)
        slip = self.w @ self.v_start
        for f in np.flatnonzero(self.one_way):
            if slip[f] < 0.0:
                mode[f] = algebra.BACKWARD
        extra = n if recorded else 0
        return State(np.zeros((0, loss_width(n, m))), self.v_start.copy(), np.append(self.twist_start, np.zeros(extra)), mode,
                     np.zeros((4, m)), np.zeros((2, s)), np.zeros(n), np.zeros((max_events, 3 + extra)),
                     np.zeros(2, np.int64), np.zeros(work_size(n, m, s)))

    def limits(self) -> np.ndarray:
        """A fresh `cap` (7, m) for the kernel: drag and free-wheels filled in, everything else open."""
        cap = np.zeros((7, len(self.elements)))
        cap[algebra.VISC] = self.drag
        cap[algebra.HI0, self.one_way] = np.inf
        cap[algebra.HI1, self.one_way] = np.inf
        return cap


class Driveline:
    """Description of a driveline. Bodies first, then what joins them; `build` gives the arrays.

    Signs: slip and twist of a joint a-b are ca w_a - cb w_b and w_a - w_b; positive torque of a joint
    slows a and drives b. All methods raise RigError with one sentence.
    """

    def __init__(self):
        self._inertia: dict[str, float] = {}
        self._speed: dict[str, float | None] = {}
        self._gears: list[tuple[str, str, float]] = []
        self._relations: dict[str, dict[str, float]] = {}  # coefficients by what people read of it
        self._ties: dict[str, dict[str, float]] = {}  # those of gears, sets and relations by name
        self._shafts: dict[str, tuple] = {}
        self._elements: dict[str, tuple] = {}

    def inertia(self, name: str, j: float, speed: float | None = None) -> None:
        """A body with inertia j (kg m2) and initial speed (rad/s, default 0 or given by what ties it to others).

        j = 0: a body that gears or relations tie to others which have some, and whose speed follows from theirs.
        """
        self._new_name(name)
        self._not_negative(f"inertia of '{name}'", j)
        if speed is not None and not math.isfinite(speed):
            raise RigError(f"driveline: initial speed of '{name}' is {speed}; a finite number is needed")
        self._inertia[name] = float(j)
        self._speed[name] = None if speed is None else float(speed)

    def gear(self, a: str, b: str, ratio: float, name: str | None = None) -> None:
        """Rigid gear w_a = ratio w_b; a negative ratio turns the direction round. Without a name it is "a-b"."""
        self._known(f"gear {a}-{b}", a, b)
        if name is None:
            alike = sum({a, b} == {one, other} for one, other, _ in self._gears)
            name = f"{a}-{b}" if alike == 0 else f"{a}-{b}-{alike + 1}"
        self._new_name(name)
        if not math.isfinite(ratio) or ratio == 0.0:
            raise RigError(f"driveline: ratio of gear {a}-{b} is {ratio}; "
                           "a finite number other than 0 is needed")
        self._gears.append((a, b, float(ratio)))
        self._ties[name] = {a: 1.0, b: -float(ratio)}

    def planetary(self, name: str, sun: str, ring: str, carrier: str, ratio: float) -> None:
        """Planetary set: w_sun + ratio w_ring = (1 + ratio) w_carrier (Willis), ratio = teeth of ring over sun > 0.

        One of the three may be the ground. Its planets have no inertia of their own.
        """
        self._positive(f"ratio of planetary set '{name}'", ratio)
        self._relate("planetary set", name, {sun: 1.0, ring: float(ratio), carrier: -1.0 - ratio}, 3)

    def relation(self, name: str, coefficients: Mapping[str, float]) -> None:
        """Speeds of two or more bodies, the ground among them if need be, times these coefficients have the sum 0."""
        self._relate("relation", name, {body: float(c) for body, c in coefficients.items()}, 2)

    def shaft(self, name: str, a: str, b: str, *, stiffness: float, damping: float = 0.0,
              twist: float = 0.0) -> None:
        """Compliant shaft: torque = stiffness (Nm/rad) * twist + damping (Nm s/rad) * (w_a - w_b)."""
        self._new_name(name)
        self._known(f"shaft '{name}'", a, b)
        self._not_negative(f"stiffness of shaft '{name}'", stiffness)
        self._not_negative(f"damping of shaft '{name}'", damping)
        self._shafts[name] = (a, b, float(stiffness), float(damping), float(twist))

    def clutch(self, name: str, a: str, b: str, ca: float = 1.0, cb: float = 1.0, *, stick: float = 1.0,
               drag: float = 0.0) -> None:
        """Friction clutch with slip = ca w_a - cb w_b (coefficients: it sits on geared wheels of a and b).

        `stick` >= 1 is break-away over kinetic torque, `drag` (Nm s/rad) acts on the slip at all times.
        The capacity (kinetic torque, Nm) is an input of the run.
        """
        self._element(name, a, b, ca, cb, stick, drag, False)

    def brake(self, name: str, a: str, *, stick: float = 1.0, drag: float = 0.0) -> None:
        """A clutch to ground: slip = w_a."""
        self._element(name, a, GROUND, 1.0, 1.0, stick, drag, False)

    def freewheel(self, name: str, a: str, b: str = GROUND, *, drag: float = 0.0) -> None:
        """One-way clutch: a cannot turn faster than b; it overruns without torque while a is slower."""
        self._element(name, a, b, 1.0, 1.0, 1.0, drag, True)

    def build(self) -> System:
        """Eliminate gears and relations and give the arrays; refuses what contradicts itself."""
        bodies = tuple(self._inertia)
        inertia = np.array([self._inertia[name] for name in bodies])
        if not inertia.any():
            raise RigError("driveline: no body with inertia; at least one is needed")
        if len(self._elements) > _MAX_ELEMENTS:
            raise RigError(f"driveline: {len(self._elements)} friction elements; "
                           f"at most {_MAX_ELEMENTS} work")
        speeds, t = bodies_from_speeds(self._inertia, self._gears, self._relations)
        heavy = inertia > 0.0
        mass = t[heavy].T @ (inertia[heavy, None] * t[heavy])
        row = {name: t[i] for i, name in enumerate(bodies)}
        row[GROUND] = np.zeros(len(speeds))
        w = np.zeros((len(self._elements), len(speeds)))
        for f, (name, (a, b, ca, cb, *_)) in enumerate(self._elements.items()):
            w[f] = ca * row[a] - cb * row[b]
            self._moves(name, w[f])
        sh = np.zeros((len(self._shafts), len(speeds)))
        for i, (name, (a, b, *_)) in enumerate(self._shafts.items()):
            sh[i] = row[a] - row[b]
            self._moves(name, sh[i])
        given = {name: speed for name, speed in self._speed.items() if speed is not None}
        v_start = start_speeds(given, bodies, t)
        e = list(self._elements.values())
        one_way = np.array([x[6] for x in e], dtype=bool)
        for f, name in enumerate(self._elements):
            if one_way[f] and w[f] @ v_start > 1e-9 * (1.0 + np.abs(v_start).max()):
                raise RigError(f"driveline: free-wheel '{name}' starts with its driving side faster by "
                               f"{w[f] @ v_start:g} rad/s; give initial speeds with a at most as fast as b")
        k = list(self._shafts.values())
        return System(bodies, tuple(self._elements), tuple(self._shafts), speeds, inertia, t, mass,
                      np.ascontiguousarray(np.linalg.inv(mass)), w, sh,
                      np.array([[x[2] for x in k], [x[3] for x in k]], dtype=float).reshape(2, len(k)),
                      np.array([x[4] for x in e], dtype=float), np.array([x[5] for x in e], dtype=float),
                      one_way, v_start, np.array([x[4] for x in k], dtype=float),
                      _rows(bodies, ({a: ca, b: -cb} for a, b, ca, cb, *_ in e)),
                      _rows(bodies, ({a: 1.0, b: -1.0} for a, b, *_ in k)),
                      tuple(self._ties), _rows(bodies, self._ties.values()))

    def _new_name(self, name):
        if name == GROUND or any(name in parts for parts in (
                self._inertia, self._shafts, self._elements, self._ties)):
            raise RigError(f"driveline: the name '{name}' is already taken; every part needs its own")

    def _exist(self, where, *names):
        for name in names:
            if name != GROUND and name not in self._inertia or (name == GROUND and where.startswith("gear")):
                known = ", ".join(self._inertia) or "none"
                raise RigError(f"driveline: {where} names the body '{name}', which does not exist; "
                               f"bodies are: {known}")

    def _known(self, where, *names):
        self._exist(where, *names)
        if names[0] == names[1]:
            raise RigError(f"driveline: {where} joins '{names[0]}' with itself; two bodies are needed")

    @staticmethod
    def _positive(what, value):
        if not (math.isfinite(value) and value > 0.0):
            raise RigError(f"driveline: {what} is {value}; a finite number above 0 is needed")

    @staticmethod
    def _not_negative(what, value):
        if not (math.isfinite(value) and value >= 0.0):
            raise RigError(f"driveline: {what} is {value}; a finite number of at least 0 is needed")

    @staticmethod
    def _moves(name, row):
        if not np.any(np.abs(row) > 1e-12):
            raise RigError(f"driveline: '{name}' joins bodies that gears or relations already tie together; "
                           "its slip is always 0")

    def _relate(self, kind, name, coefficients, least):
        self._new_name(name)
        what = f"{kind} '{name}'"
        if len(coefficients) < least:
            raise RigError(f"driveline: {what} joins {' and '.join(map(repr, coefficients)) or 'nothing'}; "
                           f"{'two' if least == 2 else 'three'} different bodies are needed")
        self._exist(what, *coefficients)
        for body, c in coefficients.items():
            if not math.isfinite(c) or c == 0.0:
                raise RigError(f"driveline: coefficient of '{body}' in {what} is {c}; "
                               "a finite number other than 0 is needed")
        self._relations[what] = self._ties[name] = coefficients

    def _element(self, name, a, b, ca, cb, stick, drag, one_way):
        self._new_name(name)
        self._known(f"'{name}'", a, b)
        if not (math.isfinite(stick) and stick >= 1.0):
            raise RigError(f"driveline: stick ratio of '{name}' is {stick}; "
                           "a finite number of at least 1 is needed")
        if not (math.isfinite(ca) and math.isfinite(cb) and ca != 0.0 and cb != 0.0):
            raise RigError(f"driveline: coefficients of '{name}' are {ca} and {cb}; "
                           "finite numbers other than 0 are needed")
        self._not_negative(f"drag of '{name}'", drag)
        self._elements[name] = (a, b, float(ca), float(cb), float(stick), float(drag), one_way)


def _rows(bodies, joints):
    """Coefficients (joints, bodies) of joints, each a map from bodies to theirs."""
    joints = list(joints)
    out = np.zeros((len(joints), len(bodies)))
    for row, joint in zip(out, joints):
        for body, c in joint.items():
            if body != GROUND:
                row[bodies.index(body)] += c
    return out
