# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report lines that compare the plain metrics with Annex A's recipe and with the states of the plant.

analysis.report uses them. They only format results.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..rig.transmission import Transmission
from .course import COURSE_KEYS
from .plant_states import WHY_NOT
from .shown import in_unit, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

MEASURED = (("input_torque_max_nm", 1), ("output_speed_min_rpm", 0), ("k", 3))  # metrics beside the truth, and their digits


def annex_lines(
    columns: Sequence[tuple[str, str, float, int]], names: list[str], rows: list[dict], errors: list[dict], annex: dict
) -> list[str]:
    """Return for each shift a table of plain definition, Annex A and their difference, then what Annex A did not give.

    Parameters
    ----------
    columns : sequence of (str, str, float, int)
        (heading, key, factor, digits) of the metrics.
    names : list of str
        Names of the shifts.
    rows : list of dict
        Plain metrics of the shifts.
    errors : list of dict
        Their largest errors.
    annex : dict
        The report's part on Annex A.

    Returns
    -------
    list of str
        The lines.
    """
    lines = [f"Annex A's recipe beside the plain definitions (factor {annex['factor']:g}):"]
    columns = [one for one in columns if one[1] not in ("overlap_s", *COURSE_KEYS)]  # the recipe does not contain these
    for name, row, own, other in zip(names, rows, errors, annex["shifts"]):
        table = [[name, *(heading for heading, *_ in columns)]]
        for title, one in (("  plain", row), ("  Annex A", other)):
            table.append([title, *(_cell(one[key], own.get(key), factor, digits) for _, key, factor, digits in columns)])
        table.append(["  difference", *(_difference(row[key], other[key], factor, digits) for _, key, factor, digits in columns)])
        lines += _aligned(table) + [f"  not by Annex A: {reason}" for reason in other["why"]]
    return lines


def truth_lines(names: list[str], rows: list[dict], errors: list[dict], truths: list[dict | None], box: Transmission) -> list[str]:
    """Return for each shift the values from the plant's states, beside the measured value where there is one."""
    lines = ["plant truth (states at 200 Hz, no transducers), measured in brackets:"]
    if not any(truths):
        return [lines[0], "  this recording holds no states of a plant that cover a shift"]
    for name, row, own, truth in zip(names, rows, errors, truths):
        if truth is None:
            lines.append(f"  {name}: the engaging clutch never locked, or the states do not cover it")
            continue
        torque, speed, k = (_cell(row[key], own.get(key), 1.0, digits) for key, digits in MEASURED)
        pairs = [
            f"order to lock-up {truth['t_lock_s'] * 1e3:.0f} ms ({_cell(row['t_c_s'], own.get('t_c_s'), 1e3, 0)})",
            f"{box.input.torque} max {truth['input_torque_max_nm']:.1f} Nm ({torque})",
            f"{box.output.speed} min {truth['output_speed_min_rpm']:.0f} rpm ({speed})",
        ]
        if truth["k"] is not None:
            pairs.append(f"k {truth['k']:.3f} ({k})")
        clutches = [
            f"{clutch.name}: heat {truth[f'{clutch.heat}_j']:.0f} J, highest torque {truth[f'torque_{clutch.key}_max_nm']:.0f} Nm"
            for clutch in box.clutches
        ]
        lines += [f"  {name}: {', '.join(pairs)}", f"    {'; '.join(clutches)}"]
    return [*lines, f"  not from states: {WHY_NOT}"]


def _cell(value: float | None, error: float | None, factor: float, digits: int) -> str:
    return shown(*in_unit(value, error, factor), digits)


def _difference(plain: float | None, other: float | None, factor: float, digits: int) -> str:
    return "" if plain is None or other is None else f"{(other - plain) * factor:+z.{digits}f}"


def _aligned(table: list[list[str]]) -> list[str]:
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    return [
        "  ".join(cell.ljust(width) if i == 0 else cell.rjust(width) for i, (cell, width) in enumerate(zip(line, widths)))
        for line in table
    ]
