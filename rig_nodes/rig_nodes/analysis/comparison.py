# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report lines that compare the plain metrics with Annex A's recipe and with the states of the plant.

analysis.run_report uses them. They only format results.
"""

from __future__ import annotations

from ..rig import Transmission
from .display import aligned
from .metrics import ANNEX, Metric, named_metrics
from .plant_states import WHY_NOT

MEASURED = ("t_c_s", "input_torque_max_nm", "output_speed_min_rpm", "k")  # metrics beside the truth


def annex_lines(names: list[str], rows: list[dict], errors: list[dict], annex: dict, box: Transmission) -> list[str]:
    """Return for each shift a table of plain definition, Annex A and their difference, then what Annex A did not give.

    Parameters
    ----------
    names : list of str
        Names of the shifts.
    rows : list of dict
        Plain metrics of the shifts.
    errors : list of dict
        Their largest errors.
    annex : dict
        The report's part on Annex A.
    box : Transmission
        The transmission.

    Returns
    -------
    list of str
        The lines.
    """
    lines = [f"Annex A's recipe beside the plain definitions (factor {annex['factor']:g}):"]
    columns = named_metrics(ANNEX)
    for name, row, own, other in zip(names, rows, errors, annex["shifts"]):
        table = [[name, *(one.heading(box) for one in columns)]]
        table += [
            [title, *(one.cell(values, own) for one in columns)] for title, values in (("  plain", row), ("  Annex A", other))
        ]
        table.append(["  difference", *(_difference(row[one.key], other[one.key], one) for one in columns)])
        lines += aligned(table) + [f"  not by Annex A: {reason}" for reason in other["why"]]
    return lines


def truth_lines(names: list[str], rows: list[dict], errors: list[dict], truths: list[dict | None], box: Transmission) -> list[str]:
    """Return for each shift the values from the plant's states, beside the measured value where there is one."""
    lines = ["plant truth (states at 200 Hz, no transducers), measured in brackets:"]
    if not any(truths):
        return [lines[0], "  this recording holds no states of a plant that cover a shift"]
    measured = [one for one in named_metrics() if one.key in MEASURED]
    for name, row, own, truth in zip(names, rows, errors, truths):
        if truth is None:
            lines.append(f"  {name}: the engaging clutch never locked, or the states do not cover it")
            continue
        time, torque, speed, k = (one.cell(row, own) for one in measured)
        pairs = [
            f"order to lock-up {truth['t_lock_s'] * 1e3:.0f} ms ({time})",
            f"{box.input.torque} max {truth['input_torque_max_nm']:.1f} Nm ({torque})",
        ]
        if truth["output_speed_min_rpm"] is not None:
            pairs.append(f"{box.output.speed} min {truth['output_speed_min_rpm']:.0f} rpm ({speed})")
        if truth["k"] is not None:
            pairs.append(f"k {truth['k']:.3f} ({k})")
        clutches = [
            f"{clutch.name}: heat {truth[f'{clutch.heat}_j']:.0f} J, highest torque {truth[f'torque_{clutch.key}_max_nm']:.0f} Nm"
            for clutch in box.clutches
        ]
        lines += [f"  {name}: {', '.join(pairs)}", f"    {'; '.join(clutches)}"]
    return [*lines, f"  not from states: {WHY_NOT}"]


def _difference(plain: float | None, other: float | None, metric: Metric) -> str:
    return "" if plain is None or other is None else f"{(other - plain) * metric.factor:+z.{metric.digits}f}"
