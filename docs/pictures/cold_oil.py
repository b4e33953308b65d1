# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws cold_oil_*.svg of docs/background/physics.md beside itself: filling, shift and drag over the oil's temperature.

Run `.venv/bin/python docs/pictures/cold_oil.py`; it prints the numbers too.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np

from rig_nodes.analysis.shift import shift_metrics
from rig_nodes.bags.logged import Recording
from rig_nodes.plant.parts.load_pump import relief_setting_for
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.transmission import transmission_of
from rig_nodes.runs.rig import Rig
from rig_nodes.view import Line, chart, write_charts

HERE = Path(__file__).parent
TEMPERATURES = (-20, -10, 0, 10, 20, 30, 40, 50, 60, 70, 80, 90)  # degC, kept during the test
SPEED, LOAD = 1500 * pi / 30, 60.0
RISEN = 10e3  # Pa: first rise of a pressure
LONGEST = 6000  # ms that a filling or shift may take
KEPT = {"effects.transducers": "off", "oil_supply.tank_heat_capacity": "0 J/K"}


def at_rest(temperature: float) -> Rig:
    """A rig with oil of this temperature, its supply up and all at rest; no pressure of thick oil trips it."""
    config = load_rig("hydmag", {**KEPT, "oil_supply.temperature": f"{temperature} degC"})
    rig = Rig(config.replaced(trips_watched=False))
    rig.set("oil", 4e6, True)
    rig.advance_samples(500)
    return rig


def filling(temperature: float) -> tuple[float | None, float | None]:
    """Times [ms] from the order of gear I to the first rise of p1, and from there until the piston meets the plates."""
    rig, clearance, rises = at_rest(temperature), load_rig("hydmag").clutch_s1.clearance, None
    rig.order_gear(1)
    for t in range(1, LONGEST):
        rig.advance_samples(1)
        if rises is None and rig.line_pressure(0) > RISEN:
            rises = t
        if rises is not None and rig.clutches[0]["piston"] >= clearance:
            return float(rises), float(t - rises)
    return rises, None


def upshift(temperature: float) -> tuple[float | None, float]:
    """t_d [ms] of I to II, and the drag [Nm] of the open pack of S2 before it."""
    rig = at_rest(temperature)
    rig.order_gear(1)
    rig.advance_samples(LONGEST)
    rig.set("motor", SPEED, True)
    rig.advance_samples(4000)
    rig.set("load", relief_setting_for(LOAD, rig.true("wk.speed"), rig.config.load_pump), True)
    rig.advance_samples(2000)
    drag = float(rig.clutches[1]["drag"]) * rig.slip(1)
    order = rig.sample
    pieces = [rig.rows_at(1e-4, 10 * (order - 150), 1501)]
    rig.order_gear(2)
    for _ in range(LONGEST // 1000):
        rig.advance_samples(1000)
        pieces.append(rig.rows_at(1e-4, 10 * rig.sample - 9999, 10000))
    rows = np.concatenate(pieces)
    channels = {name: rows[:, k] for k, name in enumerate(rig.channels)}
    recording = Recording((order - 150) * 1e-3, 1e-4, channels, [], transmission_of(rig.config))
    found = shift_metrics(recording, (order * 1e-3, 1, 2))["t_dt_s"]
    return None if found is None else 1e3 * found, abs(drag)


def draw() -> None:
    """Write the pictures and print their numbers."""
    print("degC  rise ms  fill ms  t_d ms  drag Nm")
    rows = []
    for temperature in TEMPERATURES:
        rows.append((*filling(temperature), *upshift(temperature)))
        print(f"{temperature:4d}  " + "  ".join("      -" if x is None else f"{x:7.1f}" for x in rows[-1]), flush=True)
    over = [float(t) for t in TEMPERATURES]
    rise, fill, t_d, drag = ([None if x is None else round(x, 2) for x in column] for column in zip(*rows))
    times = [Line("order to first rise of p1", over, rise), Line("filling of S1", over, fill), Line("t_d of I to II", over, t_d)]
    figures = {
        "times": chart("Times over the oil's temperature, 1500 rpm, 60 Nm", "oil [degC]", "time [ms]", times),
        "drag": chart("Drag of the open S2 in gear I at 1500 rpm", "oil [degC]", "drag [Nm]", [Line("drag", over, drag)]),
    }
    write_charts(((f"cold_oil_{name}", figure) for name, figure in figures.items()), HERE)


if __name__ == "__main__":
    draw()
