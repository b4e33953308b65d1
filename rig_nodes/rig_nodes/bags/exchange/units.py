# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Splits the heads of columns, as loggers write them, into a name and a unit, and recognizes spellings of units."""

from __future__ import annotations

import re
from collections.abc import Collection

from ...base import UNITS

# units of times in files -> s
TIME_UNITS = {
    **{unit: factor for unit, (dimension, factor) in UNITS.items() if dimension == "time"},
    "ns": 1e-9,
    "h": 3600.0,
    "d": 86400.0,
}

# other spellings, by loggers and people, of the units of base.units
ALIASES = {
    **dict.fromkeys(("N.m", "N m", "N*m", "N·m", "N⋅m", "NM"), "Nm"),
    **dict.fromkeys(("1/min", "min-1", "min^-1", "min⁻¹", "r/min", "U/min", "Umin", "obr/min", "obr./min", "RPM"), "rpm"),
    **dict.fromkeys(("°C", "C", "deg C", "Grad C", "st.C", "st. C"), "degC"),
    **dict.fromkeys(("µs", "μs"), "us"),
    **dict.fromkeys(("sec", "sek", "Sek", "Sek.", "sek.", "seconds", "Sekunden", "sekundy"), "s"),
    **dict.fromkeys(("msec", "msek", "milliseconds", "Millisekunden"), "ms"),
    **dict.fromkeys(("usec", "microseconds"), "us"),
    **dict.fromkeys(("nsec", "nanoseconds"), "ns"),
    **dict.fromkeys(("hr", "hrs", "hours", "Std", "Std.", "godz", "godz."), "h"),
    **dict.fromkeys(("day", "days", "Tag", "dni", "doba"), "d"),
    **dict.fromkeys(("Bar", "bar(g)", "barg"), "bar"),
    **dict.fromkeys(("1", "1/1"), "-"),
}
_BRACKETS = re.compile(r"\s*(.+?)[\s_]*(?:\[\s*(.*?)\s*\]|\(\s*(.*?)\s*\))\s*$")
_BEHIND = (
    re.compile(r"\s*(.+?)\s+in\s+(\S.*?)\s*$"),
    re.compile(r"\s*(.+?)\s*/\s+(\S.*?)\s*$"),
    re.compile(r"\s*(.+)_([A-Za-z%]+)$"),
)


def unit_of(text: str, known: Collection[str] = UNITS) -> str | None:
    """Return the unit as base.units or another table of units writes it; None when it is unknown there."""
    text = text.strip().strip("[]()").strip()
    text = ALIASES.get(text, text)
    return text if text in known else None


def time_unit_of(text: str) -> str | None:
    """Return the unit of times as TIME_UNITS writes it; None for anything else."""
    return unit_of(text, TIME_UNITS)


def split_head(head: str) -> tuple[str, str]:
    """Return name and unit of a head such as ``torque [Nm]``, ``Drehzahl in 1/min`` or ``speed_rpm``.

    The unit is as written when it is in brackets, otherwise one of base.units; it is empty when there is none.
    """
    if match := _BRACKETS.match(head):
        return match[1], ALIASES.get(unit := match[2] or match[3] or "", unit)
    for form in _BEHIND:
        if (match := form.match(head)) and (unit := unit_of(match[2])):
            return match[1], unit
    return head.strip(), ""
