# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""DC motor with thyristor speed control on a shaft: a ramped speed setpoint, a PI speed loop, torque build-up.

It is a part of the engine; plant.engine.outside steps its physics alone for a motor that stands outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .part import SOURCE, Command, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


@dataclass(frozen=True)
class MotorConfig:
    """Values of the drive; the torque limit is the smaller of torque_limit and power_limit / speed."""

    torque_limit: float = param("torque", 1.0, 1e5, "Largest driving torque, where the power limit does not demand less")
    braking_limit: float = param("torque", 0.0, 1e5, "Largest braking torque")
    power_limit: float = param(
        "power", 1.0, 1e7, "Largest driving power; beyond its speed the torque falls with the speed's reciprocal"
    )
    torque_time: float = param(
        "time", 1e-4, 1.0, "Time constant with which the air-gap torque follows the setpoint of the speed loop"
    )
    speed_gain: float = param("torque per speed", 0.0, 1e4, "Proportional gain of the speed loop")
    speed_gain_integral: float = param("torque per angle", 0.0, 1e5, "Integral gain of the speed loop")
    ramp: float = param("angular acceleration", 0.1, 1e5, "Rate at which the speed setpoint moves to the ordered speed")


@njit(cache=True, error_model="numpy", forceinline=True)
def ramp_setpoint(setpoint: float, target: float, h: float, motor: Record) -> float:
    """Return the speed setpoint after h [s], moved towards its target by the drive's ramp [rad/s]."""
    change = motor.ramp * h
    return setpoint + min(max(target - setpoint, -change), change)


@njit(cache=True, error_model="numpy", forceinline=True)
def next_setpoint(setpoint: float, target: float, speed: float, enabled: bool, h: float, motor: Record) -> float:
    """Return the speed setpoint after h: ramped towards its target; that of a disabled drive follows the shaft."""
    return ramp_setpoint(setpoint, target, h, motor) if enabled else speed


@njit(cache=True, error_model="numpy", forceinline=True)
def drive_torque(
    torque: float, integral: float, setpoint: float, speed: float, enabled: bool, h: float, motor: Record
) -> tuple[float, float]:
    """Return the air-gap torque after a step: a PI with clamped integral; a disabled drive has no torque.

    Parameters
    ----------
    torque, integral : float
        Torque and its integral part before the step [Nm].
    setpoint, speed : float
        Speed setpoint and speed [rad/s].
    enabled : bool
        Whether the drive is on.
    h : float
        Length of the step [s].
    motor : Record
        Values of the motor.

    Returns
    -------
    tuple of float
        Torque and integral part [Nm].
    """
    return torque_after(torque, integral, setpoint, speed, enabled, h, exp(-h / motor.torque_time), motor)


@njit(cache=True, error_model="numpy", forceinline=True)
def torque_after(
    torque: float, integral: float, setpoint: float, speed: float, enabled: bool, h: float, decay: float, motor: Record
) -> tuple[float, float]:
    """Return :func:`drive_torque` after a time h in which the share ``decay`` of a change of torque is still to come."""
    if not enabled:
        return 0.0, 0.0
    upper = min(motor.torque_limit, motor.power_limit / max(abs(speed), 1.0))
    lower = -min(motor.braking_limit, upper)
    error = setpoint - speed
    before, integral = integral, min(max(integral + motor.speed_gain_integral * error * h, lower), upper)
    asked = min(max(motor.speed_gain * error + 0.5 * (before + integral), lower), upper)
    return asked + (torque - asked) * decay, integral


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of torque that is still to come after a step."""
    world.values.dc_motor[k].decay = exp(-h / world.values.dc_motor[k].torque_time)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the torque on its body at both ends of the step, by the speed in the middle of it."""
    me, my, line = world.parts.dc_motor[k], world.values.dc_motor[k], world.driveline
    drive = me.enabled > 0.0 and world.safe == 0.0
    if my.stiff > 0.0:
        # the inertia of its body is so large that no clutch changes its speed; the torque moves it to the setpoint at the step's
        # end
        me.setpoint = next_setpoint(me.setpoint, me.target, line.speed[my.body], drive, h, my)
        me.before = me.torque = (me.setpoint - line.speed[my.body]) / (my.mobility * h) if drive else 0.0
    elif me.held > 0.0:
        me.setpoint = me.held_setpoint
        me.before = me.torque = me.held_torque if world.safe == 0.0 else 0.0
    else:
        setpoint = me.setpoint
        me.setpoint = next_setpoint(setpoint, me.target, line.speed[my.body], drive, h, my)
        me.before = me.torque if drive else 0.0
        me.torque, me.integral = torque_after(
            me.torque, me.integral, 0.5 * (setpoint + me.setpoint), line.middle[my.body], drive, h, my.decay, my
        )
    line.push[0, my.body] += me.before
    line.push[1, my.body] += me.torque


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Compute the load torque on a body with a prescribed speed: the torque that its motion takes less the torque that moved it."""
    me, my, line = world.parts.dc_motor[k], world.values.dc_motor[k], world.driveline
    if my.stiff > 0.0:
        me.torque = my.inertia * line.gained[my.body] / h + (me.torque - line.rate[my.body] / my.mobility)


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its MotorState."""
    me = rig.device(name)
    return (rig.speed_at(name), me["setpoint"], me["torque"], rig.energies["motor"], me["enabled"] > 0.0)


# target, enabled: speed setpoint and switch; held*: torque and setpoint of a motor outside the plant, for a tick
# (plant.engine.outside); before: torque at the step's start; stiff > 0: the speed equals the setpoint, whatever the load; inertia:
# inertia of its body
PART = Part(
    "dc_motor",
    30,
    (MotorConfig,),
    state=("target", "enabled", "setpoint", "torque", "before", "integral", "held", "held_torque", "held_setpoint"),
    derived=("decay", "stiff", "inertia", "mobility"),
    wires=("body",),
    stages={"fill": fill, "before": before, "after": after},
    role=SOURCE,
    joined={"body": Wire("body")},
    effects={"motor_speed": {}},
    message="MotorState",
    shown_values=shown_values,
    shows=(
        Shown("torque", "torque", "torque", -700.0, 700.0, "Air-gap torque of the DC motor.", "positive drives {body}"),
        Shown(
            "speed_setpoint",
            "speed_setpoint",
            "speed",
            0.0,
            314.2,
            "Speed setpoint of the DC drive, after its ramp.",
            "positive in the driving direction",
        ),
        Shown("work", "work", "energy", -1e9, 1e9, "Work of the motor since time 0.", "positive delivered to the shaft"),
    ),
    takes=(Command("motor", {"speed": "angular velocity"}, "target", "enabled", "speed of the drive", "speed"),),
    holds=True,
)
