# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of a rig's driveline that has laws, meshes with losses or inputs over time, by driveline/law_steps.py.

The engine calls it by its address (plant.engine.general_step), with arrays of any sizes, in place of the quiet and the bare step.
What driveline/run.py does with numpy before a run is done here in each step: it evaluates the tables of inputs at the ends of the
step and cuts the step at their points.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base.compiled import njit
from rig_nodes.driveline.algebra import HI0, KIN0, LAM, LO0, TAU, VISC, lin
from rig_nodes.driveline.inputs import SAME
from rig_nodes.driveline.law_steps import jumped, put, settled_step_at, share_of
from rig_nodes.driveline.laws import CAPACITY, INERTIA, MOTION, TORQUE, Laws, LawState, law_state, laws_of
from rig_nodes.driveline.losses import LAST, OWN, put_losses
from rig_nodes.driveline.motion import invert, product
from rig_nodes.driveline.tables import Table, Tables, along, line, piece, tables_of

if TYPE_CHECKING:
    from rig_nodes.base.arrays import Floats, Ints
    from rig_nodes.driveline.system import System

FACTOR, LIMIT, PUSH = range(3)  # kinds of inputs over time: factor of a law or speed of a motion; capacity; torque on a body

# arrays of a driven step after those of the bare step, name -> dimensions, for the engine's record. First those of the laws:
LAWS = {
    "kind": 1,
    "angle": 1,
    "slot": 1,
    "element": 1,
    "factor": 1,
    "of": 2,
    "on": 2,
    "gap": 1,
    "damping": 1,
    "first_spring": 1,
    "springs": 2,
    "first_point": 1,
    "x": 1,
    "y": 1,
    "ends": 2,
    "period": 1,
}
# then the state of the laws, the work of the parts' torques on bodies, and the accelerations at the step's end:
KEPT = {"at": 1, "law_torque": 1, "spring": 1, "way": 1, "law_work": 1, "part_work": 1, "accel": 1}
# and those of the inputs: kind, place and row of the speeds of each; their points; the ratios of stick limit to capacity of the
# elements; the defaults of the laws' inputs; the mass matrix; torques and capacities at the end of the last step, and whether there
# was a step before
INPUTS = {
    "given_kind": 1,
    "given_place": 1,
    "given_on": 2,
    "given_first": 1,
    "given_x": 1,
    "given_y": 1,
    "stick": 2,
    "default": 1,
    "mass": 2,
    "q_before": 1,
    "cap_before": 2,
    "begun": 1,
}
WHOLE_NUMBERS = (
    "kind",
    "angle",
    "slot",
    "element",
    "factor",
    "first_spring",
    "first_point",
    "given_kind",
    "given_place",
    "given_first",
)


def driven_arrays(system: System, inputs: Mapping[str, Table]) -> dict[str, np.ndarray]:
    """Return the arrays of LAWS, KEPT and INPUTS for a system at its start.

    Parameters
    ----------
    system : System
        The driveline.
    inputs : mapping of str to Table
        Inputs as those of a Run, each a table over time.

    Returns
    -------
    dict of str to array
        The arrays by name.
    """
    n, m = len(system.speeds), len(system.elements)
    laws, own = laws_of(system.laws, n), law_state(system.laws)
    every = {
        name: Table(np.zeros(1), np.ones(1))
        for name in (system.elements[law.element] for law in system.laws if law.kind == CAPACITY)
    } | dict(inputs)
    kinds, at, rows = [], [], []
    for name in every:
        if name in system.factors:
            kinds.append(FACTOR)
            at.append(list(system.factors).index(name))
        elif name in system.elements:
            kinds.append(LIMIT)
            at.append(system.elements.index(name))
        else:
            kinds.append(PUSH)
            at.append(system.bodies.index(name))
        rows.append(system.bodies_from_speeds[at[-1]] if kinds[-1] == PUSH else np.zeros(n))
    over_time = tables_of(list(every.values()))
    return {
        **dict(zip(LAWS, (*laws[:11], *laws.tables))),
        **dict(zip(KEPT, own)),
        "part_work": np.zeros(1),
        "accel": np.zeros(n),
        "given_kind": np.array(kinds, np.int64),
        "given_place": np.array(at, np.int64),
        "given_on": np.array(rows).reshape(-1, n),
        "given_first": over_time.first,
        "given_x": over_time.x,
        "given_y": over_time.y,
        "stick": system.stick,
        "default": np.array(list(system.factors.values())),
        "mass": system.mass,
        "q_before": np.zeros(n),
        "cap_before": np.zeros((7, m)),
        "begun": np.zeros(1),
    }


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def driven_step(
    settled: int,
    bare: int,
    h: float,
    t: float,
    minv: Floats,
    w: Floats,
    sh: Floats,
    kc: Floats,
    q: Floats,
    cap: Floats,
    loss: Floats,
    v: Floats,
    twist: Floats,
    mode: Ints,
    el: Floats,
    shaft: Floats,
    e_in: Floats,
    events: Floats,
    count: Ints,
    work: Floats,
    kind: Ints,
    angle: Ints,
    slot: Ints,
    element: Ints,
    factor: Ints,
    of: Floats,
    on: Floats,
    gap: Floats,
    damping: Floats,
    first_spring: Ints,
    springs: Floats,
    first_point: Ints,
    x: Floats,
    y: Floats,
    ends: Floats,
    period: Floats,
    at: Floats,
    law_torque: Floats,
    spring: Floats,
    way: Floats,
    law_work: Floats,
    part_work: Floats,
    accel: Floats,
    given_kind: Ints,
    given_place: Ints,
    given_on: Floats,
    given_first: Ints,
    given_x: Floats,
    given_y: Floats,
    stick: Floats,
    default: Floats,
    mass: Floats,
    q_before: Floats,
    cap_before: Floats,
    begun: Floats,
) -> int:
    """Move a driveline from t to t + h, where q and cap are those of the rig's parts.

    settled and bare are addresses; twist has places for the integrals of the speeds. A step is cut at the points of tables over
    time. After the step cap contains the torques with which losses brake at its end. Returns 0.
    """
    n, m, slots = v.shape[0], mode.shape[0], sh.shape[0]
    laws = Laws(
        kind, angle, slot, element, factor, of, on, gap, damping, first_spring, springs, Tables(first_point, x, y, ends, period)
    )
    own = LawState(at, law_torque, spring, way, law_work)
    inputs = given_kind.shape[0]
    over_time = Tables(given_first, given_x, given_y, np.zeros((inputs, 2)), np.zeros(inputs))
    given, qq, cc, before = np.zeros((3, default.shape[0])), np.empty((2, n)), np.empty((7, m)), np.empty(n)
    for k in range(loss.shape[0]):
        for row in range(VISC):
            cap[row, int(loss[k, OWN])] = 0.0
    done, near = 0.0, SAME * h
    while done < h:
        end = h
        for k in range(inputs):
            bend = line(over_time, k, piece(over_time, k, t + done + near))[1] - t
            if bend < h - near:
                end = min(end, bend)
        begin, until = done / h, 1.0 if end == h else end / h
        for j in range(n):
            qq[0, j], qq[1, j] = share_of(q[0, j], q[1, j], begin, until)
            before[j] = twist[slots + j]
        for f in range(m):
            for row in (KIN0, LO0, HI0):
                cc[row, f], cc[row + 1, f] = share_of(cap[row, f], cap[row + 1, f], begin, until)
            cc[VISC, f] = cap[VISC, f]
        for k in range(default.shape[0]):
            given[0, k] = given[1, k] = default[k]
        for k in range(inputs):
            _, _, value, point, slope = line(over_time, k, piece(over_time, k, t + 0.5 * (done + end)))
            for side in range(2):
                now, place = value + slope * (t + (done if side == 0 else end) - point), given_place[k]
                if given_kind[k] == FACTOR:
                    given[side, place] = now
                elif given_kind[k] == LIMIT:
                    cc[KIN0 + side, place] = now
                    cc[HI0 + side, place] = stick[0, place] * now
                    cc[LO0 + side, place] = -stick[1, place] * now
                else:
                    for j in range(n):
                        qq[side, j] += now * given_on[k, j]
        fresh = begun[0] == 0.0 or jumped(qq, q_before, cc, cap_before)
        settled_step_at(
            settled,
            bare,
            end - done,
            t + done,
            fresh,
            laws,
            own,
            given,
            mass,
            minv,
            w,
            sh,
            kc,
            qq,
            cc,
            loss,
            v,
            twist,
            mode,
            el,
            shaft,
            e_in,
            events,
            count,
            work,
        )
        begun[0] = 1.0
        put(q_before, qq[1])
        put(cap_before, cc)
        for j in range(n):
            part_work[0] += 0.5 * (lin(q[0, j], q[1, j], begin) + lin(q[0, j], q[1, j], until)) * (twist[slots + j] - before[j])
        done = end
    put_losses(loss, cap, 1, LAST)
    accelerate(laws, own, mass, minv, w, sh, cap, q_before, v, el, shaft, accel)
    return int(0)


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def accelerate(
    laws: Laws,
    own: LawState,
    mass: Floats,
    minv: Floats,
    w: Floats,
    sh: Floats,
    cap: Floats,
    q: Floats,
    v: Floats,
    el: Floats,
    shaft: Floats,
    accel: Floats,
) -> None:
    """Set `accel` to the accelerations (n,) at the end of a step, from all torques at that time; q is that of parts and inputs."""
    n = v.shape[0]
    force, inverse, heavy = q.copy(), minv.copy(), False
    for f in range(w.shape[0]):
        torque = el[LAM, f] + cap[VISC, f] * product(w[f], v)
        for j in range(n):
            force[j] -= w[f, j] * torque
    held = mass.copy()
    straight = sh.shape[0]  # number of rows of shafts, which come before those of torques
    for k in range(laws.kind.shape[0]):
        push = 0.0
        if laws.kind[k] == TORQUE:
            push = own.torque[k]
            straight -= laws.slot[k] >= 0
        elif laws.kind[k] == MOTION:
            push = own.torque[k]
        elif laws.kind[k] == INERTIA:
            heavy = True
            push = -0.5 * along(laws.tables, k, own.at[k], 1e-9)[1] * product(laws.on[k], v) ** 2
            for i in range(n):
                for j in range(n):
                    held[i, j] += own.torque[k] * laws.on[k, i] * laws.on[k, j]
        for j in range(n):
            force[j] += push * laws.on[k, j]
    for a in range(straight):
        for j in range(n):
            force[j] -= sh[a, j] * shaft[TAU, a]
    if heavy:
        invert(held, inverse)
    for i in range(n):
        accel[i] = product(inverse[i], force)
