# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The press of a multi-plate clutch bench (thesis chapter 8): its springs, its clamp force, and the prediction of each model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import closed
from .geometry import not_negative, number

if TYPE_CHECKING:
    from .geometry import Numbers, PackGeometry

SPRING_TRAVEL = 4e-3  # m, how far the springs of (8.1) were pressed, 8.1.6
# F_s [N] over s [mm], from s^6 down to the constant, (8.1). The thesis prints + 38.063 s^5, which gives 79 kN at 4 mm, far above
# the 10 kN of the testing machine; with a minus the line rises evenly to 0.91 kN.
SPRING_FORCE = (2.9035, -38.063, 197.57, -515.09, 658.13, -38.596, 9.8468)
CYLINDER_FORCE = (63.034, 1251.7, -123.7)  # F_p [N] over the pressure [MPa], (8.2), measured up to about 5 kN


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
        Pressure in the cylinder [Pa].

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
        Pressure in the cylinder [Pa].
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
