# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plate pack that a press cylinder clamps: the clutch bench's (thesis chapter 8).

A part of the engine; the plates themselves are parts.plates, the force comes from a parts.press_cylinder.
"""

from __future__ import annotations

from numba import njit

from . import plates
from .part import Part
from .plates import PackFriction, PlatePack


@njit(error_model="numpy", forceinline=True)
def fill(world, k, h):
    """What the step's length makes of the plates' cooling."""
    plates.fill_plates(world.values.pressed_clutch[k], h)


@njit(error_model="numpy", forceinline=True)
def before(world, k, h, t):
    """The pack under the force of its cylinder."""
    me, my = world.parts.pressed_clutch[k], world.values.pressed_clutch[k]
    press = world.parts.press_cylinder[my.press]
    drag = plates.capacities_before(me, my, world.driveline.cap)
    my.clearance = my.new_clearance + me.wear
    me.clamp = press.clamp
    plates.capacities_after(me, my, press.travel, drag, world)


@njit(error_model="numpy", forceinline=True)
def after(world, k, h):
    """Heat and wear of the plates."""
    plates.heat_plates(world.parts.pressed_clutch[k], world.values.pressed_clutch[k], world)


PART = Part("pressed_clutch", 20, (PackFriction, PlatePack), state=plates.STATE, derived=(*plates.DERIVED, "clearance"),
            wires=(*plates.WIRES, "press"), stages={"fill": fill, "before": before, "after": after})
