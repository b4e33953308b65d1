# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of any rig: parts, driveline, parts again, in this order. Called by engine.loop.

1. speeds that the bodies are expected to have in the middle of the step, as they have been going;
2. ``before`` of each part, in the order of the parts: oil supplies, valves, clutches, motors, loads, losses;
3. the driveline between the old and the new torques and capacities;
4. speeds, accelerations and torques between bodies at the step's end;
5. ``after`` of each part: heat, wear and what follows from torques.
"""

from __future__ import annotations

from numba import njit

from ..plant.driveline_algebra import LAM, VISC
from ..plant.driveline_kernel import driveline_step
from ..plant.driveline_quiet import quiet_step
from .stages import after, before, bound


@njit(error_model="numpy", forceinline=True)
def plant_step(world, h, t):
    """The plant from t to t + h."""
    line = world.driveline
    v, gain, q, cap, el, w = line.v, line.gain, line.q, line.cap, line.el, line.w
    for b in range(line.middle.shape[0]):
        total = 0.0
        for j in range(v.shape[0]):
            total += line.bodies[b, j] * (v[j] + 0.5 * gain[j])
        line.middle[b] = total
        line.push[0, b] = line.push[1, b] = 0.0
    before(world, h, t)
    for j in range(v.shape[0]):
        for end in range(2):
            total = 0.0
            for b in range(line.middle.shape[0]):
                total += line.bodies[b, j] * line.push[end, b]
            q[end, j] = total
        gain[j] = v[j]
    if not quiet_step(h, line):
        driveline_step(h, t, line.minv, w, line.sh, line.kc, q, cap, line.loss, v, line.twist, line.mode, el, line.shaft,
                       line.e_in, line.events, line.count, line.work)
    bound(world)
    for j in range(v.shape[0]):
        gain[j] = v[j] - gain[j]
    measure_driveline(line)
    after(world, h)


@njit(error_model="numpy", forceinline=True)
def measure_driveline(line):
    """Speeds and accelerations of the bodies with a port, and torques between bodies, at the end of a step."""
    v, q, cap, el, w, rates = line.v, line.q, line.cap, line.el, line.w, line.rates
    m = el.shape[1]
    for j in range(v.shape[0]):
        rates[j] = 0.0
    for i in range(v.shape[0]):
        on = q[1, i]
        for f in range(m):
            slip = 0.0
            for j in range(v.shape[0]):
                slip += w[f, j] * v[j]
            on -= w[f, i] * (el[LAM, f] + cap[VISC, f] * slip)
        for j in range(v.shape[0]):
            rates[j] += line.minv[j, i] * on
    for b in range(line.speed.shape[0]):
        speed, rate = 0.0, 0.0
        for j in range(v.shape[0]):
            speed += line.bodies[b, j] * v[j]
            rate += line.bodies[b, j] * rates[j]
        line.gained[b] = speed - line.speed[b]
        line.speed[b], line.rate[b] = speed, rate
    for k in range(line.meter.shape[0]):
        # three sums, so that none waits for the other
        friction, pushed, inertia = 0.0, 0.0, 0.0
        for f in range(m):
            friction += line.meter_of[k, f] * el[LAM, f]
        for b in range(line.speed.shape[0]):
            pushed += line.meter_of[k, m + b] * line.push[1, b]
        for j in range(v.shape[0]):
            inertia += line.meter_of[k, m + line.speed.shape[0] + j] * rates[j]
        line.meter[k] = friction + pushed + inertia
