# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hydraulic motor SH of the clutch bench with flow regulator RP and maximum valve ZP_2 (thesis 8.1.2, fig. 8.1).

Called by plant.clutch_bench; the shaft behind it, with its torque meter, is described here for the general driveline.
"""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit

from ..config.schema import param
from .driveline import Driveline

# elements of the driveline, in this order
PACK, FRICTION = range(2)


@dataclass(frozen=True)
class HydraulicMotorConfig:
    """Motor, its line and its valves. relief_rate: how fast ZP_2 is turned; relief_droop: of ZP_2, by its flow."""

    displacement: float = param("displacement", 1e-7, 1e-3)
    friction: float = param("torque", 0.0, 100.0)
    inertia: float = param("inertia", 1e-4, 10.0)
    line_volume: float = param("volume", 1e-6, 1e-1)
    supply_pressure: float = param("pressure", 1e5, 1e8)
    relief_droop: float = param("hydraulic resistance", 1e6, 1e12)
    relief_rate: float = param("pressure rate", 1e3, 1e9)


@dataclass(frozen=True)
class BenchShaft:
    """Torque meter, which joins motor and shaft (fig. 8.4), and the shaft with the inner plates."""

    inertia: float = param("inertia", 1e-4, 10.0)
    meter_stiffness: float = param("torque per angle", 1e2, 1e7)
    meter_damping: float = param("torque per speed", 0.0, 1e4)


def build_driveline(motor: HydraulicMotorConfig, shaft: BenchShaft):
    """The compiled description: motor, torque meter, shaft, pack to the held housing, friction of the motor."""
    d = Driveline()
    d.inertia("motor", motor.inertia)
    d.inertia("shaft", shaft.inertia)
    d.shaft("torque_meter", "motor", "shaft", stiffness=shaft.meter_stiffness, damping=shaft.meter_damping)
    d.brake("pack", "shaft")
    d.brake("friction", "motor")
    return d.build()


@njit(cache=True)
def valve_setting(setting, target, h, motor):
    """Setting [Pa] of ZP_2 after h: turned towards its target; shut off (target 0) it opens at once.

    Nothing sets more than the pressure of the pump's line, p_2.
    """
    if target <= 0.0:
        return 0.0
    change = motor.relief_rate * h
    return min(setting + min(max(target - setting, -change), change), motor.supply_pressure)


@njit(cache=True)
def line_pressure(pressure, flow, speed, setting, h, bulk_modulus, motor):
    """Pressure [Pa] before the motor after h, implicit: V/K dp/dt = Q_RP - V_SH w - (p - p_ZP2) / droop.

    flow: of the regulator [m3/s], whatever the pressure; the last term only above the setting. A motor that runs ahead
    of its oil draws from the tank: no pressure below zero.
    """
    stiff = motor.line_volume / bulk_modulus / h
    rest = flow - motor.displacement * speed
    free = pressure + rest / stiff
    if free > setting:
        free = (stiff * pressure + rest + setting / motor.relief_droop) / (stiff + 1.0 / motor.relief_droop)
    return max(0.0, free)
