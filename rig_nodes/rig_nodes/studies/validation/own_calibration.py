# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calibration of a rig's folder: calibration.yaml, on those of its validation rows whose role is to calibrate.

Used by ``rig calibrate --rig``; the search itself is in studies.validation.calibrate.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

from ...base import RigError
from ...rig import RigConfig
from .calibrate import UNSHIFTED, Calibration, Miss, load_stages
from .own_rows import OwnRow, load_rows, measure_rows, rows_by_run
from .which_rows import CALIBRATION_FILE, file_of_rig, programme_of, rows_file


def calibration_of(rig: str | Path, config: RigConfig) -> Calibration:
    """Return what is searched for a rig: on the rows of its laboratory's programme, or on its own.

    Parameters
    ----------
    rig : str or Path
        Name or file of the rig.
    config : RigConfig
        Its configuration.

    Returns
    -------
    Calibration
        The stages with their parameters and rows.

    Raises
    ------
    RigError
        When the rig has no rows, none with the role calibrate, or no right calibration.yaml.
    """
    path = rows_file(rig)
    if (programme := programme_of(path)) is not None:
        return import_module(f"{programme}.calibration_rows").calibration()
    rows = [row for row in load_rows(path, rig, config) if row.target.role == "calibrate"]
    if not rows:
        raise RigError(f"{path}: no row has the role calibrate, so there is nothing to search on")
    stages = load_stages(file_of_rig(rig, CALIBRATION_FILE), config)
    return Calibration(stages, dict.fromkeys(stages, partial(own_misses, str(rig), rows)))


def own_misses(rig: str, rows: list[OwnRow], config: RigConfig) -> list[Miss]:
    """Return how far the rows of a rig are from the middle of what they accept, or from what is printed; true values are taken.

    A tolerance is half of what a row accepts. A value that the run does not give counts as many tolerances as a shift that
    does not end.

    Parameters
    ----------
    rig : str
        Name or file of the rig.
    rows : list of OwnRow
        The rows.
    config : RigConfig
        The rig with the values that are tried.

    Returns
    -------
    list of Miss
        One miss for each row.
    """
    config, out = config.replaced(effects=replace(config.effects, transducers=False)), []
    for group in rows_by_run(rows):
        for row, (value, _) in zip(group, measure_rows(config, rig, group)):
            target = row.target
            middle = target.printed[0] if target.printed else 0.5 * (target.low + target.high)
            half = 0.5 * (target.high - target.low)
            if value is None:
                out.append(Miss(target.id, float("nan"), UNSHIFTED))
            else:
                out.append(Miss(target.id, value, (value - middle) / half))
    return out
