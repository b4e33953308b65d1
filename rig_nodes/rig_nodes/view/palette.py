# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The colours of all pictures by name: a light and a dark palette; the figures, the pages and the viewer use it.

Curves differ for the colour-blind too, and stand out from the ground and from each phase. Line styles are beside the colours.
"""

from __future__ import annotations

import re

from ..analysis import FILL, INERTIA, INTERRUPTED, TORQUE

INPUT, OUTPUT, OTHER = "input", "output", "other"
CLUTCHES = ("first", "second", "third", "fourth", "fifth")  # in the order of the transmission
CURVES = (INPUT, OUTPUT, *CLUTCHES, OTHER)
SETTLING = "settling"
PHASES = (FILL, TORQUE, INTERRUPTED, INERTIA, SETTLING)
GROUND, INK, NOTE, RULE, GRID = "ground", "ink", "note", "rule", "grid"  # NOTE is of small words, RULE of axes
LIMIT, MET = "limit", "met"
PALER = 0.35  # share of white in the colour of a demanded value, where there are no line styles
BRIGHTER = 2.2  # factor of a phase's colour where it is a bar instead of a ground

LIGHT = {
    INPUT: "#3d6742",
    OUTPUT: "#9c3f6a",
    "first": "#003c7f",
    "second": "#c85300",
    "third": "#734bbc",
    "fourth": "#584800",
    "fifth": "#027d8a",
    OTHER: "#444444",
    FILL: "#f1f1f1",
    TORQUE: "#ffedb0",
    INTERRUPTED: "#f5dbff",
    INERTIA: "#f8ccc0",
    SETTLING: "#edfff6",
    GROUND: "#ffffff",
    INK: "#1a1a1a",
    NOTE: "#4f4f4f",
    RULE: "#8a8a8a",
    GRID: "#e3e3e3",
    LIMIT: "#a8001c",
    MET: "#1e6b3a",
    "good": "#2c6e2f",
    "fair": "#8a5a14",
    "poor": "#a8430e",
    "failed": "#a01020",
}
DARK = {
    INPUT: "#09a573",
    OUTPUT: "#c777b1",
    "first": "#76b3f9",
    "second": "#ee811c",
    "third": "#9074fc",
    "fourth": "#e0d653",
    "fifth": "#66e9ff",
    OTHER: "#a6a6a6",
    FILL: "#2f2f2f",
    TORQUE: "#483908",
    INTERRUPTED: "#43254a",
    INERTIA: "#3b120a",
    SETTLING: "#273e31",
    GROUND: "#14171c",
    INK: "#ececec",
    NOTE: "#b4b4b4",
    RULE: "#7c7c7c",
    GRID: "#30343b",
    LIMIT: "#ff7b7b",
    MET: "#6fcf97",
    "good": "#2d7030",
    "fair": "#8b5b15",
    "poor": "#a9440f",
    "failed": "#b0202f",
}
# of curves in the viewer, whose file has one colour for windows with a light and with a dark ground
MIDDLE = dict(zip(CURVES, ("#259161", "#b9448f", "#2198f7", "#d1821c", "#4c53f7", "#7d6022", "#27695c", "#949494")))
ON_GRADE = "#fefefe"  # of letters on the colour of a grade
_NAMES = {colour: name for name, colour in LIGHT.items()}


def clutch_colour(place: int) -> str:
    """Return the colour of the clutch or gear at a place of the transmission; further places begin again with the first one."""
    return CLUTCHES[place % len(CLUTCHES)]


def variables(palette: dict[str, str]) -> str:
    """Return a palette as declarations of CSS variables, for :func:`with_variables`."""
    return "".join(f"{_variable(name)}:{colour};" for name, colour in palette.items())


def with_variables(svg: str) -> str:
    """Return a drawing in the light palette with its colours as CSS variables, so that a page can change the palette."""

    def found(match: re.Match) -> str:
        name = _NAMES.get(match[0])
        return match[0] if name is None else f"var({_variable(name)})"

    return re.sub(r"#[0-9a-f]{6}\b", found, svg)


def _variable(name: str) -> str:
    return f"--{name.replace(' ', '-')}"


def rgb(name: str, demanded: bool = False) -> tuple[int, int, int]:
    """Return red, green and blue of a colour in the viewer: a demanded value is paler, a phase brighter."""
    more, colour = BRIGHTER if name in PHASES else 1.0, MIDDLE.get(name, DARK[name])
    parts = (min(round(more * int(colour[place : place + 2], 16)), 255) for place in (1, 3, 5))
    red, green, blue = (round(part + PALER * (255 - part)) if demanded else part for part in parts)
    return red, green, blue
