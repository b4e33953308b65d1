# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The compiled entry of the clutch bench (thesis chapter 8): hydraulics, piston, shaft, pack and instruments together.

Called by testbench.clutch_bench only; the counterpart of plant.kernel, made of the same parts and driveline.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..instruments.noise import noise_at
from ..instruments.transducers import HUM, NOISE, STEP, analog, encoder, logged
from . import clutch as clutch_model
from . import hydraulic_motor, oil_supply, press_cylinder
from .driveline_algebra import E_FRIC, E_VISC, HI0, HI1, KIN0, KIN1, LO0, LO1, N_CAPPED, TAU, VISC
from .driveline_kernel import driveline_step
from .hydraulic_motor import FRICTION, PACK
from .outcome import NOT_FINITE, NOT_SETTLED, WHOLE

# columns of the logger's rows; the signal catalogue must agree (testbench.clutch_bench checks it)
CHANNELS = ("M_e", "n", "p_z", "s", "p_sh", "T_emp", "F_ps")
M_E, N, P_Z, S, P_SH, T_EMP, F_PS = range(len(CHANNELS))
MOTOR, SHAFT = range(2)  # bodies

# relief: setting of ZP_2 as it is turned; force: on what the piston or the testing machine presses
BENCH_STATE = np.dtype([
    ("motor_pressure", "f8"), ("relief", "f8"), ("p_z", "f8"), ("travel", "f8"), ("force", "f8"), ("clamp", "f8"),
    ("kinetic", "f8"), ("static", "f8"), ("drag", "f8"), ("temperature", "f8"), ("heat", "f8"), ("m_e", "f8"),
])
# what people and the sequencer set, and the safe state
BENCH_SETTINGS = np.dtype([
    ("motor_speed", "f8"), ("motor_on", "f8"), ("relief_pressure", "f8"), ("relief_on", "f8"),
    ("cylinder_pressure", "f8"), ("cylinder_on", "f8"), ("press_travel", "f8"), ("press_on", "f8"), ("safe", "f8"),
])


@njit(cache=True)
def clamp(state, settings, h, cylinder, oil):
    """The lever valve R, chamber, piston and springs, or the testing machine in their place."""
    on = settings.cylinder_on > 0.0 and settings.safe == 0.0
    state.p_z = oil_supply.supply_pressure(state.p_z, settings.cylinder_pressure, on, 0.0, h, oil)
    if cylinder.testing_machine > 0.0:
        target = settings.press_travel if settings.press_on > 0.0 and settings.safe == 0.0 else 0.0
        state.travel = press_cylinder.machine_step(state.travel, target, h, cylinder)
        state.force = press_cylinder.spring_force(state.travel, cylinder)[0]
        return
    state.travel = press_cylinder.piston_step(state.travel, state.p_z, h, cylinder)
    state.force = state.clamp = press_cylinder.contact_force(state.travel, cylinder)


@njit(cache=True)
def measure(row, index, state, v, oil, table, keys, hum, gauge_state, counts):
    """One logger row: true values as transducers, speed sensor and converter show them at the end of a step."""
    row[M_E], row[N] = state.m_e, v[SHAFT]
    row[P_Z], row[S], row[P_SH] = state.p_z, state.travel, state.motor_pressure
    row[T_EMP], row[F_PS] = oil.temperature, state.force
    mains = hum[index % hum.size]
    for c in range(row.size):
        if table[STEP, c] > 0.0:
            value = encoder(row[c], index, c, keys[c], table, gauge_state, counts)
        else:
            value = analog(row[c], table[HUM, c] * mains, c, table, gauge_state)
            if table[NOISE, c] > 0.0:
                value += table[NOISE, c] * noise_at(keys[c], index)
        row[c] = logged(value, c, table)


@njit(cache=True)
def bench_step(h, t, settings, state, v, twist, mode, el, shaft, e_in, events, count, work, q, cap, loss, minv, w, sh,
               kc, motor, cylinder, oil, pack):
    """The bench from t to t + h: clamp and motor line first, then the shaft between the old and the new capacities."""
    kinetic, static = state.kinetic, state.static
    clamp(state, settings, h, cylinder, oil)
    # (6.56): what the pack asks for beyond its clamp is there as soon as the asperities carry
    rest = pack.rest_torque * min(1.0, state.clamp / pack.film_force)
    factor = clutch_model.friction_factor(state.temperature, pack)
    state.kinetic = factor * pack.kinetic_per_force * state.clamp + rest
    state.static = factor * pack.static_per_force * state.clamp + rest
    viscosity = oil_supply.viscosity_at(state.temperature, oil)
    state.drag = clutch_model.drag_coefficient(state.travel, state.clamp, viscosity, pack)
    cap[KIN0, PACK], cap[KIN1, PACK] = kinetic, state.kinetic
    cap[HI0, PACK], cap[HI1, PACK] = static, state.static
    cap[LO0, PACK], cap[LO1, PACK] = -static, -state.static
    cap[VISC, PACK] = state.drag
    cap[KIN0, FRICTION] = cap[KIN1, FRICTION] = cap[HI0, FRICTION] = cap[HI1, FRICTION] = motor.friction
    cap[LO0, FRICTION] = cap[LO1, FRICTION] = -motor.friction

    safe = settings.safe > 0.0
    open_to = settings.relief_pressure if settings.relief_on > 0.0 and not safe else 0.0
    state.relief = hydraulic_motor.valve_setting(state.relief, open_to, h, motor)
    flow = motor.displacement * settings.motor_speed if settings.motor_on > 0.0 and not safe else 0.0
    q[0, MOTOR] = motor.displacement * state.motor_pressure
    state.motor_pressure = hydraulic_motor.line_pressure(
        state.motor_pressure, flow, v[MOTOR], state.relief, h, oil.bulk_modulus, motor)
    q[1, MOTOR] = motor.displacement * state.motor_pressure

    driveline_step(h, t, minv, w, sh, kc, q, cap, loss, v, twist, mode, el, shaft, e_in, events, count, work)
    state.m_e = shaft[TAU, 0]
    heat = el[E_FRIC, PACK] + el[E_VISC, PACK]
    # wear is left out: a slip of some milliseconds moves the contact by less than a nanometre
    left, rise = clutch_model.plates_cooling(h, pack)
    state.temperature = clutch_model.plates_after(
        state.temperature, 0.0, heat - state.heat, oil.temperature, left, rise, pack)[0]
    state.heat = heat


@njit(cache=True, nogil=True)
def advance(samples, first_sample, steps_per_sample, h, settings, state, v, twist, mode, el, shaft, e_in, events, count,
            work, q, cap, loss, minv, w, sh, kc, motor, cylinder, oil, pack, table, keys, hum, gauge_state, counts, log,
            moved, kept):
    """Move the bench by whole samples of 1 ms; row j of the ring ``log`` is the time j * h after 0.

    Returns (the sample that was reached, WHOLE, NOT_FINITE or NOT_SETTLED), as plant.kernel.advance does; moved: all of
    ``state``, ``v`` to ``e_in`` but the modes lie in it; kept (2, as many): its copy at the sample's beginning, and the
    state that was not finite.
    """
    rows, how, capped = log.shape[0], WHOLE, count[N_CAPPED]
    modes = mode.copy()
    for s in range(first_sample, first_sample + samples):
        kept[0, :] = moved
        modes[:] = mode
        for index in range(s * steps_per_sample, (s + 1) * steps_per_sample):
            if how == WHOLE:
                bench_step(h, index * h, settings[0], state[0], v, twist, mode, el, shaft, e_in, events, count, work, q,
                           cap, loss, minv, w, sh, kc, motor[0], cylinder[0], oil[0], pack[0])
                if not np.isfinite(moved).all():
                    how = NOT_FINITE
                    kept[1, :] = moved
                    moved[:] = kept[0]
                    mode[:] = modes
                    work[:] = 0.0
            measure(log[(index + 1) % rows], index + 1, state[0], v, oil[0], table, keys, hum, gauge_state, counts)
        if how == WHOLE and count[N_CAPPED] != capped:
            how = NOT_SETTLED
        if how != WHOLE:
            return s + 1, how
    return first_sample + samples, how
