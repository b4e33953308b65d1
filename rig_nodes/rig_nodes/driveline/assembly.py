# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the arrays of a driveline of its description: eliminates gears and relations, and finds the laws and the initial speeds.

Used by driveline/builder.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import RigError
from rig_nodes.driveline.description import Description, Reading, losses_of
from rig_nodes.driveline.laws import (
    ANGLE,
    ARGUMENT,
    CAPACITY,
    FRICTION,
    GEARING,
    HEAT,
    INPUT,
    MOTION,
    SHAFT,
    SPEED,
    TEETH,
    TORQUE,
    Law,
)
from rig_nodes.driveline.losses import loss_share
from rig_nodes.driveline.motions import locks_itself, rank
from rig_nodes.driveline.system import Mesh, System
from rig_nodes.driveline.tables import Grid, Table
from rig_nodes.driveline.ties import GROUND, bodies_from_speeds, move_nothing, start_speeds

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base import Floats

_WEIGHTLESS = (
    1e-12  # share of the largest inertia that the speed of a variator has, which is prescribed; none would have no inverse
)


class Assembly(Description):
    """A description that can be built."""

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
        given = {name: speed for name, speed in self._speed.items() if speed is not None}
        v_start = self._start(given, bodies, speeds, t, relations)
        # each variator adds a speed of its own (driveline.variators), on which nothing but its element acts
        own = len(self._variators)
        speeds += tuple(f"the ratio of {name}" for name in self._variators)
        t, v_start = np.pad(t, ((0, 0), (0, own))), np.pad(v_start, (0, own))
        mass = np.pad(mass, (0, own)) + np.diag([0.0] * len(mass) + [_WEIGHTLESS * mass.max()] * own)
        row = {name: t[i] for i, name in enumerate(bodies)}
        row[GROUND] = np.zeros(len(speeds))
        w, sh = self._slips(elements, rows, row, own)
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
            tuple(name for name in bodies if name in self._states),
        )

    def _slips(
        self, elements: Mapping[str, tuple], rows: Mapping[str, Mapping[str, float]], row: Mapping[str, Floats], own: int
    ) -> tuple[Floats, Floats]:
        """Return the rows (m, n) of the slips and (s, n) of the twists by the speeds, the last `own` of which are of variators.

        ``rows`` has the coefficients of elements with more than two bodies, and ``row`` the speeds of each body.
        """
        w = np.zeros((len(elements), len(row[GROUND])))
        for f, (name, (a, b, ca, cb, *_)) in enumerate(elements.items()):
            joint = rows.get(name)
            w[f] = ca * row[a] - cb * row[b] if joint is None else sum(c * row[body] for body, c in joint.items())
            self._moves(name, w[f])
            if name in self._variators:
                w[f, len(row[GROUND]) - own + list(self._variators).index(name)] = -1.0
        sh = np.zeros((len(self._shafts), len(row[GROUND])))
        for i, (name, (a, b, ca, cb, *_)) in enumerate(self._shafts.items()):
            sh[i] = ca * row[a] - cb * row[b]
            self._moves(name, sh[i])
        return w, sh

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
        acting |= {name: on for name, (kind, on, *_) in self._acts.items() if kind != GEARING}
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
        """Return the mesh with the coefficients of its loss."""
        there, back = (self._meshes.get(name) or self._lossy_sets[name])[-2:]
        return Mesh(name, elements.index(name), elements.index(f"{name} loss"), *loss_share.py_func(there, back))

    def _start(
        self,
        given: Mapping[str, float],
        bodies: tuple[str, ...],
        speeds: tuple[str, ...],
        t: Floats,
        relations: Mapping[str, Mapping[str, float]],
    ) -> Floats:
        if not self._mesh_rows():
            return start_speeds(given, bodies, t)
        rows = self._mesh_rows()
        meshes = {f"mesh '{name}'": rows[name] for name in self._meshes}
        meshes |= {f"planetary set '{name}'": rows[name] for name in self._lossy_sets}
        meshes |= {f"variator '{name}'": rows[name] for name in self._variators}
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
        for name, (reads, table) in self._capacities.items():
            f = elements.index(name)
            law = Law(name, CAPACITY, SPEED, 0.0 * w[f], 0.0 * w[f], nothing, element=f)
            laws += self._reading_laws(law, reads, table, bodies, t, factors)
        for name, table in self._friction.items():
            f = elements.index(name)
            laws.append(Law(name, FRICTION, SPEED, w[f], 0.0 * w[f], nothing, table, element=f))
        for name, (table, gap, damping, springs) in self._soft.items():
            i = shafts.index(name)
            laws.append(
                Law(
                    name,
                    SHAFT,
                    ANGLE,
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
        names = list(self._elements | self._mesh_elements())
        for name, (grid, least) in self._teeth.items():
            gear, loss = names.index(name), names.index(f"{name} loss")
            law = Law(name, TEETH, SPEED, w[loss], 0.0 * w[loss], nothing, element=loss, factor=gear, gap=least)
            # the torque that the mesh carries, which the law sets itself
            laws += law, Law(name, ARGUMENT, ANGLE, law.on, law.on, nothing, grid.rows, curves=grid.curves)
        for name, (kind, on, reads, table, *ratio) in self._acts.items():
            acts = _rows(bodies, [on])[0]
            on = acts @ t
            self._moves(name, on)
            factor = -1
            if kind in (TORQUE, MOTION, GEARING):
                factor = len(factors)
                factors[name] = float(on @ v_start) if kind == MOTION else ratio[0] if ratio else 1.0
            law = Law(name, kind, SPEED, on, on, acts, factor=factor)
            if kind == GEARING:
                f = names.index(name)
                law = law._replace(element=f, gap=self._variators[name][2])
            law, *other = self._reading_laws(law, reads, table, bodies, t, factors)
            # with two arguments a part of the slopes is implicit, with one all of it or nothing
            rows = [law.of, *(one for second in other for one in (second.of, second.on))]
            if kind == TORQUE and (any(on @ row for row in rows) if other else np.array_equal(on, law.of)):
                law = law._replace(slot=len(slots))
                slots.append(on)
            laws += law, *other
        held = np.array([law.on for law in laws if law.kind == MOTION]).reshape(-1, len(speeds))
        if rank(held) < len(held):
            raise RigError("driveline: motions prescribe the speeds of bodies that gears or relations tie together; one is enough")
        if len(held) or self._variators:
            self._left_free(held.any(axis=0) | (np.arange(len(speeds)) >= len(speeds) - len(self._variators)), w)
        laws.sort(key=lambda law: law.kind)
        laws += self._heat_laws(bodies, t, laws, len(slots))
        return tuple(sorted(laws, key=lambda law: law.kind)), np.array(slots).reshape(-1, len(speeds)), factors

    def _heat_laws(self, bodies: tuple[str, ...], t: Floats, laws: Sequence[Law], slots: int) -> list[Law]:
        """Return the flows of what elements lose into states; `laws` are all others, sorted, and `slots` counts their rows."""
        elements, out = [*self._elements, *self._mesh_elements()], []
        follow = {law.name: k for k, law in enumerate(laws) if law.kind in (SHAFT, TORQUE)}
        for state, of, share in self._heats:
            acts = _rows(bodies, [{state: share}])[0]
            if of in follow:
                source = len(elements) + slots + follow[of]
            elif of in self._shafts:
                source = len(elements) + list(self._shafts).index(of)
            else:
                source = elements.index(f"{of} loss" if of in (*self._meshes, *self._lossy_sets) else of)
            out.append(Law(f"{of} in {state}", HEAT, SPEED, 0.0 * (acts @ t), acts @ t, acts, element=source))
        return out

    @staticmethod
    def _reading_laws(
        law: Law, reads: tuple[Reading, ...], table: Table | Grid, bodies: tuple[str, ...], t: Floats, factors: dict[str, float]
    ) -> list[Law]:
        """Return a law with its argument and its table, and its second argument where it has two; adds its input to `factors`."""
        rows = [_rows(bodies, [one.of, one.under]) @ t for one in reads]
        law = law._replace(by=reads[0].by, of=rows[0][0], start=reads[0].start)
        if not isinstance(table, Grid):
            return [law._replace(table=table)]
        second, factor = reads[1], -1
        if second.by == INPUT:
            factors.setdefault(second.given, 0.0)
            factor = list(factors).index(second.given)
        of, under = rows[1]
        return [
            law,
            Law(
                law.name,
                ARGUMENT,
                second.by,
                of,
                under,
                0.0 * law.bodies,
                table.rows,
                factor=factor,
                start=second.start,
                curves=table.curves,
            ),
        ]

    def _left_free(self, held: npt.NDArray[np.bool_], w: Floats) -> None:
        """Raise a RigError for elements that could hold the prescribed speeds `held` (n,); `w` (m, n) are the slips."""
        elements, rows = self._elements | self._mesh_elements(), self._mesh_rows()
        rigid = [f for f, (name, one) in enumerate(elements.items()) if one[6] or f"{name} loss" in rows or name in self._variators]
        if rank(w[np.ix_(rigid, ~held)]) < rank(w[rigid]):
            names = ", ".join(f"'{list(elements)[f]}'" for f in rigid)
            raise RigError(
                f"driveline: motions or ratios prescribe speeds that the meshes, variators and free-wheels ({names}) can hold "
                "against them; leave out one of those that do"
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
