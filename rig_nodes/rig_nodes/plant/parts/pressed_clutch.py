# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plate pack that a press cylinder clamps: the clutch bench's (thesis chapter 8).

It is a part of the engine. The plates themselves are in plant.parts.plates; the force comes from a plant.parts.press_cylinder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base import INLINED, njit
from . import plates
from .part import CLUTCH, Part, Shown, Wire
from .plates import PackFriction, PlatePack

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the values of the plates' cooling that depend on the step's length."""
    plates.fill_plates(world.values.pressed_clutch[k], h)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move the pack over a step under the force of its cylinder."""
    me, my = world.parts.pressed_clutch[k], world.values.pressed_clutch[k]
    press = world.parts.press_cylinder[my.press]
    drag = plates.capacities_before(me, my, world.driveline.cap)
    my.clearance = my.new_clearance + me.wear
    press.late, press.waves = my.clearance - world.values.press_cylinder[my.press].contact_travel, my.waves
    me.clamp = press.clamp
    plates.capacities_after(me, my, press.travel, drag, world)


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Add the heat and wear of the plates."""
    plates.heat_plates(world.parts.pressed_clutch[k], world.values.pressed_clutch[k], world)


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ClutchState."""
    press = rig.device(rig.wire(name, "press"))
    return plates.shown_pack(rig, name, press["pressure"], press["travel"])


# waves: further height of the steel plates' waves over the pack, as the cylinder takes it
PART = Part(
    "pressed_clutch",
    20,
    (PackFriction, PlatePack),
    state=plates.STATE,
    derived=(*plates.DERIVED, "clearance", "waves"),
    wires=(*plates.WIRES, "press"),
    stages={"fill": fill, "before": before, "after": after},
    role=CLUTCH,
    joined={**plates.JOINED, "press": Wire("press")},
    message="ClutchState",
    shown_values=shown_values,
    shows=(
        Shown(
            "mode",
            "mode",
            "state",
            0.0,
            2.0,
            "The pack: open, slipping or locked.",
            "none",
            {0: "open", 1: "slipping", 2: "locked"},
        ),
        Shown("torque", "torque", "torque", -700.0, 700.0, "Friction torque of the pack.", "positive brakes the shaft"),
        Shown("capacity", "capacity_static", "torque", 0.0, 1000.0, "Torque at which the pack breaks away.", "magnitude"),
        Shown("slip", "slip", "speed", -20.0, 20.0, "Slip of the pack.", "shaft minus housing"),
        Shown(
            "clamp",
            "clamp_force",
            "force",
            0.0,
            10000.0,
            "Force on the plates of the pack.",
            "positive presses the plates together",
        ),
        Shown("heat", "heat", "energy", 0.0, 1e9, "Heat of friction and drag in the pack since time 0.", "positive"),
    ),
)
