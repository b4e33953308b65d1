# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Centrifugal clutch: shoes on the driving body that springs hold back and that press on a drum as they turn.

It is a part of the engine. Its capacity follows the speed of the body that carries the shoes; slip, lock-up and break-away are
those of any clutch of the driveline.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import E_FRIC, HI0, HI1, KIN0, KIN1, LAM, LO0, LO1
from .part import CLUTCH, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


@dataclass(frozen=True)
class CentrifugalConfig:
    """Shoes, springs and drum, with the symbols of Wiesik's paper on chain saws."""

    shoe_mass: float = param("mass", 1e-5, 100.0, "Mass of one shoe, m_s")
    shoe_radius: float = param("length", 1e-4, 10.0, "Radius of the centre of mass of a shoe that touches the drum, r_s")
    spring_mass: float = param("linear density", 0.0, 100.0, "Mass of the return spring per length of wire axis, q_spr")
    spring_radius: float = param("length", 0.0, 10.0, "Radius at which the coils of the spring lie, r_spr")
    spring_angle: float = param("angle", 0.0, 1.57, "Angle at which the spring leaves the shoe, gamma")
    drum_radius: float = param("length", 1e-4, 10.0, "Radius of the drum, r_b")
    shoes: float = param("ratio", 1.0, 64.0, "Number of the shoes, k")
    friction: float = param("ratio", 0.0, 2.0, "Coefficient of friction between shoe and drum, mu")
    stick: float = param("ratio", 1.0, 10.0, "Torque at which a locked clutch breaks away over the torque of one that slips")
    engagement_speed: float = param("angular velocity", 0.0, 1e4, "Speed at which shoes of the engagement mass touch the drum, w_0")
    engagement_mass: float = param(
        "mass", 1e-5, 100.0, "Mass of a shoe that touches at the engagement speed; the same springs hold back any other mass"
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def engagement_squared(clutch: Record) -> float:
    """Return the square of the speed at which the shoes touch the drum [rad2/s2].

    The springs' force at that speed, m_s r_s w_0^2 / (2 cos gamma) by eq. (4) of the paper, does not depend on the shoes.
    """
    return clutch.engagement_mass * clutch.engagement_speed * clutch.engagement_speed / clutch.shoe_mass


@njit(cache=True, error_model="numpy", forceinline=True)
def torque_per_square(clutch: Record) -> float:
    """Return (m_s r_s + 2 q r_spr^2 cos gamma) r_b k mu, the factor of eq. (5) [Nm s2/rad2]."""
    mass = clutch.shoe_mass * clutch.shoe_radius
    mass += 2.0 * clutch.spring_mass * clutch.spring_radius * clutch.spring_radius * cos(clutch.spring_angle)
    return mass * clutch.drum_radius * clutch.shoes * clutch.friction


@njit(cache=True, error_model="numpy", forceinline=True)
def slipping_torque(speed: float, factor: float, engaged: float) -> float:
    """Return the torque of a slipping clutch [Nm] at a speed of the shoes [rad/s], eq. (5); 0 before they touch."""
    return max(0.0, factor * (speed * speed - engaged))


def clutch_torque(clutch: CentrifugalConfig, speed: float) -> float:
    """Return the torque that the clutch transmits while it slips [Nm] at a speed [rad/s], eq. (5)."""
    return float(slipping_torque.py_func(speed, torque_per_square.py_func(clutch), engagement_squared.py_func(clutch)))


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the two numbers of eq. (5) that do not depend on the speed."""
    my = world.values.centrifugal_clutch[k]
    my.factor, my.engaged = torque_per_square(my), engagement_squared(my)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the capacity at both ends of the step, at its end by the speed that is expected there."""
    me, my, line = world.parts.centrifugal_clutch[k], world.values.centrifugal_clutch[k], world.driveline
    cap, f, speed = line.cap, my.element, line.speed[my.body]
    start = slipping_torque(speed, my.factor, my.engaged)
    me.kinetic = slipping_torque(2.0 * line.middle[my.body] - speed, my.factor, my.engaged)
    me.static = my.stick * me.kinetic
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = start, my.stick * start, -my.stick * start
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = me.kinetic, me.static, -me.static


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Record torque, heat and the force of a shoe at the step's end."""
    me, my, el = world.parts.centrifugal_clutch[k], world.values.centrifugal_clutch[k], world.driveline.el
    me.torque, me.heat = el[LAM, my.element], el[E_FRIC, my.element]
    arm = my.friction * my.drum_radius * my.shoes
    me.force = me.kinetic / arm if arm > 0.0 else 0.0


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ClutchState; it has no drag, no pressure and no piston."""
    me = rig.device(name)
    return (
        rig.clutch_mode(name),
        rig.friction_torque(name),
        0.0,
        me["kinetic"],
        me["static"],
        rig.slip(name),
        me["force"],
        0.0,
        0.0,
        rig.energies[rig.heat_of(name)],
    )


# kinetic, static: torque of the clutch while it slips, and at which it breaks away; torque, heat: those of its element of the
# driveline; force: of one shoe; factor, engaged: the numbers of eq. (5)
PART = Part(
    "centrifugal_clutch",
    20,
    (CentrifugalConfig,),
    state=("kinetic", "static", "torque", "heat", "force"),
    derived=("factor", "engaged"),
    wires=("element", "body"),
    stages={"fill": fill, "before": before, "after": after},
    role=CLUTCH,
    joined={"joins": Wire("bodies"), "body": Wire("body")},
    message="ClutchState",
    shown_values=shown_values,
    shows=(
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
        Shown("slip", "slip", "speed", -1600.0, 1600.0, "Slip of clutch {called}.", "{driving} minus {driven}"),
        Shown("clamp", "clamp_force", "force", 0.0, 8000.0, "Force of one shoe of {called} on the drum.", "positive presses"),
        Shown("heat", "heat", "energy", 0.0, 1e9, "Heat of friction in {called} since time 0.", "positive"),
    ),
)
