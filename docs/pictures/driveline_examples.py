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
    """What an example's `lines` and `over` look like."""
    x_name, x = names["over"]
    every = max(1, len(x) // POINTS)
    series = [
        Line(name, np.round(x[::every], 6).tolist(), np.round(y[::every], 6).tolist(), marks=False)
        for name, y in names["lines"].items()
    ]
    return chart(title, x_name, "", series)


if __name__ == "__main__":
    write_charts(((Path(name).stem, picture(title, left_by(code))) for title, code, name in examples()), HERE)
