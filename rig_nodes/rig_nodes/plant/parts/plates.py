# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plates of a wet multi-plate clutch, whatever presses them: friction, drag, heat, wear and hysteresis.

Used by plant.parts.wet_clutch, plant.parts.pressed_clutch and plant.parts.curve_clutch, so that all packs follow one law; the
models of torque and drag themselves are in plant.friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import exp, expm1
from typing import TYPE_CHECKING

from ...base import INLINED, RigError, choice, njit, param
from ...driveline import E_FRIC, E_VISC, HI0, HI1, KIN0, KIN1, LO0, LO1, VISC, dot, vector
from ..friction import closed, drag
from ..friction.geometry import PackGeometry
from .oil_supply import viscosity_at
from .part import Wire

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...base import Floats, Record
    from ..friction.geometry import Numbers
    from .shown_rig import ShownRig

# models of chapter 6 that a configuration may name
# name -> (pack, friction of the plates, friction of the splines, True as it is released) -> torque per force
FRICTION_MODELS: dict[str, Callable[[PlatePack, float, float, bool], Numbers]] = {
    "thesis": lambda pack, friction, spline, releasing: closed.thesis(pack, 1.0, friction, spline, releasing=releasing),
    "traditional": lambda pack, friction, _spline, _releasing: closed.traditional(pack, 1.0, friction),
    "osinski": lambda pack, friction, _spline, _releasing: closed.osinski(pack, 1.0, friction, beyond_table=True),
    "newcomb": lambda pack, friction, spline, _releasing: closed.newcomb(pack, 1.0, friction, spline),
    "chen": lambda pack, friction, spline, _releasing: closed.chen(pack, 1.0, friction, spline),
}
DRAG_MODELS = ("kitabayashi", "davis", "pahlovy", "peng_yuan", "iqbal")


@dataclass(frozen=True)
class PlatePack(PackGeometry):
    """Geometry and friction of the plates (thesis tab. 3.3)."""

    friction_static: float = param("ratio", 0.0, 1.0, "Coefficient of friction at rest, with the oil squeezed out of the contact")
    friction_kinetic: float = param("ratio", 0.0, 1.0, "Coefficient of friction that is left when the plates slip fast")
    friction_speed: float = param(
        "velocity",
        1e-6,
        100.0,
        "Sliding speed at the mean radius at which 1/e of the difference between both is left, at friction_pressure and with the "
        "oil's stated viscosity",
    )
    friction_pressure: float = param(
        "pressure",
        1e3,
        1e8,
        "Pressure on the plates at friction_speed; a higher one keeps the asperities in contact up to more speed",
    )
    film_time: float = param(
        "time",
        0.0,
        10.0,
        "Time constant with which oil is squeezed out between the plates, or drawn in again, with the oil's stated viscosity",
    )
    friction_spline: float = param("ratio", 0.0, 1.0, "Coefficient of friction of the plates on their splines, in both directions")
    friction_correction: float = param("ratio", 0.1, 10.0, "Factor on the torque of the friction model, k_kor of (6.56)")
    rest_torque: float = param(
        "torque",
        0.0,
        500.0,
        "Torque that the pack holds at rest without being pressed, once its plates have touched: M_rest of (6.56)",
    )
    film_gap: float = param(
        "length",
        1e-6,
        1e-2,
        "Height of the oil film between two plates that are not pressed; the drag is computed with no smaller gap",
    )
    film_force: float = param("force", 1.0, 1e5, "Clamp force from which the asperities carry all of it and no film is sheared")
    film_radius: float = param(
        "length", 1e-3, 1.0, "Radius at which the closed oil film ends, in the drag models with such a radius"
    )
    liquid_share: float = param("ratio", 0.0, 1.0, "Share of liquid in the oil beyond the closed film, in the drag model iqbal")
    mist_viscosity_share: float = param(
        "ratio", 0.0, 1.0, "Viscosity of the mist beyond the closed film over that of the oil, in the drag model iqbal"
    )
    heat_capacity: float = param("heat capacity", 1.0, 1e6, "Heat capacity of all plates of the pack")
    cooling: float = param("thermal conductance", 0.0, 1e6, "Heat flow from the plates to the oil per kelvin between them")
    friction_per_kelvin: float = param(
        "per temperature", -0.02, 0.02, "Share by which the friction of the plates changes per kelvin"
    )
    friction_temperature: float = param(
        "temperature",
        -30.0,
        300.0,
        "Temperature of the plates at which their coefficients of friction and their wear rate are stated",
    )
    wear_rate: float = param("wear rate", 0.0, 1e-6, "Growth of the whole pack's clearance with the heat of friction")
    wear_per_kelvin: float = param("per temperature", 0.0, 1.0, "Share by which the wear rate grows per kelvin")
    break_slip: float = param(
        "length",
        0.0,
        0.1,
        "Way of slip at the mean radius on which contacts lose all but 1/e of the static friction that the speed takes; 0 for none",
        0.0,
    )


@dataclass(frozen=True)
class PackFriction:
    """Models of a pack's torque and of its drag."""

    friction_model: str = choice("Model of the torque by the clamp force", *FRICTION_MODELS)
    drag_model: str = choice("Model of the viscous drag of the open pack", *DRAG_MODELS)


@lru_cache(maxsize=32)  # the packs of a rig are alike, and every run of a campaign needs the same results
def torque_per_force(pack: PlatePack, friction: float, releasing: bool = False, model: str = "thesis") -> float:
    """Return the torque per clamp force of the whole pack by a model of chapter 6.

    Only the thesis's model has a form for the release, with the friction of the splines in the reversed direction. With the other
    models the torque depends on the present clamp force only.

    Parameters
    ----------
    pack : PlatePack
        Geometry and friction of the plates.
    friction : float
        Coefficient of friction of the plates.
    releasing : bool
        True as the pack is released.
    model : str
        One of FRICTION_MODELS.

    Returns
    -------
    float
        Torque per force [Nm/N].

    Raises
    ------
    RigError
        For a pack that is not possible.
    """
    try:
        return float(FRICTION_MODELS[model](pack, friction, pack.friction_spline, releasing))
    except ValueError as error:
        raise RigError(f"plate_pack: {error}") from None


def drag_factor(pack: PlatePack, model: str = "kitabayashi") -> float:
    """Return the viscous drag of a model of chapter 6 per viscosity, slip and reciprocal gap.

    Parameters
    ----------
    pack : PlatePack
        Geometry and friction of the plates.
    model : str
        One of DRAG_MODELS.

    Returns
    -------
    float
        Factor [m4].

    Raises
    ------
    RigError
        For a pack that is not possible.
    """
    try:
        if model == "kitabayashi":
            return float(drag.kitabayashi(pack, 1.0, 1.0, 1.0))
        if model == "davis":
            return float(drag.davis_viscous(pack, 1.0, 1.0, 1.0))
        if model == "iqbal":
            return float(drag.iqbal(pack, 1.0, 1.0, 1.0, pack.film_radius, pack.liquid_share, pack.mist_viscosity_share))
        return float({"pahlovy": drag.pahlovy, "peng_yuan": drag.peng_yuan}[model](pack, 1.0, 1.0, 1.0, pack.film_radius))
    except ValueError as error:
        raise RigError(f"plate_pack: {error}") from None


@njit(cache=True, error_model="numpy", forceinline=True)
def friction_factor(temperature: float, clutch: Record) -> float:
    """Return the friction of the plates at their temperature [degC] over that at ``friction_temperature``."""
    return max(0.2, 1.0 + clutch.friction_per_kelvin * (temperature - clutch.friction_temperature))


@njit(cache=True, error_model="numpy", forceinline=True)
def plates_cooling(h: float, clutch: Record) -> tuple[float, float]:
    """Return (share of a difference to the oil's temperature that is left after h, rise by heat at a constant rate [K/J])."""
    spent = h * clutch.cooling / clutch.heat_capacity
    return exp(-spent), (-expm1(-spent) / spent if spent > 0.0 else 1.0) / clutch.heat_capacity


@njit(cache=True, error_model="numpy", forceinline=True)
def plates_after(
    temperature: float, wear: float, heat: float, oil_temperature: float, left: float, rise: float, clutch: Record
) -> tuple[float, float]:
    """Return temperature and wear of the plates after a step, by the exact solution for heat at a constant rate.

    Parameters
    ----------
    temperature : float
        Temperature of the plates before the step [degC].
    wear : float
        Wear of the whole pack before the step [m].
    heat : float
        Heat of the step [J].
    oil_temperature : float
        Temperature of the oil [degC].
    left, rise : float
        Values of :func:`plates_cooling`.
    clutch : Record
        Values of the clutch.

    Returns
    -------
    tuple of float
        Temperature [degC] and wear of the whole pack [m].
    """
    rate = clutch.wear_rate * max(0.0, 1.0 + clutch.wear_per_kelvin * (temperature - clutch.friction_temperature))
    return oil_temperature + (temperature - oil_temperature) * left + heat * rise, wear + rate * heat


@njit(cache=True, error_model="numpy", forceinline=True)
def drag_coefficient(piston: float, clamp: float, viscosity: float, clutch: Record) -> float:
    """Return the viscous torque per slip [Nm s/rad] of the oil in the gaps; it falls as the asperities carry more force."""
    gap = max((clutch.clearance - piston) / clutch.surfaces, clutch.film_gap)
    film_share = max(0.0, 1.0 - clamp / clutch.film_force)
    return clutch.drag_factor * viscosity / gap * film_share


@njit(cache=True, error_model="numpy", forceinline=True)
def held_force(before: float, clamp: float, most: float) -> float:
    """Return the force [N] that presses the plates, with the hysteresis of the splines' friction.

    It rises with the clamp force, stays while the plates stick on their splines, and falls along ``most`` times the clamp force.
    """
    return min(max(before, clamp), most * clamp)


@njit(cache=True, error_model="numpy", forceinline=True)
def boundary_share(slip: float, force: float, viscosity: float, stribeck: float) -> float:
    """Return the share of boundary friction at a slip in steady state: 1 for the friction at rest, 0 for that of fast slip.

    This is the Stribeck curve, which depends on viscosity times speed over pressure; 0 is where an oil film carries the force.

    Parameters
    ----------
    slip : float
        Slip [rad/s].
    force : float
        Force on the plates [N].
    viscosity : float
        Viscosity of the oil over that at which ``friction_speed`` is stated.
    stribeck : float
        Force per slip at which 1/e of the boundary friction is left [N s/rad].

    Returns
    -------
    float
        Share, 0 to 1.
    """
    over = abs(slip) * viscosity * stribeck
    if over == 0.0:
        return 1.0
    return exp(-over / force) if over < FAR * force else 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def rest_share(before: float, piston: float, clamp: float, clutch: Record) -> float:
    """Return the share of M_rest of (6.56) that acts, with the hysteresis of the contact; an unclamped pack still holds M_rest.

    The torque acts as soon as the asperities carry, and it lasts longer than the clamp force. Its causes are plates that adhere and
    waves that press them (8.3.5 names both); both end when the piston has gone back far enough for a film of full height between
    all plates, or as far as it can.
    """
    carried = max(before, min(1.0, clamp / clutch.film_force))
    gap = clutch.clearance - piston
    return carried if gap <= 0.0 else min(carried, max(0.0, 1.0 - gap / min(clutch.surfaces * clutch.film_gap, clutch.clearance)))


# states of a pack from step to step, and values derived from its configuration; clearance is new_clearance plus wear; seized_force:
# force with which welded plates hold without being pressed, 0 for none
STATE = (
    "temperature",
    "wear",
    "heat",
    "clamp",
    "held",
    "rest",
    "boundary",
    "kinetic",
    "static",
    "drag",
    "film_temperature",
    "film_viscosity",
    "film_thinning",
)
FAR = 40.0  # multiples of the Stribeck speed beyond which no boundary friction is left
SERIES = 0.03  # K: largest distance of the plates' temperature from that of the series for their film's viscosity
DERIVED = (
    "kinetic_per_force",
    "excess_per_force",
    "holding_kinetic",
    "holding_excess",
    "stribeck",
    "per_break",
    "rest_force",
    "drag_factor",
    "new_clearance",
    "step",
    "plates_left",
    "plates_rise",
    "seized_force",
)
WIRES = ("element", "oil")
# a pack between two bodies, or between one body and the fixed housing; plates: the part with the values of its plates
JOINED = {
    "joins": Wire("bodies", needed=False),
    "brakes": Wire("body", needed=False),
    "plates": Wire("values"),
    "oil": Wire("oil", needed=False),
}


def derived_of_pack(plates: PlatePack, pack: PackFriction, clearance: float, spline_hysteresis: bool = True) -> dict[str, float]:
    """Return the values of DERIVED that do not change with time, for a pack that is new.

    Parameters
    ----------
    plates : PlatePack
        Geometry and friction of the plates.
    pack : PackFriction
        Models and correction of the pack.
    clearance : float
        Clearance of the new pack [m].
    spline_hysteresis : bool
        False to leave out the sticking on the splines.

    Returns
    -------
    dict of str to float
        The values by name.

    Raises
    ------
    RigError
        For a pack that is not possible.
    """
    (kinetic, slow), (static, fast) = (
        tuple(plates.friction_correction * torque_per_force(plates, mu, way, pack.friction_model) for way in (False, True))
        for mu in (plates.friction_kinetic, plates.friction_static)
    )
    if not spline_hysteresis:
        slow, fast = kinetic, static
    hold_kinetic, hold_static = (most / least if least else 1.0 for most, least in ((slow, kinetic), (fast, static)))
    return {
        "kinetic_per_force": kinetic,
        "excess_per_force": static - kinetic,
        "holding_kinetic": hold_kinetic,
        "holding_excess": hold_static - hold_kinetic,
        "stribeck": plates.mean_radius * plates.area * plates.friction_pressure / plates.friction_speed,
        "per_break": 0.5 * plates.mean_radius / plates.break_slip if plates.break_slip else 0.0,
        "rest_force": plates.rest_torque / static if static else 0.0,
        "drag_factor": drag_factor(plates, pack.drag_model),
        "new_clearance": clearance,
    }


def shown_pack(rig: ShownRig, name: str, pressure: float, travel: float) -> tuple[float, ...]:
    """Return the fields of a pack's ClutchState.

    Parameters
    ----------
    rig : ShownRig
        The rig.
    name : str
        Name of the clutch.
    pressure : float
        Pressure that presses the pack [Pa].
    travel : float
        Travel of the piston that presses it [m].

    Returns
    -------
    tuple of float
        The fields in the order of the message.
    """
    me, slip = rig.device(name), rig.slip(name)
    return (
        rig.clutch_mode(name),
        rig.friction_torque(name),
        me["drag"] * slip,
        me["kinetic"],
        me["static"],
        slip,
        me["clamp"],
        pressure,
        travel,
        rig.energies[rig.heat_of(name)],
    )


@njit(**INLINED)
def film_viscosity(me: Record, oil: Record) -> float:
    """Return the viscosity [Pa s] of the oil between the plates, by the series of the exponential around a nearby temperature.

    Near that temperature it is exact to 1e-6 and needs no call of the logarithm in every step. The pack stores the temperature of
    the series, the viscosity there and the share by which it falls per kelvin.
    """
    apart = me.temperature - me.film_temperature
    if abs(apart) > SERIES or me.film_viscosity == 0.0:
        me.film_temperature = me.temperature
        me.film_viscosity, me.film_thinning = viscosity_at(me.temperature, oil)
        apart = 0.0
    x = -me.film_thinning * apart
    return me.film_viscosity * (1.0 + x * (1.0 + 0.5 * x))


@njit(**INLINED)
def fill_plates(my: Record, h: float) -> None:
    """Compute the values of the plates' cooling that depend on the step's length."""
    my.plates_left, my.plates_rise = plates_cooling(h, my)
    my.step = h


@njit(**INLINED)
def capacities_before(me: Record, my: Record, cap: Floats) -> float:
    """Set the pack's torques at the step's start in the driveline, and return the drag at that time."""
    f = my.element
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = me.kinetic, me.static, -me.static
    return me.drag


@njit(**INLINED)
def capacities_after(me: Record, my: Record, piston: float, drag: float, world: Record) -> None:
    """Set the pack's capacities at its clamp force, with their hysteresis, and the drag over the step, in the driveline.

    ``drag`` is that at the step's start.
    """
    line, f, oil = world.driveline, my.element, world.values.oil_supply[my.oil]
    film = film_viscosity(me, oil)
    viscosity = film / oil.viscosity
    me.rest = rest_share(me.rest, piston, me.clamp, my)
    me.held = held_force(me.held, me.clamp, my.holding_kinetic + my.holding_excess * me.boundary)
    # the waves of the plates press them without the piston; with this force, (6.56) holds at rest
    force = me.held + my.rest_force * me.rest + my.seized_force
    n = line.v.shape[0]
    across = vector(line.w, f * n, line.v)
    slip = dot(across, vector(line.v, 0, line.v)) + 0.5 * dot(across, vector(line.gain, 0, line.v))  # expected in the middle
    twice = 2.0 * my.film_time * viscosity
    left = max(0.0, (twice - my.step) / (twice + my.step))
    at_rest = 1.0 - (1.0 - me.boundary) * left
    share = boundary_share(slip, force, viscosity, my.stribeck)
    if share < me.boundary:  # oil has to flow in, but asperities part as the plates slide: whichever is faster
        parted = twice * abs(slip) * my.step * my.per_break
        left = max(0.0, (twice - my.step - parted) / (twice + my.step + parted))
    me.boundary = share + (me.boundary - share) * left
    force *= friction_factor(me.temperature, my)
    me.kinetic = force * (my.kinetic_per_force + my.excess_per_force * me.boundary)
    me.static = force * (my.kinetic_per_force + my.excess_per_force * at_rest)
    me.drag = drag_coefficient(piston, me.clamp, film, my)
    cap = line.cap
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = me.kinetic, me.static, -me.static
    cap[VISC, f] = 0.5 * (drag + me.drag)


@njit(**INLINED)
def heat_plates(me: Record, my: Record, world: Record) -> None:
    """Compute temperature and wear by the heat of the step."""
    el, f = world.driveline.el, my.element
    heat = el[E_FRIC, f] + el[E_VISC, f]
    oil, before = world.parts.oil_supply[my.oil], me.temperature
    me.temperature, me.wear = plates_after(
        me.temperature, me.wear, heat - me.heat, oil.oil_temperature, my.plates_left, my.plates_rise, my
    )
    values = world.values.oil_supply[my.oil]
    if values.tank_heat_capacity > 0.0:  # the heat that the plates do not store goes to the oil
        world.oil[values.line].heat += heat - me.heat - my.heat_capacity * (me.temperature - before)
    me.heat = heat
