# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of the clutch bench (thesis 8.1.6, 8.2.3, (8.3)-(8.6)): torque at slip, its line, k_kor and M_rest.

analysis.run_report and the validation use it. It needs only the logger's channels, as the laboratory did, named by what they show:
press_bench.of_press. The evaluations of the spring and the cylinder bench (8.2.1, 8.2.2) are here, too.
"""

from __future__ import annotations

from math import pi

import numpy as np

from ..bags import Logged
from ..base import RigError
from ..plant import SPRING_TRAVEL, PackGeometry, clamp_force, slip_torques
from .edges import running_mean

NEEDED = ("torque", "speed", "pressure", "travel")
CLAMPED = 0.3e6  # Pa in the cylinder, above which the pack counts as clamped
SLIPS = 0.2  # rad/s, two steps of the speed sensor
TORQUE_MEAN = 2e-3  # s; the laboratory's 20 samples (Annex A)
PRESSURE_MEAN = 20e-3  # s
BEFORE = 0.1  # s before the slip over which pressure and travel are averaged
SETTLE, STAY = 0.3, 0.5  # s between a change of pressure and a step of the cylinder bench, and length of the step
AFTER = 20e-3  # s, the speed sensor's gate: the torque peak may lie up to this time after the speed shows the slip
MODELS = ("thesis", "osinski", "traditional")
LEAST_TESTS = 3  # smallest number of tests for a line


def slip_tests(logged: Logged, pack: PackGeometry) -> list[dict]:
    """Return one row for each clamping in which the pack slipped.

    Parameters
    ----------
    logged : Logged
        The bench's channels.
    pack : PackGeometry
        The clutch pack.

    Returns
    -------
    list of dict
        ``t_slip_s, cylinder_pa, s_m, clamp_n, pressure_pa, m_eks_nm``. m_eks_nm: largest torque before the slip; clamp_n: F_p -
        F_s, (8.3), of the cylinder's mean pressure and travel in the 100 ms before it; pressure_pa: pressure on the friction ring.

    Raises
    ------
    RigError
        When a channel is missing.
    """
    lacking = [name for name in NEEDED if name not in logged.channels]
    if lacking:
        raise RigError(f"the recording has no channel of {', '.join(lacking)}; slip tests need {', '.join(NEEDED)}")
    rows_in = {
        name: max(1, round(time / logged.period))
        for name, time in (("torque", TORQUE_MEAN), ("pressure", PRESSURE_MEAN), ("before", BEFORE), ("after", AFTER))
    }
    torque = running_mean(logged.channels["torque"], rows_in["torque"])
    pressure = running_mean(logged.channels["pressure"], rows_in["pressure"])
    speed, travel = logged.channels["speed"], logged.channels["travel"]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], pressure > CLAMPED, [False]]).astype(int)))
    out = []
    for first, end in edges.reshape(-1, 2):
        slipping = np.flatnonzero(speed[first:end] > SLIPS)
        if not len(slipping):
            continue  # clamped, but the torque did not reach the pack's capacity
        peak = first + int(np.argmax(torque[first : min(end, first + slipping[0] + rows_in["after"])]))
        before = slice(max(first, peak - rows_in["before"]), peak + 1)
        cylinder, s = float(np.mean(logged.channels["pressure"][before])), float(np.mean(travel[before]))
        clamp = clamp_force(cylinder, min(max(s, 0.0), SPRING_TRAVEL))
        out.append(
            {
                "t_slip_s": float(logged.t0 + peak * logged.period),
                "cylinder_pa": cylinder,
                "s_m": s,
                "clamp_n": float(clamp),
                "pressure_pa": float(clamp) / ring_area(pack),
                "m_eks_nm": float(torque[peak]),
            }
        )
    return out


def ring_area(pack: PackGeometry) -> float:
    """Return the area A [m2] of one friction surface, (6.28)."""
    return pi * (pack.outer_radius**2 - pack.inner_radius**2)


def slip_line(tests: list[dict], pack: PackGeometry, friction: float, friction_spline: float) -> dict:
    """Fit M_eks = a p + M_rest by least squares, (8.4), and compute k_kor for each of MODELS, (8.5), (8.6).

    Parameters
    ----------
    tests : list of dict
        Rows of :func:`slip_tests`.
    pack : PackGeometry
        The clutch pack.
    friction, friction_spline : float
        Friction coefficients of the models.

    Returns
    -------
    dict
        ``tests, slope_nm_per_pa, m_rest_nm, r_squared, k_kor`` (model -> number).

    Raises
    ------
    RigError
        When there are fewer than three tests, which do not give a line.
    """
    if len(tests) < LEAST_TESTS:
        raise RigError(f"{len(tests)} tests in which the pack slipped; a line needs at least {LEAST_TESTS}")
    pressure, torque = (np.array([test[key] for test in tests]) for key in ("pressure_pa", "m_eks_nm"))
    slope, rest = np.polyfit(pressure, torque, 1)
    off = torque - (slope * pressure + rest)
    per_force = slip_torques(pack, 1.0, friction, friction_spline)
    return {
        "tests": len(tests),
        "slope_nm_per_pa": float(slope),
        "m_rest_nm": float(rest),
        "r_squared": float(1.0 - off @ off / np.sum((torque - torque.mean()) ** 2)),
        "k_kor": {model: float(slope / (per_force[model] * ring_area(pack))) for model in MODELS},
    }


def cylinder_line(logged: Logged) -> tuple[np.ndarray, np.ndarray]:
    """Return pressure and force at the steps of a rising pressure of the cylinder bench, 8.2.2.

    A step is a time of STAY in which the pressure stays within 0.02 MPa, beginning SETTLE after it was reached. Steps of a
    falling pressure, where seals and guide rings hold in the other direction, are left out: (8.2) is read as the line of rising
    pressure.

    Parameters
    ----------
    logged : Logged
        The bench's channels.

    Returns
    -------
    pressure : (n,) array of float
        Pressure in the cylinder [Pa].
    force : (n,) array of float
        F_p [N].
    """
    rows, wide = round(STAY / logged.period), round(SETTLE / logged.period)
    pressure = running_mean(logged.channels["pressure"], max(1, round(PRESSURE_MEAN / logged.period)))
    force = logged.channels["force"]
    found, at = [], 0
    while at + wide + rows <= len(pressure):
        window = pressure[at : at + wide + rows]
        if np.ptp(window) < 0.02e6:
            part = slice(at + wide, at + wide + rows)
            found.append((float(np.mean(logged.channels["pressure"][part])), float(np.mean(force[part]))))
            at += wide + rows
        else:
            at += rows // 10
    rising = [pair for before, pair in zip([(0.0, 0.0), *found], found) if pair[0] > before[0] + CLAMPED / 10.0]
    return np.array([p for p, _ in rising]), np.array([f for _, f in rising])


def spring_line(logged: Logged, travels: np.ndarray) -> np.ndarray:
    """Return F_s at some travels while the springs are pressed, as the mean of the series, 8.2.1.

    Parameters
    ----------
    logged : Logged
        The bench's channels.
    travels : (n,) array of float
        Travels [m].

    Returns
    -------
    (n,) array of float
        F_s [N].

    Raises
    ------
    RigError
        When the springs were not pressed that far.
    """
    s = running_mean(logged.channels["travel"], max(1, round(PRESSURE_MEAN / logged.period)))
    force = running_mean(logged.channels["force"], max(1, round(PRESSURE_MEAN / logged.period)))
    step = max(1, round(0.1 / logged.period))
    rising = np.zeros(len(s), bool)
    rising[:-step] = s[step:] > s[:-step] + 1e-6
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rising, [False]]).astype(int))).reshape(-1, 2)
    lines = [np.interp(travels, s[a:b], force[a:b]) for a, b in edges if s[b - 1] >= np.max(travels) - 30e-6]
    if not lines:
        raise RigError(f"the springs were pressed to {np.max(s) * 1e3:.2f} mm, expected {np.max(travels) * 1e3:.2f} mm")
    return np.mean(lines, axis=0)
