# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wet multi-plate clutch with its cylinder: line, rotary feed, turning chamber, piston against disc springs, plate pack.

It is a part of the engine, fed by a plant.parts.proportional_valve. The plates themselves are in plant.parts.plates.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf, sqrt
from typing import TYPE_CHECKING, NamedTuple

from ...base import INLINED, njit, param
from . import plates
from .part import BODY, CLUTCH, NOWHERE, Part, Shown, Wire
from .plates import PackFriction, PlatePack
from .proportional_valve import fed, laminar_force, leak, line_flow, orifice, orifice_speed

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

THIRD = 1.0 / 3.0
NEAR = 200.0  # Pa: change up to which the balance is linear enough for Newton's method to stop
CLOSE = 1e-3  # Pa: change of the chamber's pressure in a step below which it counts as constant
LEVEL = 1.0  # Pa: rise in a step below which no further rise is expected in the next step
LOWEST = -1e4  # Pa: lowest pressure in the integration, below that of the tank
NO_PRESSURE = 10e3  # Pa: below it the line runs empty
NOTHING = 0.1  # Pa: pressure below which a drained line counts as without pressure; the decay to exactly 0 would take minutes
STIFF = 9.0  # pack's stiffness times half a step over the piston's damping; an oscillation then falls by a fifth per step


@dataclass(frozen=True)
class Cylinder(PackFriction):
    """Cylinder, return springs, seals, the axial elasticity of the pack and the oil in front of the piston."""

    piston_area: float = param("area", 1e-5, 1e-1, "Area of the piston")
    force_per_pressure_squared: float = param(
        "force per pressure squared", 0.0, 1e-9, "Force on the piston per pressure squared, in addition to that of its area"
    )
    spring_preload: float = param("force", 0.0, 1e5, "Force of the return springs on the released piston")
    spring_rate: float = param("stiffness", 1e2, 1e9, "Stiffness of the return springs")
    clearance: float = param("length", 1e-5, 5e-2, "Travel of the piston from its stop to the kiss point, with a new pack")
    pack_rate: float = param(
        "stiffness", 1e3, 1e10, "Stiffness of the pack at the kiss point, where only the waves of the steel plates carry"
    )
    pack_travel: float = param("length", 1e-5, 1e-2, "Travel of the piston beyond the kiss point at which the pack is flat")
    seal_friction: float = param("force", 0.0, 1e4, "Friction of the piston's seals without pressure")
    seal_friction_share: float = param(
        "ratio", 0.0, 0.5, "Friction of the seals as a share of the pressure's force, in addition to that without pressure"
    )
    piston_damping: float = param("damping", 1.0, 1e7, "Viscous damping of the piston at the oil's reference temperature")
    line_volume: float = param("volume", 1e-7, 1e-2, "Volume of the oil between valve and feed orifice")
    chamber_volume: float = param("volume", 1e-7, 1e-2, "Volume of the oil in the chamber of the released piston")
    feed_area: float = param("area", 1e-8, 1e-2, "Area of the feed orifice between line and chamber")
    centrifugal_radius: float = param(
        "length",
        0.0,
        1.0,
        "Root of the mean square radius of the chamber's oil on the piston; 0 leaves out the effect of rotation",
        0.0,
    )
    drained_volume: float = param(
        "volume", 0.0, 1e-2, "Volume of the line that runs empty while it has no pressure, and is filled first; 0 for none", 0.0
    )
    drain_time: float = param("time", 1e-3, 1e4, "Time constant with which the line runs empty", 1.0)
    hose_give: float = param(
        "volume per pressure", 0.0, 1e-9, "Volume by which the hose and air in it give way per pressure, beside the oil itself", 0.0
    )
    return_area: float = param(
        "area",
        0.0,
        1e-4,
        "Area of the way from the line to the tank that opens beside the drained valve once the piston is off the pack; 0 for none",
        0.0,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def pack_force(piston: float, clutch: Record) -> tuple[float, float]:
    """Return (force on the plates [N], its slope [N/m]): none up to the kiss point, then the waves of the steel plates.

    F = k x / (1 - x / x_f): soft at first, stiff as the sinusoidal plates lie flat at the travel x_f.

    Parameters
    ----------
    piston : float
        Position of the piston [m].
    clutch : Record
        Values of the clutch.

    Returns
    -------
    tuple of float
        Force [N] and its slope [N/m].
    """
    squeeze = piston - clutch.clearance
    if squeeze <= 0.0:
        return 0.0, 0.0
    left = max(1e-4, 1.0 - squeeze / clutch.pack_travel)
    return clutch.pack_rate * squeeze / left, clutch.pack_rate / (left * left)


@njit(cache=True, error_model="numpy", forceinline=True)
def is_stiff(piston: float, half: float, damping: float, clutch: Record) -> bool:
    """Return whether the pack is so stiff that the piston's speed would oscillate with the trapezoidal rule.

    The slope of :func:`pack_force` is compared without a division, because this is computed in every step.

    Parameters
    ----------
    piston : float
        Position of the piston [m].
    half : float
        Half of the step [s].
    damping : float
        Damping of the piston [N s/m].
    clutch : Record
        Values of the clutch.

    Returns
    -------
    bool
        True when the slope times half the step is above STIFF times the damping of the piston.
    """
    squeeze = piston - clutch.clearance
    if squeeze <= 0.0:
        return False
    travel = clutch.pack_travel
    left = max(1e-4 * travel, travel - squeeze)
    return clutch.pack_rate * travel * travel * half > STIFF * damping * left * left


@njit(cache=True, error_model="numpy", forceinline=True)
def piston_step(piston: float, pressure: float, spin: float, h: float, damping: float, clutch: Record) -> tuple[float, float]:
    """Return (piston position after h, its derivative by pressure) by an implicit step of the massless, damped piston.

    The balance is push = springs + pack + damping v + seal friction; the seals hold the piston while the sum of the other forces is
    smaller than their friction. The push is area times p and a square term, which the laboratory's force over pressure has (Annex
    D), and the force of the oil that turns with the chamber.

    Parameters
    ----------
    piston : float
        Position of the piston [m].
    pressure : float
        Pressure in the chamber, where the oil enters [Pa].
    spin : float
        Force of the turning oil [N].
    h : float
        Length of the step [s].
    damping : float
        Damping of the piston [N s/m].
    clutch : Record
        Values of the clutch.

    Returns
    -------
    tuple of float
        Position [m] and its derivative by pressure [m/Pa].
    """
    square = clutch.force_per_pressure_squared * max(pressure, 0.0)
    push, slope = (clutch.piston_area + square) * pressure + spin, clutch.piston_area + 2.0 * square
    seal = clutch.seal_friction + clutch.seal_friction_share * abs(push)
    resist = clutch.spring_preload + clutch.spring_rate * piston + pack_force(piston, clutch)[0]
    if push - resist > seal:
        drive, gain = push - seal, slope * (1.0 - clutch.seal_friction_share)
    elif push - resist < -seal and piston > 0.0:
        drive, gain = push + seal, slope * (1.0 + clutch.seal_friction_share)
    else:
        return piston, 0.0
    rate = damping / h
    stiff = clutch.spring_rate + rate
    # the balance at the kiss point; beyond it k s / (1 - s / s_f) makes the balance a quadratic in the squeeze s
    miss = drive - clutch.spring_preload + rate * piston - stiff * clutch.clearance
    if miss <= 0.0:
        x = clutch.clearance + miss / stiff
    else:
        middle = (stiff + clutch.pack_rate) * clutch.pack_travel + miss
        root = sqrt(max(0.0, middle * middle - 4.0 * stiff * miss * clutch.pack_travel))
        x = clutch.clearance + 2.0 * miss * clutch.pack_travel / (middle + root)
        stiff += pack_force(x, clutch)[1]
    if x <= 0.0:
        return 0.0, 0.0
    return x, gain / stiff


@njit(cache=True, error_model="numpy", forceinline=True)
def oil_stiffness(h: float, oil: Record, clutch: Record) -> tuple[float, float, float]:
    """Return the values of the volumes and the feed for steps of h.

    Parameters
    ----------
    h : float
        Length of a step [s].
    oil : Record
        Values of the oil supply.
    clutch : Record
        Values of the clutch.

    Returns
    -------
    tuple of float
        Flow that raises the line's pressure [m3/(s Pa)], the same for the chamber by backward differences, and pressure drop
        of the feed orifice per flow squared [Pa s2/m6].
    """
    return (
        (clutch.line_volume / oil.bulk_modulus + clutch.hose_give) / h,
        1.5 * clutch.chamber_volume / oil.bulk_modulus / h,
        oil.density / (2.0 * clutch.feed_area * clutch.feed_area),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def feed_resistance(oil: Record, clutch: Record) -> float:
    """Return the pressure drop of the feed per flow and viscosity [1/m3] where its flow is laminar; the turbulent drop is added.

    The feed is a sharp-edged orifice (plant.parts.proportional_valve.laminar_force).
    """
    area = clutch.feed_area
    return sqrt(0.5 * oil.density * laminar_force(1.0, oil.density) / area) / area


@njit(cache=True, error_model="numpy", forceinline=True)
def turning_force(speed: float, density: float, clutch: Record) -> float:
    """Return the force on the piston [N] of oil that turns with the chamber at a speed [rad/s]: rho w^2 r^2 / 2 over its area.

    The oil enters at the shaft's axis, and nothing balances it on the piston's other side (fig. 3.6).
    """
    around = speed * clutch.centrifugal_radius
    return 0.5 * density * around * around * clutch.piston_area


class Oil(NamedTuple):
    """What the oil is to a cylinder in a step.

    Parameters
    ----------
    supply : float
        Supply pressure [Pa].
    viscosity : float
        Viscosity [Pa s].
    damping : float
        Damping of the piston [N s/m].
    spin : float
        Force of the turning oil on the piston [N].
    lost : float
        Flow that the empty part of the line and leaks of the line take, less that of a leak from the supply [m3/s].
    seep : float
        Flow past the piston's seal [m3/s].
    """

    supply: float
    viscosity: float
    damping: float
    spin: float
    lost: float
    seep: float


class Volumes(NamedTuple):
    """What the balance of a cylinder's volumes starts from in a step.

    Parameters
    ----------
    start, half, per_half : float
        Position from which the piston is moved by an implicit step [m], the length of this step [s], and the reciprocal of the time
        in which the piston makes this travel [1/s].
    line_before, stiff_line, chamber_before, stiff_chamber : float
        Pressures from which the compression of line and chamber counts [Pa], and flows per pressure [m3/(s Pa)].
    laminar_drop : float
        Laminar resistance of the feed [Pa s/m3].
    laminar : float
        Pressure drop times area below which the valve's flow is laminar [N].
    way_back : float
        Area of the opening to the tank beside the valve [m2].
    """

    start: float
    half: float
    per_half: float
    line_before: float
    stiff_line: float
    chamber_before: float
    stiff_chamber: float
    laminar_drop: float
    laminar: float
    way_back: float


@njit(**INLINED)
def volumes_of(cylinder: Record, port: Record, state: Record, oil: Oil, h: float, clutch: Record) -> Volumes:
    """Return what the balance of a step h starts from; the parameters are those of :func:`cylinder_step`."""
    stiff_line, stiff_chamber = 1.5 * clutch.full_line, clutch.stiff_chamber
    # (3 p - 4 p0 + p00) / 2 h = 1.5 (p - (p0 + rise / 3)) / h
    chamber_before = cylinder.chamber + cylinder.chamber_rise * THIRD
    line_before = port.port + port.rise * THIRD
    # after a fast fall of the pressure that ends in this step, the difference over two steps would give a pressure below the
    # tank's. There a backward step is taken, with which no pressure falls below the tank's, as nothing draws oil from the volumes
    if line_before < LOWEST:
        line_before, stiff_line = port.port, clutch.full_line
    if chamber_before < LOWEST:
        chamber_before, stiff_chamber = cylinder.chamber, stiff_chamber / 1.5
    half, per_half = 0.5 * h, 2.0 / h
    start = max(0.0, cylinder.piston + half * cylinder.speed)
    # with the trapezoidal rule the speed of a piston on a stiff pack oscillates from step to step: there a backward step is taken
    if is_stiff(cylinder.piston, half, oil.damping, clutch):
        half, per_half, start = h, 0.5 * per_half, cylinder.piston
    laminar_drop, laminar = oil.viscosity * clutch.feed_resistance, clutch.laminar * oil.viscosity * oil.viscosity
    drained = state.share < 0.0 and state.cut == 0.0
    way_back = -state.share * clutch.return_area if drained and cylinder.piston < clutch.clearance else 0.0
    return Volumes(start, half, per_half, line_before, stiff_line, chamber_before, stiff_chamber, laminar_drop, laminar, way_back)


@njit(**INLINED)
def balance(
    p: float, of: Volumes, oil: Oil, state: Record, valve: Record, clutch: Record
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return the states that follow from a chamber pressure p at the step's end [Pa], for :func:`cylinder_step`.

    Returns
    -------
    tuple of float
        Line pressure [Pa], piston position [m] and valve flow [m3/s], the derivative of each by p, excess of the line's volume flow
        [m3/s], and the chamber pressure at which Newton's method expects no excess [Pa].
    """
    x, dx = piston_step(of.start, p, oil.spin, of.half, oil.damping, clutch)
    feed = of.stiff_chamber * (p - of.chamber_before) + clutch.piston_area * (x - of.start) * of.per_half + oil.seep
    dfeed = of.stiff_chamber + clutch.piston_area * dx * of.per_half
    turbulent = clutch.feed_drop * abs(feed)
    line = p + (of.laminar_drop + turbulent) * feed
    dline = 1.0 + (of.laminar_drop + 2.0 * turbulent) * dfeed
    flow, dflow = line_flow(state, line, oil.supply, clutch.orifice_speed, of.laminar, clutch.full_line, valve)
    if of.way_back > 0.0:
        back, dback = orifice(of.way_back, line, of.way_back, clutch.orifice_speed, of.laminar)
        flow, dflow = flow - back, dflow - dback
    dflow *= dline
    miss = of.stiff_line * (line - of.line_before) + feed + oil.lost - flow
    return line, x, flow, dline, dx, dflow, miss, p - miss / (of.stiff_line * dline + dfeed - dflow)


@njit(cache=True, error_model="numpy", forceinline=True)
def cylinder_step(cylinder: Record, port: Record, state: Record, oil: Oil, h: float, valve: Record, clutch: Record) -> float:
    """Take one implicit step of line, feed orifice, chamber and piston, whose states are in ``port`` and ``cylinder``.

    The step is of second order: the compression of the oil by backward differences over two steps, which damp a stiff volume as a
    backward step does, and the travel of the piston by the trapezoidal rule, or by a backward step on a stiff pack. The chamber
    pressure is the only unknown: piston, feed flow and line pressure follow from it in closed form, and the balance of the line's
    volume is a monotone function of it, which is solved by Newton's method inside a shrinking bracket. It starts from the pressure
    that continues the rise of the last step, and ends with a correction so small that all values follow linearly; most steps need
    one iteration.

    Parameters
    ----------
    cylinder, port : Record
        States of the clutch and of the oil line.
    state : Record
        States of the valve, with its opening or, for a valve outside the plant, its held answer.
    oil : Oil
        The oil.
    h : float
        Length of the step [s].
    valve, clutch : Record
        Values of the valve and of the clutch, with those that its stage ``fill`` has computed.

    Returns
    -------
    float
        Flow of the valve [m3/s].
    """
    low, high = -0.1e6, inf
    rise = cylinder.chamber_rise if abs(cylinder.chamber_rise) > LEVEL else 0.0
    p = max(cylinder.chamber + rise, low)
    of = volumes_of(cylinder, port, state, oil, h, clutch)
    # In most steps there is one iteration only. It is written before the loop, because the compiler moves expressions that do not
    # change in the loop before it, where they would be computed in every step
    line, x, flow, dline, dx, dflow, miss, new = balance(p, of, oil, state, valve, clutch)
    turn = 0
    # a root that is found lies on the bracket's edge, so this test comes before that of the bracket
    while not abs(new - p) * dline < NEAR and turn < 120:
        if miss > 0.0:
            high = p
        else:
            low = p
        p = new if turn < 40 and low < new < high else 0.5 * (low + high) if high < inf else 2.0 * p + 1000000.0
        line, x, flow, dline, dx, dflow, miss, new = balance(p, of, oil, state, valve, clutch)
        turn += 1
    ahead = new - p
    if abs(ahead) > CLOSE and turn < 120:
        p, line, x, flow = new, line + dline * ahead, max(0.0, x + dx * ahead), flow + dflow * ahead
    else:
        # the remaining error goes into the line's pressure, so that no oil is lost or created over any number of steps
        line -= miss / of.stiff_line
    port.rise, cylinder.chamber_rise = line - port.port, p - cylinder.chamber
    port.port, cylinder.chamber = line, p
    cylinder.piston, cylinder.speed = x, (x - of.start) * of.per_half
    return flow


@njit(cache=True, error_model="numpy", forceinline=True)
def at_rest(cylinder: Record, port: Record, state: Record, h: float, damping: float, spin: float, clutch: Record) -> bool:
    """Return whether the last step has changed no state and this step would not either.

    This is so in most steps: a cylinder is empty, or its valve holds the pressure with both edges closed. The parameters are those
    of :func:`cylinder_step`.
    """
    if state.share < 0.0 and state.cut == 0.0 and cylinder.piston == 0.0 and max(abs(port.port), abs(cylinder.chamber)) < NOTHING:
        port.port = port.rise = cylinder.chamber = cylinder.chamber_rise = cylinder.speed = 0.0
    if cylinder.speed != 0.0 or port.rise != 0.0 or cylinder.chamber_rise != 0.0:
        return False
    if state.cut > 0.0 or state.share > 0.0 or (state.share < 0.0 and port.port != 0.0):
        return False
    return piston_step(cylinder.piston, cylinder.chamber, spin, h, damping, clutch)[0] == cylinder.piston


@njit(cache=True, error_model="numpy", forceinline=True)
def emptied(empty: float, pressure: float, fills: bool, clutch: Record) -> float:
    """Return the empty part of the line [m3] after a step, in which the valve fills it or does not.

    A line without pressure runs empty through the drained valve and the gaps of the rotary feed.
    """
    if fills or pressure > NO_PRESSURE:
        return empty
    return clutch.drained_volume + (empty - clutch.drained_volume) * clutch.drain_left


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the values of oil, line and plates' cooling that depend on the step's length or on the oil."""
    my = world.values.wet_clutch[k]
    oil = world.values.oil_supply[my.oil]
    my.full_line, my.stiff_chamber, my.feed_drop = oil_stiffness(h, oil, my)
    my.feed_resistance = feed_resistance(oil, my)
    my.orifice_speed, my.laminar = orifice_speed(oil.density), laminar_force(1.0, oil.density)
    my.damping_by_viscosity = my.piston_damping / oil.viscosity
    my.drain_left = exp(-h / my.drain_time)
    plates.fill_plates(my, h)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move line, chamber, piston and pack over the step."""
    me, my = world.parts.wet_clutch[k], world.values.wet_clutch[k]
    drag = plates.capacities_before(me, my, world.driveline.cap)
    port, valve = world.oil[my.line], world.parts.proportional_valve[my.valve]
    my.clearance = my.new_clearance + me.wear
    supply = world.oil[world.values.proportional_valve[my.valve].supply].pressure
    viscosity = world.parts.oil_supply[my.oil].viscosity
    lost = 0.0
    if my.drained_volume > 0.0:
        fills = valve.cut_flow > 0.0 if valve.cut > 0.0 else valve.share > 0.0
        if fills and me.empty > 0.0:
            flow = line_flow(
                valve,
                0.0,
                supply,
                my.orifice_speed,
                my.laminar * viscosity * viscosity,
                my.full_line,
                world.values.proportional_valve[my.valve],
            )[0]
            lost = min(max(0.0, flow), me.empty / h)
            me.empty -= lost * h
        me.empty = emptied(me.empty, port.pressure, fills, my)
    spin = 0.0
    if my.turns_with != NOWHERE:
        spin = turning_force(world.driveline.middle[my.turns_with], world.values.oil_supply[my.oil].density, my)
    damping, values, flow = my.damping_by_viscosity * viscosity, world.values.proportional_valve[my.valve], 0.0
    inward, outward, seep = 0.0, 0.0, 0.0
    leaks = my.line_leak + my.piston_leak + values.leak_area > 0.0
    if leaks:
        inward = leak(values.leak_area, supply - port.port, my.orifice_speed, my.full_line)
        outward = leak(my.line_leak, port.port, my.orifice_speed, my.full_line)
        seep = leak(my.piston_leak, me.chamber, my.orifice_speed, my.stiff_chamber)
    if leaks or not at_rest(me, port, valve, h, damping, spin, my):
        oil = Oil(supply, viscosity, damping, spin, lost + (outward - inward), seep)
        flow = cylinder_step(me, port, valve, oil, h, values, my) + inward
    fed(world, my.valve, port.port, flow, h)
    port.pressure = me.chamber
    me.clamp = pack_force(me.piston, my)[0]
    plates.capacities_after(me, my, me.piston, drag, world)


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Add the heat and wear of the plates."""
    plates.heat_plates(world.parts.wet_clutch[k], world.values.wet_clutch[k], world)


# chamber_rise: rise of the chamber's pressure in the last step; speed: speed of the piston; empty: empty part of the line [m3];
# line_leak, piston_leak: areas of leaks of line and seal, 0 for none. The pressure that is measured is the chamber's, where the
# oil enters (tab. 7.1)
SHOWS = (
    Shown(
        "mode",
        "mode",
        "state",
        0.0,
        2.0,
        "Clutch {called}: open, slipping or locked.",
        "none",
        {0: "open", 1: "slipping", 2: "locked"},
    ),
    Shown("torque", "torque", "torque", -700.0, 700.0, "Friction torque of clutch {called}.", "positive drives {driven}"),
    Shown("capacity", "capacity_kinetic", "torque", 0.0, 700.0, "Torque that {called} transmits while slipping.", "magnitude"),
    Shown("slip", "slip", "speed", -320.0, 320.0, "Slip of clutch {called}.", "{driving} minus {driven}"),
    Shown(
        "clamp",
        "clamp_force",
        "force",
        0.0,
        8000.0,
        "Force on the plates of clutch {called}.",
        "positive presses the plates together",
    ),
    Shown(
        "piston",
        "piston_position",
        "length",
        0.0,
        0.01,
        "Piston position of clutch {called}, 0 when released.",
        "rising towards the plates",
    ),
)
EFFECTS = {"seal_friction": {"seal_friction": 0.0, "seal_friction_share": 0.0}}


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ClutchState."""
    me = rig.device(name)
    return plates.shown_pack(rig, name, me["chamber"], me["piston"])


PART = Part(
    "wet_clutch",
    20,
    (Cylinder, PlatePack),
    state=("chamber", "chamber_rise", "piston", "speed", "empty", *plates.STATE),
    derived=(
        *plates.DERIVED,
        "full_line",
        "stiff_chamber",
        "feed_drop",
        "feed_resistance",
        "orifice_speed",
        "laminar",
        "damping_by_viscosity",
        "drain_left",
        "line_leak",
        "piston_leak",
    ),
    wires=(*plates.WIRES, "line", "valve", "turns_with"),
    stages={"fill": fill, "before": before, "after": after},
    role=CLUTCH,
    joined={**plates.JOINED, "turns_with": Wire(BODY, needed=False)},
    effects=EFFECTS,
    message="ClutchState",
    shown_values=shown_values,
    shows=SHOWS,
)
