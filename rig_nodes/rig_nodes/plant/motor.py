# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""DC motor with thyristor speed control on the input shaft w0 (70 kW, laboratory device SE1).

Called by plant.kernel: a ramped speed setpoint, a PI speed loop with limits, first-order torque build-up.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

from numba import njit

from ..config.schema import param


@dataclass(frozen=True)
class MotorConfig:
    """Drive data; the torque limit is the smaller of torque_limit and power_limit / speed."""

    torque_limit: float = param("torque", 1.0, 1e5)
    braking_limit: float = param("torque", 0.0, 1e5)
    power_limit: float = param("power", 1.0, 1e7)
    torque_time: float = param("time", 1e-4, 1.0)
    speed_gain: float = param("torque per speed", 0.0, 1e4)
    speed_gain_integral: float = param("torque per angle", 0.0, 1e5)
    ramp: float = param("angular acceleration", 0.1, 1e5)


@njit(cache=True, error_model="numpy", forceinline=True)
def ramp_setpoint(setpoint, target, h, motor):
    """The speed setpoint after h, moved towards its target by the drive's ramp."""
    change = motor.ramp * h
    return setpoint + min(max(target - setpoint, -change), change)


@njit(cache=True, error_model="numpy", forceinline=True)
def next_setpoint(setpoint, target, speed, enabled, h, motor):
    """The speed setpoint after h: ramped towards its target; that of a disabled drive follows the shaft."""
    return ramp_setpoint(setpoint, target, h, motor) if enabled else speed


@njit(cache=True, error_model="numpy", forceinline=True)
def drive_torque(torque, integral, setpoint, speed, enabled, h, motor):
    """(torque [Nm], integral part [Nm]) after h: PI with clamped integral; a disabled drive has no torque."""
    return torque_after(torque, integral, setpoint, speed, enabled, h, exp(-h / motor.torque_time), motor)


@njit(cache=True, error_model="numpy", forceinline=True)
def torque_after(torque, integral, setpoint, speed, enabled, h, decay, motor):
    """:func:`drive_torque` over a time h in which the share ``decay`` of a change of torque is still to come."""
    if not enabled:
        return 0.0, 0.0
    upper = min(motor.torque_limit, motor.power_limit / max(abs(speed), 1.0))
    lower = -min(motor.braking_limit, upper)
    error = setpoint - speed
    before, integral = integral, min(max(integral + motor.speed_gain_integral * error * h, lower), upper)
    asked = min(max(motor.speed_gain * error + 0.5 * (before + integral), lower), upper)
    return asked + (torque - asked) * decay, integral
