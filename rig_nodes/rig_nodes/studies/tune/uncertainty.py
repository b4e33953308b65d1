# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigs that the calibrating rows of a rig allow as well: calibrated parameters within their spreads, and oil of other temperatures.

Used by studies.tune.run; the spreads are those that ``rig calibrate`` prints.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from ...base import RigError
from ...plant import part as parts
from ...rig import RigConfig
from ...runs import Workers
from ..validation.calibrate import Calibration, Miss, sensitivities, shares_of, with_values
from ..validation.own_calibration import calibration_of
from ..validation.which_rows import CALIBRATION_FILE, has_file

DRAWN_BACK = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05)  # shares of the way to a sampled value that are tried


def calibration_for(rig: str | Path, config: RigConfig) -> Calibration:
    """Return the calibration of a rig; one without stages for a rig that was never calibrated.

    That is a rig without calibration.yaml, or one that lacks a device whose values its base calibrates.

    Parameters
    ----------
    rig : str or Path
        Name or file of the rig.
    config : RigConfig
        Its configuration.

    Raises
    ------
    RigError
        When the rig's rows or its calibration.yaml are not right.
    """
    if not has_file(rig, CALIBRATION_FILE):
        return Calibration({}, {})
    calibration = calibration_of(rig, config)
    places = {place.partition(".")[0] for one in calibration.parameters.values() for place in one.of}
    return calibration if all(config.values(name) is not None for name in places) else Calibration({}, {})


def values_now(config: RigConfig, calibration: Calibration) -> dict[str, float]:
    """Return the value [SI] of each parameter in this rig, within the bounds of the calibration, by "stage.name"."""
    known = calibration.parameters
    shares = shares_of(config, known)
    return {name: p.low + (p.high - p.low) * share for (name, p), share in zip(known.items(), shares)}


def spreads_of(config: RigConfig, calibration: Calibration, workers: Workers) -> dict[str, float]:
    """Determine the spread of each calibrated parameter of this rig, as ``rig calibrate`` does; this takes some seconds.

    Parameters
    ----------
    config : RigConfig
        The rig.
    calibration : Calibration
        Its calibration.
    workers : Workers
        The worker processes.

    Returns
    -------
    dict of str to float
        Spreads [SI] by "stage.name".
    """
    found = workers.map(partial(_stage_spread, config, calibration), list(calibration.stages))
    return {name: value for one in found for name, value in one.items()}


def _stage_spread(config: RigConfig, calibration: Calibration, stage: str) -> dict[str, float]:
    those, now = calibration.stages[stage], values_now(config, calibration)
    values = {name: now[f"{stage}.{name}"] for name in those}
    spread = sensitivities(config, those, values, calibration.rows[stage])[1]
    return {f"{stage}.{name}": float(value) for name, value in spread.items()}


def read_spreads(path: str | Path, calibration: Calibration) -> dict[str, float]:
    """Read the spreads from a file of ``rig calibrate --json``.

    Parameters
    ----------
    path : str or Path
        The file.
    calibration : Calibration
        The rig's calibration.

    Returns
    -------
    dict of str to float
        Spreads [SI] by "stage.name".

    Raises
    ------
    RigError
        When the file holds no spreads, or those of another calibration.
    """
    try:
        spread = json.loads(Path(path).read_text(encoding="utf-8"))["spread"]
        spread = {str(name): float(value) for name, value in spread.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RigError(f"{path}: holds no spreads ({error}); make it with: ./rig calibrate --json FILE") from None
    for name in spread:
        if name not in calibration.parameters:
            raise RigError(f"{path}: the calibration has no parameter '{name}'; make the file anew")
    return spread


def misses_now(config: RigConfig, calibration: Calibration, spreads: dict[str, float]) -> dict[str, float]:
    """Return the sum of squared misses [tolerances squared] of the rig itself, by stage, of the stages that a spread moves."""
    moved = {name.partition(".")[0] for name in calibration.parameters if spreads.get(name, 0.0) > 0.0}
    return {stage: _misses(config, calibration.rows[stage]) for stage in calibration.stages if stage in moved}


def sampled_rigs(
    config: RigConfig,
    calibration: Calibration,
    spreads: dict[str, float],
    misses: dict[str, float],
    oil: tuple[float, float],
    count: int,
    seed: int,
    mapped: Callable = map,
) -> list[RigConfig]:
    """Sample rigs that the rows of the calibration allow, by a Latin hypercube.

    Each parameter lies within its spread around the rig's value and within its bounds; each stage is drawn back towards the
    rig's values until its rows allow it.

    Parameters
    ----------
    config : RigConfig
        The rig.
    calibration : Calibration
        Its calibration, whose rows decide which rigs are allowed.
    spreads : dict of str to float
        Spreads [SI] by "stage.name".
    misses : dict of str to float
        What :func:`misses_now` returns for these spreads.
    oil : (float, float)
        Lowest and highest temperature of the oil [degC].
    count : int
        Number of rigs.
    seed : int
        Seed of the draw.
    mapped : callable
        Used like ``map``, for instance that of Workers.

    Returns
    -------
    list of RigConfig
        The rigs.
    """
    known, now = calibration.parameters, values_now(config, calibration)
    names = [name for name in known if spreads.get(name, 0.0) > 0.0]
    draws = []
    for row in qmc.LatinHypercube(len(names) + 1, seed=np.random.default_rng(seed)).random(count).tolist():
        values: dict[str, float] = {}
        for name, share in zip(names, row):
            value = now[name] + spreads[name] * (2.0 * share - 1.0)
            values[name] = float(np.clip(value, known[name].low, known[name].high))
        draws.append((values, oil[0] + (oil[1] - oil[0]) * row[-1]))
    return list(mapped(partial(_sampled, config, calibration, misses, now), draws))


def _sampled(
    config: RigConfig,
    calibration: Calibration,
    misses: dict[str, float],
    now: dict[str, float],
    draw: tuple[dict[str, float], float],
) -> RigConfig:
    rig = _allowed(config, calibration, misses, now, draw[0])
    return rig.replaced(
        **{one.name: replace(rig.values(one.name), temperature=draw[1]) for one in rig.structure.of_role(parts.OIL)}
    )


def _allowed(
    config: RigConfig, calibration: Calibration, misses: dict[str, float], now: dict[str, float], values: dict[str, float]
) -> RigConfig:
    """Return the rig with these values, each stage of them drawn back towards ``now`` until its rows allow it.

    A spread is the change of one parameter that moves the sum of a stage's squared misses by 1 while the others are held. So
    values within the spreads may move that sum by as much as their number. Where they move it further, together or because a
    row cannot be computed, they do not describe a rig that the laboratory's rows allow.
    """
    rig = config
    for stage, before in misses.items():
        those, rows = calibration.stages[stage], calibration.rows[stage]
        moved = {name: values[f"{stage}.{name}"] for name in those if f"{stage}.{name}" in values}
        limit = before + len(moved)
        for part in DRAWN_BACK:
            drawn = {name: now[f"{stage}.{name}"] + part * (value - now[f"{stage}.{name}"]) for name, value in moved.items()}
            if _misses(with_values(config, those, drawn), rows) <= limit:
                rig = with_values(rig, those, drawn)
                break
    return rig


def _misses(config: RigConfig, rows: Callable[[RigConfig], list[Miss]]) -> float:
    """Return the sum of squared misses of a stage's rows [tolerances squared]."""
    return sum(miss.tolerances**2 for miss in rows(config))
