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


def feed_per_tooth() -> Description:
    """Feed per tooth over the stroke."""
    c, printed = columns("over_stroke"), columns("feed_table")

    def cells(radius: float) -> tuple[list, list]:
        rows = [
            k for k, (r, s) in enumerate(zip(printed["radius"], printed["feed"])) if abs(r - radius) < 1e-9 and abs(s - 30) < 1e-9
        ]
        return [printed["y"][k] for k in rows], [printed["printed"][k] for k in rows]

    return chart(
        "Feed per tooth over the stroke, S_0 = 30 mm",
        "travel y from the top [mm]",
        "feed per tooth S_z [mm]",
        [
            line("r = 0, all teeth", c["y"], c["without"]),
            Line("r = 0, printed", *cells(0.0), line=False),
            line("r = 3.25 mm, all teeth", c["y"], c["swing"]),
            Line("r = 3.25 mm, printed", *cells(3.25), line=False),
            line("r = 0, formula (8)", c["y"], c["without_by_8"], dashed=True),
            line("r = 3.25 mm, (8)", c["y"], c["swing_by_8"], dashed=True),
        ],
    )


def power(run: Recorded) -> Description:
    """Power of the teeth and of the motor over a turn at the new feed, from the run and by scipy."""
    c = columns("over_turn")
    part = slice(int(28.0 / 1e-4), int(29.0 / 1e-4))
    travel, speed = run["y"][part], run["n_crank"][part]
    first = int(np.argmin(travel[:2200]))
    turned = np.cumsum(speed[first:]) * 1e-4
    last = first + int(np.searchsorted(turned, 2.0 * np.pi))
    angle = np.degrees(turned[: last - first])
    motor = (run["M_motor"] * run["n_motor"])[part][first:last]
    teeth = (run["M_saw"] * run["n_crank"])[part][first:last]
    return chart(
        "Power over a turn at 2.1 times the output, motor of 75 kW",
        "angle of the crank from the top [deg]",
        "power [kW]",
        [
            line("teeth", angle, teeth / 1e3),
            line("motor", angle, motor / 1e3),
            line("teeth, scipy", c["angle"], c["teeth"], dashed=True),
            line("motor, scipy", c["angle"], c["motor"], dashed=True),
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
    strong = demo(motor_drive__power_limit="75 kW")
    runs = {
        "75 kW": strong,
        "65 kW": demo(motor_drive__power_limit="65 kW"),
        "45 kW": demo(motor_drive__power_limit="45 kW"),
        "75 kW, no swing": demo(**{name.replace(".", "__"): value for name, value in OLD.items()}),
    }
    figures = {"path": tooth_path(), "feed": feed_per_tooth(), "power": power(strong), "speed": speed_dip(runs)}
    write_charts(((f"frame_saw_{name}", figure) for name, figure in figures.items()), HERE)


if __name__ == "__main__":
    draw()
