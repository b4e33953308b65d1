# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The law of the Alfa46 box, compiled: six-point current profiles, shift delays, PID on the coil current.

Called by the engine (embedded controller) and by alfa46.controller (a process of its own) alike, once per sample.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from ..arrays import Floats, Record

OUTPUTS = 3  # the box drives up to three valves
GEARS = 7  # as many as there are choices of outputs
NEUTRAL, GEAR_I, GEAR_II, GEAR_III = 0, 1, 2, 3

LAW_CONFIG = np.dtype(
    [
        ("period", "f8"),
        ("supply_voltage", "f8"),
        ("gain_p", "f8"),
        ("gain_i", "f8"),
        ("gain_d", "f8"),
        ("derivative_time", "f8"),
        ("t12", "f8"),
        ("t21", "f8"),
        ("t23", "f8"),
        ("t32", "f8"),
        ("drives", "i8", (GEARS + 1,)),
    ]
)  # drives: of each gear by its number, bit k: output k
# phase of an output: 0 off, 1 rising or on, 2 falling; start: sample of the switch signal of that phase
LAW_OUTPUT = np.dtype(
    [
        ("phase", "f8"),
        ("start", "f8"),
        ("pending", "f8"),
        ("pending_at", "f8"),
        ("level", "f8"),
        ("setpoint", "f8"),
        ("integral", "f8"),
        ("filtered", "f8"),
        ("duty", "f8"),
    ]
)
LAW_STATE = np.dtype([("gear", "f8"), ("shift_end", "f8"), ("sample", "f8")])
OFF, ON, FALLING = 0.0, 1.0, 2.0


@njit(cache=True, error_model="numpy", forceinline=False)
def profile_current(elapsed: float, rising: bool, level: float, points: Floats) -> float:
    """Current setpoint [A], ``elapsed`` seconds after the switch signal.

    points: (6, 2) times [s] and currents [A]. P1-P3 count from switch-on and start at no current, P4-P6 from
    switch-off and start at the current ``level`` of that moment; straight lines in between (thesis 3.4).
    """
    first = 0 if rising else 3
    t0 = 0.0
    i0 = 0.0 if rising else level
    for k in range(first, first + 3):
        t1, i1 = points[k, 0], points[k, 1]
        if elapsed < t1:
            return i0 + (i1 - i0) * (elapsed - t0) / (t1 - t0)
        t0, i0 = t1, i1
    return i0


@njit(cache=True, error_model="numpy", forceinline=False)
def order_gear(gear: int, sample: int, config: Record, profiles: Floats, outputs: Record, state: Record) -> None:
    """Take a gear order at a sample: schedules switch-on and switch-off with the delay of this change.

    A negative delay energises the engaging valves that much before the releasing ones are switched off; a positive
    one lets them wait; only changes to the next gear have one. An output of both gears stays as it is. Orders are checked by
    the caller (gear already in, shift running).
    """
    old = int(state.gear)
    delay = 0.0
    if old == GEAR_I and gear == GEAR_II:
        delay = config.t12
    elif old == GEAR_II and gear == GEAR_I:
        delay = config.t21
    elif old == GEAR_II and gear == GEAR_III:
        delay = config.t23
    elif old == GEAR_III and gear == GEAR_II:
        delay = config.t32
    wait = round(delay / config.period)
    end = sample
    engaging, releasing = config.drives[gear] & ~config.drives[old], config.drives[old] & ~config.drives[gear]
    for k in range(OUTPUTS):
        out = outputs[k]
        if engaging >> k & 1:
            out.pending = ON
            out.pending_at = sample + max(0, wait)
            end = max(end, out.pending_at + round(profiles[k, 2, 0] / config.period))
        elif releasing >> k & 1:
            out.pending = FALLING
            out.pending_at = sample + max(0, -wait)
            end = max(end, out.pending_at + round(profiles[k, 5, 0] / config.period))
    state.gear = gear
    state.shift_end = end


@njit(cache=True, error_model="numpy", forceinline=False)
def current_loop(active: bool, current: float, out: Record, config: Record) -> None:
    """One sample of an output's power stage: PID on the measured coil current [A], leaves its duty in ``out``.

    In volts of coil voltage, with a filtered derivative; the integral is held inside the supply (no wind-up);
    duty = voltage / supply, 0 to 1. An output that is not active gets no duty.
    """
    if not active:
        out.duty = 0.0
        out.integral = 0.0
        out.filtered = -current
        return
    error = out.setpoint - current
    # the filtered error follows the error with the derivative's time constant; their difference is its slope
    slope = (error - out.filtered) / config.derivative_time
    out.filtered += slope * config.period
    out.integral = min(max(out.integral + config.gain_i * error * config.period, 0.0), config.supply_voltage)
    voltage = config.gain_p * error + out.integral + config.gain_d * slope
    out.duty = min(max(voltage / config.supply_voltage, 0.0), 1.0)


@njit(cache=True, error_model="numpy", forceinline=False)
def law_step(sample: int, currents: Floats, config: Record, profiles: Floats, outputs: Record, state: Record) -> None:
    """One controller sample: reads the measured coil currents (3,) [A], leaves duty and setpoint in ``outputs``."""
    state.sample = sample
    for k in range(OUTPUTS):
        out = outputs[k]
        if out.pending != OFF and sample >= out.pending_at:
            out.phase = out.pending
            out.start = out.pending_at
            out.level = out.setpoint
            out.pending = OFF
        out_of_time = False
        if out.phase != OFF:
            rising = out.phase == ON
            elapsed = (sample - out.start) * config.period
            out.setpoint = profile_current(elapsed, rising, out.level, profiles[k])
            out_of_time = not rising and elapsed > profiles[k, 5, 0] and out.setpoint <= 0.0
        if out_of_time or out.phase == OFF:
            out.phase = OFF
            out.setpoint = 0.0
        current_loop(out.phase != OFF, currents[k], out, config)
