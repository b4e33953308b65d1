# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plate pack whose line has a prescribed pressure, piecewise cubic in the time since its order: chapter 9's clutches.

It is a part of the engine for comparing models; it has no valve and no cylinder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ..alfa46_law import OFF, ON
from . import plates
from .part import CLUTCH, Part
from .plates import PlatePack
from .wet_clutch import SHOWS, Cylinder, shown_values

if TYPE_CHECKING:
    from ...base import Floats, Record


@dataclass(frozen=True)
class Force:
    """Force on the plates: square p^2 + linear p + offset (Annex D) less the force of the springs at the kiss point."""

    force_square: float = param("force per pressure squared", 0.0, 1e-6, "Force on the plates per pressure squared")
    force_linear: float = param("area", 0.0, 1.0, "Force on the plates per pressure, in addition to the square part")
    force_offset: float = param(
        "force", -1e5, 1e5, "Force on the plates without pressure, negative as springs push the piston back"
    )
    contact_force: float = param("force", 0.0, 1e5, "Force at the kiss point, which the springs keep from the plates")


@njit(**INLINED)
def prescribed_clamp(pressure: float, clutch: Record) -> float:
    """Return the clamp force [N] at a prescribed pressure [Pa]: F_p of Annex D less the springs' force at the kiss point."""
    push = (clutch.force_square * pressure + clutch.force_linear) * pressure + clutch.force_offset
    return max(0.0, push - clutch.contact_force)


@njit(error_model="numpy")
def prescribed_pressure(since: float, phase: float, pieces: Floats) -> float:
    """Return the pressure at a time after the switch signal of a valve's phase; it is 0 before the first signal.

    Parameters
    ----------
    since : float
        Time since the switch signal [s].
    phase : float
        Phase of the valve's output.
    pieces : (2, n, 5) array of float
        For switching on and off, rows with the end [s] and the coefficients of a cubic [Pa, s], lowest power first. The last row
        has no end.

    Returns
    -------
    float
        Pressure [Pa].
    """
    if phase == OFF:
        return 0.0
    way = 0 if phase == ON else 1
    for row in range(pieces.shape[1]):
        if since <= pieces[way, row, 0]:
            p = pieces[way, row, 1] + since * (pieces[way, row, 2] + since * (pieces[way, row, 3] + since * pieces[way, row, 4]))
            return max(0.0, p)
    return 0.0


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the values of the plates' cooling that depend on the step's length."""
    plates.fill_plates(world.values.curve_clutch[k], h)


@njit(**INLINED)
def ordered(world: Record, k: int, outputs: Record, steps_per_sample: int, h: float) -> None:
    """Record which branch of the curve has begun, and in which step."""
    me, out = world.parts.curve_clutch[k], outputs[world.values.curve_clutch[k].output]
    me.phase, me.began = out.phase, out.start * steps_per_sample


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the pressure of the curve at the step's end, and the pack under it."""
    me, my = world.parts.curve_clutch[k], world.values.curve_clutch[k]
    drag = plates.capacities_before(me, my, world.driveline.cap)
    me.chamber = world.oil[my.line].pressure = prescribed_pressure((round(t / h) + 1 - me.began) * h, me.phase, my.pieces)
    me.clamp = prescribed_clamp(me.chamber, my)
    me.piston = my.clearance if me.clamp > 0.0 else 0.0
    plates.capacities_after(me, my, me.piston, drag, world)


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Add the heat and wear of the plates."""
    plates.heat_plates(world.parts.curve_clutch[k], world.values.curve_clutch[k], world)


# phase, began: phase of the curve and the step in which it began; clearance, piston: used only by the drag of the pack
PART = Part(
    "curve_clutch",
    20,
    (Cylinder, PlatePack, Force),
    state=("chamber", "piston", "phase", "began", *plates.STATE),
    derived=plates.DERIVED,
    wires=(*plates.WIRES, "line", "output"),
    tables=("pieces",),
    stages={"fill": fill, "ordered": ordered, "before": before, "after": after},
    role=CLUTCH,
    joined=plates.JOINED,
    message="ClutchState",
    shown_values=shown_values,
    shows=SHOWS,
)
