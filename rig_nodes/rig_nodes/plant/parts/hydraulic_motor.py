# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hydraulic motor behind a flow regulator and a maximum valve: the clutch bench's SH with RP and ZP_2 (thesis fig. 8.1).

It is a part of the engine, with a torque by the pressure before the motor and a friction of its own on its body.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import HI0, HI1, KIN0, KIN1, LO0, LO1
from .part import SOURCE, Command, Part, Shown, Wire
from .proportional_valve import leak, orifice_speed

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


@dataclass(frozen=True)
class HydraulicMotorConfig:
    """Values of the motor, its line and its valves; the maximum valve is ZP_2 of the thesis."""

    displacement: float = param("displacement", 1e-7, 1e-3, "Displacement of the motor")
    friction: float = param("torque", 0.0, 100.0, "The motor's own friction on its body")
    line_volume: float = param("volume", 1e-6, 1e-1, "Volume of the oil between flow regulator and motor")
    supply_pressure: float = param(
        "pressure", 1e5, 1e8, "Pressure of the pump's line, which no setting of the maximum valve exceeds"
    )
    relief_droop: float = param(
        "hydraulic resistance",
        1e6,
        1e12,
        "Rise of the line's pressure above the setting of the maximum valve with the flow through the valve",
    )
    relief_rate: float = param("pressure rate", 1e3, 1e9, "Rate at which the setting of the maximum valve moves to its setpoint")


@njit(cache=True)
def valve_setting(setting: float, target: float, h: float, motor: Record) -> float:
    """Return the setting [Pa] of ZP_2 after h: it is turned towards its target; switched off (target 0) it opens at once.

    No setting exceeds the pressure of the pump's line, p_2.
    """
    if target <= 0.0:
        return 0.0
    change = motor.relief_rate * h
    return min(setting + min(max(target - setting, -change), change), motor.supply_pressure)


@njit(cache=True)
def displacement(motor: Record) -> float:
    """Return the displacement that is left [m3/rad] where pistons have failed."""
    return motor.displacement * (1.0 - motor.lost)


@njit(cache=True)
def line_pressure(pressure: float, flow: float, speed: float, setting: float, h: float, oil: Record, motor: Record) -> float:
    """Return the pressure before the motor after a step, implicitly: V/K dp/dt = Q_RP - V_SH w - Q_leak - (p - p_ZP2) / droop.

    The last term acts only above the setting. A motor that takes more than this flow draws the rest from the tank, so the pressure
    is never below zero.

    Parameters
    ----------
    pressure : float
        Pressure before the step [Pa].
    flow : float
        Flow of the regulator, whatever the pressure [m3/s].
    speed : float
        Speed of the motor [rad/s].
    setting : float
        Setting of ZP_2 [Pa].
    h : float
        Length of the step [s].
    oil : Record
        Values of the oil.
    motor : Record
        Values of the motor.

    Returns
    -------
    float
        Pressure [Pa].
    """
    stiff = motor.line_volume / oil.bulk_modulus / h
    rest = flow - displacement(motor) * speed - leak(motor.leak_area, pressure, orifice_speed(oil.density), stiff)
    free = pressure + rest / stiff
    if free > setting:
        free = (stiff * pressure + rest + setting / motor.relief_droop) / (stiff + 1.0 / motor.relief_droop)
    return max(0.0, free)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set relief setting, line pressure and torque over the step."""
    me, my, line = world.parts.hydraulic_motor[k], world.values.hydraulic_motor[k], world.driveline
    cap, f, safe = line.cap, my.element, world.safe > 0.0
    cap[KIN0, f] = cap[KIN1, f] = cap[HI0, f] = cap[HI1, f] = my.friction
    cap[LO0, f] = cap[LO1, f] = -my.friction
    open_to = me.relief_target if me.relief_enabled > 0.0 and not safe else 0.0
    me.relief = valve_setting(me.relief, open_to, h, my)
    flow = my.displacement * me.target if me.enabled > 0.0 and not safe else 0.0  # the regulator is set for a motor that is whole
    left = displacement(my)
    line.push[0, my.body] += left * me.pressure
    me.pressure = line_pressure(me.pressure, flow, line.speed[my.body], me.relief, h, world.values.oil_supply[my.oil], my)
    me.torque = left * me.pressure
    line.push[1, my.body] += me.torque


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its MotorState."""
    me = rig.device(name)
    return (rig.speed_at(name), me["target"], me["torque"], rig.energies["motor"], me["enabled"] > 0.0)


# target, enabled: speed for which the regulator is set, and its switch; relief_target, relief_enabled: target of the setting of
# ZP_2, and its switch; relief: its present setting; torque: of the oil; leak_area: area of the gaps, 0 for none; lost: share of the
# displacement
PART = Part(
    "hydraulic_motor",
    30,
    (HydraulicMotorConfig,),
    state=("target", "enabled", "relief_target", "relief_enabled", "relief", "pressure", "torque"),
    derived=("leak_area", "lost"),
    wires=("body", "element", "oil"),
    stages={"before": before},
    role=SOURCE,
    joined={"body": Wire("body"), "oil": Wire("oil", needed=False)},
    message="MotorState",
    shown_values=shown_values,
    shows=(
        Shown(
            "torque",
            "torque",
            "torque",
            -700.0,
            700.0,
            "Torque of the oil on the hydraulic motor, before its own friction.",
            "positive drives the shaft",
        ),
        Shown("speed", "speed", "speed", -20.0, 20.0, "True speed of the hydraulic motor.", "positive in the driving direction"),
        Shown(
            "setpoint",
            "speed_setpoint",
            "speed",
            0.0,
            20.0,
            "Speed that the flow regulator is set for.",
            "positive in the driving direction",
        ),
        Shown("work", "work", "energy", -1e9, 1e9, "Work of the hydraulic motor since time 0.", "positive delivered to the shaft"),
    ),
    takes=(
        Command("motor", {"speed": "angular velocity"}, "target", "enabled", "speed for which the flow regulator is set", "speed"),
        Command(
            "relief",
            {"pressure": "pressure"},
            "relief_target",
            "relief_enabled",
            "pressure to which the maximum valve is turned",
            "pressure",
            "relief",
        ),
    ),
)
