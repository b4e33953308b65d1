# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The multi-plate clutch bench of the thesis, chapter 8: its packs, its clamp force, and the prediction of each model.

Used by friction.comparison; it can be used alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import closed
from .geometry import PackGeometry, not_negative, number

if TYPE_CHECKING:
    from .geometry import Numbers

SPRING_TRAVEL = 4e-3  # m, how far the springs of (8.1) were pressed, 8.1.6
# F_s [N] over s [mm], from s^6 down to the constant, (8.1). The thesis prints + 38.063 s^5, which gives 79 kN at 4 mm, far above
# the 10 kN of the testing machine; with a minus the line rises evenly to 0.91 kN.
SPRING_FORCE = (2.9035, -38.063, 197.57, -515.09, 658.13, -38.596, 9.8468)
CYLINDER_FORCE = (63.034, 1251.7, -123.7)  # F_p [N] over p_z [MPa], (8.2), measured up to about 5 kN


@dataclass(frozen=True)
class BenchPack:
    """One size of plates on the bench. Lengths in m; ``surfaces`` are the numbers of friction surfaces that were tested."""

    name: str
    inner_diameter: float
    outer_diameter: float
    inner_spline_diameter: float
    outer_spline_diameter: float
    plate_thickness: tuple[float, ...]
    surfaces: tuple[int, ...]
    material: str
    source: str

    def geometry(self, surfaces: int) -> PackGeometry:
        """Return the pack with a number of friction surfaces; raise ValueError when it was not on the bench."""
        if surfaces not in self.surfaces:
            known = ", ".join(map(str, self.surfaces))
            raise ValueError(f"{self.name} was tested with {known} surfaces, not {surfaces}")
        return PackGeometry(
            float(surfaces),
            self.inner_diameter / 2.0,
            self.outer_diameter / 2.0,
            self.inner_spline_diameter,
            self.outer_spline_diameter,
            30.0,
        )


ALL = (18, 16, 14, 12, 10)
STEEL = ((33e-3, 135e-3), "steel S355J2 on steel S355J2")  # DIN 5480 N 36x1.5x22 and W 140x3x45, tab. 8.3
LINED = ((42e-3, 80e-3), "organic JP402 on steel")  # the gearbox's plates, tab. 3.3, in adapters (fig. 8.3)


def _pack(
    name: str,
    inner: float,
    outer: float,
    thickness: tuple[float, ...],
    surfaces: tuple[int, ...],
    plates: tuple[tuple[float, float], str],
    source: str,
) -> BenchPack:
    splines, material = plates
    return BenchPack(name, inner, outer, *splines, thickness, surfaces, material, source)


PACKS = {
    pack.name: pack
    for pack in (
        _pack("80x115", 80e-3, 115e-3, (1e-3, 1.5e-3, 2e-3), ALL, STEEL, "tab. 8.1-8.3, 8.3.1"),
        _pack("80x101.9", 80e-3, 101.9e-3, (2e-3,), ALL, STEEL, "tab. 8.1-8.3, 8.3.2"),
        _pack("65x115", 65e-3, 115e-3, (2e-3,), ALL, STEEL, "tab. 8.1-8.3, 8.3.3"),
        _pack("46x88.9", 46e-3, 88.9e-3, (2.5e-3,), (18, 16), STEEL, "tab. 8.1-8.3, 8.3.4; 16 surfaces seized"),
        _pack("50x76", 50e-3, 76e-3, (1e-3, 3e-3), ALL, LINED, "tab. 3.3, 8.3.5"),
    )
}


def spring_force(travel: Numbers) -> Numbers:
    """Return F_s of the six springs, (8.1) with the corrected sign.

    Parameters
    ----------
    travel : float or array of float
        Travel s [m].

    Returns
    -------
    float or array of float
        Force [N].

    Raises
    ------
    ValueError
        Outside 0 to 4 mm.
    """
    s = number(travel)
    if not np.all((np.asarray(s) >= 0.0) & (np.asarray(s) <= SPRING_TRAVEL)):
        raise ValueError(
            f"travel goes from {np.min(s):g} to {np.max(s):g} m, the springs were measured from 0 to {SPRING_TRAVEL:g} m"
        )
    return number(np.polyval(SPRING_FORCE, s * 1e3))


def cylinder_force(pressure: Numbers) -> Numbers:
    """Return F_p of the cylinder, (8.2); it is 0 below about 0.1 MPa, where its seals hold it.

    Parameters
    ----------
    pressure : float or array of float
        Pressure p_z [Pa].

    Returns
    -------
    float or array of float
        Force [N].

    Raises
    ------
    ValueError
        For a pressure that is negative or not finite.
    """
    pressure = number(pressure)
    not_negative(pressure=pressure)
    return number(np.maximum(0.0, np.polyval(CYLINDER_FORCE, pressure * 1e-6)))


def clamp_force(pressure: Numbers, travel: Numbers) -> Numbers:
    """Return F_a, (8.3): cylinder less springs, 0 where the springs are stronger.

    Parameters
    ----------
    pressure : float or array of float
        Pressure p_z [Pa].
    travel : float or array of float
        Travel s [m]; broadcasts with the pressure.

    Returns
    -------
    float or array of float
        Force [N].

    Raises
    ------
    ValueError
        As for :func:`cylinder_force` and :func:`spring_force`.
    """
    return number(np.maximum(0.0, cylinder_force(pressure) - spring_force(travel)))


def slip_torques(pack: PackGeometry, force: Numbers, friction: Numbers, friction_spline: Numbers) -> dict[str, Numbers]:
    """Return the torque at which the clamped pack would slip, by model.

    Osinski's factor is continued beyond 10 surfaces, as chapter 8 does. Measured torques are these times k_kor, plus M_rest:
    friction.closed.corrected.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force from :func:`clamp_force` [N].
    friction : float or array of float
        Friction of the surfaces [-].
    friction_spline : float or array of float
        Friction of the splines [-].

    Returns
    -------
    dict of str to float or array
        Torque of each model [Nm].

    Raises
    ------
    ValueError
        As for the models of friction.closed.
    """
    return {
        "traditional": closed.traditional(pack, force, friction),
        "osinski": closed.osinski(pack, force, friction, beyond_table=True),
        "newcomb": closed.newcomb(pack, force, friction, friction_spline),
        "chen": closed.chen(pack, force, friction, friction_spline),
        "thesis": closed.thesis(pack, force, friction, friction_spline),
    }
