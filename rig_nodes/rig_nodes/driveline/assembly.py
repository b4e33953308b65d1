# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the arrays of a driveline of its description: eliminates gears and relations, and finds the laws and the initial speeds.

Used by driveline/builder.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import RigError
from rig_nodes.driveline.description import Description, losses_of
from rig_nodes.driveline.laws import CAPACITY, FRICTION, MOTION, SHAFT, TORQUE, Law
from rig_nodes.driveline.motions import locks_itself, rank
from rig_nodes.driveline.system import Mesh, System
from rig_nodes.driveline.ties import GROUND, bodies_from_speeds, move_nothing, start_speeds

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base import Floats

_MAX_ELEMENTS = 50


class Assembly(Description):
    """A description that can be built."""

    def _assemble(self) -> System:
        """Return the arrays; RigError when the description contradicts itself or has no body with inertia."""
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

    def _mesh_of(self, name: str, elements: tuple[str, ...]) -> Mesh:
        """Return the mesh with the coefficients of its loss.

        Of a power x from a, (1 - efficiency) x is lost, and of a power x from b, (1 - back) x. With a torque t into the mesh at a,
        and t - loss out of it, both losses are `share` times |t - before * loss|, because t is greater than before * loss where a
        drives and smaller where b drives.
        """
        there, back = (self._meshes.get(name) or self._lossy_sets[name])[-2:]
        ahead, behind = losses_of(there, back)
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
            joints.append((gear, loss, *losses_of(there, back)))
        others = [f for f in rigid if list(elements.values())[f][6]]
        if joints and locks_itself(joints, w[others], held):
            names = ", ".join(f"'{name}'" for name in (*self._meshes, *self._lossy_sets))
            raise RigError(
                f"driveline: motions prescribe speeds that meshes ({names}) can hold by their losses, because they lock "
                "themselves; leave out a motion, or raise an efficiency until power gets through"
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
