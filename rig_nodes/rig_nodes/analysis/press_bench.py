# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The part of a report for the clutch benches: slip tests with their line, or the line of cylinder or springs.

analysis.run_report uses it; the evaluations themselves are in analysis.slip_bench.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..bags import Logged
from ..base import RigError
from ..plant import PackGeometry
from ..plant import part as parts
from ..rig import Device, Structure, structure_of
from .slip_bench import LEAST_TESTS, cylinder_line, slip_line, slip_tests, spring_line

if TYPE_CHECKING:
    from ..bags import Bag
    from .gathered import Gathered

OF_A_RUN = "run"  # place of a result that does not belong to a single shift, device or model
TRAVELS = np.arange(0.5e-3, 4.01e-3, 0.5e-3)  # m, at which the springs' line is given


def pressed_clutch(structure: Structure) -> tuple[Device, Device] | None:
    """Return the press of a bench and the clutch that it presses; None on any other rig, whose results are its signals' ranges."""
    press = next(iter(structure.of_role(parts.PRESS)), None)
    clutch = next((one for one in structure.clutches if press is not None and one.wires.get("press") == press.name), None)
    return None if press is None or clutch is None else (press, clutch)


def of_press(structure: Structure, logged: Logged) -> Logged:
    """Return a bench's channels by what they show: torque and speed of the clutch; pressure, travel and force of its press.

    Raises
    ------
    RigError
        When no clutch of the rig is pressed.
    """
    found = pressed_clutch(structure)
    if found is None:
        raise RigError("the rig has no press that clamps a clutch, so it gives no slip tests")
    press, clutch = found
    shows = {f"{press.name}.{what}": what for what in ("pressure", "travel", "force")}
    shows[f"{clutch.wires['brakes']}.speed"] = "speed"
    named = {one.name: "torque" if one.type == "torque" else shows.get(one.shows) for one in structure.transducers}
    channels = {what: logged.channels[name] for name, what in named.items() if what and name in logged.channels}
    return Logged(logged.t0, logged.period, channels)


def bench_report(bag: Bag | Gathered, record: Mapping, problems: list[str]) -> dict:
    """Return the results of a run of a bench.

    Parameters
    ----------
    bag : Bag or Gathered
        The recording.
    record : mapping
        Record of the run's rig.
    problems : list of str
        Receives a sentence for each result that the recording does not give.

    Returns
    -------
    dict
        ``slip_tests`` (rows) and ``line`` of a clutch bench; ``cylinder`` or ``springs``, rows of a force bench; nothing for a rig
        without a clutch that is pressed to slip.
    """
    structure = structure_of(record["structure"])
    found = pressed_clutch(structure)
    if found is None:
        return {}
    press, clutch = found
    try:
        logger = bag.logger(fill=True)
        logged = of_press(structure, Logged(logger.t0, logger.period, logger.channels))
        if record[press.name]["testing_machine"]:
            travels = TRAVELS[np.max(logged.channels["travel"]) + 30e-6 >= TRAVELS]
            forces = spring_line(logged, travels) if len(travels) else []
            return {"springs": [{"s_m": float(s), "f_s_n": float(f)} for s, f in zip(travels, forces)]}
        if record["instruments"]["force_fitted"]:
            return {"cylinder": [{"cylinder_pa": float(p), "f_p_n": float(f)} for p, f in zip(*cylinder_line(logged))]}
        plates = record[clutch.wires["plates"]]
        pack = PackGeometry(**{name: plates[name] for name in PackGeometry.__dataclass_fields__})
        tests = slip_tests(logged, pack)
        line = None
        if len(tests) >= LEAST_TESTS:
            line = slip_line(tests, pack, plates["friction_static"], plates["friction_spline"])
        return {"slip_tests": tests, "line": line}
    except RigError as error:
        problems.append(f"no results of the bench: {error}")
        return {}


def bench_numbers(found: Mapping) -> list[tuple[str, str, str, str, int, float]]:
    """Return the results of a bench as (key, name, place, unit, digits, value): k_kor of each model, the lines' numbers."""
    numbers = []
    if line := found.get("line"):
        numbers += [("k_kor", "k_kor", model, "-", 3, value) for model, value in line["k_kor"].items()]
        numbers.append(("slope_nm_per_pa", "slope of M_eks", OF_A_RUN, "Nm/MPa", 2, line["slope_nm_per_pa"] * 1e6))
        numbers.append(("m_rest_nm", "M_rest", OF_A_RUN, "Nm", 2, line["m_rest_nm"]))
        numbers.append(("r_squared", "R2 of the line", OF_A_RUN, "-", 4, line["r_squared"]))
    springs, cylinder = found.get("springs", ()), found.get("cylinder", ())
    numbers += [("f_s_n", "spring force", f"{row['s_m'] * 1e3:.1f} mm", "N", 1, row["f_s_n"]) for row in springs]
    return numbers + [("f_p_n", "cylinder force", f"{row['cylinder_pa'] * 1e-6:.1f} MPa", "N", 1, row["f_p_n"]) for row in cylinder]


def bench_lines(found: dict) -> list[str]:
    """Return the lines for the terminal, in MPa, mm, N and Nm."""
    if "springs" in found:
        return ["s mm    F_s N"] + [f"{row['s_m'] * 1e3:4.1f} {row['f_s_n']:8.1f}" for row in found["springs"]]
    if "cylinder" in found:
        return ["    MPa    F_p N"] + [f"{row['cylinder_pa'] * 1e-6:7.3f} {row['f_p_n']:8.1f}" for row in found["cylinder"]]
    if not found:
        return []  # the report's problems give the reason
    tests = found["slip_tests"]
    if not tests:
        return ["no pack was slipped"]
    lines = ["   t s press MPa    s mm    F_a N    p MPa  M_eks Nm"]
    lines += [
        f"{row['t_slip_s']:6.2f} {row['cylinder_pa'] * 1e-6:9.3f} {row['s_m'] * 1e3:7.3f} {row['clamp_n']:8.1f} "
        f"{row['pressure_pa'] * 1e-6:8.3f} {row['m_eks_nm']:9.2f}"
        for row in tests
    ]
    line = found["line"]
    if line is None:
        return [*lines, f"no line: it takes at least {LEAST_TESTS} tests"]
    k_kor = ", ".join(f"{model} {value:.3f}" for model, value in line["k_kor"].items())
    return [
        *lines,
        f"M_eks = {line['slope_nm_per_pa'] * 1e6:.2f} Nm/MPa p {line['m_rest_nm']:+z.2f} Nm, R2 {line['r_squared']:.4f}",
        f"k_kor against the models: {k_kor}",
    ]
