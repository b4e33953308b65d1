"""Wet multi-plate clutch: cylinder with piston against disc springs, plate pack, friction after (6.54), drag.

Called by plant.kernel for S1 and S2; the models of torque and drag themselves are in plant.friction.
"""

from __future__ import annotations

from dataclasses import dataclass

from numba import njit

from ..config.schema import param
from ..errors import RigError
from .friction.closed import thesis
from .friction.drag import kitabayashi
from .friction.geometry import PackGeometry
from .valve import held_flow, port_flow


@dataclass(frozen=True)
class PlatePack(PackGeometry):
    """Geometry and friction of the plates (thesis tab. 3.3)."""

    friction_static: float = param("ratio", 0.0, 1.0)
    friction_kinetic: float = param("ratio", 0.0, 1.0)
    friction_spline: float = param("ratio", 0.0, 1.0)
    film_gap: float = param("length", 1e-6, 1e-2)
    film_force: float = param("force", 1.0, 1e5)


@dataclass(frozen=True)
class Cylinder:
    """Cylinder, return springs, seals, the pack's axial elasticity and the oil in front of the piston."""

    piston_area: float = param("area", 1e-5, 1e-1)
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


def torque_per_force(pack: PlatePack, friction: float, releasing: bool = False) -> float:
    """Torque per clamp force [Nm/N] of the whole pack after (6.54), (6.55); RigError for a pack that cannot be."""
    try:
        return thesis(pack, 1.0, friction, pack.friction_spline, releasing=releasing)
    except ValueError as error:
        raise RigError(f"plate_pack: {error}") from None


def drag_factor(pack: PlatePack) -> float:
    """Kitabayashi's drag (6.4) per viscosity, slip and reciprocal gap: n pi r_m^2 (R_z^2 - R_w^2) [m4]."""
    return kitabayashi(pack, slip=1.0, viscosity=1.0, gap=1.0)


@njit(cache=True)
def drag_coefficient(piston, clamp, viscosity, clutch):
    """Viscous torque per slip [Nm s/rad]: oil sheared in the gaps, giving way to the asperities as they carry."""
    gap = max((clutch.clearance - piston) / clutch.surfaces, clutch.film_gap)
    film_share = max(0.0, 1.0 - clamp / clutch.film_force)
    return clutch.drag_factor * viscosity / gap * film_share


@njit(cache=True)
def held_torque(before, clamp, engaging, releasing):
    """Torque capacity [Nm] with the memory of the splines: rises along ``engaging`` times the clamp force, stays
    while the plates stick on their splines, falls along ``releasing`` times the clamp force [Nm/N]."""
    return min(max(before, engaging * clamp), releasing * clamp)


@njit(cache=True)
def pack_force(piston, clutch):
    """(force on the plates [N], its slope [N/m]): none up to the kiss point, then the waves of the steel plates.

    F = k x / (1 - x / x_f): soft at first, stiff as the sinusoidal plates lie flat at the travel x_f.
    """
    squeeze = piston - clutch.clearance
    if squeeze <= 0.0:
        return 0.0, 0.0
    left = max(1e-4, 1.0 - squeeze / clutch.pack_travel)
    return clutch.pack_rate * squeeze / left, clutch.pack_rate / (left * left)


@njit(cache=True)
def piston_step(piston, pressure, h, clutch):
    """(piston position after h, its derivative by pressure): implicit step of the massless, damped piston.

    Balance: area p = springs + pack + damping v + seal friction, which holds the piston while the rest is smaller.
    """
    push = clutch.piston_area * pressure
    seal = clutch.seal_friction + clutch.seal_friction_share * abs(push)
    resist = clutch.spring_preload + clutch.spring_rate * piston + pack_force(piston, clutch)[0]
    if push - resist > seal:
        drive, gain = push - seal, clutch.piston_area * (1.0 - clutch.seal_friction_share)
    elif push - resist < -seal and piston > 0.0:
        drive, gain = push + seal, clutch.piston_area * (1.0 + clutch.seal_friction_share)
    else:
        return piston, 0.0
    rate = clutch.piston_damping / h
    flat = clutch.clearance + clutch.pack_travel
    x, stiff = piston, rate
    for _ in range(40):  # Newton on a monotone, piecewise convex balance, never past the flat pack
        plates, slope = pack_force(x, clutch)
        stiff = clutch.spring_rate + rate + slope
        miss = rate * (x - piston) + clutch.spring_preload + clutch.spring_rate * x + plates - drive
        new = x - miss / stiff
        if new >= flat:
            new = 0.5 * (x + flat)
        if abs(new - x) < 1e-12:
            break
        x = new
    if x <= 0.0:
        return 0.0, 0.0
    return x, gain / stiff


@njit(cache=True)
def cylinder_step(line_pressure, chamber_pressure, piston, state, supply, h, oil, valve, clutch):
    """One implicit step of line, feed orifice, chamber and piston.

    state: of the valve, with its opening or, where it stands outside the plant, its held answer.
    Returns (line pressure, chamber pressure, piston, valve flow). Unknown is the chamber pressure alone: piston,
    feed flow and line pressure follow from it in closed form, and the balance of the line's volume is a
    monotone function of it, solved by Newton inside a shrinking bracket.
    """
    stiff_chamber = clutch.chamber_volume / oil.bulk_modulus / h
    stiff_line = clutch.line_volume / oil.bulk_modulus / h
    inertia_drop = oil.density / (2.0 * clutch.feed_area * clutch.feed_area)
    low, high = -0.09e6, max(supply, line_pressure, chamber_pressure) + 1e5
    p = min(max(chamber_pressure, low), high)
    line, x, flow = line_pressure, piston, 0.0
    for _ in range(60):
        x, dx = piston_step(piston, p, h, clutch)
        feed = stiff_chamber * (p - chamber_pressure) + clutch.piston_area * (x - piston) / h
        dfeed = stiff_chamber + clutch.piston_area * dx / h
        line = p + inertia_drop * feed * abs(feed)
        dline = 1.0 + 2.0 * inertia_drop * abs(feed) * dfeed
        if state.cut > 0.0:
            flow, dflow = held_flow(state, line, supply, stiff_line)
        else:
            flow, dflow = port_flow(state.share, line, supply, oil.density, valve)
        miss = stiff_line * (line - line_pressure) + feed - flow
        if miss > 0.0:
            high = p
        else:
            low = p
        step = miss / (stiff_line * dline + dfeed - dflow * dline)
        new = p - step
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - p) < 1e-3:  # Pa
            break
        p = new
    return line, p, x, flow
