# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reciprocating mass on a crank with a counterweight: a saw's sash, a piston.

It is a part of the engine. driveline.laws has the same mechanism as an element of the driveline, which is solved together
with all others; this part acts on its body by a torque, which the quick step of the driveline takes.

The torque depends on the body's acceleration, which is a result of the same step. It is predicted from all other torques at the end
of the last step. The difference between the exact impulse and that of the predicted torque is applied in the next step, so that
errors do not accumulate. The exact impulse is that of the discrete gradient (Gonzalez, J. Nonlinear Sci. 6, 1996): its work is the
change of the stored energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .part import MASS, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

GRAVITY = 9.80665  # m/s2
LITTLE = 1e-5  # rad: rotation in a step below which the rounding error of a difference quotient would be too large
TURN = 2.0 * pi


@dataclass(frozen=True)
class SashConfig:
    """Values of the mass, the crank and the counterweight, whose own inertia about the crank's axis is the body's."""

    mass: float = param("mass", 1e-3, 1e5, "Reciprocating mass, with all parts fixed to it")
    radius: float = param("length", 1e-4, 10.0, "Radius of the crank")
    rod_ratio: float = param(
        "ratio", 0.0, 0.9, "Radius of the crank over length of the rod; at 0 the travel is radius (1 - cos angle), as of a long rod"
    )
    counterweight: float = param("mass", 0.0, 1e5, "Mass opposite the crank pin, reduced to the crank's radius")
    weight: float = param("ratio", -1.0, 1.0, "Share of gravity along the travel; 1 where the mass goes straight down from angle 0")


@njit(cache=True, error_model="numpy", forceinline=True)
def motion(angle: float, radius: float, rod_ratio: float) -> tuple[float, float, float]:
    """Return the travel of the mass and its first and second derivative by the angle of the crank.

    Parameters
    ----------
    angle : float
        Angle of the crank [rad], 0 where the mass is farthest from the crank's axis.
    radius : float
        Radius of the crank [m].
    rod_ratio : float
        Radius of the crank over length of the rod; 0 for a rod of any length.

    Returns
    -------
    tuple of float
        Travel [m], from its place at angle 0; its derivatives [m/rad, m/rad2].
    """
    s, c = sin(angle), cos(angle)
    if rod_ratio == 0.0:
        return radius * (1.0 - c), radius * s, radius * c
    q = sqrt(1.0 - (rod_ratio * s) ** 2)
    # 1 - q, without the loss of digits of a difference
    travel = radius * (1.0 - c + rod_ratio * s * s / (1.0 + q))
    first = radius * s * (1.0 + rod_ratio * c / q)
    second = radius * (c + rod_ratio * (c * c - s * s) / q + rod_ratio**3 * (s * c) ** 2 / q**3)
    return travel, first, second


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the torque on its body at both ends of the step, by the angle and the speed that are predicted for its end."""
    me, my, line = world.parts.sash[k], world.values.sash[k], world.driveline
    body = my.body
    own, pull = 1.0 / my.mobility, GRAVITY * my.weight
    speed = line.speed[body]
    end = 2.0 * line.middle[body] - speed
    me.ahead = me.angle + h * line.middle[body]
    # push already contains the torques of the parts before this one
    others = me.others + line.push[0, body]
    mass = my.mass * me.first * me.first
    bend = my.mass * me.first * me.second * speed * speed
    down = pull * (my.mass * me.first - my.counterweight * my.radius * sin(me.angle))
    missing = me.lacking * own / (own + mass) / h
    me.begin = down - bend - mass * (others + down - bend) / (own + mass) + missing
    me.travel, me.first, me.second = motion(me.ahead, my.radius, my.rod_ratio)
    others = me.others + line.push[1, body]
    mass = my.mass * me.first * me.first
    bend = my.mass * me.first * me.second * end * end
    down = pull * (my.mass * me.first - my.counterweight * my.radius * sin(me.ahead))
    me.torque = down - bend - mass * (others + down - bend) / (own + mass) + missing
    line.push[0, body] += me.begin
    line.push[1, body] += me.torque


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Advance the crank's angle by the speeds of the step, and compute the impulse that the predicted torque lacks."""
    me, my, line = world.parts.sash[k], world.values.sash[k], world.driveline
    body = my.body
    speed, gained = line.speed[body], line.gained[body]
    turned = h * (speed - 0.5 * gained)
    before_mass, height, slope = me.inertia, me.height, me.slope
    # the error of the predicted angle is of third order in the step
    missed = me.angle + turned - me.ahead
    angle = me.ahead + missed
    me.travel += me.first * missed
    me.first += me.second * missed
    mass = my.mass * me.first * me.first
    lever = my.mass * me.first - my.counterweight * my.radius * sin(angle)
    me.height = my.mass * me.travel - my.counterweight * my.radius * (1.0 - cos(angle))
    me.slope = 2.0 * my.mass * me.first * me.second
    me.inertia = mass
    if abs(turned) > LITTLE:
        steep, sink = (mass - before_mass) / turned, (me.height - height) / turned
    else:
        steep, sink = 0.5 * (me.slope + slope), lever
    square = 0.5 * (speed * speed + (speed - gained) ** 2)
    needed = h * GRAVITY * my.weight * sink - 0.5 * (before_mass + mass) * gained - 0.5 * h * steep * square
    mean = 0.5 * (me.begin + me.torque)
    me.lacking += needed - h * mean
    me.work += mean * turned
    me.energy = 0.5 * mass * speed * speed - GRAVITY * my.weight * me.height
    rate = line.rate[body]
    me.others = rate / my.mobility - line.push[1, body]
    me.velocity = me.first * speed
    turning, speeding = speed * speed, rate
    me.force_along = -my.mass * (me.second * turning + me.first * speeding) + my.counterweight * my.radius * (
        cos(angle) * turning + sin(angle) * speeding
    )
    me.force_across = -my.counterweight * my.radius * (sin(angle) * turning - cos(angle) * speeding)
    if angle >= TURN:
        angle -= TURN
    elif angle < 0.0:
        angle += TURN
    me.angle = angle


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its LoadState."""
    me = rig.device(name)
    return (-me["torque"], 0.0, 0.0, 0.0, -me["work"])


# angle: of the crank, 0 to 2 pi; ahead: prediction of it for the step's end; travel, first, second: of the mass and its derivatives
# by the angle; begin, torque: on the body at the step's start and end; others: all other torques at the last step's end; lacking:
# impulse that is still to be applied [N m s]; inertia, slope, height: at the last step's end the mass reduced to the crank, its
# derivative by the angle, and the moment of mass on which gravity acts [kg m]; work: work on its body; energy: stored energy, 0 at
# rest at angle 0; force_along, force_across: inertia forces on the frame along the travel from angle 0, and across it towards the
# crank pin at a quarter of a turn
PART = Part(
    "sash",
    35,
    (SashConfig,),
    state=(
        "angle",
        "ahead",
        "travel",
        "first",
        "second",
        "velocity",
        "begin",
        "torque",
        "others",
        "lacking",
        "inertia",
        "slope",
        "height",
        "work",
        "energy",
        "force_along",
        "force_across",
    ),
    derived=("mobility",),
    wires=("body",),
    stages={"before": before, "after": after},
    role=MASS,
    joined={"body": Wire("body")},
    message="LoadState",
    shown_values=shown_values,
    shows=(
        Shown("torque", "torque", "torque", -1e4, 1e4, "Torque of the {called} on {body}.", "positive brakes {body}"),
        Shown("work", "work", "energy", -1e9, 1e9, "Work taken by the {called} since time 0.", "positive taken from {body}"),
    ),
    stores=("work", "energy"),
)
