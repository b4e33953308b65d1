# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Teeth whose efficiency is a table over speed and torque: the loss of their mesh in a part of a step.

Used by driveline/lines.py. The table is over the size of the speed and over the torque, above 0 for power from a and below 0 for
power from b. The loss is linear over a part, from that which was reached to that at the end, where the speed and the torque count.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import LAM, noinline
from rig_nodes.driveline.losses import OWN, SHARE, WEIGHTS, loss_share
from rig_nodes.driveline.tables import over_two

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.laws import Laws
    from rig_nodes.driveline.lines import Lines
    from rig_nodes.driveline.state import State

PATIENCE = 10  # attempts at a part
STEEPEST = 0.9  # rise of the torque reached over the torque expected, above which its secant says nothing


@njit(**INNER)
def efficiencies(k: int, x: float, u: float, laws: Laws) -> tuple[float, float]:
    """Return the efficiencies of TEETH for power from a and from b, at a speed x and a torque u of either sign."""
    noinline()
    size = max(abs(u), laws.gap[k])
    there, _, _ = over_two(laws.tables, laws.second[k], abs(x), size)
    back, _, _ = over_two(laws.tables, laws.second[k], abs(x), -size)
    return there, back


@njit(**INLINED)
def teeth_line(k: int, attempt: int, laws: Laws, lines: Lines, loss: Floats) -> None:
    """Give the loss of a mesh the efficiencies that are expected at the end of a part.

    Where a clutch slips the other way close to the end, the torque there may jump with the efficiency, so that none fits: after
    PATIENCE attempts those of the torque at the start count.
    """
    s, own = laws.second[k], laws.element[k]
    lines.slope[k] = 1.0 if attempt >= PATIENCE else 0.0
    lines.torque[s] = lines.start[s] if attempt >= PATIENCE else lines.start[s] + lines.way[s]
    lines.torque[k], lines.other[k] = efficiencies(k, lines.start[k] + lines.way[k], lines.torque[s], laws)
    share, before = loss_share(lines.torque[k], lines.other[k])
    for row in range(loss.shape[0]):
        if int(loss[row, OWN]) == own:
            loss[row, SHARE], loss[row, WEIGHTS + own] = share, -before


@njit(**INLINED)
def teeth_error(k: int, dx: float, laws: Laws, state: State, lines: Lines) -> tuple[float, float]:
    """Return (error, scale) of the loss of a mesh after a part of a step in which the speed has changed by dx.

    The torque that is expected next is that of the secant through the last two attempts: a loss that is steep over the torque moves
    it about as much as it is off. In the torque's row of ``lines`` `torque` is the expected one; `slope` and `other` are those that
    were expected and reached in the attempt before.
    """
    s, torque = laws.second[k], state.el[LAM, laws.factor[k]]
    there, back = efficiencies(k, lines.start[k] + dx, torque, laws)
    if lines.slope[k] > 0.0:
        lines.way[s] = torque - lines.start[s]
        return 0.0, 1.0
    expected, rise = lines.torque[s], 0.0
    if lines.other[s] != 0.0 and expected != lines.slope[s]:
        rise = (torque - lines.other[s]) / (expected - lines.slope[s])
    lines.slope[s], lines.other[s] = expected, torque
    lines.way[s] = expected - lines.start[s] + (torque - expected) / (1.0 - (rise if rise < STEEPEST else 0.0))
    return (abs(there - lines.torque[k]) + abs(back - lines.other[k])) * abs(torque), 1.0 + abs(torque)
