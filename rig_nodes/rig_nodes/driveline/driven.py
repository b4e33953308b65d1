# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of a rig's driveline that has laws, meshes with losses or inputs over time, by driveline/law_steps.py.

The engine calls it by its address (plant.engine.general_step), with a record of any sizes, in place of the quiet and the bare step.
What driveline/run.py does with numpy before a run is done here in each step: it evaluates the tables of inputs at the ends of the
step and cuts the step at their points.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import HI0, KIN0, LAM, LO0, TAU, VISC, noinline, places, short_loops
from rig_nodes.driveline.arrays import address, floats
from rig_nodes.driveline.inputs import SAME
from rig_nodes.driveline.law_steps import jumped, settled_step_at
from rig_nodes.driveline.laws import (
    CAPACITY,
    GEARING,
    HEAT,
    INERTIA,
    MOTION,
    TORQUE,
    Given,
    LawState,
    Model,
    Moving,
    law_state,
    laws_of,
)
from rig_nodes.driveline.lines import share_of
from rig_nodes.driveline.losses import LAST, OWN, put_losses
from rig_nodes.driveline.motion import invert, product, work_over
from rig_nodes.driveline.record import (
    AT,
    KEPT,
    LAWS,
    before_at,
    laws_at,
    loads_at,
    loss_at,
    outcome_at,
    over_time_at,
    own_at,
    state_at,
    structure_at,
)
from rig_nodes.driveline.state import Loads, put
from rig_nodes.driveline.tables import Table, Tables, along, line, piece, tables_of

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.record import OverTime
    from rig_nodes.driveline.state import State
    from rig_nodes.driveline.system import System

FACTOR, LIMIT, PUSH = range(3)  # kinds of inputs over time: factor of a law or speed of a motion; capacity; torque on a body


def driven_arrays(system: System, inputs: Mapping[str, Table]) -> dict[str, np.ndarray]:
    """Return the arrays of LAWS, KEPT and INPUTS of driveline.record for a system at its start.

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
        **dict(zip(LAWS, (*laws[:-1], *laws.tables))),
        **dict(zip(KEPT, own)),
        "part_work": np.zeros(1),
        "accel": np.zeros(n),
        "given_kind": np.array(kinds, np.int64),
        "given_place": np.array(at, np.int64),
        "given_on": np.array(rows).reshape(-1, n),
        "given_first": over_time.first,
        "given_x": over_time.x,
        "given_y": over_time.y,
        "given_ends": over_time.ends,
        "given_period": over_time.period,
        "stick": system.stick,
        "default": np.array(list(system.factors.values())),
        "mass": system.mass,
        "q_before": np.zeros(n),
        "cap_before": np.zeros((7, m)),
        "begun": np.zeros(1),
    }


@njit(**INLINED)
def next_bend(tables: Tables, t: float, done: float, h: float) -> float:
    """Return the time from t at which a step of h, of which a part is done, has to end because of a point of a table over time."""
    end, near = h, SAME * h
    for k in range(tables.period.shape[0]):
        bend = line(tables, k, piece(tables, k, t + done + near))[1] - t
        if bend < h - near:
            end = min(end, bend)
    return end


@njit(**INLINED)
def put_inputs(over_time: OverTime, t: float, begin: float, end: float, given: Given) -> None:
    """Set factors, capacities and forces to the inputs over time at both ends of a part of a step, from t + begin to t + end."""
    cap, stick = given.loads.cap, over_time.stick
    for k in range(over_time.default.shape[0]):
        given.factors[0, k] = given.factors[1, k] = over_time.default[k]
    for k in range(over_time.kind.shape[0]):
        _, _, value, point, slope = line(over_time.tables, k, piece(over_time.tables, k, t + 0.5 * (begin + end)))
        for side in range(2):
            now, place = value + slope * (t + (begin if side == 0 else end) - point), over_time.place[k]
            if over_time.kind[k] == FACTOR:
                given.factors[side, place] = now
            elif over_time.kind[k] == LIMIT:
                cap[KIN0 + side, place] = now
                cap[HI0 + side, place] = stick[0, place] * now
                cap[LO0 + side, place] = -stick[1, place] * now
            else:
                for j in range(over_time.on.shape[1]):
                    given.loads.q[side, j] += now * over_time.on[k, j]


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False)
def driven_step(settled: int, bare: int, layout: Ints, h: float, t: float) -> int:
    """Move the driveline of a record from t to t + h, where q and cap are those of the rig's parts.

    A step is cut at the points of tables over time. After the step cap contains the torques with which losses brake at its end.

    Parameters
    ----------
    settled, bare : int
        Addresses of `settled_step` and `driveline_step`.
    layout : (count,) array of int64
        Field ``layout`` of the record (driveline.record).
    h, t : float
        Length of the step, and time at its start [s].

    Returns
    -------
    int
        0.
    """
    n = layout[0]
    memory = np.empty(5 * n + 7 * layout[1] + 3 * layout[6] + 2 * n * n)
    return driven_parts(settled, bare, layout, h, t, address(memory), memory)


@njit(**INNER)
def driven_parts(settled: int, bare: int, layout: Ints, h: float, t: float, room: int, _memory: Floats) -> int:
    """Do what :func:`driven_step` does with room at an address, which ``_memory`` keeps."""
    noinline()
    short_loops()
    structure, loads, state, over_time = structure_at(layout), loads_at(layout), state_at(layout), over_time_at(layout)
    before, outcome = before_at(layout), outcome_at(layout)
    n, m, slots = state.v.shape[0], state.mode.shape[0], structure.sh.shape[0]
    q, cap = loads.q, loads.cap
    model = Model(bare, structure, floats(address(layout) + layout[AT.mass], n, n), laws_at(layout))
    moving = Moving(loss_at(layout), state, own_at(layout))
    inputs = over_time.default.shape[0]
    qq, by, turned, rest = floats(room, 2, n), floats(room + 16 * n, 2, n), floats(room + 32 * n, n), room + 40 * n
    cc, factors, rest = floats(rest, 7, m), floats(rest + 56 * m, 3, inputs), rest + 56 * m + 24 * inputs
    held, inverse = floats(rest, n, n), floats(rest + 8 * n * n, n, n)
    given = Given(Loads(qq, cc), factors)
    for k in range(inputs):
        factors[2, k] = 0.0
    at = places(n, m, slots, moving.loss.shape[0])
    for k in range(moving.loss.shape[0]):
        for row in range(VISC):
            cap[row, int(moving.loss[k, OWN])] = 0.0
    done = 0.0
    while done < h:
        end = next_bend(over_time.tables, t, done, h)
        begin, until = done / h, 1.0 if end == h else end / h
        for j in range(n):
            qq[0, j], qq[1, j] = share_of(q[0, j], q[1, j], begin, until)
            turned[j] = state.twist[slots + j]
        for f in range(m):
            for row in (KIN0, LO0, HI0):
                cc[row, f], cc[row + 1, f] = share_of(cap[row, f], cap[row + 1, f], begin, until)
            cc[VISC, f] = cap[VISC, f]
        put_inputs(over_time, t, done, end, given)
        fresh = before.begun[0] == 0.0 or jumped(qq, before.q, cc, before.cap)
        settled_step_at(settled, model, given, moving, end - done, t + done, fresh)
        before.begun[0] = 1.0
        put(before.q, qq[1])
        put(before.cap, cc)
        for j in range(n):
            by[0, j], by[1, j] = share_of(q[0, j], q[1, j], begin, until)
            outcome.part_work[0] += work_over(by, j, state.twist[slots + j] - turned[j], state.work[at.lag + j])
        done = end
    put_losses(moving.loss, cap, int(1), int(LAST))
    put(turned, before.q)
    accelerate(model, moving.own, cap, turned, state, held, inverse, outcome.accel)
    return int(0)


@njit(**INNER)
def accelerate(
    model: Model, own: LawState, cap: Floats, force: Floats, state: State, held: Floats, inverse: Floats, accel: Floats
) -> None:
    """Set `accel` to the accelerations (n,) at the end of a step, from all torques at that time.

    ``force`` (n,) has those of parts and inputs, and is changed; ``held`` and ``inverse`` are room for (n, n) numbers.
    """
    noinline()
    short_loops()
    laws, w, sh, v = model.laws, model.structure.w, model.structure.sh, state.v
    n = v.shape[0]
    heavy = False
    put(inverse, model.structure.minv)
    put(held, model.mass)
    for f in range(w.shape[0]):
        torque = state.el[LAM, f] + cap[VISC, f] * product(w[f], v)
        for j in range(n):
            force[j] -= w[f, j] * torque
    straight = sh.shape[0]  # number of rows of shafts, which come before those of torques
    for k in range(laws.kind.shape[0]):
        push = 0.0
        if laws.kind[k] == TORQUE:
            push = own.torque[k]
            straight -= laws.slot[k] >= 0
        elif laws.kind[k] == MOTION or laws.kind[k] == HEAT:
            push = own.torque[k]
        elif laws.kind[k] == GEARING:
            push = (own.torque[k] - laws.gap[k]) * state.el[LAM, laws.element[k]]
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
            force[j] -= sh[a, j] * state.shaft[TAU, a]
    if heavy:
        invert(held, inverse)
    for i in range(n):
        accel[i] = product(inverse[i], force)
