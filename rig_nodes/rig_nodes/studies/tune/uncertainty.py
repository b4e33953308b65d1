# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rigs that the laboratory's rows allow as well: calibrated parameters within their spreads, and oil of other temperatures.

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

from ...base.errors import RigError
from ...plant.parts import part as parts
from ...rig.configuration import RigConfig
from ...rigs.hydmag.laboratory.calibration_rows import ROWS, calibrating
from ...runs.campaign import Workers
from ..validation.calibrate import Parameter, load_stages, sensitivities, shares_of, with_values

DRAWN_BACK = (1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05)  # shares of the way to a sampled value that are tried


def stages_of(config: RigConfig) -> dict[str, dict[str, Parameter]]:
    """Return the stages of the calibration; none for a rig without the values that they calibrate, as it was never calibrated."""
    stages = load_stages()
    places = {place.partition(".")[0] for those in stages.values() for one in those.values() for place in one.of}
    return stages if all(config.values(name) is not None for name in places) else {}


def parameters(config: RigConfig) -> dict[str, Parameter]:
    """Return the parameters of all stages of a rig's calibration, by "stage.name"."""
    return {f"{stage}.{name}": p for stage, those in stages_of(config).items() for name, p in those.items()}


def values_now(config: RigConfig) -> dict[str, float]:
    """Return the value [SI] of each parameter in this rig, within the bounds of the calibration, by "stage.name"."""
    known = parameters(config)
    shares = shares_of(config, known)
    return {name: p.low + (p.high - p.low) * share for (name, p), share in zip(known.items(), shares)}


def spreads_of(config: RigConfig, workers: Workers) -> dict[str, float]:
    """Determine the spread of each calibrated parameter of this rig, as ``rig calibrate`` does; this takes some seconds.

    Parameters
    ----------
    config : RigConfig
        The rig.
    workers : Workers
        The worker processes.

    Returns
    -------
    dict of str to float
        Spreads [SI] by "stage.name".
    """
    found = workers.map(partial(_stage_spread, config), list(stages_of(config)))
    return {name: value for one in found for name, value in one.items()}


def _stage_spread(config: RigConfig, stage: str) -> dict[str, float]:
    those, now = load_stages()[stage], values_now(config)
    values = {name: now[f"{stage}.{name}"] for name in those}
    spread = sensitivities(config, those, values, ROWS[stage])[1]
    return {f"{stage}.{name}": float(value) for name, value in spread.items()}


def read_spreads(path: str | Path, config: RigConfig) -> dict[str, float]:
    """Read the spreads from a file of ``rig calibrate --json``.

    Parameters
    ----------
    path : str or Path
        The file.
    config : RigConfig
        The rig.

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
        if name not in parameters(config):
            raise RigError(f"{path}: the calibration has no parameter '{name}'; make the file anew")
    return spread


def sampled_rigs(
    config: RigConfig, spreads: dict[str, float], oil: tuple[float, float], count: int, seed: int, mapped: Callable = map
) -> list[RigConfig]:
    """Sample rigs that the laboratory's rows allow, by a Latin hypercube.

    Each parameter lies within its spread around the rig's value and within its bounds; each stage is drawn back towards the
    rig's values until its rows allow it.

    Parameters
    ----------
    config : RigConfig
        The rig.
    spreads : dict of str to float
        Spreads [SI] by "stage.name".
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
    known, now = parameters(config), values_now(config)
    names = [name for name in known if spreads.get(name, 0.0) > 0.0]
    draws = []
    for row in qmc.LatinHypercube(len(names) + 1, seed=np.random.default_rng(seed)).random(count).tolist():
        values: dict[str, float] = {}
        for name, share in zip(names, row):
            value = now[name] + spreads[name] * (2.0 * share - 1.0)
            values[name] = float(np.clip(value, known[name].low, known[name].high))
        draws.append((values, oil[0] + (oil[1] - oil[0]) * row[-1]))
    return list(mapped(partial(_sampled, config, now), draws))


def _sampled(config: RigConfig, now: dict[str, float], draw: tuple[dict[str, float], float]) -> RigConfig:
    rig = _allowed(config, draw[0], now)
    return rig.replaced(
        **{one.name: replace(rig.values(one.name), temperature=draw[1]) for one in rig.structure.of_role(parts.OIL)}
    )


def _allowed(config: RigConfig, values: dict[str, float], now: dict[str, float]) -> RigConfig:
    """Return the rig with these values, each stage of them drawn back towards ``now`` until its rows allow it.

    A spread is the change of one parameter that moves the sum of a stage's squared misses by 1 while the others are held. So
    values within the spreads may move that sum by as much as their number. Where they move it further, together or because a
    row cannot be computed, they do not describe a rig that the laboratory's rows allow.
    """
    rig = config
    for stage, those in stages_of(config).items():
        moved = {name: values[f"{stage}.{name}"] for name in those if f"{stage}.{name}" in values}
        limit = _misses(config, stage) + len(moved)
        for part in DRAWN_BACK:
            drawn = {name: now[f"{stage}.{name}"] + part * (value - now[f"{stage}.{name}"]) for name, value in moved.items()}
            if _misses(with_values(config, those, drawn), stage) <= limit:
                rig = with_values(rig, those, drawn)
                break
    return rig


def _misses(config: RigConfig, stage: str) -> float:
    """Return the sum of squared misses of a stage's rows [tolerances squared]."""
    return sum(miss.tolerances**2 for miss in ROWS[stage](config, calibrating()))
