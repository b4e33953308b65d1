# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The result of a bench as a figure: torque at slip over pressure with the fitted line, or force over pressure or travel.

view.figure_of_run puts it first; the numbers are those of the report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..plant import part as parts
from .figure import DASHED, POINTS, SOLID, Column, Curve, Description, Panel
from .palette import CLUTCHES, INPUT, OTHER
from .recorded import envelopes_of, samples_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from .pages import Pages

HIGH = 380  # px of the plot
ROOM = 0.05  # share of the axis left free at both ends


def figure_of_bench(report: Mapping, pages: Pages, path: str | Path) -> Description | None:
    """Return the figure of a bench's result; None for a run that has none.

    Parameters
    ----------
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    path : str or Path
        Its folder or bag.
    """
    found = report.get("bench") or {}
    tests, line = found.get("slip_tests"), found.get("line")
    if tests:
        x = np.array([one["pressure_pa"] for one in tests]) * 1e-6
        y = np.array([one["m_eks_nm"] for one in tests])
        curves = [Curve("m_eks_nm", "M_eks, torque at slip", "M_eks", CLUTCHES[0], POINTS, x, y)]
        said = f"{len(tests)} tests in which the pack slipped; a line needs at least 3."
        if line:
            slope, rest = line["slope_nm_per_pa"] * 1e6, line["m_rest_nm"]
            ends = np.array([0.0, 1.05 * x.max()])
            text = f"M_eks = {slope:.4g} Nm/MPa · p {rest:+.3g} Nm"
            curves.append(Curve("line", text, "fitted line", CLUTCHES[1], DASHED, ends, slope * ends + rest))
            said = (
                f"{text}, R² {line['r_squared']:.4f}; k_kor "
                + ", ".join(f"{name} {k:.3f}" for name, k in line["k_kor"].items())
                + "."
            )
        return _figure(
            report, "Torque at slip over the pressure on the friction rings", said, "pressure [MPa]", "torque", "Nm", curves
        )
    press = next(iter(pages.structure.of_role(parts.PRESS)), None)
    for key, what, unit, factor, title, ends in (
        ("springs", "travel", "mm", 1e3, "Force of the springs over their travel", ("s_m", "f_s_n")),
        ("cylinder", "pressure", "MPa", 1e-6, "Force of the cylinder over its pressure", ("cylinder_pa", "f_p_n")),
    ):
        if press is None or not (rows := found.get(key)):
            continue
        x, y = (np.array([one[end] for one in rows]) * scale for end, scale in zip(ends, (factor, 1.0)))
        curves = _measured(pages, path, report, (f"{press.name}.{what}", f"{press.name}.force"))
        slope, rest = np.polyfit(x, y, 1)
        line_ends = np.array([x.min(), x.max()])
        text = f"{slope:.4g} N/{unit} {rest:+.3g} N"
        curves.append(
            Curve("line", f"fitted line, {text}", "fitted line", CLUTCHES[1], DASHED, line_ends, slope * line_ends + rest)
        )
        curves.append(Curve(ends[1], "results while it rises", "results", INPUT, POINTS, x, y))
        off = float(np.abs(y - slope * x - rest).max())
        said = f"The straight line through the {len(x)} results while it rises, {text}, fits them within {off:.3g} N."
        return _figure(report, title, said, f"{what} [{unit}]", "force", "N", curves)
    return None


def _measured(pages: Pages, path: str | Path, report: Mapping, shows: tuple[str, str]) -> list[Curve]:
    """Return the measured force over travel or pressure."""
    names = [name for one in shows for name in pages.measured(one)[:1]]
    end = report["run"].get("duration_s")
    if end is None:  # of a bag alone, beside which no report lies
        end = max((float(t[-1]) for _, t, _ in samples_of(path, pages, names) if len(t)), default=0.0)
    found = envelopes_of(path, pages, names, (0.0, end)) if len(names) == 2 and end > 0.0 else {}
    if len(found) < 2:
        return []
    x, y = (found[name].middle for name in names)
    return [Curve(names[1], f"{names[1]}, measured", names[1], OTHER, SOLID, x, y)]


def _figure(report: Mapping, title: str, said: str, across: str, quantity: str, unit: str, curves: list[Curve]) -> Description:
    x = np.concatenate([one.t for one in curves])
    room = ROOM * float(np.nanmax(x) - np.nanmin(x))
    column = Column(float(np.nanmin(x)) - room, float(np.nanmax(x)) + room, across)
    conditions = str(report["run"].get("description") or report["run"].get("sequence") or "")
    return Description(title, conditions, said, "", (column,), (Panel(quantity, unit, tuple(curves)),), high=HIGH)
