# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws the pictures of docs/rigs/hydmag_coupling.md, hydmag_coupling_*.svg, beside itself, from calculations and runs of the rig.

Run `.venv/bin/python docs/pictures/hydmag_coupling.py runs/SWEEP`, with the folder of the page's sweep.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.calculations import Recorded, of_run
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.view import Description, Line, chart, write_charts

HERE = Path(__file__).parent
RIG, POINTS = "hydmag_coupling", 1500  # of a line, about
HARD = {"coupling.spring_rate": "1600 N/mm", "coupling.knee_rate": "1600 N/mm"}
ORDERED = "shift_ordered"


def demo(rig: str, settings: dict[str, str]) -> Recorded:
    """A run of the demo without the errors of transducers."""
    config = load_rig(rig, {"effects.transducers": "off", **settings})
    return of_run(record(config, load_sequence("demo", rig=rig)), config)


def line(name: str, x: np.ndarray, y: np.ndarray) -> Line:
    """A line with a limited number of points."""
    every = max(1, len(x) // POINTS)
    kept = slice(None, None, every)
    return Line(name, [round(float(v), 4) for v in x[kept]], [round(float(v), 3) for v in y[kept]], marks=False)


def upshift(runs: dict[str, Recorded]) -> Description:
    """Torque at the gearbox's input around the lock-up of the shift I-II."""
    series = []
    for name, run in runs.items():
        at = [at for at, event, *_ in run.events if event == ORDERED][1]
        part = (run.t >= at + 0.55) & (run.t < at + 0.95)
        series.append(line(name, 1e3 * (run.t[part] - at), run["M_wej"][part]))
    return chart("Shift I-II of the demo: torque behind the coupling", "time since the order [ms]", "M_wej [Nm]", series)


def sweep(folder: Path) -> Description:
    """Largest torque of the upshift and smallest of the downshift over the stiffness of the springs, for each play."""
    rows = pq.read_table(folder / "results.parquet").to_pylist()
    series = []
    for play in sorted({row["coupling.play"] for row in rows}):
        for way, gears, what in (("I-II", "1-2", "highest"), ("II-I", "2-1", "lowest")):
            own = [row for row in rows if row["coupling.play"] == play and row["table.shift"] == gears]
            series.append(
                Line(
                    f"{what} {way}, {play:g} deg",
                    [row["coupling.spring_rate"] for row in own],
                    [row[f"table.{what}"] for row in own],
                    dashed=way == "II-I",
                )
            )
    title, across = "M_wej in both shifts over springs and play", "stiffness of the springs [N/mm]"
    return chart(title, across, "M_wej [Nm]", series, log=(True, False))


def draw(folder: Path) -> None:
    """Write all pictures."""
    runs = {"without coupling": demo("hydmag", {}), "404 N/mm": demo(RIG, {}), "1600 N/mm": demo(RIG, HARD)}
    figures = {"up": upshift(runs), "sweep": sweep(folder)}
    write_charts(((f"hydmag_coupling_{name}", figure) for name, figure in figures.items()), HERE)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
