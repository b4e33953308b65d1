# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trade-offs between calibrating rows: how much one row loses when another one is met better.

Used by `rig calibrate --trade-offs`. Each point of a curve is the rig with the least misses for one weight of the one row
against the other, with all other rows and the bounds kept. A curve does not show which of the two rows is right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from rig_nodes.rig import RigConfig
from rig_nodes.runs import Workers
from rig_nodes.studies import Miss, Parameter, at_shares, nearby, shares_of

from .calibration_rows import ROWS, calibration

WEIGHTS = (16.0, 4.0, 1.0, 0.25, 0.0625)  # of the first row's squared miss relative to the second's
CLEAR = 0.5  # tolerances: a row with a smaller miss needs no trade-off


@dataclass(frozen=True)
class Point:
    """One rig on a curve.

    Parameters
    ----------
    weight : float
        Weight of the first row.
    misses : (float, float)
        Misses of both rows [tolerances].
    rows : (float, float)
        Values of both rows [SI].
    parameters : dict of str to float
        Values of the parameters [SI].
    """

    weight: float
    misses: tuple[float, float]
    rows: tuple[float, float]
    parameters: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """The trade-off of two rows of a stage, from the point that favours the first row to the one that favours the second."""

    stage: str
    rows: tuple[str, str]
    points: list[Point]


def conflicts(after: list[Miss], sensitivities: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    """Return the pairs of rows that both miss clearly and of which no small change mends one without harming the other.

    A step that lowers the one squared miss raises the other one when their gradients point apart.

    Parameters
    ----------
    after : list of Miss
        Misses of a stage.
    sensitivities : dict of str to dict
        Parameter -> row -> change of its miss.

    Returns
    -------
    list of (str, str)
        Names of the rows.
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
    found = {miss.row: miss for miss in misses(rig)}
    pair = [found[row] for row in rows]
    return Point(weight, tuple(miss.tolerances for miss in pair), tuple(miss.value for miss in pair), values)


def trade_offs(
    config: RigConfig,
    after: dict[str, list[Miss]],
    sensitivities: dict[str, dict[str, float]],
    jobs: int,
    progress: Callable[[str, str, str], None] | None = None,
) -> list[Curve]:
    """Compute the curves of all conflicts of a calibrated rig.

    Parameters
    ----------
    config : RigConfig
        The calibrated rig.
    after : dict of str to list of Miss
        Misses of each stage.
    sensitivities : dict of str to dict
        As in calibrate.Found.
    jobs : int
        Number of worker processes.
    progress : callable or None
        Takes the stage and the two rows of each pair before it is computed.

    Returns
    -------
    list of Curve
        One curve for each conflict.
    """
    stages, curves = calibration().stages, []
    with Workers(jobs) as workers:
        for stage, misses in after.items():
            own = {name: rows for name, rows in sensitivities.items() if name.startswith(f"{stage}.")}
            for pair in conflicts(misses, own):
                if progress:
                    progress(stage, *pair)
                one = partial(_point, config=config, parameters=stages[stage], misses=ROWS[stage], rows=pair)
                curves.append(Curve(stage, pair, list(workers.map(one, WEIGHTS))))
    return curves
