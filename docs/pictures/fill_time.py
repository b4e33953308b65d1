# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws fill_time.svg of docs/learn/lessons.md beside itself: how the errors of learned fill times fall from shift to shift.

It reads docs/reference/fill_time.json, which `docs/examples/fill_time/plants.py --drawn 20 --json FILE` writes.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from rig_nodes.view import Line, chart, write_charts

HERE = Path(__file__).parent
RESULT = HERE.parent / "reference" / "fill_time.json"
LIMIT = 10.0  # ms


def draw() -> None:
    """Write the picture."""
    gearboxes = json.loads(RESULT.read_text(encoding="utf-8"))
    lines = []
    for clutch in "12":
        errors = np.abs([one["errors"][clutch] for one in gearboxes])
        shifts = list(range(1, errors.shape[1] + 1))
        lines.append(Line(f"S{clutch}, worst", shifts, errors.max(axis=0).tolist()))
        lines.append(Line(f"S{clutch}, middle", shifts, np.median(errors, axis=0).tolist(), dashed=True))
    title = f"Error of the fill time on {len(gearboxes)} gearboxes, begun three tenths wrong"
    figure = chart(title, "shift into the gear", "error [ms]", lines, accepted=(None, LIMIT), log=(False, True))
    write_charts([("fill_time", figure)], HERE)


if __name__ == "__main__":
    draw()
