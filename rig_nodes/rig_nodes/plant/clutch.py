# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wet multi-plate clutch: cylinder with piston against disc springs, plate pack, friction, drag, heat and wear.

Called by plant.kernel for S1 and S2; the models of torque and drag themselves are in plant.friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, expm1, inf, sqrt

from numba import njit

from ..config.schema import choice, param
from ..errors import RigError
from .friction import closed, drag
from .friction.geometry import PackGeometry
from .valve import held_flow, port_flow

LOWEST = -1e4  # Pa: to which the tank's pressure may be missed by the order of the integration
# models of chapter 6 that a configuration may name
FRICTION_MODELS = ("thesis", "traditional", "osinski", "newcomb", "chen")
DRAG_MODELS = ("kitabayashi", "davis", "pahlovy", "peng_yuan", "iqbal")


@dataclass(frozen=True)
class PlatePack(PackGeometry):
    """Geometry and friction of the plates (thesis tab. 3.3)."""

    friction_static: float = param("ratio", 0.0, 1.0)
    friction_kinetic: float = param("ratio", 0.0, 1.0)
    friction_spline: float = param("ratio", 0.0, 1.0)
    friction_spline_static: float = param("ratio", 0.0, 1.0)
    film_gap: float = param("length", 1e-6, 1e-2)
    film_force: float = param("force", 1.0, 1e5)
    film_radius: float = param("length", 1e-3, 1.0)
    liquid_share: float = param("ratio", 0.0, 1.0)
    mist_viscosity_share: float = param("ratio", 0.0, 1.0)
    heat_capacity: float = param("heat capacity", 1.0, 1e6)
    cooling: float = param("thermal conductance", 0.0, 1e6)
    friction_per_kelvin: float = param("per temperature", -0.02, 0.02)
    friction_temperature: float = param("temperature", -30.0, 300.0)
    wear_rate: float = param("wear rate", 0.0, 1e-6)
    wear_per_kelvin: float = param("per temperature", 0.0, 1.0)


@dataclass(frozen=True)
class Cylinder:
    """Cylinder, return springs, seals, the pack's axial elasticity and the oil in front of the piston."""

    piston_area: float = param("area", 1e-5, 1e-1)
    force_per_pressure_squared: float = param("force per pressure squared", 0.0, 1e-9)
    spring_preload: float = param("force", 0.0, 1e5)
    spring_rate: float = param("stiffness", 1e2, 1e9)
    clearance: float = param("length", 1e-5, 5e-2)
    pack_rate: float = param("stiffness", 1e3, 1e10)
    pack_travel: float = param("length", 1e-5, 1e-2)
    seal_friction: float = param("force", 0.0, 1e4)
    seal_friction_share: float = param("ratio", 0.0, 0.5)
    piston_damping: float = param("damping", 1.0, 1e7)
    line_volume: float = param("volume", 1e-7, 1e-2)
    chamber_volume: float = param("volume", 1e-7, 1e-2)
    feed_area: float = param("area", 1e-8, 1e-2)
    friction_model: str = choice(*FRICTION_MODELS)
    drag_model: str = choice(*DRAG_MODELS)
    friction_correction: float = param("ratio", 0.1, 10.0)
    rest_torque: float = param("torque", 0.0, 500.0)
    rest_sliding: float = param("ratio", 0.0, 1.0)
    spline_hold: float = param("ratio", 0.0, 1.0)


def torque_per_force(pack: PlatePack, friction: float, releasing: bool = False, model: str = "thesis") -> float:
    """Torque per clamp force [Nm/N] of the whole pack by a model of chapter 6; RigError for a pack that cannot be.

    Only for the thesis's model there is a reading of the release: plates that stick on their splines, so its spline
    friction is that of rest, turned round. With the others the pack follows its clamp force.
    """
    spline = pack.friction_spline_static if releasing and model == "thesis" else pack.friction_spline
    try:
        if model == "thesis":
            return closed.thesis(pack, 1.0, friction, spline, releasing=releasing)
        if model == "traditional":
            return closed.traditional(pack, 1.0, friction)
        if model == "osinski":
            return closed.osinski(pack, 1.0, friction, beyond_table=True)
        return {"newcomb": closed.newcomb, "chen": closed.chen}[model](pack, 1.0, friction, spline)
    except ValueError as error:
        raise RigError(f"plate_pack: {error}") from None


def drag_factor(pack: PlatePack, model: str = "kitabayashi") -> float:
    """Viscous drag of a model of chapter 6 per viscosity, slip and reciprocal gap [m4]; RigError as above."""
    try:
        if model == "kitabayashi":
            return drag.kitabayashi(pack, 1.0, 1.0, 1.0)
        if model == "davis":
            return drag.davis_viscous(pack, 1.0, 1.0, 1.0)
        if model == "iqbal":
            return drag.iqbal(pack, 1.0, 1.0, 1.0, pack.film_radius, pack.liquid_share, pack.mist_viscosity_share)
        return {"pahlovy": drag.pahlovy, "peng_yuan": drag.peng_yuan}[model](pack, 1.0, 1.0, 1.0, pack.film_radius)
    except ValueError as error:
        raise RigError(f"plate_pack: {error}") from None


@njit(cache=True, error_model="numpy", forceinline=True)
def friction_factor(temperature, clutch):
    """Friction of the plates at their temperature [degC] over that at ``friction_temperature``."""
    return max(0.2, 1.0 + clutch.friction_per_kelvin * (temperature - clutch.friction_temperature))


@njit(cache=True, error_model="numpy", forceinline=True)
def plates_cooling(h, clutch):
    """(share of a difference to the oil's temperature that is left after h, rise by heat that comes evenly [K/J])."""
    spent = h * clutch.cooling / clutch.heat_capacity
    return exp(-spent), (-expm1(-spent) / spent if spent > 0.0 else 1.0) / clutch.heat_capacity


@njit(cache=True, error_model="numpy", forceinline=True)
def plates_after(temperature, wear, heat, oil_temperature, left, rise, clutch):
    """(temperature [degC], wear of the whole pack [m]) of the plates after a step in which they took ``heat`` [J].

    left, rise: of :func:`plates_cooling`, the exact solution for heat that comes evenly.
    """
    rate = clutch.wear_rate * max(0.0, 1.0 + clutch.wear_per_kelvin * (temperature - clutch.friction_temperature))
    return oil_temperature + (temperature - oil_temperature) * left + heat * rise, wear + rate * heat


@njit(cache=True, error_model="numpy", forceinline=True)
def drag_coefficient(piston, clamp, viscosity, clutch):
    """Viscous torque per slip [Nm s/rad]: oil sheared in the gaps, giving way to the asperities as they carry."""
    gap = max((clutch.clearance - piston) / clutch.surfaces, clutch.film_gap)
    film_share = max(0.0, 1.0 - clamp / clutch.film_force)
    return clutch.drag_factor * viscosity / gap * film_share


@njit(cache=True, error_model="numpy", forceinline=True)
def held_torque(before, clamp, engaging, releasing):
    """Torque [Nm] at which a stuck pack slips, with the memory of the splines: rises along ``engaging`` times the clamp
    force, stays while the plates stick on their splines, falls along ``releasing`` times the clamp force [Nm/N]."""
    return min(max(before, engaging * clamp), releasing * clamp)


@njit(cache=True, error_model="numpy", forceinline=True)
def rest_share(before, piston, clamp, clutch):
    """Share of M_rest of (6.56), what an unclamped pack still asks for, with the memory of the contact.

    It is there as soon as the asperities carry, and outlasts the clamp: plates that stick, and waves that press them
    (8.3.5 names both), let go as the piston gives way to a film of full height between all of them.
    """
    carried = max(before, min(1.0, clamp / clutch.film_force))
    return min(carried, max(0.0, 1.0 - (clutch.clearance - piston) / (clutch.surfaces * clutch.film_gap)))


@njit(cache=True, error_model="numpy", forceinline=True)
def prescribed_clamp(pressure, clutch):
    """Clamp force [N] at a prescribed pressure [Pa]: F_p of Annex D less the springs' force at the kiss point."""
    push = (clutch.force_square * pressure + clutch.force_linear) * pressure + clutch.force_offset
    return max(0.0, push - clutch.contact_force)


@njit(cache=True, error_model="numpy", forceinline=True)
def pack_force(piston, clutch):
    """(force on the plates [N], its slope [N/m]): none up to the kiss point, then the waves of the steel plates.

    F = k x / (1 - x / x_f): soft at first, stiff as the sinusoidal plates lie flat at the travel x_f.
    """
    squeeze = piston - clutch.clearance
    if squeeze <= 0.0:
        return 0.0, 0.0
    left = max(1e-4, 1.0 - squeeze / clutch.pack_travel)
    return clutch.pack_rate * squeeze / left, clutch.pack_rate / (left * left)


@njit(cache=True, error_model="numpy", forceinline=True)
def piston_step(piston, pressure, h, clutch):
    """(piston position after h, its derivative by pressure): implicit step of the massless, damped piston.

    Balance: push = springs + pack + damping v + seal friction, which holds the piston while the rest is smaller. The
    push is area p and a square term, which the laboratory's force over pressure has (Annex D).
    """
    square = clutch.force_per_pressure_squared * max(pressure, 0.0)
    push, slope = (clutch.piston_area + square) * pressure, clutch.piston_area + 2.0 * square
    seal = clutch.seal_friction + clutch.seal_friction_share * abs(push)
    resist = clutch.spring_preload + clutch.spring_rate * piston + pack_force(piston, clutch)[0]
    if push - resist > seal:
        drive, gain = push - seal, slope * (1.0 - clutch.seal_friction_share)
    elif push - resist < -seal and piston > 0.0:
        drive, gain = push + seal, slope * (1.0 + clutch.seal_friction_share)
    else:
        return piston, 0.0
    rate = clutch.piston_damping / h
    stiff = clutch.spring_rate + rate
    # the balance with the pack just touched; k s / (1 - s / s_f) makes it a quadratic in the squeeze s beyond that
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
def oil_stiffness(h, oil, clutch):
    """(flow that raises the line's pressure [m3/(s Pa)], that of the chamber by backward differences, pressure that the
    feed orifice takes per flow squared [Pa s2/m6]), for steps of h: constants of :func:`cylinder_step`.
    """
    return (clutch.line_volume / oil.bulk_modulus / h, 1.5 * clutch.chamber_volume / oil.bulk_modulus / h,
            oil.density / (2.0 * clutch.feed_area * clutch.feed_area))


@njit(cache=True, error_model="numpy", forceinline=True)
def cylinder_step(cylinder, state, supply, h, full_line, stiff_chamber, inertia_drop, oil, valve, clutch):
    """One implicit step of line, feed orifice, chamber and piston from where they are in ``cylinder``.

    state: of the valve, with its opening or, where it stands outside the plant, its held answer; full_line to
    inertia_drop: of :func:`oil_stiffness`.
    Of second order: the oil's compression by backward differences over two steps, which damp a stiff volume as a
    backward step does, the piston's way by the trapezoidal rule.
    Returns (line pressure, chamber pressure, piston, its speed [m/s], valve flow). Unknown is the chamber pressure
    alone: piston, feed flow and line pressure follow from it in closed form, and the balance of the line's volume is a
    monotone function of it, solved by Newton inside a shrinking bracket.
    """
    stiff_line = 1.5 * full_line
    # (3 p - 4 p0 + p00) / 2 h = 1.5 (p - (p0 + rise / 3)) / h
    chamber_before = cylinder.chamber + cylinder.chamber_rise / 3.0
    line_before = cylinder.line + cylinder.line_rise / 3.0
    # what fell this fast, and stopped, would fall on below the tank's pressure by the step before alone: there a backward
    # step, with which no volume gets below the tank, as nothing draws from it
    if line_before < LOWEST:
        line_before, stiff_line = cylinder.line, full_line
    if chamber_before < LOWEST:
        chamber_before, stiff_chamber = cylinder.chamber, stiff_chamber / 1.5
    low, high = -0.1e6, inf
    p = max(cylinder.chamber, low)
    half = 0.5 * h
    start = max(0.0, cylinder.piston + half * cylinder.speed)
    line, x, flow, speed = cylinder.line, start, 0.0, 0.0
    for turn in range(120):
        x, dx = piston_step(start, p, half, clutch)
        speed = (x - start) / half
        feed = stiff_chamber * (p - chamber_before) + clutch.piston_area * speed
        dfeed = stiff_chamber + clutch.piston_area * dx / half
        line = p + inertia_drop * feed * abs(feed)
        dline = 1.0 + 2.0 * inertia_drop * abs(feed) * dfeed
        if state.cut > 0.0:
            flow, dflow = held_flow(state, line, supply, full_line)
        else:
            flow, dflow = port_flow(state.share, line, supply, oil.density, valve)
        miss = stiff_line * (line - line_before) + feed - flow
        if miss > 0.0:
            high = p
        else:
            low = p
        new = p - miss / (stiff_line * dline + dfeed - dflow * dline)
        if abs(new - p) < 1e-3:  # Pa; a root that is met lies on the bracket's edge, so this comes first
            break
        if turn < 40 and low < new < high:
            p = new
        else:
            p = 0.5 * (low + high) if high < inf else 2.0 * p + 1e6
    # what Newton has left goes into the line's pressure: no oil is lost or made, however many steps
    return line - miss / stiff_line, p, x, speed, flow
