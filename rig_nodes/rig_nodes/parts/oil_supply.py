# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clutch oil supply: pump P with relief valve ZP and the oil's properties.

A part of the engine; the laboratory kept p_p = 4 MPa in all tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

from numba import njit

from ..compiled import INLINED
from ..config.schema import param
from .lag import lagged
from .part import OIL, Command, Part, Wire

if TYPE_CHECKING:
    from ..arrays import Record
    from .shown_rig import ShownRig


@dataclass(frozen=True)
class OilSupplyConfig:
    """Values of the relief valve and the oil."""

    relief_droop: float = param(
        "hydraulic resistance", 0.0, 1e12, "How far the supply pressure falls below its setting with the flow that is drawn"
    )
    pressure_time: float = param("time", 1e-4, 5.0, "Time constant with which the supply pressure follows the relief valve")
    bulk_modulus: float = param("pressure", 1e7, 3e9, "Bulk modulus of the oil with its share of air and the hoses' give")
    density: float = param("density", 500.0, 1200.0, "Density of the oil")
    viscosity: float = param("viscosity", 1e-4, 5.0, "Dynamic viscosity of the oil at the reference temperature")
    viscosity_per_kelvin: float = param("per temperature", 0.0, 0.2, "Share by which the viscosity falls with each degree")
    viscosity_temperature: float = param("temperature", -30.0, 150.0, "Reference temperature, at which the viscosity is stated")
    temperature: float = param(
        "temperature", -30.0, 150.0, "Temperature of the oil, to which the plates cool", live="oil_temperature"
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def viscosity_at(temperature: float, oil: Record) -> float:
    """Return the dynamic viscosity [Pa s] at a temperature [degC], exponential around ``viscosity_temperature``."""
    return oil.viscosity * exp(-oil.viscosity_per_kelvin * (temperature - oil.viscosity_temperature))


@njit(cache=True, error_model="numpy", forceinline=True)
def supply_pressure(pressure: float, setting: float, enabled: bool, flow: float, h: float, oil: Record) -> float:
    """Return the supply pressure after a step; it moves towards the relief setting less its droop with the flow drawn.

    Parameters
    ----------
    pressure : float
        Supply pressure before the step [Pa].
    setting : float
        Setting of the relief valve [Pa].
    enabled : bool
        Whether the supply is on.
    flow : float
        Flow that is drawn [m3/s].
    h : float
        Length of the step [s].
    oil : Record
        Values of the oil supply.

    Returns
    -------
    float
        Supply pressure [Pa].
    """
    return supply_after(pressure, setting, enabled, flow, exp(-h / oil.pressure_time), oil)


@njit(cache=True, error_model="numpy", forceinline=True)
def supply_after(pressure: float, setting: float, enabled: bool, flow: float, decay: float, oil: Record) -> float:
    """Return :func:`supply_pressure` after a time in which the share ``decay`` of a change is still to come."""
    target = 0.0
    if enabled:
        target = max(0.0, setting - oil.relief_droop * max(flow, 0.0))
    return lagged(pressure, target, decay)


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of pressure that is still to come after a step."""
    world.values.oil_supply[k].decay = exp(-h / world.values.oil_supply[k].pressure_time)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the pressure by the flow that was drawn in the last step."""
    me, my = world.parts.oil_supply[k], world.values.oil_supply[k]
    line = world.oil[my.line]
    me.flow = line.drawn
    line.drawn = 0.0
    me.pressure = line.pressure = supply_after(me.pressure, me.setting, me.enabled > 0.0, me.flow, my.decay, my)


# setting, enabled: setting and switch of the relief valve; temperature: temperature of the oil in the whole rig [degC]
def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its OilState."""
    me = rig.device(name)
    return (
        float(me["pressure"]),
        float(me["setting"]),
        rig.oil_drawn(name),
        getattr(rig.config, name).temperature,
        bool(me["enabled"] > 0.0),
    )


PART = Part(
    "oil_supply",
    0,
    (OilSupplyConfig,),
    state=("setting", "enabled", "pressure", "flow", "oil_temperature"),
    derived=("decay",),
    wires=("line",),
    stages={"fill": fill, "before": before},
    role=OIL,
    joined={"line": Wire("line", needed=False)},
    effects={"oil_temperature": {"viscosity_per_kelvin": 0.0}},
    message="OilState",
    shown_values=shown_values,
    takes=(Command("oil", {"pressure": "pressure"}, "setting", "enabled", "supply pressure of the clutch oil", "pressure"),),
)
