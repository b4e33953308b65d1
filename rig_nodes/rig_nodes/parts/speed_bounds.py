# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Keeps a shaft between two multiples of another one's speed, whatever the torques are: chapter 9's integrator.

A part of the engine for comparing model with model; what it does to a speed is in no torque and no energy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numba import njit

from ..compiled import INLINED
from .part import Part

if TYPE_CHECKING:
    from ..arrays import Record


@njit(**INLINED)
def bound(world: Record, k: int) -> None:
    """Put the speed back between its bounds, after the driveline's step."""
    my, v = world.values.speed_bounds[k], world.driveline.v
    v[my.held] = min(max(v[my.held], v[my.by] * my.lowest), v[my.by] * my.highest)


# held, by: of the driveline's speeds; lowest, highest: their ratio
PART = Part("speed_bounds", 60, (), derived=("lowest", "highest"), wires=("held", "by"), stages={"bound": bound})
