# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units that people write in configuration and sequences, and their conversion to SI.

base.schema and runs.sequence use it; a number without its unit is refused where a unit is expected.
"""

from __future__ import annotations

import math
import re

from .errors import RigError, brief

# unit -> (dimension, factor to SI)
UNITS: dict[str, tuple[str, float]] = {
    "-": ("ratio", 1.0),
    "%": ("ratio", 0.01),
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "min": ("time", 60.0),
    "Hz": ("frequency", 1.0),
    "kHz": ("frequency", 1e3),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
    "rad/s": ("angular velocity", 1.0),
    "rpm": ("angular velocity", math.pi / 30.0),
    "rad/s2": ("angular acceleration", 1.0),
    "rpm/s": ("angular acceleration", math.pi / 30.0),
    "Nm": ("torque", 1.0),
    "kNm": ("torque", 1e3),
    "1/Nm": ("torque per torque squared", 1.0),
    "kg m2": ("inertia", 1.0),
    "W": ("power", 1.0),
    "kW": ("power", 1e3),
    "J": ("energy", 1.0),
    "kJ": ("energy", 1e3),
    "Nm s/rad": ("torque per speed", 1.0),
    "Nm/rad": ("torque per angle", 1.0),
    "Pa": ("pressure", 1.0),
    "kPa": ("pressure", 1e3),
    "MPa": ("pressure", 1e6),
    "mbar": ("pressure", 1e2),
    "bar": ("pressure", 1e5),
    "psi": ("pressure", 6894.757293168),
    "MPa/A": ("pressure per current", 1e6),
    "Pa/s": ("pressure rate", 1.0),
    "MPa/s": ("pressure rate", 1e6),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "um": ("length", 1e-6),
    "in": ("length", 0.0254),
    "m/s": ("velocity", 1.0),
    "mm/s": ("velocity", 1e-3),
    "km/h": ("velocity", 1.0 / 3.6),
    "mm2": ("area", 1e-6),
    "cm2": ("area", 1e-4),
    "m2": ("area", 1.0),
    "cm3": ("volume", 1e-6),
    "l": ("volume", 1e-3),
    "m3": ("volume", 1.0),
    "cm3/s": ("volume flow", 1e-6),
    "cm3/MPa": ("volume per pressure", 1e-12),
    "l/min": ("volume flow", 1e-3 / 60.0),
    "m3/s": ("volume flow", 1.0),
    "cm3/rev": ("displacement", 1e-6 / (2.0 * math.pi)),
    "N": ("force", 1.0),
    "kN": ("force", 1e3),
    "N/m": ("stiffness", 1.0),
    "N/mm": ("stiffness", 1e3),
    "N/mm3": ("cubic stiffness", 1e9),
    "N s/m": ("damping", 1.0),
    "kg": ("mass", 1.0),
    "g": ("mass", 1e-3),
    "kg/m": ("linear density", 1.0),
    "kg/m3": ("density", 1.0),
    "Pa s": ("viscosity", 1.0),
    "mPa s": ("viscosity", 1e-3),
    "bar/(l/min)": ("hydraulic resistance", 6e9),
    "Pa s/m3": ("hydraulic resistance", 1.0),
    "A": ("current", 1.0),
    "mA": ("current", 1e-3),
    "V": ("voltage", 1.0),
    "ohm": ("resistance", 1.0),
    "H": ("inductance", 1.0),
    "mH": ("inductance", 1e-3),
    "V/A": ("resistance", 1.0),
    "V/(A s)": ("gain integral", 1.0),
    "V s/A": ("inductance", 1.0),
    "degC": ("temperature", 1.0),
    "K": ("temperature difference", 1.0),
    "1/K": ("per temperature", 1.0),
    "%/K": ("per temperature", 0.01),
    "J/K": ("heat capacity", 1.0),
    "W/K": ("thermal conductance", 1.0),
    "um/MJ": ("wear rate", 1e-12),
    "N/MPa2": ("force per pressure squared", 1e-12),
    "N/MPa": ("area", 1e-6),
}
SI = {dimension: unit for unit, (dimension, factor) in reversed(UNITS.items()) if factor == 1.0}
# the SI unit of dimensions for which it cannot be written
NOT_WRITTEN = {
    "displacement": "m3/rad",
    "pressure per current": "Pa/A",
    "cubic stiffness": "N/m3",
    "wear rate": "m/J",
    "force per pressure squared": "N/Pa2",
    "volume per pressure": "m3/Pa",
}
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", re.DOTALL)


def dimension_of(text: str) -> str | None:
    """Return the dimension of e.g. ``"1500 rpm"``; None for a text that is not a number with a known unit."""
    match = _QUANTITY.fullmatch(text.strip())
    return None if match is None or match[2] not in UNITS else UNITS[match[2]][0]


def shown_in(dimension: str) -> tuple[str, float]:
    """Return the unit in which ranges of a dimension are shown, and its factor to SI.

    It is the SI unit if that can be written, or else the first unit of the dimension.
    """
    if dimension in SI:
        return SI[dimension], 1.0
    return next((unit, factor) for unit, (kind, factor) in UNITS.items() if kind == dimension)


def with_article(name: str) -> str:
    """Return the name of a dimension with its article."""
    return f"{'an' if name[0] in 'aei' else 'a'} {name}"


def dimension_of_text(text: str) -> str | None:
    """Return the dimension of a text such as "1500 rpm"; None when it is no number with a known unit."""
    match = _QUANTITY.fullmatch(text.strip())
    return UNITS[match[2]][0] if match is not None and match[2] in UNITS else None


def quantity(text: object, dimension: str, where: str) -> float:
    """Return the SI value of e.g. ``"1500 rpm"``.

    Parameters
    ----------
    text : object
        What was written; a number alone is taken for a ratio.
    dimension : str
        The dimension that is expected.
    where : str
        Beginning of the error.

    Returns
    -------
    float
        The value [SI].

    Raises
    ------
    RigError
        When the text is not a finite quantity of this dimension.
    """
    known = ", ".join(u for u, (d, _) in UNITS.items() if d == dimension)
    if dimension == "ratio" and isinstance(text, (int, float)) and not isinstance(text, bool):
        text = f"{text} -"
    match = _QUANTITY.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        found = brief(text) if isinstance(text, str) else f"'{brief(text)}'"
        raise RigError(f"{where}: {found} is not {with_article(dimension)}; write a number with its unit ({known})")
    number, unit = float(match[1]), match[2] or "-"
    if not match[2] and dimension != "ratio":
        raise RigError(f"{where}: {brief(text)} has no unit, expected {with_article(dimension)} ({known})")
    if unit not in UNITS:
        raise RigError(f"{where}: {brief(text)} has the unknown unit {brief(unit)}; {with_article(dimension)} takes {known}")
    if UNITS[unit][0] != dimension:
        found = with_article(UNITS[unit][0])
        raise RigError(f"{where}: {brief(text)} is {found}, expected {with_article(dimension)} ({known})")
    if not math.isfinite(number * UNITS[unit][1]):
        raise RigError(f"{where}: {brief(text)} is too large a number")
    return number * UNITS[unit][1]


def number_text(value: float, digits: int = 4, apart: str = "") -> str:
    """Return a number with so many digits that count; a large one has no exponent, and ``apart`` between its thousands."""
    text = f"{value:.{digits}g}"
    return f"{float(text):,.0f}".replace(",", apart) if "e+" in text else text


def span(low: float, high: float, text: object) -> str:
    """Return a range [SI] as text in the unit in which a value was written, e.g. ``0 to 3000 rpm`` for ``"-5 rpm"``."""
    match = _QUANTITY.fullmatch(text.strip()) if isinstance(text, str) else None
    unit = match[2] if match and match[2] in UNITS else "-"
    factor = UNITS[unit][1]
    low_text, high_text = (
        f"{end:.0f}" if 1e3 <= abs(end) < 1e6 else number_text(end, apart=" ") for end in (low / factor, high / factor)
    )
    return f"{low_text} to {high_text}{'' if unit == '-' else f' {unit}'}"
