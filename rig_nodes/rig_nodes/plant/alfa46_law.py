# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The compiled law of the Alfa46: current profiles of six points, shift delays, and a PID on the coil current.

Called once per sample by the engine (embedded controller) and by controllers.alfa46.box (a process of its own).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import njit

if TYPE_CHECKING:
    from ..base import Floats, Record

OUTPUTS = 3  # the Alfa46 drives up to three valves; other controllers have as many outputs as the rig wires
GEARS = 7  # number of combinations of outputs
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
)  # drives: by number of the gear, bit k is set where the gear drives output k
# phase of an output: 0 off, 1 rising or on, 2 falling; start: sample of the switch signal that began this phase
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
    """Return the current setpoint at a time after the switch signal.

    P1-P3 count from switch-on and start at no current; P4-P6 count from switch-off and start at the current of that moment. The
    current is linear in between (thesis 3.4).

    Parameters
    ----------
    elapsed : float
        Time since the switch signal [s].
    rising : bool
        True after switch-on, False after switch-off.
    level : float
        Current at switch-off [A].
    points : (6, 2) array of float
        Times [s] and currents [A] of P1-P6.

    Returns
    -------
    float
        Current setpoint [A].
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
    """Accept a gear order at a sample: schedule switch-on and switch-off with the delay of this change of gear.

    A negative delay energises the engaging valves that much before the releasing ones are switched off; a positive delay energises
    them that much later. Only changes to the next gear have a delay. An output of both gears stays as it is. The caller checks the
    order (gear already in, shift running).

    Parameters
    ----------
    gear : int
        Number of the gear.
    sample : int
        Number of the sample.
    config : Record
        Record of LAW_CONFIG.
    profiles : (OUTPUTS, 6, 2) array of float
        Times [s] and currents [A] of the profiles.
    outputs : (OUTPUTS,) record array
        Records of LAW_OUTPUT, which are changed.
    state : Record
        Record of LAW_STATE, which is changed.
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
    """Take one sample of an output's power stage: a PID on the measured coil current sets the duty in ``out``.

    The PID works in volts of coil voltage, with a filtered derivative. Its integral is held inside the supply (no wind-up);
    duty = voltage / supply, 0 to 1. An output that is not active gets no duty.

    Parameters
    ----------
    active : bool
        Whether the output is on.
    current : float
        Measured coil current [A].
    out : Record
        Record of LAW_OUTPUT, which is changed.
    config : Record
        Record of LAW_CONFIG.
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
    """Take one controller sample: set duty and setpoint in ``outputs`` by the measured coil currents.

    Parameters
    ----------
    sample : int
        Number of the sample.
    currents : (OUTPUTS,) array of float
        Measured coil currents [A].
    config : Record
        Record of LAW_CONFIG.
    profiles : (OUTPUTS, 6, 2) array of float
        Times [s] and currents [A] of the profiles.
    outputs : (OUTPUTS,) record array
        Records of LAW_OUTPUT, which are changed.
    state : Record
        Record of LAW_STATE, which is changed.
    """
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
