# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Charts of results: named lines and points over one axis, with what is accepted; validation, tuning and the docs draw them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .figure import DASHED, DOTTED, POINTS, STYLES, TALL, Curve, Description, Level, Panel, column_of
from .palette import CURVES


@dataclass(frozen=True)
class Line:
    """Points of a chart, drawn as marks, as a line or as both.

    Parameters
    ----------
    name : str
        Its label.
    x, y : sequence of float
        Places of equal number; None in y leaves a gap.
    line, marks : bool
        Whether a line and marks are drawn.
    dashed : bool
        Whether the line is dashed.
    colour : str
        Name of its colour (palette.CURVES), as that of a signal; by default the next one.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float | None]
    line: bool = True
    marks: bool = True
    dashed: bool = False
    colour: str = ""


def chart(
    title: str,
    across: str,
    up: str,
    lines: Sequence[Line],
    accepted: tuple[float | None, float | None] = (None, None),
    log: tuple[bool, bool] = (False, False),
) -> Description:
    """Return a chart.

    Parameters
    ----------
    title, across, up : str
        Its title, and the names of both axes with their units.
    lines : sequence of Line
        What is drawn, at least one point.
    accepted : (float or None, float or None)
        The lowest and the highest value that is accepted.
    log : (bool, bool)
        True for a logarithmic axis across, and up.
    """
    column = column_of(np.concatenate([np.asarray(one.x, float) for one in lines]), across, log[0])
    curves = []
    for n, one in enumerate(lines):
        colour = one.colour or CURVES[(n + 2) % len(CURVES)]  # the clutches' colours come first, which differ most
        points = np.asarray(one.x, float), np.array([np.nan if value is None else value for value in one.y], float)
        style = DOTTED if one.dashed and n >= len(CURVES) else DASHED if one.dashed else STYLES[n // len(CURVES) % len(STYLES)]
        if one.line:
            curves.append(Curve(one.name, one.name, one.name, colour, style, *points))
        if one.marks:
            text = "" if one.line else one.name
            curves.append(Curve(one.name, text, text, colour, POINTS, *points))
    levels = [Level(end, f"accepted {way} {end:.4g}") for end, way in zip(accepted, ("from", "up to")) if end is not None]
    panel = Panel(up, "", tuple(curves), (), tuple(levels), log=log[1])
    return Description(title, "", "", "", (column,), (panel,), high=TALL)


def front(way: str, rows: Sequence[Mapping], objectives: Sequence[str], chosen: Mapping[str, Mapping]) -> Description:
    """Return the chart of a tuning's front over its first two objectives; 1 is the value of the compared settings.

    Parameters
    ----------
    way : str
        Name of the shift, e.g. I-II.
    rows : sequence of mapping
        The front's rows.
    objectives : sequence of str
        Names of the objectives, at least two.
    chosen : mapping of str to mapping
        Names and rows of the chosen settings.
    """
    x, y = objectives[:2]
    lines = []
    for title, kept, suffix in (
        ("as sought", rows, ""),
        ("elsewhere, mean", rows, "_mean"),
        *((f"{name}, elsewhere", [row], "_mean") for name, row in chosen.items()),
    ):
        points = [(row[f"{x}{suffix}"], row[f"{y}{suffix}"]) for row in kept if row[f"{x}{suffix}"] is not None]
        if points:
            lines.append(Line(title, *map(list, zip(*sorted(points))), line=False))
    if "dip" not in (x, y):
        lines.append(Line("compared", [1.0], [1.0], line=False))
    across, up = (f"{one} (1 - k)" if one == "dip" else f"{one}, share of the compared settings'" for one in (x, y))
    return chart(f"{way}: settings that nothing found is better than", across, up, lines)


def write_charts(found: Iterable[tuple[str, Description]], folder: str | Path) -> list[Path]:
    """Write charts as SVG files.

    Parameters
    ----------
    found : iterable of (str, Description)
        Names of the files without ending, and charts.
    folder : str or Path
        Folder of the files; it is made when it does not exist.

    Returns
    -------
    list of Path
        The files.
    """
    from .draw import draw_figure, write_figure

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, description in found:
        paths.append(folder / f"{name}.svg")
        write_figure(draw_figure(description), paths[-1])
    return paths
