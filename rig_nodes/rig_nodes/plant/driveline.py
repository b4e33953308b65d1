# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""General driveline: inertias, rigid gears, shafts, clutches, brakes and free-wheels in any arrangement.

Describe it with `Driveline`, turn it into arrays with `build`, run it alone with plant/driveline_run.py,
or hand the arrays to plant/driveline_kernel.py inside a larger kernel. Every rig's drive train is such a
description.
"""

import math
from dataclasses import dataclass

import numpy as np

from rig_nodes.errors import RigError
from rig_nodes.plant import driveline_algebra as algebra
from rig_nodes.plant.driveline_algebra import work_size
from rig_nodes.plant.driveline_losses import loss_width

GROUND = "ground"
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
    free-wheels, `minv`, `w`, `sh`, `kc` go into the kernel as they are.
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

    def state(self, max_events: int = 256) -> State:
        """Initial state, without losses by torque. Free-wheels start overrunning or locked, everything else open."""
        n, m, s = len(self.speeds), len(self.elements), len(self.shafts)
        mode = np.zeros(m, np.int64)
        slip = self.w @ self.v_start
        for f in np.flatnonzero(self.one_way):
            if slip[f] < 0.0:
                mode[f] = algebra.BACKWARD
        return State(np.zeros((0, loss_width(n, m))), self.v_start.copy(), self.twist_start.copy(), mode,
                     np.zeros((4, m)), np.zeros((2, s)), np.zeros(n), np.zeros((max_events, 3)),
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
        self._shafts: dict[str, tuple] = {}
        self._elements: dict[str, tuple] = {}

    def inertia(self, name: str, j: float, speed: float | None = None) -> None:
        """A body with inertia j > 0 (kg m2) and initial speed (rad/s, default 0 or given by a gear)."""
        self._new_name(name)
        self._positive(f"inertia of '{name}'", j)
        if speed is not None and not math.isfinite(speed):
            raise RigError(f"driveline: initial speed of '{name}' is {speed}; a finite number is needed")
        self._inertia[name] = float(j)
        self._speed[name] = None if speed is None else float(speed)

    def gear(self, a: str, b: str, ratio: float) -> None:
        """Rigid gear w_a = ratio w_b; a negative ratio turns the direction round."""
        self._known(f"gear {a}-{b}", a, b)
        if not math.isfinite(ratio) or ratio == 0.0:
            raise RigError(f"driveline: ratio of gear {a}-{b} is {ratio}; "
                           "a finite number other than 0 is needed")
        self._gears.append((a, b, float(ratio)))

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
        """Eliminate the gears and give the arrays; refuses what contradicts itself."""
        if not self._inertia:
            raise RigError("driveline: no body; at least one inertia is needed")
        bodies = tuple(self._inertia)
        root, factor = self._gear_groups(bodies)
        speeds = tuple(name for name in bodies if root[name] == name)
        if len(self._elements) > _MAX_ELEMENTS:
            raise RigError(f"driveline: {len(self._elements)} friction elements; "
                           f"at most {_MAX_ELEMENTS} work")
        t = np.zeros((len(bodies), len(speeds)))
        for i, name in enumerate(bodies):
            t[i, speeds.index(root[name])] = factor[name]
        row = {name: t[i] for i, name in enumerate(bodies)}
        row[GROUND] = np.zeros(len(speeds))
        inertia = np.array([self._inertia[name] for name in bodies])
        mass = t.T @ (inertia[:, None] * t)
        w = np.zeros((len(self._elements), len(speeds)))
        for f, (name, (a, b, ca, cb, _stick, _drag, _one_way)) in enumerate(self._elements.items()):
            w[f] = ca * row[a] - cb * row[b]
            self._moves(name, w[f])
        sh = np.zeros((len(self._shafts), len(speeds)))
        for i, (name, (a, b, _k, _c, _twist)) in enumerate(self._shafts.items()):
            sh[i] = row[a] - row[b]
            self._moves(name, sh[i])
        v_start = self._start(speeds, root, factor)
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
                      one_way, v_start, np.array([x[4] for x in k], dtype=float))

    def _new_name(self, name):
        if name == GROUND or name in self._inertia or name in self._shafts or name in self._elements:
            raise RigError(f"driveline: the name '{name}' is already taken; every part needs its own")

    def _known(self, where, *names):
        for name in names:
            if name != GROUND and name not in self._inertia or (name == GROUND and where.startswith("gear")):
                known = ", ".join(self._inertia) or "none"
                raise RigError(f"driveline: {where} names the body '{name}', which does not exist; "
                               f"bodies are: {known}")
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
            raise RigError(f"driveline: '{name}' joins bodies that gears already tie together; "
                           "its slip is always 0")

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

    def _gear_groups(self, bodies):
        """Root body of each gear group and every body's speed as a multiple of its root's."""
        meshes = {name: [] for name in bodies}
        for a, b, ratio in self._gears:
            meshes[b].append((a, ratio))
            meshes[a].append((b, 1.0 / ratio))
        root, factor = {}, {}
        for name in bodies:
            if name in root:
                continue
            root[name], factor[name] = name, 1.0
            todo = [name]
            while todo:
                here = todo.pop()
                for other, ratio in meshes[here]:
                    value = factor[here] * ratio
                    if other not in root:
                        root[other], factor[other] = name, value
                        todo.append(other)
        for a, b, ratio in self._gears:
            if abs(factor[a] - ratio * factor[b]) > 1e-9 * abs(factor[a]):
                raise RigError(f"driveline: gear {a}-{b} with ratio {ratio:g} closes a loop that needs "
                               f"{factor[a] / factor[b]:g}; as it is the loop could not turn")
        return root, factor

    def _start(self, speeds, root, factor):
        v = np.zeros(len(speeds))
        given = {}
        for name, value in self._speed.items():
            if value is None:
                continue
            speed = value / factor[name]
            first = given.setdefault(root[name], (name, speed))
            if abs(first[1] - speed) > 1e-9 * (1.0 + abs(speed)):
                raise RigError(f"driveline: initial speeds of '{first[0]}' and '{name}' contradict the gears "
                               f"between them; '{name}' would have {first[1] * factor[name]:g} rad/s")
            v[speeds.index(root[name])] = first[1]
        return v
