# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs on all cores: what is measured of each comes back, the rows stay where they were made.

Used by the validation, the calibration, the sweeps and the tuner.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from .procedure import Series, run_repeat
from .record import Run
from .workers import Workers


def run_campaign(
    series: list[Series],
    measure: Callable[[Series, Run], Any],
    rig: str | None = None,
    settings: dict[str, str] | None = None,
    workers: Workers | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[list]:
    """measure(series, run) of every repeat of every series: one list for each series, one result for each repeat.

    measure: a function of a module, so that other processes find it; it runs where the rows are. rig, settings: as
    run_repeat's. workers: those of the caller, kept for the next campaign; without them two, for this one.
    """
    if workers is None:
        with Workers() as own:
            return run_campaign(series, measure, rig, settings, own, progress)
    tasks = [(one, repeat) for one in series for repeat in range(one.repeats)]
    results = iter(workers.map(partial(_measured, measure, rig, settings), tasks, progress))
    return [[next(results) for _ in range(one.repeats)] for one in series]


def _measured(
    measure: Callable[[Series, Run], Any], rig: str | None, settings: dict[str, str] | None, task: tuple[Series, int]
) -> Any:
    series, repeat = task
    return measure(series, run_repeat(series, repeat, rig, settings))
