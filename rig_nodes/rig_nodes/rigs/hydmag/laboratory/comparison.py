# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statements of chapter 8 of the thesis on its bench, as bounds on the coefficients of friction, which it does not print.

It can be used alone. The chapter gives k_kor (measured slope over the thesis's model) and k_os (over Osinski's), but neither a
friction coefficient nor a slope. The ratio of two models does not contain the measured slope, and it depends on the product
mu mu_sp alone. So the statements bound that product, and none of them can separate mu from mu_sp.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from rig_nodes.plant import osinski_factor, thesis, traditional

from .packs import ALL, PACKS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rig_nodes.plant import Numbers

NEAR = 0.05  # own: meaning of "very close" for two lines, as a share of their slope


@dataclass(frozen=True)
class Statement:
    """A statement that the ratio of two models lies within bounds for one pack.

    The ratio of the thesis's model to ``against`` ("osinski" or "traditional") lies in low to high.
    """

    pack: str
    surfaces: int
    against: str
    low: float
    high: float
    text: str
    read_into: bool = False  # True for an own interpretation of an ambiguous sentence


def _statements() -> tuple[Statement, ...]:
    found = [
        Statement("46x88.9", 18, "osinski", 1.505 / 0.955, 1.515 / 0.945, "8.3.4: k_kor 0.95, k_os 1.51, as rounded"),
        # measured = k_kor thesis = k_os osinski, so thesis / osinski = k_os / k_kor
        *(Statement("50x76", n, "osinski", 1.2 / 1.02, inf, "8.3.5: k_os > 1.2, k_kor at most 1.02") for n in (18, 16)),
        *(Statement("65x115", n, "osinski", 1.2 / 1.1, inf, "8.3.3: k_os > 1.2, k_kor at most 1.1") for n in ALL),
        *(Statement("80x115", n, "osinski", 1.0, inf, "8.3.1: M_t clearly above Osinski's") for n in ALL),
        Statement(
            "80x115",
            14,
            "traditional",
            0.0,
            (1.0 + NEAR) / 1.2,
            "8.3.1.2, 8.4: 1.5 mm plates, k_kor > 1.2 and measured very close to traditional",
        ),
        Statement(
            "80x115",
            12,
            "traditional",
            (1.0 - NEAR) / 1.19,
            inf,
            "8.3.1.3, 8.4: 1 mm plates, k_kor at most 1.19 and measured very close to traditional "
            "(fig. 8.15 d, which is read as 8.14 d)",
        ),
    ]
    # a better fit than Osinski's is claimed for 16 and 18 surfaces only: with fewer surfaces Osinski's is then at least as
    # good, |k_os - 1| <= |k_kor - 1|, with k_kor 0.88 (n = 10) and at least 0.9 (n = 12, 14)
    for n, lowest in ((14, 0.9), (12, 0.9), (10, 0.88)):
        found.append(
            Statement(
                "50x76",
                n,
                "osinski",
                0.0,
                (2.0 - lowest) / lowest,
                "8.3.5: better than Osinski's is said of 16 and 18 surfaces only",
                read_into=True,
            )
        )
    return tuple(found)


STATEMENTS = _statements()


def model_ratio(pack: str, surfaces: int, against: str, product: Numbers) -> Numbers:
    """Return the ratio of the thesis's model to Osinski's or the traditional one.

    Parameters
    ----------
    pack : str
        Name of the pack.
    surfaces : int
        Number of friction surfaces.
    against : str
        "osinski" or "traditional".
    product : float or array of float
        Product mu mu_sp [-].

    Returns
    -------
    float or array of float
        Ratio [-], in the shape of ``product``.

    Raises
    ------
    ValueError
        For an unknown pack, number of surfaces or model, and for a product that locks the splines.
    """
    if pack not in PACKS or against not in ("osinski", "traditional"):
        raise ValueError(
            f"no ratio for pack '{pack}' against '{against}'; packs are {', '.join(PACKS)}, models are osinski and traditional"
        )
    geometry = PACKS[pack].geometry(surfaces)
    # all torque is proportional to mu at a given product, so mu = 1 represents any mu
    share = thesis(geometry, 1.0, 1.0, product) / traditional(geometry, 1.0, 1.0)
    return share / osinski_factor(surfaces) if against == "osinski" else share


def product_bounds(statement: Statement) -> tuple[float, float]:
    """Return the lowest and the highest product mu mu_sp at which a statement holds.

    The ratio falls as the product grows, from its value without spline friction to a value above 0 where a spline locks.

    Parameters
    ----------
    statement : Statement
        The statement.

    Returns
    -------
    tuple of float
        Lowest and highest product [-].

    Raises
    ------
    ValueError
        When the statement holds at no product.
    """
    geometry = PACKS[statement.pack].geometry(statement.surfaces)
    locked = min(geometry.outer_spline_arm, geometry.inner_spline_arm) / geometry.mean_radius * (1.0 - 1e-9)

    def where(ratio: float) -> float:
        return brentq(
            lambda q: model_ratio(statement.pack, statement.surfaces, statement.against, q) - ratio, 0.0, locked, xtol=1e-12
        )

    loose, tight = (model_ratio(statement.pack, statement.surfaces, statement.against, q) for q in (0.0, locked))
    if statement.low > loose or statement.high < tight:
        raise ValueError(
            f"{statement.pack} with {statement.surfaces} surfaces has a ratio of {tight:.3f} to "
            f"{loose:.3f} against {statement.against}, never {statement.low:.3f} to "
            f"{statement.high:.3f}"
        )
    return (where(statement.high) if statement.high < loose else 0.0, where(statement.low) if statement.low > tight else locked)


def common_product(statements: Iterable[Statement]) -> tuple[float, float] | None:
    """Return the lowest and the highest product mu mu_sp at which all statements hold.

    Parameters
    ----------
    statements : iterable of Statement
        The statements.

    Returns
    -------
    tuple of float or None
        Lowest and highest product [-], None when the statements contradict each other.

    Raises
    ------
    ValueError
        When one of the statements holds at no product.
    """
    low, high = np.transpose([product_bounds(statement) for statement in statements])
    return (float(low.max()), float(high.min())) if low.max() <= high.min() else None


def contradicted(friction: float, friction_spline: float, statements: Iterable[Statement] = STATEMENTS) -> list[Statement]:
    """Return the statements that do not hold with this friction of plates and splines [-]."""
    out = []
    for statement in statements:
        low, high = product_bounds(statement)
        if not low <= friction * friction_spline <= high:
            out.append(statement)
    return out
