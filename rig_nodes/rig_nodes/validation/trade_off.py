# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where calibrating rows pull against each other: how much of the one a better value of the other costs.

Used by `rig calibrate --trade-offs`. Each point of a curve is the rig with the least misses for one weight of the one row
against the other, all other rows and the bounds kept; which of them is right, no curve says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..testbench.campaign import Workers
from ..testbench.configuration import RigConfig
from .calibrate import Parameter, at_shares, load_stages, nearby, shares_of
from .calibration_rows import ROWS, Miss, calibrating

WEIGHTS = (16.0, 4.0, 1.0, 0.25, 0.0625)  # of the first row's squared miss over the second's
CLEAR = 0.5  # tolerances: a row that is nearer needs no trade


@dataclass(frozen=True)
class Point:
    """One rig on a curve: weight of the first row, both misses [tolerances], values of both rows and parameters (SI)."""

    weight: float
    misses: tuple[float, float]
    rows: tuple[float, float]
    parameters: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """The trade-off of two rows of a stage, from the first row's favour to the second's."""

    stage: str
    rows: tuple[str, str]
    points: list[Point]


def conflicts(after: list[Miss], sensitivities: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    """Pairs of rows that both miss clearly and of which no small change mends one without harming the other.

    after: misses of a stage. sensitivities: parameter -> row -> change of its miss. A step that lowers the one squared
    miss raises the other when their gradients point apart.
    """
    bad = [miss for miss in after if abs(miss.tolerances) > CLEAR]
    gradient = {miss.row: np.array([miss.tolerances * by_row[miss.row] for by_row in sensitivities.values()]) for miss in bad}
    return [
        (one.row, other.row) for i, one in enumerate(bad) for other in bad[i + 1 :] if gradient[one.row] @ gradient[other.row] < 0.0
    ]


def _point(weight: float, config: RigConfig, parameters: dict[str, Parameter], misses: Callable, rows: tuple[str, str]) -> Point:
    scale = {rows[0]: weight**0.5, rows[1]: weight**-0.5}
    best = nearby(shares_of(config, parameters), config, parameters, misses, scale, bounded=False)
    rig, values = at_shares(config, parameters, best)
    found = {miss.row: miss for miss in misses(rig, calibrating())}
    pair = [found[row] for row in rows]
    return Point(weight, tuple(miss.tolerances for miss in pair), tuple(miss.value for miss in pair), values)


def trade_offs(
    config: RigConfig,
    after: dict[str, list[Miss]],
    sensitivities: dict[str, dict[str, float]],
    jobs: int,
    progress: Callable[[str, str, str], None] | None = None,
) -> list[Curve]:
    """The curves of all conflicts of a calibrated rig. after: stage -> misses; sensitivities as calibrate.Found has them."""
    stages, curves = load_stages(), []
    with Workers(jobs) as workers:
        for stage, misses in after.items():
            own = {name: rows for name, rows in sensitivities.items() if name.startswith(f"{stage}.")}
            for pair in conflicts(misses, own):
                if progress:
                    progress(stage, *pair)
                one = partial(_point, config=config, parameters=stages[stage], misses=ROWS[stage], rows=pair)
                curves.append(Curve(stage, pair, list(workers.map(one, WEIGHTS))))
    return curves
