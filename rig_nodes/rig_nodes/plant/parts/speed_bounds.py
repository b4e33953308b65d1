# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Keeps a shaft between two multiples of another shaft's speed, whatever the torques are: the integrator of chapter 9.

It is a part of the engine for comparing models; no torque and no energy contains its changes of speed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base import INLINED, njit
from .part import Part

if TYPE_CHECKING:
    from ...base import Record


@njit(**INLINED)
def bound(world: Record, k: int) -> None:
    """Limit the speed to its bounds after the driveline's step."""
    my, v = world.values.speed_bounds[k], world.driveline.v
    v[my.held] = min(max(v[my.held], v[my.by] * my.lowest), v[my.by] * my.highest)


# held, by: numbers of the driveline's speeds; lowest, highest: bounds of their ratio
PART = Part("speed_bounds", 60, (), derived=("lowest", "highest"), wires=("held", "by"), stages={"bound": bound})
