# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Elements of a driveline that depend on its motion: torques, capacities, friction, shafts, prescribed motion, inertias.

Each of them is a law: a table over an angle or a speed, its argument, or over two arguments (driveline/maps.py).
driveline/law_steps.py moves a driveline that has laws, in driveline/run.py and, by driveline/driven.py, in the engine of a rig.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.driveline.state import Loads, State, Structure
from rig_nodes.driveline.tables import Table, Tables, stored_in, tables_of, value_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rig_nodes.base import Floats, Ints
    from rig_nodes.driveline.system import System

# kinds, in the order in which they act on a step; an ARGUMENT does not act, but is the second one of the law with its name
CAPACITY, FRICTION, SHAFT, TORQUE, MOTION, INERTIA, GEARING, HEAT, TEETH, ARGUMENT = range(10)
# what a law reads; the last three are possible for an ARGUMENT only: the ratio of two speeds, an input over time, the time
SPEED, ANGLE, RATIO, INPUT, TIME = range(5)


class Law(NamedTuple):
    """One law: it reads the angle or speed of `of` and acts on `on` or on a friction element.

    Parameters
    ----------
    name : str
        Name of the law.
    kind : int
        CAPACITY, FRICTION, SHAFT, TORQUE, MOTION, INERTIA, GEARING (driveline/variators.py), HEAT (driveline/heat.py), TEETH
        (driveline/teeth.py) or ARGUMENT.
    by : int
        What it reads: SPEED, ANGLE, RATIO, INPUT or TIME.
    of, on : (n,) array of float
        Coefficients of the generalised speeds that it reads and on which it acts. A RATIO is that of the speed by `of` to the speed
        by `on`.
    bodies : (b,) array of float
        The same as `on`, by bodies.
    table : Table
        Its characteristic.
    slot : int
        Its row among the shafts, where its slope is implicit; -1 without one.
    element : int
        Number of its friction element, -1 without one; of a HEAT that of what loses power, of
        TEETH that of the loss.
    factor : int
        Number of the input over time that multiplies it, or of the INPUT that it reads; of TEETH that
        of the element that holds the wheels together; -1 without one.
    start : float
        Angle at the start [rad].
    gap : float
        Half the backlash of a SHAFT [rad], the ratio of a GEARING at the start, or the least torque of the table of TEETH [Nm].
    damping : float
        Damping of a SHAFT [Nm s/rad].
    springs : tuple of (float, float)
        Stiffness [Nm/rad] and limit [Nm] of the springs of a SHAFT that slide.
    curves : tuple of Table
        Of an ARGUMENT the curves of its law over the first one; its table has the numbers of these.
    """

    name: str
    kind: int
    by: int
    of: np.ndarray
    on: np.ndarray
    bodies: np.ndarray
    table: Table = Table(np.zeros(1), np.zeros(1))
    slot: int = -1
    element: int = -1
    factor: int = -1
    start: float = 0.0
    gap: float = 0.0
    damping: float = 0.0
    springs: tuple[tuple[float, float], ...] = ()
    curves: tuple[Table, ...] = ()


class Laws(NamedTuple):
    """All laws as arrays, one row for each of `Law`; law k has the springs from first_spring[k] to first_spring[k + 1].

    Parameters
    ----------
    kind, by, slot, element, factor : (laws,) arrays of int64
        As those of `Law`.
    second : (laws,) array of int64
        Which law is its second argument, -1 without one.
    of, on : (laws, n) arrays
        Coefficients of the generalised speeds that each reads and on which it acts.
    gap, damping : (laws,) arrays
        Half the backlash [rad] and damping [Nm s/rad] of a SHAFT; `gap` is also the ratio of a GEARING at the start.
    first_spring : (laws + 1,) array of int64
        Where the springs of each begin.
    springs : (springs, 2) array
        Stiffness [Nm/rad] and limit [Nm] of each.
    tables : Tables
        The characteristics, followed by the curves of those over two arguments.
    """

    kind: Ints
    by: Ints
    slot: Ints
    element: Ints
    factor: Ints
    second: Ints
    of: Floats
    on: Floats
    gap: Floats
    damping: Floats
    first_spring: Ints
    springs: Floats
    tables: Tables


class LawState(NamedTuple):
    """State of the laws.

    Parameters
    ----------
    at : (laws,) array of float
        Position that each law reads.
    torque : (laws,) array of float
        Its torque (for a MOTION the mean of the last step), factor, inertia or ratio, or the mean power of a HEAT.
    spring : (springs,) array of float
        Torque of each spring with friction [Nm].
    way : (laws,) array of float
        Change of each position in the last step.
    work : (1,) array of float
        Work from outside that the work on the speeds does not include [J].
    """

    at: np.ndarray
    torque: np.ndarray
    spring: np.ndarray
    way: np.ndarray
    work: np.ndarray


class Model(NamedTuple):
    """A driveline with laws; no step changes it.

    Parameters
    ----------
    bare : int
        Address of the bare step.
    structure : Structure
        The driveline without its laws.
    mass : (n, n) array
        Mass matrix of the speeds [kg m2].
    laws : Laws
        The laws.
    """

    bare: int
    structure: Structure
    mass: Floats
    laws: Laws


class Given(NamedTuple):
    """What acts on a driveline with laws over a step, or (k, ...) over k steps.

    Parameters
    ----------
    loads : Loads
        Forces and capacities without those of laws.
    factors : (3, inputs) array
        Inputs of the laws at both ends, and by how much they are above the mean of these in the middle.
    """

    loads: Loads
    factors: Floats


class Moving(NamedTuple):
    """What a step of a driveline with laws changes in place.

    Parameters
    ----------
    loss : (k, loss_width(n, m)) array
        Losses by torque, with the columns of driveline.losses.
    state : State
        State of the driveline; its twist has places for the integrals of the speeds.
    own : LawState
        State of the laws.
    """

    loss: Floats
    state: State
    own: LawState


def laws_of(laws: Sequence[Law], n: int) -> Laws:
    """Return the arrays of laws that are sorted by kind, for n speeds."""
    ints = (np.array([getattr(one, name) for one in laws], np.int64) for name in ("kind", "by", "slot", "element", "factor"))
    kind, by, slot, element, factor = ints
    arguments = {one.name: k for k, one in enumerate(laws) if one.kind == ARGUMENT}
    second = [arguments.get(one.name, -1) if one.kind in (CAPACITY, TORQUE, TEETH) else -1 for one in laws]
    of, on = (np.array([getattr(one, name) for one in laws], float).reshape(len(laws), n) for name in ("of", "on"))
    springs = [spring for one in laws for spring in one.springs]
    tables, curves = [_straightened(one.table) if one.kind == SHAFT and one.gap == 0.0 else one.table for one in laws], []
    for k in arguments.values():
        tables[k] = tables[k]._replace(y=tables[k].y + len(laws) + len(curves))
        curves += laws[k].curves
    return Laws(
        kind,
        by,
        slot,
        element,
        factor,
        np.array(second, np.int64),
        of,
        on,
        np.array([one.gap for one in laws]),
        np.array([one.damping for one in laws]),
        np.cumsum([0, *(len(one.springs) for one in laws)]),
        np.array(springs, float).reshape(-1, 2),
        tables_of(tables + curves),
    )


def _straightened(table: Table) -> Table:
    """Return a table without the points at which its slope does not change."""
    slopes = np.diff(table.y) / np.diff(table.x)
    kept = np.concatenate([[True], np.abs(np.diff(slopes)) > 1e-12 * np.abs(slopes).max(), [True]])
    return table._replace(x=table.x[kept], y=table.y[kept])


def law_state(laws: Sequence[Law]) -> LawState:
    """Return the state of the laws at the start of a run."""
    count = len(laws)
    torque = np.array([value_at(one.table, one.start) if one.kind == INERTIA else one.gap * (one.kind == GEARING) for one in laws])
    return LawState(
        np.array([one.start for one in laws], float),
        torque,
        np.zeros(sum(len(one.springs) for one in laws)),
        np.zeros(count),
        np.zeros(1),
    )


def stored_energy(system: System, v: Floats, twist: Floats, torque: Floats, spring: Floats) -> Floats:
    """Return the energy that is stored at r moments.

    Parameters
    ----------
    system : System
        The driveline.
    v : (r, n) array of float
        Generalised speeds [rad/s].
    twist : (r, s) array of float
        Twists of the shafts [rad].
    torque : (r, laws) array of float
        Torque or inertia of the laws.
    spring : (r, springs) array of float
        Torque of the springs with friction [Nm].

    Returns
    -------
    (r,) array of float
        Energy [J].
    """
    straight, springs = system.kc[0].copy(), laws_of(system.laws, len(system.speeds)).springs
    moving = np.where(system.state_speeds, 0.0, v)
    out = 0.5 * np.einsum("ri,ij,rj->r", moving, system.mass, moving)
    for k, law in enumerate(system.laws):
        if law.kind == SHAFT:
            straight[law.slot] = 0.0
            out += stored_in(law.table, twist[:, law.slot])
        elif law.kind == INERTIA:
            out += 0.5 * torque[:, k] * (v @ law.on) ** 2
    out += 0.5 * twist**2 @ straight
    return out + 0.5 * spring**2 @ (1.0 / springs[:, 0])
