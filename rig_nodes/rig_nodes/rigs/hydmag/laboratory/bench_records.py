# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of the clutch bench (8.1.6) and of the spring and cylinder benches (8.1.4), from the runs of these benches.

Used by rigs.hydmag.laboratory.programme; the evaluation itself is analysis.slip_bench. The friction of chapter 8 is not printed:
STATED holds the values that reproduce its comparison of models (docs/background/friction_models.md). With them the rig's packs
follow the thesis's model, so k_kor against that model is 1 within the errors of the instruments; what is compared are
the results of the other models for the same packs.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from rig_nodes.analysis import MODELS, cylinder_line, of_press, ring_area, slip_line, slip_tests, spring_line
from rig_nodes.plant import SPRING_TRAVEL, clamp_force, slip_torques
from rig_nodes.rig import RigConfig, load_rig

from .packs import PACKS
from .records import Record

if TYPE_CHECKING:
    from rig_nodes.runs import Run

# friction [-] of the lined and the steel plates and of all splines; inferred from the thesis, not measured
STATED = {"lined": 0.30, "steel": 0.12, "spline": 0.058}
SETTINGS = 0.5e6  # Pa between two settings of p_z in the series
ALLOWED_PRESSURE = 3e6  # Pa on the plates, thesis 3.3; 8.4 extrapolates to it
GOOD = 0.10  # chapter 8 calls up to 10 % a good agreement


def friction_of(ring: str) -> float:
    """Return the static friction [-] of the plates of a ring."""
    return STATED["lined" if ring == "50x76" else "steel"]


def clutch_bench(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of one pack: m_eks, model_torque_nm, k_kor, k_kor_error, m_eks_trend_above_nm and m_rest_nm.

    M_eks is recorded at the surface pressure that was set; the fitted line is that over the measured pressures.

    Parameters
    ----------
    conditions : dict
        ring, surfaces and, except for the gearbox's plates, thickness [m].
    run : Run
        The recorded run.

    Returns
    -------
    list of list of Record
        One repeat with its records.
    """
    geometry = PACKS[conditions["ring"]].geometry(conditions["surfaces"])
    friction, area = friction_of(conditions["ring"]), ring_area(geometry)
    tests = slip_tests(of_press(_bench().structure, run.recording), geometry)
    line = slip_line(tests, geometry, friction, STATED["spline"])
    force = np.array([set_force(round(test["cylinder_pa"] / SETTINGS) * SETTINGS) for test in tests])
    pressure = force / area
    records = [
        Record("clutch_bench", {**conditions, "pressure": float(p)}, {"m_eks": test["m_eks_nm"]})
        for p, test in zip(pressure, tests)
    ]
    records.append(Record("clutch_bench", conditions, {"m_rest_nm": line["m_rest_nm"]}))
    torques = slip_torques(geometry, force, friction, STATED["spline"])
    full = slip_torques(geometry, ALLOWED_PRESSURE * area, friction, STATED["spline"])
    for model in MODELS:
        k_kor, named = line["k_kor"][model], {**conditions, "model": model}
        records.append(
            Record(
                "clutch_bench",
                named,
                {"k_kor": k_kor, "k_kor_error": abs(k_kor - 1.0), "model_torque_nm": float(np.asarray(torques[model])[-1])},
            )
        )
        for p, torque in [*zip(pressure, torques[model]), (ALLOWED_PRESSURE, full[model])]:
            above = line["slope_nm_per_pa"] * p + line["m_rest_nm"] - torque
            records.append(Record("clutch_bench", {**named, "pressure": float(p)}, {"m_eks_trend_above_nm": float(above)}))
    return [records]


@cache
def _bench() -> RigConfig:
    """The bench with whose names the force benches record, too."""
    return load_rig("clutch_bench")


def set_force(pressure: float) -> float:
    """Return the clamp force [N] of the bench at a pressure p_z [Pa] by (8.3), with the travel by which the pack yields."""
    cylinder: Any = _bench().cylinder
    return brentq(lambda force: force - clamp_force(pressure, cylinder.contact_travel + force / cylinder.contact_rate), 0.0, 1e4)


def off_in_most(records: list[Record]) -> list[Record]:
    """Return for each model the class of k_kor over all packs, once for every ring so that a row may ask for any of them.

    Parameters
    ----------
    records : list of Record
        The records of all packs.

    Returns
    -------
    list of Record
        Records with k_kor "off in most" or "close in most".
    """
    out = []
    for model in MODELS:
        off = [
            r.values["k_kor_error"] > GOOD
            for r in records
            if r.conditions.get("model") == model and r.values.get("k_kor_error") is not None
        ]
        word = "off in most" if 2 * sum(off) > len(off) else "close in most"
        out += [Record("clutch_bench", {"ring": ring, "model": model}, {"k_kor": word}) for ring in PACKS]
    return out


def spring_bench(_conditions: dict, run: Run) -> list[list[Record]]:
    """Return the forces of the springs over their travel ``s``, or of the cylinder over its pressure and where its force begins.

    A run with oil is that of the cylinder, because the testing machine of the springs needs none.

    Parameters
    ----------
    _conditions : dict
        Not used.
    run : Run
        The recorded run.

    Returns
    -------
    list of list of Record
        One repeat with its records.
    """
    logged = of_press(_bench().structure, run.recording)
    if np.max(logged.channels["pressure"]) < SETTINGS:
        travels = np.linspace(0.0, SPRING_TRAVEL, 81)
        return [
            [
                Record("spring_bench", {"s": float(s)}, {"spring_force_n": float(f)})
                for s, f in zip(travels, spring_line(logged, travels))
            ]
        ]
    pressure, force = cylinder_line(logged)
    records = [Record("spring_bench", {"pressure": float(p)}, {"cylinder_force_n": float(f)}) for p, f in zip(pressure, force)]
    begins = min(root for root in np.roots(np.polyfit(pressure, force, 2)).real if root > 0.0)
    return [[*records, Record("spring_bench", {}, {"cylinder_start_mpa": float(begins)})]]
