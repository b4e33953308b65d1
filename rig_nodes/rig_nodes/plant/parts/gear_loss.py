# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loss of a gear train on one of its shafts: by speed, and by a torque that it passes on, as the driveline solves it.

It is a part of the engine. The parabola of the loss by torque itself is in driveline.losses.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import TYPE_CHECKING

from ...base import INLINED, choice, njit, param
from ...driveline import BASE, E_FRIC, FACTOR, KIN1
from .part import LOSS, NOWHERE, Part, Wire

if TYPE_CHECKING:
    from ...base import Record

RPM = pi / 30.0
PER_RPM = 30.0 / pi
PER_COAST_DOWN = 1.0 / 49.274  # s/rad: reciprocal of the speed at which the coast-down of 7.3.1 began
LEAST_LOSS = 1e-9  # Nm: with it the element is never open, so that it can brake as soon as a torque acts


@dataclass(frozen=True)
class GearLossConfig:
    """Loss torque on a shaft: by its speed, and a parabola of the torque passed on (Annex D), which the driveline solves.

    There are two losses by speed. One is that of Annex D; the other is that of the printed coast-down (7.7), whose speed is a
    parabola of time, so that the square of the torque is linear in the speed. In Annex D the part that depends on the output's
    torque acts on the output. Whichever side this part brakes, the torque at the input in steady state is the same, but the torque
    of the clutches is not.
    """

    by_speed: float = param("ratio", 0.0, 10.0, "Factor on Annex D's parabola of the speed, which falls above 1300 rpm")
    at_rest: float = param("torque", 0.0, 100.0, "Loss by speed at a standstill, by the coast-down")
    at_470: float = param(
        "torque", 0.0, 100.0, "Loss by speed where the coast-down began; its square is linear in the speed from that at rest"
    )
    drag: float = param("torque", 0.0, 100.0, "Constant loss, at any speed and torque")
    constant: float = param("torque", -100.0, 100.0, "Constant part of the parabola of the torque passed on")
    share: float = param("ratio", -0.5, 0.5, "Linear part of the parabola of the torque passed on")
    square: float = param("torque per torque squared", -0.01, 0.01, "Square part of the parabola of the torque passed on")
    torque_side: str = choice(
        "Which shaft the part by torque brakes: its own (driven) or, with the same power, that of the "
        "loss before the clutches (driving)",
        "driven",
        "driving",
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def loss_by_speed(speed: float, loss: Record) -> float:
    """Return the loss torque [Nm] by the shaft's speed [rad/s], (6.72), (7.7) and Annex D."""
    total = 0.0
    if loss.by_speed > 0.0:
        n = abs(speed) * PER_RPM
        total = loss.by_speed * max(0.0, -1.76e-6 * n * n + 4.58e-3 * n + 2.56)
    if loss.at_rest + loss.at_470 > 0.0:
        rest, began = loss.at_rest**2, loss.at_470**2
        total += sqrt(max(0.0, rest + (began - rest) * abs(speed) * PER_COAST_DOWN))
    return total


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the loss by speed, which is held over the step; the driveline solves the loss by torque."""
    my, line = world.values.gear_loss[k], world.driveline
    line.loss[my.row, BASE] = max(LEAST_LOSS, loss_by_speed(line.middle[my.body], my) + my.steady)
    if my.elsewhere > 0.0:  # the same power on the other shaft
        there = line.middle[my.braked]
        line.loss[my.row, FACTOR] = min(1.0, max(0.0, line.middle[my.body] / there)) if there > 1.0 else 0.0


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Record the torque that now brakes the shaft, and give the heat of the step to the oil."""
    me, my = world.parts.gear_loss[k], world.values.gear_loss[k]
    me.torque = world.driveline.cap[KIN1, my.element]
    if my.supply != NOWHERE:
        heat = world.driveline.el[E_FRIC, my.element]
        world.oil[my.supply].heat += heat - me.heat
        me.heat = heat


# row: row of the driveline's losses; element: element that brakes its body; elsewhere > 0: its loss by torque brakes the body
# ``braked``
PART = Part(
    "gear_loss",
    50,
    (GearLossConfig,),
    state=("torque", "heat"),
    derived=("elsewhere", "steady"),
    wires=("body", "element", "row", "braked", "supply"),
    stages={"before": before, "after": after},
    role=LOSS,
    joined={
        "body": Wire("body"),
        "torque": Wire("torque", needed=False),
        "axis": Wire("body", needed=False),
        "driving": Wire("loss", needed=False),
    },
    effects={"torque_losses": {"constant": 0.0, "share": 0.0, "square": 0.0}},
)
