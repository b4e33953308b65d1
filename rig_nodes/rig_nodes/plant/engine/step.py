# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of any rig: parts, driveline, and parts again, in this order. Called by plant.engine.loop.

1. the speeds that the bodies are expected to have in the middle of the step, continued from the last step;
2. ``before`` of each part, in the order of the parts: oil supplies, valves, clutches, motors, loads, losses;
3. the driveline between the old and the new torques and capacities;
4. speeds, accelerations and torques between bodies at the step's end;
5. ``after`` of each part: heat, wear and what follows from torques.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numba.extending import overload

from ...base import INLINED, njit
from ...driveline import LAM, TAU, VISC, add, dot, product, put, quiet_shafts_step, quiet_step, scaled, vector
from .general_step import driven_step_at, general_step, quick_step_at
from .stages import after, before, bound

if TYPE_CHECKING:
    from collections.abc import Callable

    from numba import types

    from ...base import Record
    from .general_step import Addresses


@njit(**INLINED)
def plant_step(world: Record, addresses: Addresses, h: float, t: float) -> None:
    """Move the plant from t to t + h.

    Parameters
    ----------
    world : Record
        The world.
    addresses : Addresses
        Addresses of the driveline's steps.
    h : float
        Length of the step [s].
    t : float
        Time at its start [s].
    """
    line = world.driveline
    v, gain, q, pushed = line.v, line.gain, line.q, line.middle.shape[0]
    n = v.shape[0]
    middle = add(vector(v, 0, v), 0.5, vector(gain, 0, v))
    for b in range(pushed):
        line.middle[b] = dot(vector(line.bodies, b * n, v), middle)
        line.push[0, b] = line.push[1, b] = 0.0
    before(world, h, t)
    for end in range(2):
        on = scaled(0.0, middle)
        for b in range(pushed):
            on = add(on, line.push[end, b], vector(line.bodies, b * n, v))
        put(q, end * n, on)
    put(gain, 0, vector(v, 0, v))
    move_driveline(line, addresses, h, t)
    bound(world)
    put(gain, 0, add(vector(v, 0, v), -1.0, vector(gain, 0, v)))
    measure_driveline(line)
    after(world, h)


def is_driven(line: types.Record) -> bool:
    """Return whether the type of a driveline's record is one with laws, meshes with losses or inputs over time."""
    return "begun" in line.fields


def move_driveline(line: Record, addresses: Addresses, h: float, t: float) -> None:
    """Move the driveline's record from t over h, by the step that its type needs."""
    raise TypeError("the driveline is moved from compiled code only")


# numba compares the parameters of an overload, with their annotations, with those of the function that it returns. The parameters
# of the first are types and those of the second are values, so neither function has annotations
@overload(move_driveline, jit_options=INLINED)
def _move_driveline(line, addresses, h, t) -> Callable[..., None]:  # noqa: ANN001, see above
    if is_driven(line):

        def driven(line, addresses, h, t) -> None:  # noqa: ANN001, see above
            if not quick_step_at(addresses, h, t, line):
                driven_step_at(addresses, h, t, line)

        return driven

    if line.fields["sh"][0].shape[0] > 0:

        def swung(line, addresses, h, t) -> None:  # noqa: ANN001, see above
            if not quiet_shafts_step(h, line):
                general_step(addresses, h, t, line)

        return swung

    def moved(line, addresses, h, t) -> None:  # noqa: ANN001, see above
        if not quiet_step(h, line):
            general_step(addresses, h, t, line)

    return moved


def accelerations(line: Record) -> tuple[float, ...]:
    """Return the accelerations of the driveline's speeds at the end of a step [rad/s2]."""
    raise TypeError("accelerations are taken from compiled code only")


@overload(accelerations, jit_options=INLINED)
def _accelerations(line) -> Callable[..., tuple[float, ...]]:  # noqa: ANN001, see above
    if is_driven(line):
        return lambda line: vector(line.accel, 0, line.v)

    def taken(line) -> tuple[float, ...]:  # noqa: ANN001, see above
        v, w, sh, cap, el = line.v, line.w, line.sh, line.cap, line.el
        m, n = w.shape
        speeds = vector(v, 0, v)
        on = vector(line.q, n, v)
        for f in range(m):
            along = vector(w, f * n, v)
            on = add(on, -(el[LAM, f] + cap[VISC, f] * dot(along, speeds)), along)
        for a in range(sh.shape[0]):
            on = add(on, -line.shaft[TAU, a], vector(sh, a * n, v))
        return product(line.minv, 0, on)

    return taken


@njit(**INLINED)
def measure_driveline(line: Record) -> None:
    """Compute speeds and accelerations of the bodies with a port, and torques between bodies, at the end of a step."""
    v, el, own = line.v, line.el, line.speed.shape[0]
    m, n = line.w.shape
    shafts = line.sh.shape[0]
    speeds = vector(v, 0, v)
    rates = accelerations(line)
    for b in range(own):
        turns = vector(line.bodies, b * n, v)
        speed = dot(turns, speeds)
        line.gained[b] = speed - line.speed[b]
        line.speed[b], line.rate[b] = speed, dot(turns, rates)
    for k in range(line.meter.shape[0]):
        # three separate sums, so that the processor can compute them at the same time
        friction, pushed = 0.0, 0.0
        for f in range(m):
            friction += line.meter_of[k, f] * el[LAM, f]
        for b in range(own):
            pushed += line.meter_of[k, m + b] * line.push[1, b]
        for a in range(shafts):
            pushed += line.meter_of[k, m + own + a] * line.shaft[TAU, a]
        line.meter[k] = friction + pushed + dot(vector(line.meter_of, k * (m + own + shafts + n) + m + own + shafts, v), rates)
