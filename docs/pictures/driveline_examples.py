# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws driveline_1.svg and so on, beside itself, by running the examples of docs/how_to/driveline_examples.md as they stand
there.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from rig_nodes.view import Description, Line, chart, write_charts

HERE = Path(__file__).parent
PAGE = HERE.parent / "how_to" / "driveline_examples.md"
POINTS = 500  # of a line, about
QUANTITIES = {"rad/s": "speed", "Nm": "torque", "kJ": "energy"}  # by the unit behind a line's name


def examples() -> list[tuple[str, str, str]]:
    """(title, code, name of the picture) of each example of the page, its first lines in front of the code."""
    page = PAGE.read_text(encoding="utf-8")
    first, *parts = re.split(r"^## ", page, flags=re.MULTILINE)
    imports = re.search(r"```python\n(.*?)```", first, re.DOTALL).group(1)
    return [
        (
            part.splitlines()[0],
            imports + re.search(r"```python\n(.*?)```", part, re.DOTALL).group(1),
            re.search(r"!\[.*\]\(../pictures/(.*)\)", part).group(1),
        )
        for part in parts
    ]


def left_by(code: str) -> dict:
    """Names that an example leaves."""
    names: dict = {}
    exec(compile(code, PAGE.name, "exec"), names)
    return names


def picture(title: str, names: dict) -> Description:
    """What an example's `lines` and `over` look like; a unit that all lines share is at the axis instead of behind their names."""
    x_name, x = names["over"]
    every = max(1, len(x) // POINTS)
    units = dict.fromkeys(name.partition(" [")[2].removesuffix("]") for name in names["lines"])
    up = ", ".join(f"{QUANTITIES[unit.rpartition(' ')[2]]} [{unit}]" if unit else "amplitude, the largest 1" for unit in units)
    series = [
        Line(name if len(units) > 1 else name.partition(" [")[0], np.round(x[::every], 6), np.round(y[::every], 6), marks=False)
        for name, y in names["lines"].items()
    ]
    return chart(title, x_name, up, series)


if __name__ == "__main__":
    write_charts(((Path(name).stem, picture(title, left_by(code))) for title, code, name in examples()), HERE)
