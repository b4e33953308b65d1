# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The kiss pressure of a clutch's cylinder, in closed form; of the balance that plant.clutch steps through in time.

Used by transmission, and by the calibration, which holds it against the printed one.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:

    class Cylinder(Protocol):
        """What is read of a cylinder, SI; parts.wet_clutch has the like."""

        piston_area: float
        force_per_pressure_squared: float
        spring_preload: float
        spring_rate: float
        clearance: float
        seal_friction: float
        seal_friction_share: float


def kiss_pressure(cylinder: Cylinder) -> float:
    """Pressure [Pa, gauge] at which the rising piston meets the plates: springs and seals at the end of the clearance.

    The push is area p and a square term, the seals take a constant and a share of it. cylinder: a clutch.Cylinder, or
    whatever has those of its values.
    """
    resist = cylinder.spring_preload + cylinder.spring_rate * cylinder.clearance + cylinder.seal_friction
    slope, square = cylinder.piston_area, cylinder.force_per_pressure_squared
    share = 1.0 - cylinder.seal_friction_share
    return 2.0 * resist / share / (slope + sqrt(slope * slope + 4.0 * square * resist / share))
