# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lever: gives an input of the driveline the position that a setpoint orders: a throttle, a ratio, a factor of a torque.

It is a part of the engine. In a step the input has the position that the lever has reached at its end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .part import INPUT, LEVER, Command, Part, Wire

if TYPE_CHECKING:
    from ...base import Record


@dataclass(frozen=True)
class LeverConfig:
    """Values of the lever."""

    rest: float = param("ratio", -1e3, 1e3, "Position at the start, when it is off, and in the safe state")
    travel_time: float = param("time", 1e-4, 1e3, "Time in which it moves by 1, or by 100 %")


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move the lever and set the input."""
    me, my = world.parts.lever[k], world.values.lever[k]
    way, to = h / my.travel_time, me.target if me.enabled > 0.0 and world.safe == 0.0 else my.rest
    me.position += min(max(to - me.position, -way), way)
    world.driveline.default[my.given] = me.position


# target, enabled: setpoint and switch; position: where it is
PART = Part(
    "lever",
    20,
    (LeverConfig,),
    state=("target", "enabled", "position"),
    wires=("given",),
    stages={"before": before},
    role=LEVER,
    joined={"moves": Wire(INPUT)},
    takes=(Command("lever", {"position": "ratio"}, "target", "enabled", "position of the lever", "ratio"),),
)
