# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The result of a bench as a figure: torque at slip over pressure with the fitted line, or force over pressure or travel.

view.figure_of_run puts it first; the numbers are those of the report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..plant import part as parts
from .figure import DASHED, POINTS, SOLID, TALL, Curve, Description, Panel, column_of
from .palette import CLUTCHES, INPUT, OTHER
from .recorded import envelopes_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from .pages import Pages


def figure_of_bench(report: Mapping, pages: Pages, path: str | Path, span: tuple[float, float]) -> Description | None:
    """Return the figure of a bench's result; None for a run that has none.

    Parameters
    ----------
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    path : str or Path
        Its folder or bag.
    span : (float, float)
        Its first and last time [s].
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
            text = f"M_eks = {slope:.4g} Nm/MPa · p {rest:+.3g} Nm"
            curves.append(_line(text, np.array([0.0, 1.05 * x.max()]), slope, rest))
            models = ", ".join(f"{name} {k:.3f}" for name, k in line["k_kor"].items())
            said = f"{text}, R² {line['r_squared']:.4f}; k_kor {models}."
        title = "Torque at slip over the pressure on the friction rings"
        return _figure(report, title, said, "pressure [MPa]", Panel("torque", "Nm", tuple(curves)))
    press = next(iter(pages.structure.of_role(parts.PRESS)), None)
    for key, what, unit, factor, title, ends in (
        ("springs", "travel", "mm", 1e3, "Force of the springs over their travel", ("s_m", "f_s_n")),
        ("cylinder", "pressure", "MPa", 1e-6, "Force of the cylinder over its pressure", ("cylinder_pa", "f_p_n")),
    ):
        if press is None or not (rows := found.get(key)):
            continue
        x, y = (np.array([one[end] for one in rows]) * scale for end, scale in zip(ends, (factor, 1.0)))
        curves = _measured(pages, path, span, (f"{press.name}.{what}", f"{press.name}.force"))
        slope, rest = np.polyfit(x, y, 1)
        text = f"{slope:.4g} N/{unit} {rest:+.3g} N"
        curves.append(_line(f"fitted line, {text}", np.array([x.min(), x.max()]), slope, rest))
        curves.append(Curve(ends[1], "results while it rises", "results", INPUT, POINTS, x, y))
        off = float(np.abs(y - slope * x - rest).max())
        said = f"The straight line through the {len(x)} results while it rises, {text}, fits them within {off:.3g} N."
        return _figure(report, title, said, f"{what} [{unit}]", Panel("force", "N", tuple(curves)))
    return None


def _line(text: str, x: np.ndarray, slope: float, rest: float) -> Curve:
    return Curve("line", text, "fitted line", CLUTCHES[1], DASHED, x, slope * x + rest)


def _measured(pages: Pages, path: str | Path, span: tuple[float, float], shows: tuple[str, str]) -> list[Curve]:
    """Return the measured force over travel or pressure."""
    names = [name for one in shows for name in pages.measured(one)[:1]]
    found = envelopes_of(path, pages, names, span) if len(names) == 2 else {}
    if len(found) < 2:
        return []
    x, y = (found[name].middle for name in names)
    return [Curve(names[1], f"{names[1]}, measured", names[1], OTHER, SOLID, x, y)]


def _figure(report: Mapping, title: str, said: str, across: str, panel: Panel) -> Description:
    conditions = str(report["run"].get("description") or report["run"].get("sequence") or "")
    column = column_of(np.concatenate([one.t for one in panel.curves]), across)
    return Description(title, conditions, said, "", (column,), (panel,), high=TALL)
