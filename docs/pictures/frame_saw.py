# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws the pictures of docs/rigs/frame_saw.md, frame_saw_*.svg, beside itself, from calculations and runs of the rig.

Run `.venv/bin/python docs/pictures/frame_saw.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.calculations import Recorded, calculations_of, of_run
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.view import Description, Line, chart, write_charts

HERE = Path(__file__).parent
RIG, POINTS = "frame_saw", 600  # of a line, about
OLD = {"saw.eccentric_radius": "0 mm", "saw.cutting_pressure": "58.9 MPa"}


def columns(name: str) -> dict[str, list]:
    """The columns of a calculation in their units."""
    table = calculations_of(RIG)[name].table(load_rig(RIG))
    return dict(zip(table.columns, zip(*table.in_units())))


def demo(**settings: str) -> Recorded:
    """A run of the demo without the errors of transducers; the names of settings have __ for the point."""
    named = {name.replace("__", "."): value for name, value in settings.items()}
    config = load_rig(RIG, {"effects.transducers": "off", **named})
    return of_run(record(config, load_sequence("demo", rig=RIG)), config)


def line(name: str, x: list | np.ndarray, y: list | np.ndarray, dashed: bool = False) -> Line:
    """A line with a limited number of points."""
    every = max(1, len(x) // POINTS)
    return Line(
        name,
        [round(float(v), 4) for v in x[::every]],
        [None if v is None else round(float(v), 4) for v in y[::every]],
        marks=False,
        dashed=dashed,
    )


def tooth_path() -> Description:
    """Depth of a tooth in the wood over its travel, one turn."""
    c = columns("tooth_path")
    y = [-v for v in c["y"]]
    above = [-v for v in c["y_above"]]
    return chart(
        "Path of a tooth against the log over one turn, S_0 = 30 mm",
        "into the wood [mm]",
        "height below the top [mm]",
        [
            line("r = 3.25 mm", c["swing"], y),
            line("tooth above it", c["swing_above"], above, dashed=True),
            line("r = 0", c["without"], y),
            line("tooth above it", c["without_above"], above, dashed=True),
        ],
    )


def speed_dip(runs: dict[str, Recorded]) -> Description:
    """Speed of the crank in the demo, as a mean over each turn."""
    series = []
    for name, run in runs.items():
        turned = np.cumsum(run["n_crank"]) * 1e-4 / (2.0 * np.pi)
        ends = np.searchsorted(turned, np.arange(1, int(turned[-1]) + 1))
        t = run.t[ends]
        middles, means = 0.5 * (t[1:] + t[:-1]), 60.0 / np.diff(t)
        kept = (middles > 5.0) & (middles < 32.0)
        series.append(line(name, middles[kept], means[kept]))
    return chart(
        "Speed of the crank: old feed from 10 s, 2.1 times it from 15 s to 30 s", "time [s]", "mean of each turn [rpm]", series
    )


def draw() -> None:
    """Write all pictures."""
    runs = {
        "75 kW": demo(motor_drive__power_limit="75 kW"),
        "65 kW": demo(motor_drive__power_limit="65 kW"),
        "45 kW": demo(motor_drive__power_limit="45 kW"),
        "75 kW, no swing": demo(**{name.replace(".", "__"): value for name, value in OLD.items()}),
    }
    figures = {"path": tooth_path(), "speed": speed_dip(runs)}
    write_charts(((f"frame_saw_{name}", figure) for name, figure in figures.items()), HERE)


if __name__ == "__main__":
    draw()
