# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torque of plates in solid contact, (6.13)-(6.21) and (6.54)-(6.56) of the thesis.

Used by plant.parts.plates (the thesis's model), friction.bench and the rigs. Each model gives the torque of the whole
pack, static or kinetic by the friction that it receives; the torque is proportional to the clamp force. Forces and frictions are
numbers or arrays that broadcast together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .geometry import PackGeometry, not_negative, number, positive

if TYPE_CHECKING:
    from .geometry import Numbers

OSINSKI_TABLE = (2, 10)  # lowest and highest number of surfaces for which tab. 6.1 gives k_os
OSINSKI_STEP = 0.03


def traditional(pack: PackGeometry, force: Numbers, friction: Numbers) -> Numbers:
    """Return N mu r_m F_a, (6.13) with (6.27), (6.29), without a loss in the splines.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force F_a [N].
    friction : float or array of float
        Friction mu of the surfaces [-].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a pack that is not possible, or a negative or infinite force or friction.
    """
    pack.check()
    force, friction = number(force), number(friction)
    not_negative(force=force, friction=friction)
    return force * (pack.surfaces * friction * pack.mean_radius)


def osinski_factor(surfaces: Numbers) -> Numbers:
    """Return k_os(n) [-], 1 - 0.03 (n - 2): the arithmetic series of tab. 6.1, continued.

    The table has n = 2 to 10, and for wet clutches only (dry ones have 1). n k_os is largest at 18 surfaces and negative from 36
    on, which the thesis calls against physics. One surface has 1 (own; the series would give 1.03).

    Parameters
    ----------
    surfaces : float or array of float
        Number of surfaces n.

    Returns
    -------
    float or array of float
        The factor, in the shape of ``surfaces``.

    Raises
    ------
    ValueError
        Below 1 surface.
    """
    n = number(surfaces)
    if not np.all(np.asarray(n) >= 1):
        raise ValueError(f"surfaces is {np.min(n):g}, expected at least 1")
    return number(np.minimum(1.0, 1.0 - OSINSKI_STEP * (n - 2)))


def osinski(pack: PackGeometry, force: Numbers, friction: Numbers, beyond_table: bool = False) -> Numbers:
    """Return k_os times the traditional torque, (6.14), whatever the splines are like.

    Chapter 8 compares this model at 10 to 18 surfaces, so it must have continued the series.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force F_a [N].
    friction : float or array of float
        Friction mu of the surfaces [-].
    beyond_table : bool
        True to continue the series beyond tab. 6.1.

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        As for the other models, outside tab. 6.1 (2 to 10 surfaces) unless ``beyond_table``, and where k_os is not positive (36
        surfaces and more).
    """
    pack.check()
    low, high = OSINSKI_TABLE
    if not beyond_table and not low <= pack.surfaces <= high:
        raise ValueError(f"Osinski's table has {low} to {high} surfaces, not {pack.surfaces:g}; beyond_table=True carries it on")
    factor = osinski_factor(pack.surfaces)
    if factor <= 0.0:
        raise ValueError(f"Osinski's factor is {factor:.2f} at {pack.surfaces:g} surfaces, where it has no meaning")
    return factor * traditional(pack, force, friction)


def newcomb(pack: PackGeometry, force: Numbers, friction: Numbers, friction_spline: Numbers) -> Numbers:
    """Return the torque of Newcomb's pack, (6.15)-(6.19): straight splines at R_1 (shaft), R_2 (hub), friction in between.

    (6.15) numbers the surfaces i_s = 2 ... n, but as a torque of single surfaces it fails without spline friction (surface 2 of 4
    would carry 5/3 of F mu R_m). With i_s and n both read as the number of plates it is the mean torque of the surfaces, and times
    their number it equals the balance of a pack whose first plate sits on the shaft. That reading is used here. R_m = (R_1 + R_2)/2
    replaces the ring, and the pressure angle has no effect.

    With B, C of (6.16), (6.17), m = plates // 2, y delta = exp(-2 (artanh B + artanh C)): M / (F mu R_m) is
    (1 - (y delta)^m) / (B + C), less (y delta)^m / (1 - B) when the number of plates is even.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force F_a [N].
    friction : float or array of float
        Friction mu of the surfaces [-].
    friction_spline : float or array of float
        Friction of the splines [-].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        As for the other models, and when B or C reach 1: a plate would then take all of the clamp force.
    """
    pack.check()
    force, friction, friction_spline = number(force), number(friction), number(friction_spline)
    not_negative(force=force, friction=friction, friction_spline=friction_spline)
    shaft, hub = pack.inner_spline_diameter / 2.0, pack.outer_spline_diameter / 2.0
    radius = (shaft + hub) / 2.0
    b = np.asarray(friction * friction_spline) * (radius / shaft)
    c = np.asarray(friction * friction_spline) * (radius / hub)
    if np.any(b >= 1.0):
        raise ValueError(
            f"friction times spline friction takes {np.max(b):.2f} of the clamp force at one plate; (6.15) holds below 1"
        )
    plates = int(pack.surfaces) + 1
    fall = -2.0 * (plates // 2) * (np.arctanh(b) + np.arctanh(c))  # ln of (y delta)^m
    both = b + c
    share = np.where(both > 0.0, -np.expm1(fall) / np.where(both > 0.0, both, 1.0), 2.0 * (plates // 2))
    if plates % 2 == 0:
        share = share - np.exp(fall) / (1.0 - b)
    return number(force * friction * radius * share)


def thesis(
    pack: PackGeometry,
    force: Numbers,
    friction: Numbers,
    friction_spline: Numbers,
    friction_inner_spline: Numbers | None = None,
    releasing: bool = False,
) -> Numbers:
    """Return the torque by (6.54), (6.55): friction of both splines takes clamp force plate by plate, the first in the hub.

    With a = d_po/2 cos(alpha), b = d_pin/2 cos(alpha), C = mu r_m (6.33), surface i carries F_a times
    C a/(a + C mu_o)^(k+1) (a - C mu_o)^k ((b - C mu_in)/(b + C mu_in))^j, j = i // 2, k = (i - 1) // 2.
    (6.55) prints floor(i/2) for both exponents; (6.54) and Annex D agree on the two given here, and the second surface (6.45)
    results only with them. (6.36) prints mu for mu_o, but the text below it names mu_o.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force F_a [N].
    friction : float or array of float
        Friction mu of the surfaces [-].
    friction_spline : float or array of float
        Friction mu_o of the outer splines [-].
    friction_inner_spline : float or array of float, optional
        Friction mu_in of the inner splines [-], by default the same as ``friction_spline``.
    releasing : bool
        While the pack is released the plates slide in the other direction on their splines, and the same friction holds clamp
        force in the pack: both spline frictions change sign (own reading, not that of the thesis).

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        As for the other models, and when the spline of a plate would take, or hold when releasing, all of the clamp force
        (C mu_o >= a or C mu_in >= b): the plates are then locked on the splines and (6.54) has no meaning.
    """
    pack.check()
    inner = friction_spline if friction_inner_spline is None else friction_inner_spline
    force, friction, outer, inner = number(force), number(friction), number(friction_spline), number(inner)
    not_negative(force=force, friction=friction, friction_spline=outer, friction_inner_spline=inner)
    c = friction * pack.mean_radius  # (6.33)
    a, b = pack.outer_spline_arm, pack.inner_spline_arm
    co, ci = c * outer, c * inner
    worst = max(np.max(co / a), np.max(ci / b))
    if worst >= 1.0:
        raise ValueError(
            f"friction times spline friction takes {worst:.2f} of the clamp force at one "
            "plate, which is then locked on its spline; (6.54) holds below 1"
        )
    if releasing:
        co, ci = -co, -ci
    total = 0.0
    for i in range(1, int(pack.surfaces) + 1):
        j, k = i // 2, (i - 1) // 2
        total = total + c * a / (a + co) ** (k + 1) * (a - co) ** k * ((b - ci) / (b + ci)) ** j
    return force * total


def chen(pack: PackGeometry, force: Numbers, friction: Numbers, friction_outer_spline: Numbers) -> Numbers:
    """Return the torque of Chen's pack, (6.20), (6.21): pressure falls only at plates with an outer spline, by F_ch / A.

    (6.21) gives the torque on each plate from both its faces; the torque of the pack is the sum over all plates with the same
    spline, inner or outer. The thesis does not say whether the clamped plate, number 0, loses too. Here (6.20) holds for it as well
    (own), so this is the thesis's model without friction on the inner splines.

    Parameters
    ----------
    pack : PackGeometry
        Geometry of the pack.
    force : float or array of float
        Clamp force F_a [N].
    friction : float or array of float
        Friction mu of the surfaces [-].
    friction_outer_spline : float or array of float
        Friction of the outer splines [-].

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        As for :func:`thesis`.
    """
    return thesis(pack, force, friction, friction_outer_spline, friction_inner_spline=0.0)


def corrected(torque: Numbers, factor: Numbers, rest_torque: Numbers) -> Numbers:
    """Return k_kor M_t + M_rest, (6.56): the torque of a model fitted to a measurement; all values broadcast together.

    Parameters
    ----------
    torque : float or array of float
        Torque of the model M_t [Nm].
    factor : float or array of float
        k_kor [-], measured slope over slope of the model.
    rest_torque : float or array of float
        M_rest [Nm], which the measured line has without clamp force.

    Returns
    -------
    float or array of float
        Torque of the pack [Nm], in the common shape.

    Raises
    ------
    ValueError
        For a factor that is not above 0 or a negative rest.
    """
    torque, factor, rest_torque = number(torque), number(factor), number(rest_torque)
    positive(factor=factor)
    not_negative(rest_torque=rest_torque)
    return factor * torque + rest_torque
