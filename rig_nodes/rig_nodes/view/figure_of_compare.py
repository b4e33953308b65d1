# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of a comparison: each shift of all recordings over each other from its own order on, and its differences.

`rig compare --html` and ``Compared.plot`` show them; recordings without a common shift are drawn over the whole run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..analysis import in_unit, named_metrics, short_names, shown
from .figure import DASHED, DOTTED, SOLID, Column, Curve, Description, Moment, Number, Panel
from .palette import CURVES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..analysis import Comparison, ShiftCurves
    from .pages import Pages

STYLES = SOLID, DASHED, DOTTED  # of the recordings, as long as they are no more
MS = 1e3
NUMBERS = ("t_c_s", "t_p_s", "t_o_s", "input_torque_high_nm", "input_torque_low_nm", "output_speed_low_rpm", "k", "e_loss_j")


def figures_of_compare(found: Comparison, pages: Pages) -> list[Description]:
    """Return a figure for each shift; without any, one of the whole run.

    Parameters
    ----------
    found : Comparison
        The comparison.
    pages : Pages
        The pages of the first recording's rig.
    """
    return [_of_shift(found, one, pages) for one in found.shifts] or [_of_run(found, pages)]


def _of_shift(found: Comparison, shift: ShiftCurves, pages: Pages) -> Description:
    assert pages.box is not None
    first = next(row for row in shift.rows if row)
    way = pages.box.way(first["from_gear"], first["to_gear"], " → ")
    panels = _panels(shift.time * MS, shift.values, short_names(found.names), pages)
    moments = [Moment(0.0, "①", "order")]
    if first["t_c_s"] is not None:
        moments.append(Moment(MS * first["t_c_s"], "②", f"lock-up of {short_names(found.names)[0]}"))
    column = Column(MS * shift.time[0], MS * shift.time[-1], "time after each recording's own order [ms]")
    title = f"Shift {shift.number}, {way}: {len(found.names)} recordings from their own orders"
    numbers = _numbers(found, shift, pages) if len(found.names) == 2 else ()
    return Description(title, _names(found), "", "", (column,), panels, (), tuple(moments), numbers)


def _of_run(found: Comparison, pages: Pages) -> Description:
    curves = {one.name: one.values for one in found.curves}
    time = max((one.time for one in found.curves), key=len, default=np.array([0.0, 1.0]))
    same = {name: values for name, values in curves.items() if len(values[0]) == len(time)}
    column = Column(float(time[0]), float(time[-1]), "time of the first recording [s]")
    title = f"{len(found.names)} recordings on the first one's clock"
    return Description(title, _names(found), "", "", (column,), _panels(time, same, short_names(found.names), pages))


def _names(found: Comparison) -> str:
    styles = ("solid", "dashed", "dotted")
    names = short_names(found.names)
    return ", ".join(f"{style}: {name}" for style, name in zip(styles, names)) if len(names) <= len(styles) else ""


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
                text = "" if few and n else name if few else names[n]
                over.append(Curve(name, text, text, colour, style, time, y))
                if n:
                    apart.append(Curve(name, text or name, text or name, colour, style, time, y - shown_values[0]))
        if over and any(np.isfinite(one.y).any() for one in over):
            unit = pages.signal(signals[0]).display_unit
            panels.append(Panel(title, unit, tuple(over)))
            if any(np.isfinite(one.y).any() for one in apart):
                panels.append(Panel("less the first", unit, tuple(apart)))
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
        errors = f" = {abs(row['in_errors']):.1f} errors" if row["in_errors"] is not None else ""
        apart = "within its error" if change.startswith("<") else f"{'' if change.startswith('-') else '+'}{change}{errors}"
        unit = "" if one.unit == "-" else f" {one.shown_unit}"
        numbers.append(Number(one.key, one.named(pages.box), value + unit, apart, None))
    return tuple(numbers)
