# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Saw chain on its bar, in wood: the mass that the drum moves, friction on the bar, cutting resistance, and a kerf that pinches.

It is a part of the engine. Like a friction it can hold the drum but never drive it. The resistance of the wood follows the angle of
the engine's crank, because the chain's tension, which turns its teeth out of the wood, does so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, exp
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import HI0, HI1, KIN0, KIN1, LAM, LO0, LO1
from .cycles import TURN, normal_of
from .lag import lagged
from .part import LOAD, Command, Part, Shown, Wire, not_whole

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

SCATTER = 1  # channel of plant.parts.cycles for the cutting resistance; that of the engine is 0


@dataclass(frozen=True)
class ChainConfig:
    """Chain by the length of its bar, and wood by the force with which the bar is pressed into it."""

    bar: float = param("length", 0.05, 3.0, "Length of the bar")
    stated_bar: float = param("length", 0.05, 3.0, "Length of the bar whose chain has the stated mass")
    stated_mass: float = param("mass", 1e-3, 50.0, "Mass of the chain of that bar, m_p")
    mass_per_bar: float = param("linear density", 0.0, 50.0, "Growth of the chain's mass with the length of the bar")
    sprocket_radius: float = param("length", 1e-3, 1.0, "Radius of the sprocket that drives the chain, r_k")
    friction: float = param("torque", 0.0, 1e3, "Friction of the chain on bar and sprocket, as torque on the drum")
    friction_by_speed: float = param("torque per speed", 0.0, 10.0, "Growth of that friction with the speed of the drum")
    cutting_torque: float = param("torque", 0.0, 1e4, "Mean torque of cutting and friction over a turn at the stated feed, M_o")
    cutting_scatter: float = param("torque", 0.0, 1e4, "Standard deviation of that mean from turn to turn, s_p")
    stated_feed: float = param(
        "force", 0.1, 1e4, "Force on the bar at which cutting_torque is the mean torque, which is proportional to the force"
    )
    feed_time: float = param("time", 1e-4, 10.0, "Time constant with which the force on the bar follows its setpoint")
    seed: float = param("ratio", 0.0, 1e9, "Number that chooses the turns; the same number gives the same turns")


def chain_mass(chain: ChainConfig | Mapping[str, float]) -> float:
    """Return the mass of the chain [kg], linear in the length of its bar."""
    of = chain.__getitem__ if isinstance(chain, Mapping) else lambda name: getattr(chain, name)
    return max(0.0, of("stated_mass") + of("mass_per_bar") * (of("bar") - of("stated_bar")))


def contradiction(chain: ChainConfig) -> tuple[str, str] | None:
    """Return the name of a value and the rest of a sentence for a chain without mass or a seed that is none, otherwise None."""
    if chain_mass(chain) == 0.0:
        return "bar", f"is {chain.bar:g} m, for which stated_mass and mass_per_bar leave a chain without mass"
    return not_whole(chain, "seed")


def chain_inertia(chain: ChainConfig | Mapping[str, float]) -> float:
    """Return the inertia of the chain on the drum's axis, m_p r_k^2 of eq. (11) [kg m2]."""
    radius = chain["sprocket_radius"] if isinstance(chain, Mapping) else chain.sprocket_radius
    return chain_mass(chain) * radius * radius


@njit(cache=True, error_model="numpy", forceinline=True)
def resistance(mean: float, rubbing: float, phase: float) -> float:
    """Return the torque [Nm] that resists at an angle of the crank, eq. (12): friction, and the rest of the mean times 1 - cos.

    Parameters
    ----------
    mean : float
        Mean torque of the turn, cutting and friction [Nm].
    rubbing : float
        Friction of the chain [Nm], which acts at any angle.
    phase : float
        Angle of the crank since the upper dead centre [rad].

    Returns
    -------
    float
        Torque, never below the friction.
    """
    return rubbing + max(0.0, mean - rubbing) * (1.0 - cos(phase))


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of the feed force that is still to come after a step."""
    world.values.saw_chain[k].decay = exp(-h / world.values.saw_chain[k].feed_time)


@njit(**INLINED)
def held_torque(me: Record, speed: float, phase: float, feed: float, my: Record) -> float:
    """Return the torque that chain and kerf can hold [Nm] at a speed of the drum, an angle of the crank and a feed force."""
    share = feed / my.stated_feed
    rubbing = my.friction + my.friction_by_speed * abs(speed)
    pinched = me.jam * my.sprocket_radius if me.jammed > 0.0 else 0.0
    if share <= 0.0:
        return rubbing + pinched
    return resistance(share * (my.cutting_torque + my.cutting_scatter * me.scatter), rubbing, phase) + pinched


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the resisting torque at both ends of the step, at its end by the speed and the angle that are expected there."""
    me, my, line = world.parts.saw_chain[k], world.values.saw_chain[k], world.driveline
    cap, f, speed = line.cap, my.element, line.speed[my.body]
    start = me.feed
    me.feed = lagged(start, me.target if me.enabled > 0.0 else 0.0, my.decay)
    first = held_torque(me, speed, me.phase, start, my)
    last = held_torque(me, 2.0 * line.middle[my.body] - speed, me.phase + h * line.middle[my.crank], me.feed, my)
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = first, first, -first
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = last, last, -last


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Advance the crank's angle by the step's motion; at its upper dead centre another revolution begins."""
    me, my, line = world.parts.saw_chain[k], world.values.saw_chain[k], world.driveline
    me.torque = line.el[LAM, my.element]
    me.phase += h * (line.speed[my.crank] - 0.5 * line.gained[my.crank])
    if me.phase >= TURN or me.phase < 0.0:
        way = 1.0 if me.phase > 0.0 else -1.0
        me.phase -= way * TURN
        me.cycle += way
        me.scatter = normal_of(my.seed, SCATTER, me.cycle)


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its LoadState; it has no pressure."""
    return (rig.friction_torque(name), rig.capacity(name), 0.0, 0.0, rig.energies["load"])


# target, enabled: setpoint of the feed force and its switch; jam, jammed: force along the chain with which the kerf holds it, and
# its switch; feed: present force on the bar; phase, cycle, scatter: angle of the crank, number of its revolution, and the random
# number of this revolution; torque: present resisting torque on the drum
PART = Part(
    "saw_chain",
    40,
    (ChainConfig,),
    state=("target", "enabled", "jam", "jammed", "feed", "phase", "cycle", "scatter", "torque"),
    derived=("decay",),
    wires=("body", "element", "crank"),
    stages={"fill": fill, "before": before, "after": after},
    role=LOAD,
    joined={"body": Wire("body"), "crank": Wire("body")},
    message="LoadState",
    shown_values=shown_values,
    shows=(
        Shown("torque", "torque", "torque", -500.0, 500.0, "Torque of chain and wood.", "positive brakes {body}"),
        Shown("capacity", "capacity", "torque", 0.0, 500.0, "Torque that chain and kerf can hold.", "magnitude"),
        Shown("work", "work", "energy", 0.0, 1e9, "Work taken by chain and wood since time 0.", "positive taken from the drum"),
    ),
    takes=(
        Command("wood", {"force": "force"}, "target", "enabled", "force that presses the bar into the wood", "force"),
        Command("jam", {"force": "force"}, "jam", "jammed", "force with which the kerf holds the chain", "force", node="kerf"),
    ),
    inertia=chain_inertia,
    check=contradiction,
)
