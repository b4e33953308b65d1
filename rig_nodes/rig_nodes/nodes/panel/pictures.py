# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process beside the operator's page that judges a shift from a short recording and draws its figure, one a line of its input.

nodes.panel.shifts starts it, because analysis and drawing take longer than a page may wait. It ends with its input.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis import named_metrics, plain, results_of_shift, verdicts_in
from ...api import Run
from ...base import RigError
from ...view import Envelope, Pages, draw_figure, figure_of_shift, write_figure
from .measured import measured

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...rig import Transmission
    from ...view import Description

NICE = 10  # below the rig, whose samples must be on time
NAMES = {  # of the figures, with width [px] and whether the ground is dark
    f"{name}_{ground}.svg": (width, ground == "dark")
    for name, width in (("wide", 1100), ("narrow", 370))
    for ground in ("light", "dark")
}
MOST = 12  # figures that are held
POINTS = 600  # stretches of a curve that is laid over others
BEFORE = 0.1  # s before the order from which such curves are given


class Figures:
    """The described shifts by the name of their folder, as long as the page keeps them."""

    def __init__(self) -> None:
        self._held: dict[str, Description] = {}

    def describe(self, folder: str) -> dict[str, Any]:
        """Return what the page says of the last shift of a recording; nothing when it holds no shift."""
        run = Run(Path(folder))
        report = run.report
        if not report["shifts"]:
            return {}
        number = len(report["shifts"])
        self._held[folder] = figure_of_shift(report, number, Pages(run.record), run.signals, run.signals.span, True)
        while len(self._held) > MOST:
            del self._held[next(iter(self._held))]
        return told(run, report, self._held[folder].title)

    def draw(self, folder: str, name: str) -> dict[str, Any]:
        """Draw the figure of a described shift as a file of one of NAMES in its folder; RigError when it is not held."""
        if folder not in self._held or name not in NAMES:
            raise RigError("there is no such figure")
        width, dark = NAMES[name]
        write_figure(draw_figure(self._held[folder], dark, width), Path(folder, name))
        return {}


def told(run: Run, report: Mapping[str, Any], title: str) -> dict[str, Any]:
    """Return way, verdict, metrics and curves of the last shift of a report."""
    row, pages = report["shifts"][-1], Pages(run.record)
    box, verdict = pages.box, verdicts_in(report)[-1] or {}
    assert box is not None
    results = results_of_shift(report, len(report["shifts"]), box)
    metrics = [
        {"name": one.name, "what": metric.text, "value": one.text, "unit": "" if one.unit == "-" else one.unit}
        for metric, one in zip(named_metrics(), results)
        if one.value is not None
    ]
    return plain(
        {
            "title": title,
            "way": box.way(row["from_gear"], row["to_gear"]),
            "t": row["t_order_s"],
            "grade": verdict.get("grade") or "",
            "reasons": verdict.get("reasons") or [],
            "valid": row["valid"],
            "why": row["why"],
            "metrics": metrics,
            "curves": curves(run, box, row["t_order_s"]),
        }
    )


def curves(run: Run, box: Transmission, order: float) -> dict[str, dict[str, list]]:
    """Return the shift's main signals for a comparison: ms after the order, and values in the unit that people read."""
    found: dict[str, dict[str, list]] = {}
    end = run.signals.span[1]
    for name in box.channels:
        if name not in run.signals:
            continue
        one = run.signals[name]
        kept = Envelope(order - BEFORE, end, POINTS)
        kept.add(np.asarray(one.time), run.signals.about.catalogue.signals[name].shown(np.asarray(one)))
        good = kept.filled
        found[name] = {"t": ((kept.times[good] - order) * 1e3).tolist(), "v": kept.middle[good].tolist()}
    return found


def main() -> int:
    """Do what each line of the input says, a word with what belongs to it, and answer with a line of JSON."""
    os.nice(NICE)
    figures = Figures()
    do = {"describe": figures.describe, "draw": figures.draw, "measured": lambda file, record: plain(measured(Path(file), record))}
    for line in sys.stdin:
        what, *more = json.loads(line)
        try:
            answer = do[what](*more)
        except RigError as error:
            answer = {"error": str(error)}
        print(json.dumps(answer), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
