# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws chain_saw_shares.svg of docs/rigs/chain_saw.md beside itself, from calculations and runs of the rig.

Run `.venv/bin/python docs/pictures/chain_saw.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rig_nodes.rig.configuration import RigConfig, load_rig
from rig_nodes.runs.calculations import Recorded, calculations_of, of_run
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.view import Description, Line, chart, write_charts

HERE, RIG = Path(__file__).parent, "chain_saw"
WORN = {"clutch.shoe_mass": "41.07 g"}


def ran(name: str, settings: dict[str, str] | None = None) -> tuple[RigConfig, Recorded]:
    """A run of a sequence without errors of meters, with its rig."""
    config = load_rig(RIG, {"effects.transducers": "off", **(settings or {})})
    return config, of_run(record(config, load_sequence(name, rig=RIG)), config)


def line(name: str, x: np.ndarray, y: np.ndarray) -> Line:
    """A line."""
    return Line(name, [round(float(v), 4) for v in x], [round(float(v), 4) for v in y], marks=False)


def marks(name: str, x: np.ndarray, y: np.ndarray) -> Line:
    """Points without a line."""
    return Line(name, [round(float(v), 4) for v in x], [round(float(v), 4) for v in y], line=False)


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


if __name__ == "__main__":
    write_charts([("chain_saw_shares", shares())], HERE)
