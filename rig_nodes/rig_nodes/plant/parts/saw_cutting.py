# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blades of a frame saw in a log: feed per tooth from the paths of the teeth, and the resulting torque on the crank.

It is a part of the engine, joined to a sash (plant/parts/sash.py) that moves the blades up and down. An eccentric swings them to
and fro twice per revolution, and the log advances by its feed per revolution of the crank (Agapov 2014, (1) to (8)). It gives a
torque capacity that the driveline applies as friction, so that it can hold but never drive.

The depth of a tooth in the wood is ``advance``: the feed since the top of the stroke, less the swing, plus the blade's overhang by
(6), which compensates the feed of half a revolution. Formula (8) takes the depth of a tooth less that of the one below it as the
feed per tooth. Here the depth is compared with the deepest one of all teeth that passed the same place in this turn and the last
one. This equals (8) wherever the tooth below was the deepest one. It also covers two cases that (8) does not: the first tooth of a
stroke, and a tooth at a place where the wood has been cut away already. Only with these cases do the teeth cut the volume that the
feed brings, at every feed and swing.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, asin, cos, exp, floor, pi, sin, sqrt
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import HI0, HI1, KIN0, KIN1, LAM, LO0, LO1
from .lag import lagged
from .part import LOAD, MASS, Command, Part, Shown, Wire, not_whole

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

PER_TURN = 0.5 / pi
HAIR = 1e-12  # share of the stroke: rounding error of a place
NO_LOG = 1e-6  # m: feed per revolution below which the teeth do not touch a log


@dataclass(frozen=True)
class SawCuttingConfig:
    """Values of the blades, their swing, the wood and the feed."""

    blades: float = param("ratio", 0.0, 100.0, "Number of blades in the cut")
    height: float = param("length", 0.0, 2.0, "Height of the cut, as a mean over the blades")
    kerf: float = param("length", 1e-4, 2e-2, "Width of the cut of a blade")
    pitch: float = param("length", 2e-3, 0.2, "Distance of the teeth, less than the stroke")
    eccentric_radius: float = param("length", 0.0, 0.1, "Radius of the eccentric that swings the blades; at 0 they do not swing")
    cutting_pressure: float = param("pressure", 0.0, 1e9, "Force of a tooth per width and feed per tooth, beyond that of its edge")
    edge_force: float = param("stiffness", 0.0, 1e6, "Force of a tooth's edge per width while it cuts, whatever its feed")
    scraping_force: float = param(
        "stiffness", 0.0, 1e6, "Force of a tooth per width while it scrapes over the bottom of the kerf on its way back"
    )
    edge_depth: float = param("length", 1e-6, 1e-2, "Depth in the wood over which the forces of edge and scraping rise from none")
    feed_time: float = param("time", 1e-3, 10.0, "Time constant with which the feed per turn follows its setpoint")


@njit(cache=True, error_model="numpy", forceinline=True)
def advance(angle: float, cosine: float, sine: float, feed: float, swing: float) -> float:
    """Return the depth of a tooth in the wood [m], from the bottom of the last revolution's kerf at the top of the stroke.

    It is the path of (4) by (1) to (3), with the share of the overhang (6) that belongs to the tooth's height.

    Parameters
    ----------
    angle : float
        Angle of the crank from the top of the stroke [rad], 0 to 2 pi.
    cosine, sine : float
        Of this angle.
    feed : float
        Feed of the log per turn [m].
    swing : float
        Radius of the eccentric [m].
    """
    return feed * (angle * PER_TURN + 0.25 * (1.0 - cosine)) - 2.0 * swing * sine * cosine


@njit(cache=True, error_model="numpy", forceinline=True)
def advance_down(share: float, feed: float, swing: float) -> float:
    """Return :func:`advance` of a tooth on its way down, by its travel from the top as a share of the stroke, 0 to 1."""
    cosine = 1.0 - 2.0 * min(max(share, 0.0), 1.0)
    return advance(acos(cosine), cosine, sqrt(1.0 - cosine * cosine), feed, swing)


@njit(cache=True, error_model="numpy", forceinline=True)
def deepest(feed: float, swing: float) -> float:
    """Return the travel, as a share of the stroke, at which a tooth on its way down is deepest: 1 where the swing is small.

    There the speed of the feed equals that of the swing: feed (1 / (2 pi) + sin(angle) / 4) = 2 swing cos(2 angle).
    """
    if 2.0 * swing <= feed * PER_TURN:
        return 1.0
    sine = (sqrt(0.0625 * feed * feed + 16.0 * swing * (2.0 * swing - feed * PER_TURN)) - 0.25 * feed) / (8.0 * swing)
    return 0.5 * (1.0 + cos(asin(min(sine, 1.0))))


@njit(cache=True, error_model="numpy", forceinline=True)
def depth_of_cut(angle: float, feed: float, swing: float, pitch: float) -> float:
    """Return the feed per tooth: how deep a tooth is beyond the bottom of its kerf, below 0 where it does not touch it.

    On the way down this is the thickness of its chip, on the way up (``angle`` above pi) the depth by which it scrapes. The
    feed and the swing are those of a steady state. With S_0 = 30 mm and r = 3.25 mm it differs from (8) by at most 0.04 mm from y =
    t_3 on.

    Parameters
    ----------
    angle : float
        Angle of the crank from the top of the stroke [rad], 0 to 2 pi.
    feed : float
        Feed of the log per turn, S_0 [m].
    swing : float
        Radius of the eccentric, r [m].
    pitch : float
        Distance of the teeth as a share of the stroke, t_3 / H.

    Returns
    -------
    float
        Feed per tooth S_z [m].
    """
    cosine, sine = cos(angle), sin(angle)
    here, share = advance(angle, cosine, sine, feed, swing), 0.5 * (1.0 - cosine)
    first = share - pitch * floor(share / pitch + HAIR)  # of the teeth that pass this place in a stroke
    peak = deepest(feed, swing)
    low = first + pitch * floor((peak - first) / pitch + HAIR) if peak > first else first
    high = low + pitch
    at_low = advance_down(low, feed, swing)
    at_high = advance_down(high, feed, swing) if high <= 1.0 + HAIR else at_low
    most = max(at_low, at_high)
    if angle >= pi:  # all teeth of the stroke have passed this place
        return here - most
    bottom = most - feed
    gone = share - HAIR
    if low < gone:
        bottom = max(bottom, at_low)
    if high < gone:
        bottom = max(bottom, at_high)
    if first < gone:
        bottom = max(bottom, advance_down(first, feed, swing), advance_down(share - pitch, feed, swing))
    return here - bottom


@njit(cache=True, error_model="numpy", forceinline=True)
def feed_per_tooth(travel: float, feed: float, swing: float, radius: float, pitch: float) -> float:
    """Return the feed per tooth by formula (8) alone [m], which holds from the second tooth of a stroke on.

    Parameters
    ----------
    travel : float
        Travel of the sash from the top, y [m], at least the distance of the teeth.
    feed, swing, radius, pitch : float
        S_0, r, R and t_3 [m].
    """
    stroke = 2.0 * radius
    return advance_down(travel / stroke, feed, swing) - advance_down((travel - pitch) / stroke, feed, swing)


@njit(cache=True, error_model="numpy", forceinline=True)
def force_per_width(depth: float, down: bool, saw: Record) -> float:
    """Return the force of a tooth per width of the cut [N/m] by its depth of cut [m], on its way down or up."""
    if depth <= 0.0:
        return 0.0
    whole = min(1.0, depth / saw.edge_depth)
    return saw.cutting_pressure * depth + saw.edge_force * whole if down else saw.scraping_force * whole


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of feed that is still to come after a step."""
    world.values.saw_cutting[k].decay = exp(-h / world.values.saw_cutting[k].feed_time)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the capacity of the teeth at both ends of the step, by the angle that the sash predicts."""
    me, my, line = world.parts.saw_cutting[k], world.values.saw_cutting[k], world.driveline
    cap, f = line.cap, my.element
    capacity = cap[KIN1, f]
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = capacity, capacity, -capacity
    me.feed = lagged(me.feed, me.target if me.enabled > 0.0 and world.safe == 0.0 else 0.0, my.decay)
    radius, angle = world.values.sash[my.sash].radius, world.parts.sash[my.sash].ahead
    angle -= 2.0 * pi * floor(angle * PER_TURN)
    me.depth = depth_of_cut(angle, me.feed, my.eccentric_radius, 0.5 * my.pitch / radius)
    force = 0.0
    if me.feed > NO_LOG:
        force = force_per_width(me.depth, angle < pi, my) * my.kerf * my.blades * my.height / my.pitch
    me.force = force if angle < pi else -force
    capacity = force * radius * abs(sin(angle))
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = capacity, capacity, -capacity


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Record the torque that now brakes the crank."""
    world.parts.saw_cutting[k].torque = world.driveline.el[LAM, world.values.saw_cutting[k].element]


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its LoadState."""
    return (rig.friction_torque(name), rig.capacity(name), 0.0, 0.0, rig.energies["load"])


# target, enabled: feed per turn and its switch; feed: present one; depth: feed per tooth; force: of all teeth on the sash, upwards
# positive; torque: on the crank
PART = Part(
    "saw_cutting",
    40,
    (SawCuttingConfig,),
    state=("target", "enabled", "feed", "depth", "force", "torque"),
    derived=("decay",),
    wires=("body", "element", "sash"),
    stages={"fill": fill, "before": before, "after": after},
    role=LOAD,
    joined={"body": Wire("body"), "sash": Wire(MASS)},
    message="LoadState",
    shown_values=shown_values,
    shows=(
        Shown("torque", "torque", "torque", 0.0, 1e5, "Torque of the {called} on {body}.", "positive brakes {body}"),
        Shown("work", "work", "energy", 0.0, 1e9, "Work taken by the {called} since time 0.", "positive taken from {body}"),
    ),
    check=lambda values: not_whole(values, "blades"),
    takes=(Command("feed", {"per_turn": "length"}, "target", "enabled", "feed of the log per turn of the crank", "length"),),
)
