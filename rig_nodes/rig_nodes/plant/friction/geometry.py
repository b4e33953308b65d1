# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Geometry of a plate pack: friction ring, splines, number of friction surfaces.

Base of plant.parts.plates.PlatePack; every model of plant.friction takes such a pack.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ...base import param

if TYPE_CHECKING:
    from ...base import Floats

    Numbers: TypeAlias = float | Floats  # one number, or an array of them


@dataclass(frozen=True)
class PackGeometry:
    """Ring and splines of a pack that is clamped from one side (thesis tab. 3.3, 8.1-8.3); lengths in m."""

    surfaces: float = param("ratio", 1, 40, "Number of friction surfaces, one less than there are plates")
    inner_radius: float = param("length", 1e-3, 1.0, "Inner radius of the friction ring")
    outer_radius: float = param("length", 1e-3, 1.0, "Outer radius of the friction ring")
    inner_spline_diameter: float = param("length", 1e-3, 1.0, "Pitch diameter of the spline on the shaft")
    outer_spline_diameter: float = param("length", 1e-3, 1.0, "Pitch diameter of the spline in the hub")
    pressure_angle_deg: float = param("ratio", 0.0, 60.0, "Pressure angle of the splines, in degrees")

    def contradiction(self) -> tuple[str, str] | None:
        """Return the name of a value and the rest of a sentence when the geometry is not possible, otherwise None."""
        if not (self.surfaces >= 1 and self.surfaces == int(self.surfaces)):
            return "surfaces", f"is {self.surfaces:g}, expected a whole number of at least 1"
        if not 0.0 < self.inner_radius < self.outer_radius:
            return ("outer_radius", f"is {self.outer_radius:g} m, expected more than the {self.inner_radius:g} m of inner_radius")
        if not 0.0 < self.inner_spline_diameter <= 2.0 * self.inner_radius:
            return (
                "inner_spline_diameter",
                f"is {self.inner_spline_diameter:g} m, expected at most the {2.0 * self.inner_radius:g} m inside the friction ring",
            )
        if not 2.0 * self.outer_radius <= self.outer_spline_diameter:
            return (
                "outer_spline_diameter",
                f"is {self.outer_spline_diameter:g} m, expected at least the {2.0 * self.outer_radius:g} m of the friction ring",
            )
        if not 0.0 <= self.pressure_angle_deg < 90.0:
            return "pressure_angle_deg", f"is {self.pressure_angle_deg:g}, expected 0 to below 90"
        return None

    def check(self) -> None:
        """Raise a ValueError with one sentence when the geometry is not possible."""
        if wrong := self.contradiction():
            raise ValueError(" ".join(wrong))

    @property
    def area(self) -> float:
        """Area A of one friction surface [m2], (6.25)."""
        return pi * (self.outer_radius**2 - self.inner_radius**2)

    @property
    def mean_radius(self) -> float:
        """Mean friction radius r_m under even pressure [m], (6.5)."""
        ri, ro = self.inner_radius, self.outer_radius
        return 2.0 / 3.0 * (ro**3 - ri**3) / (ro**2 - ri**2)

    @property
    def outer_spline_arm(self) -> float:
        """Arm A = d_po/2 cos(alpha) [m]: torque on the hub's spline over the normal force there, (6.35)."""
        return self.outer_spline_diameter / 2.0 * cos(radians(self.pressure_angle_deg))

    @property
    def inner_spline_arm(self) -> float:
        """Arm B = d_pin/2 cos(alpha) [m]: torque on the shaft's spline over the normal force there, (6.40)."""
        return self.inner_spline_diameter / 2.0 * cos(radians(self.pressure_angle_deg))


def number(value: Numbers) -> Numbers:
    """Return the value as a float if it is one number, otherwise as a float64 array."""
    return float(value) if np.ndim(value) == 0 else np.asarray(value, float)


def not_negative(**values: Numbers) -> None:
    """Raise a ValueError that names the first value that is negative or not finite anywhere."""
    for name, value in values.items():
        if not np.all(np.isfinite(value) & (np.asarray(value) >= 0.0)):
            raise ValueError(f"{name} is {np.min(value):g}, expected finite numbers of at least 0")


def part_of_one(**values: Numbers) -> None:
    """Raise a ValueError that names the first value that is not within 0 to 1 everywhere."""
    for name, value in values.items():
        if not np.all((np.asarray(value) >= 0.0) & (np.asarray(value) <= 1.0)):
            raise ValueError(f"{name} goes from {np.min(value):g} to {np.max(value):g}, expected 0 to 1")


def positive(**values: Numbers) -> None:
    """Raise a ValueError that names the first value that is not above 0 everywhere."""
    for name, value in values.items():
        if not np.all(np.isfinite(value) & (np.asarray(value) > 0.0)):
            raise ValueError(f"{name} is {np.min(value):g}, expected finite numbers above 0")
