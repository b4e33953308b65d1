# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drag torque of oil, and of oil with contact, between slipping plates: (6.1)-(6.12) of the thesis.

Used by plant.parts.plates (Kitabayashi's model) and by the picture of fig. 6.5. The thesis gives Kitabayashi's model for n surfaces
and the others for one; here each gives ``pack.surfaces`` times one surface, with all surfaces alike. The arguments are numbers or
arrays that broadcast together.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from .geometry import PackGeometry, not_negative, number, part_of_one, positive

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...base import Floats
    from .geometry import Numbers

    OverRadius: TypeAlias = Numbers | Callable[[Floats], Floats]  # a constant, or a function of the radius [m]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)  # exact for polynomials up to degree 95


def kitabayashi(pack: PackGeometry, slip: Numbers, viscosity: Numbers, gap: Numbers) -> Numbers:
    """Return N pi mu_D r_m^2 (R_z^2 - R_w^2) w / h, (6.4): laminar film over the whole ring.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    slip : float or array of float
        Slip w_rel [rad/s], of either sign, which the torque follows.
    viscosity : float or array of float
        Viscosity mu_D [Pa s].
    gap : float or array of float
        Gap h [m].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, a gap that is not positive, or a negative viscosity.
    """
    pack.check()
    slip, viscosity, gap = number(slip), number(viscosity), number(gap)
    not_negative(viscosity=viscosity)
    positive(gap=gap)
    ri, ro = pack.inner_radius, pack.outer_radius
    return pack.surfaces * pi * pack.mean_radius**2 * (ro**2 - ri**2) * viscosity * slip / gap


def davis_viscous(
    pack: PackGeometry,
    slip: Numbers,
    viscosity: OverRadius,
    gap: OverRadius,
    contact_share: OverRadius = 0.0,
    flow_factor: Numbers = 1.0,
    flow_shear: Numbers = 0.0,
) -> Numbers:
    """Return (phi_f - phi_fs) times the integral of mu_D r^2 w / h over the film's area, (6.2).

    The closed form for constants is (phi_f - phi_fs) pi/2 mu_D (R_z^4 - R_w^4) w / h. The thesis calls that equal to (6.4); it is
    1.4 % more on the gearbox's ring, because the mean of r^2 is not r_m^2.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    slip : float or array of float
        Slip w_rel [rad/s], of either sign, which the torque follows.
    viscosity, gap, contact_share : float, array of float or function
        Viscosity mu_D [Pa s], gap h [m] and the share of the circle in contact, 0 to 1. A function is called with an array of
        radii [m] and returns as many values.
    flow_factor, flow_shear : float or array of float
        phi_f and phi_fs [-].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, a gap that is not positive, a negative viscosity, or a contact share outside 0 to 1.
    """
    pack.check()
    r, weight = _radii(pack.inner_radius, pack.outer_radius)
    mu, h, share = _over(viscosity, r), _over(gap, r), _over(contact_share, r)
    not_negative(viscosity=mu)
    part_of_one(contact_share=share)
    positive(gap=h)
    ring = np.sum(weight * mu / h * (1.0 - share) * r**3, axis=-1)
    return number(pack.surfaces * 2.0 * pi * ring * (number(flow_factor) - number(flow_shear)) * number(slip))


def davis_boundary(pack: PackGeometry, friction: OverRadius, pressure: OverRadius, contact_share: OverRadius = 1.0) -> Numbers:
    """Return the integral of mu_kin p_D r over the contact area, (6.3): the size of the torque, without a sign.

    The closed form for constants is n 2/3 pi mu_kin p (R_z^3 - R_w^3) share. Splines take no clamp force here; the thesis (ch. 10)
    asks for that to be added when this model is used for a pack.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    friction, pressure, contact_share : float, array of float or function
        Friction mu_kin [-], pressure on the asperities [Pa] and the share of the circle in contact, as in
        :func:`davis_viscous`.

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, a negative friction or pressure, or a contact share outside 0 to 1.
    """
    pack.check()
    r, weight = _radii(pack.inner_radius, pack.outer_radius)
    mu, p, share = _over(friction, r), _over(pressure, r), _over(contact_share, r)
    not_negative(friction=mu, pressure=p)
    part_of_one(contact_share=share)
    return number(pack.surfaces * 2.0 * pi * np.sum(weight * mu * p * share * r**2, axis=-1))


def davis(
    pack: PackGeometry,
    slip: Numbers,
    viscosity: OverRadius,
    gap: OverRadius,
    friction: OverRadius,
    pressure: OverRadius,
    contact_share: OverRadius,
    flow_factor: Numbers = 1.0,
    flow_shear: Numbers = 0.0,
) -> Numbers:
    """Return the torque of Davis, Sadeghi, Krousgrill (6.1): film (6.2) plus contact (6.3), with the sign of slip (+ at zero).

    The arguments and errors are those of :func:`davis_viscous` and :func:`davis_boundary`.
    """
    contact = davis_boundary(pack, friction, pressure, contact_share)
    film = davis_viscous(pack, slip, viscosity, gap, contact_share, flow_factor, flow_shear)
    return number(film + np.copysign(contact, number(slip)))


def effective_gap(pack: PackGeometry, gap: Numbers, groove_depth: Numbers, land_area: Numbers) -> Numbers:
    """Return h_eff = d_r (1 - A_cz / A) + h, (6.7): gap plus the depth of the grooves spread over the ring.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    gap : float or array of float
        Gap h [m].
    groove_depth : float or array of float
        Depth d_r of the grooves [m].
    land_area : float or array of float
        A_cz [m2], the ring without its grooves.

    Returns
    -------
    float or array of float
        Gap h_eff [m].

    Raises
    ------
    ValueError
        For a value out of its range, and when the land is larger than the ring.
    """
    pack.check()
    gap, groove_depth, land_area = number(gap), number(groove_depth), number(land_area)
    positive(gap=gap)
    not_negative(groove_depth=groove_depth, land_area=land_area)
    _no_more_than_the_ring(pack, land_area)
    return groove_depth * (1.0 - land_area / pack.area) + gap


def pahlovy(pack: PackGeometry, slip: Numbers, viscosity: Numbers, gap: Numbers, film_radius: Numbers) -> Numbers:
    """Return N pi mu_D r_m^2 (r_0^2 - R_w^2) w / h_eff, (6.6): film only from R_w to r_0.

    r_m stays that of the whole ring, as in (6.5), so a short film drags too much (a quarter with r_0 = 32 mm of fig. 6.5). At
    r_0 = R_z this is Kitabayashi's model.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    slip : float or array of float
        Slip w_rel [rad/s], of either sign, which the torque follows.
    viscosity : float or array of float
        Viscosity mu_D [Pa s].
    gap : float or array of float
        Gap h_eff of :func:`effective_gap` [m].
    film_radius : float or array of float
        Radius r_0 at which the film ends [m].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, a gap that is not positive, or a negative viscosity, and for a film that leaves the ring.
    """
    pack.check()
    slip, viscosity, gap, film_radius = number(slip), number(viscosity), number(gap), number(film_radius)
    not_negative(viscosity=viscosity)
    positive(gap=gap)
    _film_in_the_ring(pack, film_radius)
    film = film_radius**2 - pack.inner_radius**2
    return pack.surfaces * pi * pack.mean_radius**2 * film * viscosity * slip / gap


def peng_yuan(pack: PackGeometry, slip: Numbers, viscosity: Numbers, gap: Numbers, film_radius: Numbers) -> Numbers:
    """Return N pi mu_D w / (2 h) (r_0'^4 - R_w^4), (6.8).

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    slip : float or array of float
        Slip w_rel [rad/s], of either sign, which the torque follows.
    viscosity : float or array of float
        Viscosity mu_D [Pa s].
    gap : float or array of float
        Gap h [m].
    film_radius : float or array of float
        Radius r_0' at which the closed film ends [m].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, a gap that is not positive, or a negative viscosity, and for a film that leaves the ring.
    """
    pack.check()
    slip, viscosity, gap, film_radius = number(slip), number(viscosity), number(gap), number(film_radius)
    not_negative(viscosity=viscosity)
    positive(gap=gap)
    _film_in_the_ring(pack, film_radius)
    return pack.surfaces * pi * viscosity * slip / (2.0 * gap) * (film_radius**4 - pack.inner_radius**4)


def liquid_share(angle: Numbers, gas_angle: Numbers) -> Numbers:
    """Return Phi = (alpha - beta) / alpha [-], (6.12).

    Parameters
    ----------
    angle : float or array of float
        Angle alpha [rad].
    gas_angle : float or array of float
        Part beta of alpha that is gas [rad]; broadcasts with ``angle``.

    Returns
    -------
    float or array of float
        Share of liquid [-].

    Raises
    ------
    ValueError
        Unless 0 <= beta <= alpha and alpha > 0.
    """
    angle, gas_angle = number(angle), number(gas_angle)
    positive(angle=angle)
    part_of_one(gas_angle_over_angle=gas_angle / angle)
    return (angle - gas_angle) / angle


def iqbal(
    pack: PackGeometry,
    slip: Numbers,
    viscosity: Numbers,
    gap: Numbers,
    film_radius: Numbers,
    share: OverRadius,
    mist_viscosity: Numbers,
    land_area: Numbers | None = None,
) -> Numbers:
    """Return A_cz/A (M_PY + M_ra + M_rm), (6.9)-(6.11): Peng and Yuan's film, with liquid and mist side by side beyond r_0'.

    The printed M_ra and M_rm contain n while M_PY (6.8) is for one surface. Here all three are for n surfaces; otherwise a pack
    whose film fills the ring would drag like one surface.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    slip : float or array of float
        Slip w_rel [rad/s], of either sign, which the torque follows.
    viscosity : float or array of float
        Viscosity mu_D [Pa s].
    gap : float or array of float
        Gap h [m].
    film_radius : float or array of float
        Radius r_0' at which the closed film ends [m].
    share : float, array of float or function
        Liquid part phi of the circle, see :func:`liquid_share`. A function is called with an array of radii [m].
    mist_viscosity : float or array of float
        Viscosity of the mist [Pa s].
    land_area : float or array of float, optional
        A_cz [m2], the whole ring by default.

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        As for :func:`peng_yuan`, and for a share outside 0 to 1 or a land larger than the ring.
    """
    film = peng_yuan(pack, slip, viscosity, gap, film_radius)
    land_area = pack.area if land_area is None else number(land_area)
    not_negative(mist_viscosity=mist_viscosity, land_area=land_area)
    _no_more_than_the_ring(pack, land_area)
    r, weight = _radii(number(film_radius), pack.outer_radius)
    phi = _over(share, r)
    part_of_one(share=phi)
    liquid = np.sum(weight * phi * r**3, axis=-1)
    mist = np.sum(weight * (1.0 - phi) * r**3, axis=-1)
    beyond = 2.0 * pi * pack.surfaces * number(slip) / number(gap)
    torque = film + beyond * (number(viscosity) * liquid + number(mist_viscosity) * mist)
    return number(land_area / pack.area * torque)


def _radii(inner: Numbers, outer: Numbers) -> tuple[Floats, Floats]:
    """Return radii [m] and their weights [m] of Gauss-Legendre from inner to outer, along a new last axis."""
    inner, outer = np.asarray(inner)[..., None], np.asarray(outer)[..., None]
    half = (outer - inner) / 2.0
    return inner + half * (NODES + 1.0), half * WEIGHTS


def _over(value: OverRadius, r: Floats) -> Floats:
    """Return the values of a function at the radii, or a constant with room for them."""
    return np.asarray(value(r), float) if callable(value) else np.asarray(value, float)[..., None]


def _film_in_the_ring(pack: PackGeometry, film_radius: Numbers) -> None:
    inside = (np.asarray(film_radius) >= pack.inner_radius) & (np.asarray(film_radius) <= pack.outer_radius)
    if not np.all(inside):
        low, high = np.min(film_radius), np.max(film_radius)
        raise ValueError(
            f"film_radius from {low:g} to {high:g} m leaves the ring from {pack.inner_radius:g} to {pack.outer_radius:g} m"
        )


def _no_more_than_the_ring(pack: PackGeometry, land_area: Numbers) -> None:
    if np.any(np.asarray(land_area) > pack.area * (1.0 + 1e-12)):
        raise ValueError(f"land_area is {np.max(land_area):g} m2, more than the ring's {pack.area:g} m2")
