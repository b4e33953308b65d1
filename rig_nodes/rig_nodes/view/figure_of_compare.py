# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of a comparison: each shift of all recordings over each other from its own order on, and its differences.

`rig compare --html`, `--rrd` and ``Compared.plot`` show them; recordings without a common shift are drawn over the whole run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..analysis import in_unit, named_metrics, short_names, shown
from .figure import STYLES, Column, Curve, Description, Number, Panel
from .figure_of_shift import NUMBERS, marks_of, stretches_of
from .palette import CURVES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..analysis import Comparison, ShiftCurves
    from .pages import Pages

MS = 1e3
LESS = "less the first"  # title of a plot of differences, which is below that of the values


def figures_of_compare(found: Comparison, pages: Pages) -> list[Description]:
    """Return a figure for each shift; without any, one of the whole run.

    Parameters
    ----------
    found : Comparison
        The comparison.
    pages : Pages
        The pages of the first recording's rig.
    """
    return [_of_shift(found, one, pages) for one in found.shifts] or [figure_of_runs(found, pages)]


def _of_shift(found: Comparison, shift: ShiftCurves, pages: Pages) -> Description:
    assert pages.box is not None
    name, first = next((name, row) for name, row in zip(short_names(found.names), shift.rows) if row)
    way = pages.box.way(first["from_gear"], first["to_gear"], " → ")
    panels = _panels(shift.time * MS, shift.values, short_names(found.names), pages)
    column = Column(MS * shift.time[0], MS * shift.time[-1], "time after each recording's own order [ms]")
    title = f"Shift {shift.number}, {way}: {len(found.names)} recordings from their own orders"
    phases = tuple(stretches_of(first, pages.box)), tuple(marks_of(first, pages.box))
    numbers = _numbers(found, shift, pages) if len(found.names) == 2 else ()
    said = " · ".join([*_styles(found), f"phases and marks: {name}"])
    return Description(title, said, "", "", (column,), panels, *phases, numbers)


def figure_of_runs(found: Comparison, pages: Pages) -> Description:
    """Return the figure of the whole recordings; arguments as for :func:`figures_of_compare`."""
    curves = {one.name: one.values for one in found.curves}
    time = max((one.time for one in found.curves), key=len, default=np.array([0.0, 1.0]))
    same = {name: values for name, values in curves.items() if len(values[0]) == len(time)}
    column = Column(float(time[0]), float(time[-1]), "time of the first recording [s]")
    title = f"{len(found.names)} recordings on the first one's clock"
    return Description(title, " · ".join(_styles(found)), "", "", (column,), _panels(time, same, short_names(found.names), pages))


def _styles(found: Comparison) -> list[str]:
    names = short_names(found.names)
    return [f"{style}: {name}" for style, name in zip(STYLES, names)] if len(names) <= len(STYLES) else []


def _panels(time: np.ndarray, values: Mapping[str, Sequence[np.ndarray]], names: Sequence[str], pages: Pages) -> tuple[Panel, ...]:
    """Return a plot of each group of signals and one of their differences from the first recording."""
    few, panels = len(names) <= len(STYLES), []
    groups = [(title, [one for one in signals if one in values]) for title, signals in pages.shift_plots]
    if not few:
        groups = [(one, [one]) for _, signals in groups for one in signals]
    for title, signals in groups:
        over, apart = [], []
        for name in signals:
            shown_values = [np.asarray(pages.signal(name).shown(one), float) for one in values[name]]
            for n, y in enumerate(shown_values):
                colour = pages.look(name).colour if few else CURVES[n % len(CURVES)]
                style = STYLES[n] if few else STYLES[n // len(CURVES) % len(STYLES)]
                called = pages.words(name) if few else names[n]
                text = "" if few and n else called
                over.append(Curve(name, text, text, colour, style, time, y))
                if n:
                    apart.append(Curve(name, called, called, colour, style, time, y - shown_values[0]))
        unit = pages.signal(signals[0]).display_unit if signals else ""
        for heading, curves in ((title, over), (LESS, apart)):
            if any(np.isfinite(one.y).any() for one in curves):
                panels.append(Panel(heading, unit, tuple(curves)))
    return tuple(panels)


def _numbers(found: Comparison, shift: ShiftCurves, pages: Pages) -> tuple[Number, ...]:
    """Return the results of both recordings at the foot: the second's value, and below it how far it is from the first's."""
    metrics = {one.key: one for one in named_metrics() if one.key in NUMBERS}
    numbers = []
    for row in found.metrics:
        one = metrics.get(row["metric"])
        if one is None or row["shift"] != shift.number or row["difference"] is None or pages.box is None:
            continue
        value, change = (shown(*in_unit(row[key], row["error"], one.factor), one.digits) for key in ("other", "difference"))
        far = row["in_errors"] and abs(row["in_errors"])
        errors = "" if far is None else f" = {far:.{int(far < 10.0)}f} errors"
        apart = "within its error" if change.startswith("<") else f"{'' if change.startswith('-') else '+'}{change}{errors}"
        unit = "" if one.unit == "-" else f" {one.shown_unit}"
        numbers.append(Number(one.key, one.named(pages.box), value + unit, apart, None))
    return tuple(numbers)
