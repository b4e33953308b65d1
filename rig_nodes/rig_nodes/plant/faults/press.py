# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a clutch bench's press: the cylinder with its seals and disc springs, and the pack that it clamps."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from . import clutch
from .fault import BELOW, FIRST_SPN, STUCK, UNKNOWN, Fault, Size, nothing

if TYPE_CHECKING:
    from .fault import Target

PRESS, PRESSED, PACK, CYLINDER = "press_cylinder", "pressed_clutch", FIRST_SPN + 352, FIRST_SPN + 384
MOVED = "the testing machine moves its springs"


def leaking(press: Target, size: float) -> None:
    """Open a leak [m2] from the chamber past the piston's seal."""
    press["leak_area"] += size


def sticking(press: Target, size: float) -> None:
    """Add Coulomb friction [N] to that of the seals, both ways."""
    press["seal_friction"] += size
    press["seal_friction_back"] += size


def spring(press: Target, size: float) -> None:
    """Take a share of the disc springs, which are broken."""
    press["spring_share"] *= 1.0 - size


def warped(pack: Target, size: float) -> None:
    """Give the steel plates waves, by a length [m] over the pack: they touch earlier, and the press lays them flat."""
    pack["new_clearance"] -= min(size, 0.9 * pack["new_clearance"])
    pack["waves"] += size


def lacks_piston(configs: tuple[Any, ...]) -> str:
    """Return what a cylinder lacks for a fault of its piston."""
    return MOVED if configs[0].testing_machine else ""


def lacks_springs(configs: tuple[Any, ...]) -> str:
    """Return what a cylinder lacks for broken springs."""
    return "" if configs[0].spring_share > 0.0 else "it has no springs"


def lacks_clamping(configs: tuple[Any, ...]) -> str:
    """Return what a pack lacks for a fault that shows as it is clamped."""
    return f"nothing presses it: {MOVED}" if configs[-1].testing_machine else ""


def lacks_clearance(configs: tuple[Any, ...]) -> str:
    """Return what a pack lacks for a fault of its clearance."""
    return lacks_clamping(configs) or ("" if configs[-1].contact_travel > 0.0 else "its cylinder has no way to go")


# faults of wet clutches that a pack has whatever presses it, and what one may lack for them
OF_PACKS = {
    "glazed": lacks_clamping,
    "worn": lacks_clearance,
    "tight": lacks_clearance,
    "seized": nothing,
    "warped": lacks_clearance,
}


def _of_pack(one: Fault) -> Fault:
    """The same fault at a pressed pack, whose cylinder has the elasticity."""
    return replace(
        one,
        part=PRESSED,
        spn=PACK,
        act=warped if one.name == "warped" else one.act,
        sign="torque passes without pressure" if one.name == "seized" else one.sign,
        lacks=OF_PACKS[one.name],
    )


FAULTS = (
    *(_of_pack(one) for one in clutch.FAULTS if one.name in OF_PACKS),
    Fault(
        *("leaking", PRESS, "seal", "The piston's seal leaks."),
        *("pressure stays below its setting, the supply gives oil all the time", leaking, CYLINDER, BELOW),
        Size("area", 0.0, 50e-6, 10e-6, "area of the leak"),
        lacks=lacks_piston,
    ),
    Fault(
        *("sticking", PRESS, "seals", "The seals stick."),
        *("the plates slip at less torque, and are released late", sticking, CYLINDER, STUCK),
        Size("force", 0.0, 5e3, 250.0, "further friction each way"),
        lacks=lacks_piston,
        effect="seal_friction",
    ),
    Fault(
        *("spring", PRESS, "disc springs", "Disc springs are broken."),
        *("the piston goes further, the plates slip at more torque", spring, CYLINDER, UNKNOWN),
        Size("ratio", 0.0, 0.99, 0.5, "share of the springs"),
        lacks=lacks_springs,
    ),
)
