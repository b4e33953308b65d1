# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws the pictures of docs/rigs/chain_saw.md, chain_saw_*.svg, beside itself, from calculations and runs of the rig.

Run `.venv/bin/python docs/pictures/chain_saw.py`.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from rig_nodes.plant.parts.centrifugal_clutch import clutch_torque
from rig_nodes.plant.parts.combustion_engine import full_torque
from rig_nodes.plant.parts.saw_chain import chain_inertia
from rig_nodes.rig.configuration import RigConfig, load_rig
from rig_nodes.runs.calculations import Recorded, calculations_of, of_run
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.view import Description, Line, chart, write_charts

HERE, RIG = Path(__file__).parent, "chain_saw"
WORN = {"clutch.shoe_mass": "41.07 g"}
MEAN = 3.20  # Nm: M_o of the paper


def ran(name: str, settings: dict[str, str] | None = None) -> tuple[RigConfig, Recorded]:
    """A run of a sequence without errors of meters, with its rig."""
    config = load_rig(RIG, {"effects.transducers": "off", **(settings or {})})
    return config, of_run(record(config, load_sequence(name, rig=RIG)), config)


def line(name: str, x: np.ndarray, y: np.ndarray, dashed: bool = False) -> Line:
    """A line."""
    return Line(name, [round(float(v), 4) for v in x], [round(float(v), 4) for v in y], marks=False, dashed=dashed)


def marks(name: str, x: np.ndarray, y: np.ndarray) -> Line:
    """Points without a line."""
    return Line(name, [round(float(v), 4) for v in x], [round(float(v), 4) for v in y], line=False)


def turns(run: Recorded) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of the turns in wood and their angle from the upper dead centre [rad], the first 1.5 s of the cut left out."""
    w, feed = run["n_engine"], run["F_feed"]
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(run.t))])
    starts = np.flatnonzero(np.diff(np.floor(angle / (2.0 * np.pi))) > 0) + 1
    first = run.t[np.argmax(feed > 54.0)] + 1.5
    cut = [(b, e) for b, e in pairwise(starts) if run.t[b] > first and feed[e] > 54.0]
    return [(np.arange(b, e), angle[b:e] - 2.0 * np.pi * np.floor(angle[b] / (2.0 * np.pi))) for b, e in cut]


def characteristics() -> Description:
    """Torque of the engine and of the clutch over the speed: fig. 2 of the paper."""
    w = np.linspace(300.0, 1250.0, 191)
    series = []
    for name, settings in (("clutch, new", {}), ("clutch, worn", WORN), ("clutch, 63 g", {"clutch.shoe_mass": "63 g"})):
        clutch = load_rig(RIG, settings).clutch
        series.append(line(name, w, np.array([clutch_torque(clutch, one) for one in w])))
    engine = load_rig(RIG).engine
    series.append(line("engine, open throttle", w, np.array([full_torque.py_func(one, engine) for one in w])))
    series.append(marks("printed", np.array([347.0, 376.0, 950.0, 950.0, 950.0, 838.0]), np.array([0, 0, 10.23, 8.61, 13.31, 3.4])))
    return chart("Clutch and engine over the speed of the crank", "speed [rad/s]", "torque [Nm]", series)


def one_turn(config: RigConfig, run: Recorded) -> Description:
    """A turn that slips: the torque that the paper asks for, what the clutch carries, and the torque of the run."""
    found = turns(run)
    inertia = config.drum.inertia + chain_inertia(config.chain)
    # the turn with the largest irregularity, with half a turn before it
    best = max(range(2, len(found) - 1), key=lambda k: float(np.ptp(run["n_engine"][found[k][0]])))
    w = run["n_engine"]
    last = found[best][0]
    rows = np.arange(last[0] - 40, last[-1] + 41)
    mean = float(w[last].mean())
    delta = float((w[last].max() - w[last].min()) / (w[last].max() + w[last].min()))
    degrees = np.degrees(np.interp(rows, last, found[best][1], left=np.nan, right=np.nan))
    degrees = np.where(rows < last[0], (rows - last[0]) * 1e-4 * mean * 180 / np.pi, degrees)
    degrees = np.where(rows > last[-1], 360.0 + (rows - last[-1]) * 1e-4 * mean * 180 / np.pi, degrees)
    at = np.radians(degrees)
    asked = inertia * delta * mean**2 * np.cos(at) + MEAN * (1.0 - np.cos(at))
    capacity = np.array([clutch_torque(config.clutch, one) for one in w[rows]])
    return chart(
        "A turn that slips, worn shoes: static condition (13) and run",
        "angle of the crank from the upper dead centre [deg]",
        "torque [Nm]",
        [
            line("asked by (13)", degrees, asked, dashed=True),
            line("carried by (5)", degrees, capacity, dashed=True),
            line("clutch in the run", degrees, run["M_clutch"][rows]),
            line("chain in the run", degrees, run["M_chain"][rows]),
            line("slip [10 rad/s]", degrees, 0.1 * (run["n_engine"] - run["n_drum"])[rows]),
        ],
    )


def scatter(config: RigConfig, run: Recorded) -> Description:
    """Each turn by its irregularity and its largest torque of the clutch, with the line of (11)."""
    inertia, points = config.drum.inertia + chain_inertia(config.chain), []
    slip = np.abs(run["n_engine"] - run["n_drum"]) > 1.0
    onset = slip & ~np.concatenate([[True], slip[:-1]])
    for rows, _ in turns(run):
        w = run["n_engine"][rows]
        points.append(((w.max() - w.min()) / (w.max() + w.min()), run["M_clutch"][rows].max(), onset[rows].any()))
    delta, torque, slips = (np.array(one) for one in zip(*points))
    x = np.array([0.0, 0.085])
    capacity = clutch_torque(config.clutch, 945.0)
    return chart(
        "Turns of a cut, worn shoes: scatter of combustion and wood",
        "irregularity of the turn [-]",
        "largest torque of the clutch [Nm]",
        [
            marks("no slip", delta[~slips], torque[~slips]),
            marks("a slip begins", delta[slips], torque[slips]),
            line("inertia alone, (11)", x, inertia * x * 945.0**2, dashed=True),
            line("clutch (5), 945 rad/s", x, np.full(2, capacity), dashed=True),
        ],
    )


def shares() -> Description:
    """Share of turns that slip over the bar's length, static, in runs and printed."""
    table = calculations_of(RIG)["slips"].table(load_rig(RIG))
    bars, series = (13, 15, 18, 20), []
    for name, settings in (("new", {}), ("worn", WORN)):
        static = [100.0 * table.cell({"shoes": name, "bar": bar}, "share") for bar in bars]
        series.append(line(f"{name}, (13)", np.array(bars), np.array(static)))
        found = []
        for bar in bars:
            config, run = ran("cut", {**settings, "chain.bar": f"{bar} in"})
            found.append(100.0 * calculations_of(RIG)["cut"].table(config, run).cell({}, "slipping"))
        series.append(marks(f"{name}, run", np.array(bars), np.array(found)))
    series.append(marks("printed", np.array([13, 15, 15]), np.array([2.36, 3.8, 14.1])))
    return chart("Share of turns that slip over the length of the bar", "bar [in]", "share of turns [%]", series)


def losses() -> Description:
    """Loss by slip over the bar's length with new shoes, by each definition and printed."""
    table = calculations_of(RIG)["slips"].table(load_rig(RIG))
    bars, series = (13, 15, 18, 20), []
    names = {
        "excess_of_mean": "excess over M_o",
        "slip_time": "time",
        "excess_of_peak": "excess over peak",
        "excess_over_turn": "mean excess",
        "slip_work": "work of slip",
    }
    for column, name in names.items():
        values = [100.0 * table.cell({"shoes": "new", "bar": bar}, column) for bar in bars]
        series.append(line(name, np.array(bars), np.array(values)))
    found = []
    for bar in bars:
        config, run = ran("cut", {"chain.bar": f"{bar} in"})
        found.append(100.0 * calculations_of(RIG)["cut"].table(config, run).cell({}, "loss"))
    series.append(marks("run", np.array(bars), np.array(found)))
    series.append(marks("printed", np.array([13, 15, 20]), np.array([0.75, 1.32, 4.14])))
    return chart("Loss by slip with new shoes, by each definition", "bar [in]", "loss [%]", series, log=(False, True))


def draw() -> None:
    """Write all pictures."""
    config, run = ran("cut", WORN)
    figures = {
        "clutch": characteristics(),
        "turn": one_turn(config, run),
        "scatter": scatter(config, run),
        "shares": shares(),
        "losses": losses(),
    }
    write_charts(((f"chain_saw_{name}", figure) for name, figure in figures.items()), HERE)


if __name__ == "__main__":
    draw()
