# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of chapters 7 to 9 that can be redrawn from the thesis's text, drawn from the rig's records.

Used by the verb ``validate``. The laboratory's points are lost; what the text still says of them is drawn as a band or
as the printed curve.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import pi

import numpy as np

from rig_nodes.studies import Target
from rig_nodes.view import Description, Line, chart

from .evaluate import curve
from .records import Record, group, shown
from .targets import load_targets

RPM = pi / 30.0
MOST_MARKS = 50  # points of a line that are marked at most; a line with more is drawn without marks
AXES = {  # condition or quantity -> (name with unit, factor from SI)
    "n_wej": ("n_wej [rpm]", 1.0 / RPM),
    "m_wyj": ("M_wyj before the shift [Nm]", 1.0),
    "series": ("series", 1.0),
    "t12": ("t12 [ms]", 1e3),
    "t21": ("t21 [ms]", 1e3),
    "time": ("time [s]", 1.0),
    "surfaces": ("surfaces", 1.0),
    "pressure": ("surface pressure [MPa]", 1e-6),
    "t_dt_s": ("t_dt [s]", 1.0),
    "t_p_s": ("t_p [s]", 1.0),
    "t_c_s": ("t_c [s]", 1.0),
    "t_o_s": ("t_o [s]", 1.0),
    "input_torque_max_nm": ("highest M_wej [Nm]", 1.0),
    "output_speed_min_rpm": ("lowest n_wyj [rpm]", 1.0 / RPM),
    "k": ("k", 1.0),
    "e_loss_j": ("E_loss over t_dt [J]", 1.0),
    "e_loss_settled_j": ("E_loss until settled [J]", 1.0),
    "engagement_s": ("engagement time [s]", 1.0),
    "engagement_peak_nm": ("highest M_wej [Nm]", 1.0),
    "hold_s": ("hold phase t_O [s]", 1.0),
    "w_wej": ("w_wej [rad/s]", 1.0),
    "p1_mpa": ("p1 [MPa]", 1e-6),
    "p2_mpa": ("p2 [MPa]", 1e-6),
    "k_kor": ("k_kor", 1.0),
    "m_eks": ("torque at slip [Nm]", 1.0),
    "s": ("deflection s [mm]", 1e3),
    "spring_force_n": ("F_s [N]", 1.0),
    "cylinder_force_n": ("F_p [N]", 1.0),
}


@dataclass(frozen=True)
class _Plan:
    """The plan of one figure: a quantity over a condition, with a line for each value of ``by``.

    ``where`` holds the conditions that choose records, ``target`` the row whose ends or curve are drawn too.
    """

    name: str
    title: str
    procedure: str
    quantity: str
    over: str
    by: str | None = None
    where: tuple[tuple[str, object], ...] = ()
    target: str | None = None
    line: bool = True


def _plans() -> Iterator[_Plan]:
    """Yield the plans of all figures in the order of the thesis."""
    yield from _of_series()
    yield from _of_grids()
    yield from _of_benches()
    yield from _of_chapter_9()


def _of_series() -> Iterator[_Plan]:
    """Yield the figures of chapter 7 on the coast-down, the profiles and the delays."""
    yield _Plan("fig_7_14", "Fig. 7.14: coast-down from 470 rpm", "coast_down", "w_wej", "time", target="coast_down_curve")
    for number, valve in (("15", "ZR-P1"), ("16", "ZR-P2")):
        for part, quantity in zip("abc", ("engagement_s", "hold_s", "engagement_peak_nm")):
            name, title, where = f"fig_7_{number}_{part}", f"Fig. 7.{number}: the series of {valve}", (("valve", valve),)
            yield _Plan(name, title, "profile_series", quantity, "series", where=where, line=False)
    for shift, delay, numbers in (("I-II", "t12", ("21", "22", "23", "24")), ("II-I", "t21", ("27", "28", "29", "30"))):
        quantities = ("input_torque_max_nm", "output_speed_min_rpm", "t_dt_s", "output_speed_min_rpm")
        for number, quantity, over in zip(numbers, quantities, ("series", "series", delay, delay)):
            name, title, where = f"fig_7_{number}", f"Fig. 7.{number}: {shift}, 500 rpm, 60 Nm", (("shift", shift),)
            target = "delay_up_peak_upper" if number == "21" else None
            yield _Plan(name, title, "delay_series", quantity, over, where=where, line=False, target=target)


def _of_grids() -> Iterator[_Plan]:
    """Yield the figures of chapter 7 on the grids of speed and load."""
    grid = (
        ("35", "grid_up", "t_dt_s", "m_wyj", "up_t_dt_range"),
        ("36", "grid_up", "t_dt_s", "n_wej", None),
        ("37", "grid_up", "t_p_s", "m_wyj", "up_t_p_upper"),
        ("38", "grid_up", "t_c_s", "m_wyj", "up_t_c_upper"),
        ("39", "grid_up", "t_o_s", "m_wyj", "up_t_o_upper_2000"),
        ("40", "grid_up", "input_torque_max_nm", "m_wyj", "up_peak_torque_range"),
        ("41", "grid_up", "k", "m_wyj", None),
        ("42", "grid_up", "e_loss_j", "m_wyj", None),
        ("42_settled", "grid_up", "e_loss_settled_j", "m_wyj", None),
        ("43", "grid_up", "e_loss_j", "n_wej", None),
        ("44", "grid_down", "t_dt_s", "m_wyj", "down_t_dt_upper"),
        ("45", "grid_down", "t_p_s", "m_wyj", "down_t_p_range"),
        ("46", "grid_down", "t_c_s", "m_wyj", "down_t_c_upper"),
        ("47", "grid_down", "t_o_s", "m_wyj", "down_t_o_lower"),
        ("48", "grid_down", "input_torque_max_nm", "m_wyj", None),
        ("49", "grid_down", "k", "m_wyj", "down_k_lower"),
        ("50", "grid_down", "e_loss_j", "m_wyj", None),
        ("50_settled", "grid_down", "e_loss_settled_j", "m_wyj", None),
    )
    for number, procedure, quantity, over, target in grid:
        title = f"Fig. 7.{number.split('_')[0]}: {'I to II' if procedure == 'grid_up' else 'II to I'}"
        by = "n_wej" if over == "m_wyj" else "m_wyj"
        yield _Plan(f"fig_7_{number}", title, procedure, quantity, over, by=by, target=target)


def _of_benches() -> Iterator[_Plan]:
    """Yield the figures of chapter 8."""
    for number, ring, thickness, quantity, over, by in (
        ("11", "80x115", 2e-3, "k_kor", "surfaces", "model"),
        ("13", "80x115", 1.5e-3, "k_kor", "surfaces", "model"),
        ("15", "80x115", 1e-3, "k_kor", "surfaces", "model"),
        ("17", "80x101.9", 2e-3, "k_kor", "surfaces", "model"),
        ("19", "65x115", 2e-3, "k_kor", "surfaces", "model"),
        ("22", "50x76", None, "k_kor", "surfaces", "model"),
        ("10", "80x115", 2e-3, "m_eks", "pressure", "surfaces"),
        ("12", "80x115", 1.5e-3, "m_eks", "pressure", "surfaces"),
        ("14", "80x115", 1e-3, "m_eks", "pressure", "surfaces"),
        ("16", "80x101.9", 2e-3, "m_eks", "pressure", "surfaces"),
        ("18", "65x115", 2e-3, "m_eks", "pressure", "surfaces"),
        ("20", "46x88.9", 2.5e-3, "m_eks", "pressure", "surfaces"),
        ("21", "50x76", None, "m_eks", "pressure", "surfaces"),
    ):
        where = (("ring", ring),) + ((("thickness", thickness),) if thickness else ())
        title = f"Fig. 8.{number}: {'k_kor' if quantity == 'k_kor' else 'M_eks'} of {ring}"
        yield _Plan(f"fig_8_{number}", title, "clutch_bench", quantity, over, by=by, where=where)
    springs, cylinder = "Fig. 8.8: springs of the bench", "Fig. 8.9: cylinder of the bench"
    yield _Plan("fig_8_8", springs, "spring_bench", "spring_force_n", "s", target="spring_force_curve")
    yield _Plan("fig_8_9", cylinder, "spring_bench", "cylinder_force_n", "pressure", target="cylinder_force_curve")


def _of_chapter_9() -> Iterator[_Plan]:
    """Yield the figures of chapter 9."""
    for number, shift, quantity in (
        ("5", "I-II", "input_torque_max_nm"),
        ("6", "II-I", "input_torque_max_nm"),
        ("7", "I-II", "t_p_s"),
        ("8", "II-I", "t_p_s"),
    ):
        for rpm in (1200, 1500):
            name, title = f"fig_9_{number}_{rpm}", f"Fig. 9.{number}: {shift}, {rpm} rpm, rig and simulation"
            where = (("shift", shift), ("n_wej", rpm * RPM))
            yield _Plan(name, title, "chapter9", quantity, "m_wyj", by="source", where=where)
    for number, procedure in (("3", "grid_up"), ("4", "grid_down")):
        for gear in (1, 2):
            name, title = f"fig_9_{number}_p{gear}", f"Fig. 9.{number}: p{gear}, 1500 rpm"
            where, target = (("n_wej", 1500.0 * RPM),), f"ch9_pressure_{procedure.removeprefix('grid_')}_p{gear}"
            yield _Plan(name, title, procedure, f"p{gear}_mpa", "time", by="m_wyj", where=where, target=target)


def figures(records: list[Record]) -> Iterator[tuple[str, Description]]:
    """Draw every figure for which there are records.

    Parameters
    ----------
    records : list of Record
        The rig's records.

    Yields
    ------
    name : str
        Name of the file without its ending.
    figure : Description
        The figure.
    """
    targets = {target.id: target for target in load_targets()}
    for plan in _plans():
        found = [
            r
            for r in records
            if r.procedure == plan.procedure
            and plan.over in r.conditions
            and isinstance(r.values.get(plan.quantity), float)
            and "phase" not in r.conditions
            and ("time" in r.conditions) == (plan.over == "time")
            and r.conditions.get("m_wyj") != 0.0  # the laboratory measured nothing without load
            and all(shown(name, r.conditions.get(name, "")) == shown(name, value) for name, value in plan.where)
        ]
        if found:
            yield plan.name, _figure(plan, found, targets.get(plan.target))


def _figure(plan: _Plan, found: Iterable[Record], target: Target | None) -> Description:
    (x_name, x_factor), (y_name, y_factor) = AXES[plan.over], AXES[plan.quantity]
    lines: list[Line] = []
    for key, members in group(found, [plan.by] if plan.by else []):
        points = sorted((r.conditions[plan.over] * x_factor, r.values[plan.quantity] * y_factor) for r in members)
        name = shown(plan.by, key[plan.by]) if plan.by else "rig"
        name = {"measured": "rig", "simulated": "chapter 9"}.get(name, name)
        dense = len(points) > MOST_MARKS
        lines.append(Line(name, *map(list, zip(*points)), line=plan.line, marks=not dense))
    if target is not None and target.pieces:
        x = np.linspace(target.pieces[0][0], target.pieces[-1][1], 400)
        lines.append(Line("printed", x, curve(target, x), marks=False, dashed=True))
    elif target is not None:
        low, high = (None if end is None else end * y_factor for end in (target.low, target.high))
        return chart(plan.title, x_name, y_name, lines, (low, high))
    return chart(plan.title, x_name, y_name, lines)
