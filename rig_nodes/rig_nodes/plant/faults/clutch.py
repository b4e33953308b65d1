# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a wet clutch: plates, springs, seals and lines; each is a change of geometry, friction or flow."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..parts.plates import derived_of_pack
from .fault import BELOW, FIRST_SPN, STUCK, UNCALIBRATED, UNKNOWN, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

CLUTCH, PACK, CYLINDER = "wet_clutch", FIRST_SPN + 96, FIRST_SPN + 128
FRICTION = ("kinetic_per_force", "excess_per_force", "holding_kinetic", "holding_excess", "stribeck", "rest_force")
# Over the life of paper-based linings on a test rig SAE No. 2, static and kinetic friction and the Stribeck speed fall (Ompusunggu,
# Janssens, Sas, Friction Behavior of a Wet Clutch Subjected to Accelerated Degradation, ISRN Tribology 2013, 607279). How far they
# have fallen at the end of life is assumed: the static one more, so that its excess over the kinetic one nearly vanishes.
STATIC_LOST, KINETIC_LOST, SPEED_LOST = 0.5, 0.3, 0.4


def glazed(clutch: Target, size: float) -> None:
    """Give the linings the friction that they have after a share of their life."""
    cylinder, plates, *_ = clutch.configs
    kinetic = plates.friction_kinetic * (1.0 - KINETIC_LOST * size)
    older = replace(
        plates,
        friction_static=max(kinetic, plates.friction_static * (1.0 - STATIC_LOST * size)),
        friction_kinetic=kinetic,
        friction_speed=plates.friction_speed * (1.0 - SPEED_LOST * size),
    )
    now, new = (derived_of_pack(pack, cylinder, clutch["new_clearance"]) for pack in (older, plates))
    for name in FRICTION:
        if new[name] != 0.0:  # by the ratio, as the rig may leave out the hysteresis of the splines
            clutch[name] *= now[name] / new[name]


def worn(clutch: Target, size: float) -> None:
    """Take a thickness [m] off the pack: the piston's way to the kiss point grows by it."""
    clutch.shift("wear", size)


def tight(clutch: Target, size: float) -> None:
    """Take a share of the clearance: a pack with wrong plates or a wrong shim."""
    clutch["new_clearance"] *= 1.0 - size


def spring(clutch: Target, size: float) -> None:
    """Take a share of the return springs, which are broken."""
    clutch["spring_preload"] *= 1.0 - size
    clutch["spring_rate"] *= 1.0 - size


def seized(clutch: Target, size: float) -> None:
    """Weld some plates: without being pressed, the pack holds a torque [Nm]."""
    clutch["seized_force"] += size / (clutch["kinetic_per_force"] + clutch["excess_per_force"])


def warped(clutch: Target, size: float) -> None:
    """Give the steel plates higher waves, by a length [m] over the pack: they touch earlier, and are flat after more travel."""
    clutch["new_clearance"] -= min(size, 0.9 * clutch["new_clearance"])
    clutch["pack_travel"] += size


def leaking_line(clutch: Target, size: float) -> None:
    """Open a leak [m2] between valve and feed orifice: a hose or the rotary feed."""
    clutch["line_leak"] += size


def leaking_piston(clutch: Target, size: float) -> None:
    """Open a leak [m2] from the chamber past the piston's seal."""
    clutch["piston_leak"] += size


FAULTS = (
    Fault(
        *("glazed", CLUTCH, "linings", "The linings are glazed."),
        *("the clutch slips longer at the same pressure", glazed, PACK, UNCALIBRATED),
        Size("ratio", 0.0, 1.0, 0.8, "share of the linings' life that is over"),
        built_in=True,
    ),
    Fault(
        *("worn", CLUTCH, "linings", "The linings are worn."),
        *("the clutch engages late", worn, PACK, UNCALIBRATED),
        Size("length", 0.0, 5e-3, 0.8e-3, "thickness that the whole pack has lost"),
        built_in=True,
    ),
    Fault(
        *("tight", CLUTCH, "shim", "The clearance is too small."),
        *("the clutch engages early, and drags when open", tight, PACK, UNCALIBRATED),
        Size("ratio", 0.0, 0.95, 0.5, "share of the clearance that is missing"),
        built_in=True,
    ),
    Fault(
        *("spring", CLUTCH, "return springs", "Return springs are broken."),
        *("the clutch fills early and releases late", spring, CYLINDER, UNKNOWN),
        Size("ratio", 0.0, 0.99, 0.5, "share of the springs"),
    ),
    Fault(
        *("seized", CLUTCH, "plates", "Plates are welded together."),
        *("torque passes without pressure; the other gear ties the gearbox up", seized, PACK, STUCK),
        Size("torque", 0.0, 500.0, 60.0, "torque that the released pack holds"),
    ),
    Fault(
        *("warped", CLUTCH, "plates", "The steel plates are warped."),
        *("the clutch engages early and softly, and drags", warped, PACK, UNKNOWN),
        Size("length", 0.0, 3e-3, 0.8e-3, "further height of the waves over the pack"),
        built_in=True,
    ),
    Fault(
        *("leaking_line", CLUTCH, "line", "Hose or rotary feed leak."),
        *("pressure stays below its setpoint, the supply gives oil all the time", leaking_line, CYLINDER, BELOW),
        Size("area", 0.0, 2e-6, 0.5e-6, "area of the leak"),
    ),
    Fault(
        *("leaking_piston", CLUTCH, "seal", "The piston's seal leaks."),
        *("the clutch fills slowly, and its pressure stays low", leaking_piston, CYLINDER, BELOW),
        Size("area", 0.0, 2e-6, 0.5e-6, "area of the leak"),
    ),
)
