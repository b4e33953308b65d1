# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kiss pressure of a clutch's cylinder in closed form, from the balance that plant.clutch steps through in time.

Used by transmission, and by the calibration, which compares it with the printed one.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:

    class Cylinder(Protocol):
        """Values of a cylinder that are read here, in SI units; plant.parts.wet_clutch has a class with these values."""

        piston_area: float
        force_per_pressure_squared: float
        spring_preload: float
        spring_rate: float
        clearance: float
        seal_friction: float
        seal_friction_share: float


def kiss_pressure(cylinder: Cylinder) -> float:
    """Return the pressure at which the rising piston meets the plates.

    There the force of the pressure equals springs and seals at the end of the clearance. The force is area times p plus a square
    term; the seals take a constant and a share of it.

    Parameters
    ----------
    cylinder : Cylinder
        A clutch's cylinder, or any object that has these values.

    Returns
    -------
    float
        Pressure [Pa, gauge].
    """
    resist = cylinder.spring_preload + cylinder.spring_rate * cylinder.clearance + cylinder.seal_friction
    slope, square = cylinder.piston_area, cylinder.force_per_pressure_squared
    share = 1.0 - cylinder.seal_friction_share
    return 2.0 * resist / share / (slope + sqrt(slope * slope + 4.0 * square * resist / share))
