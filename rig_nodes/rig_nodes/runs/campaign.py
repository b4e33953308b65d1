# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs on all cores: only what is measured of each run comes back; its rows stay in the process that made them.

The validation, the calibration, the sweeps and the tuner use it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from .procedure import Series, run_repeat
from .recorded import Run
from .workers import Workers


def run_campaign(
    series: list[Series],
    measure: Callable[[Series, Run], Any],
    rig: str | None = None,
    settings: dict[str, str] | None = None,
    workers: Workers | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[list]:
    """Run every repeat of every series and measure it.

    Parameters
    ----------
    series : list of Series
        The series to run.
    measure : callable
        It is called with (series, run) in the process that has the rows; it must be a function of a module, so that other
        processes find it.
    rig : str, optional
        The rig, as :func:`run_repeat` takes it.
    settings : dict of str to str, optional
        Settings of the rig, as :func:`run_repeat` takes them.
    workers : Workers, optional
        Processes of the caller, which are kept for its next campaign; by default two are started for this campaign.
    progress : callable, optional
        It is called with the numbers of done and of all runs.

    Returns
    -------
    list of list
        One list for each series, with one result for each repeat.
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
