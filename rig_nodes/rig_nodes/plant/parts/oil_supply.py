# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clutch oil supply: pump P with relief valve ZP, the oil's properties, and the oil's temperature in its tank.

A part of the engine; the laboratory kept p_p = 4 MPa in all tests. All other parts read density, viscosity and temperature here.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, expm1, inf, log, log10
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .lag import lagged
from .part import OIL, Command, Part, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


NOTICED = 0.01  # K: change of the oil's temperature after which the viscosity, which it changes by some 0.05 %, is computed again


@dataclass(frozen=True)
class OilSupplyConfig:
    """Values of the relief valve and the oil."""

    relief_droop: float = param(
        "hydraulic resistance", 0.0, 1e12, "Fall of the supply pressure below its setting with the flow that is drawn"
    )
    pressure_time: float = param("time", 1e-4, 5.0, "Time constant with which the supply pressure follows the relief valve")
    bulk_modulus: float = param(
        "pressure", 1e7, 3e9, "Bulk modulus of the oil, with its share of air and the compliance of the hoses"
    )
    density: float = param("density", 500.0, 1200.0, "Density of the oil")
    viscosity: float = param("viscosity", 1e-4, 5.0, "Dynamic viscosity of the oil at the reference temperature")
    viscosity_temperature: float = param("temperature", -30.0, 150.0, "Reference temperature, at which the viscosity is stated")
    temperature: float = param(
        "temperature",
        -30.0,
        150.0,
        "Temperature that the oil has as the rig starts, and takes at once when it is set",
        live="oil_temperature",
    )
    second_viscosity: float = param(
        "viscosity",
        0.0,
        5.0,
        "Dynamic viscosity at a second temperature; 0 for a viscosity that does not depend on temperature",
        0.0,
    )
    second_temperature: float = param("temperature", -30.0, 150.0, "Second temperature at which the viscosity is stated", 100.0)
    tank_heat_capacity: float = param(
        "heat capacity", 0.0, 1e8, "Heat capacity of the oil with its tank; 0 for a constant temperature", 0.0
    )
    tank_cooling: float = param(
        "thermal conductance", 0.0, 1e5, "Heat flow from tank and cooler per kelvin above the surroundings", 0.0
    )
    ambient_temperature: float = param("temperature", -50.0, 60.0, "Temperature of the surroundings", 20.0)
    pump_flow: float = param(
        "volume flow", 0.0, 1e-2, "Flow of the pump, whose power turns into heat in relief valve and clutch valves", 0.0
    )


def contradiction(oil: OilSupplyConfig) -> tuple[str, str] | None:
    """Return the name of a value and the fault, where no oil can have the two viscosities; otherwise None."""
    if oil.second_viscosity == 0.0:
        return None
    warmer = oil.second_temperature - oil.viscosity_temperature
    if warmer * (oil.viscosity - oil.second_viscosity) <= 0.0:
        return "second_viscosity", "must be that of another temperature, and less than the other viscosity where the oil is warmer"
    return None


@njit(cache=True, error_model="numpy", forceinline=True)
def walther(temperature: float, viscosity: float, density: float) -> tuple[float, float]:
    """Return (log10 of the absolute temperature, log10 log10 (nu + 0.7)) of ASTM D341, nu in mm2/s."""
    return log10(temperature + 273.15), log10(log10(1e6 * viscosity / density + 0.7))


@njit(cache=True, error_model="numpy", forceinline=True)
def viscosity_at(temperature: float, oil: Record) -> tuple[float, float]:
    """Return the dynamic viscosity at a temperature, and the share by which it falls per kelvin.

    By ASTM D341 (Ubbelohde, Walther) log10 log10 (nu + 0.7) falls linearly with the logarithm of the absolute temperature; the line
    goes through the two stated points.

    Parameters
    ----------
    temperature : float
        Temperature of the oil [degC].
    oil : Record
        Values of the oil supply.

    Returns
    -------
    tuple of float
        Viscosity [Pa s] and -d ln(viscosity) / dT [1/K].
    """
    if oil.second_viscosity == 0.0:
        return oil.viscosity, 0.0
    t1, w1 = walther(oil.viscosity_temperature, oil.viscosity, oil.density)
    t2, w2 = walther(oil.second_temperature, oil.second_viscosity, oil.density)
    kelvin = max(temperature, -60.0) + 273.15  # colder oil is solid
    slope = (w2 - w1) / (t2 - t1)
    inner = 10.0 ** (w1 + slope * (log10(kelvin) - t1))  # log10 (nu + 0.7)
    shifted = 10.0**inner
    nu = shifted - 0.7
    return 1e-6 * oil.density * nu, -shifted / nu * inner * slope * log(10.0) / kelvin


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
    """Compute the shares of a change of pressure and of a difference of temperature that are still to come after a step."""
    my = world.values.oil_supply[k]
    my.decay = exp(-h / my.pressure_time)
    if my.tank_heat_capacity > 0.0:
        spent = h * my.tank_cooling / my.tank_heat_capacity
        my.tank_left = exp(-spent)
        my.tank_rise = (-expm1(-spent) / spent if spent > 0.0 else 1.0) / my.tank_heat_capacity


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set pressure and temperature by the flow that was drawn and the heat that came in the last step."""
    me, my = world.parts.oil_supply[k], world.values.oil_supply[k]
    line = world.oil[my.line]
    me.flow = line.drawn
    line.drawn = 0.0
    me.pressure = line.pressure = supply_after(me.pressure, me.setting, me.enabled > 0.0, me.flow, my.decay, my)
    heat = line.heat
    line.heat = 0.0
    # a heat that is not finite is not taken over, so that the error message names the part from which it comes
    if my.tank_heat_capacity > 0.0 and abs(heat) < inf:
        if me.enabled > 0.0:
            heat += me.pressure * my.pump_flow * h
        apart = me.oil_temperature - my.ambient_temperature
        me.oil_temperature = my.ambient_temperature + apart * my.tank_left + heat * my.tank_rise
    if abs(me.oil_temperature - me.viscosity_at) > NOTICED or me.viscosity == 0.0:
        me.viscosity_at = me.oil_temperature
        me.viscosity = viscosity_at(me.oil_temperature, my)[0]


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its OilState."""
    me = rig.device(name)
    return (me["pressure"], me["setting"], rig.oil_drawn(name), me["oil_temperature"], me["enabled"] > 0.0)


# setting, enabled: setting and switch of the relief valve; oil_temperature: temperature of the oil in the whole rig [degC];
# viscosity: of the oil at the temperature viscosity_at, which follows it in steps of NOTICED; tank_left, tank_rise: share of a
# difference to the surroundings that is left after a step, and rise by heat that comes evenly [K/J]
PART = Part(
    "oil_supply",
    0,
    (OilSupplyConfig,),
    state=("setting", "enabled", "pressure", "flow", "oil_temperature", "viscosity", "viscosity_at"),
    derived=("decay", "tank_left", "tank_rise"),
    wires=("line",),
    stages={"fill": fill, "before": before},
    role=OIL,
    joined={"line": Wire("line", needed=False)},
    effects={"oil_temperature": {"second_viscosity": 0.0}},
    message="OilState",
    check=contradiction,
    shown_values=shown_values,
    takes=(Command("oil", {"pressure": "pressure"}, "setting", "enabled", "supply pressure of the clutch oil", "pressure"),),
)
