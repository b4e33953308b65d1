# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detuning: inertias and stiffnesses of a rig with which its natural frequencies keep away from the excitations.

The values that may change, and the orders and bands to avoid, are in ``detuning.yaml`` in the rig's folder. scipy's
differential evolution chooses the values. The verb ``modes`` uses it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from ..base import RigError, brief, check_keys, find_config, load_yaml, quantity, where_of
from ..driveline import modes
from .modes import TURN, State, chosen_state, exciting_body, system_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..base import Floats, Map
    from ..rig import RigConfig

FILE = "detuning.yaml"
KEYS = ("settings", "away", "orders", "speeds", "bands", "body", "states")
STEADY = 1e-5  # weight of the change of settings against that of a margin that is too small
_SEED, _TOLERANCE = 1, 1e-10


@dataclass(frozen=True)
class Moved:
    """A setting that may change, and its range [SI]."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class Detuning:
    """The task of a detuning: what may change, and what is to be reached.

    Parameters
    ----------
    settings : tuple of Moved
        What may move.
    away : float
        Wanted distance of every natural frequency from every band, as a share of the band's nearer end.
    bands : tuple of (str, float, float)
        Name and ends [Hz] of each band.
    states : tuple of State
        States of the clutches whose frequencies count.
    """

    settings: tuple[Moved, ...]
    away: float
    bands: tuple[tuple[str, float, float], ...]
    states: tuple[State, ...]


@dataclass(frozen=True)
class Margin:
    """Distance of a natural frequency [Hz] from the band nearest to it, as a share of its nearer end; negative inside the band."""

    state: str
    frequency: float
    band: str
    margin: float


@dataclass(frozen=True)
class Detuned:
    """The result of a detuning: old and new values [SI] by setting, and the margins before and after."""

    old: dict[str, float]
    new: dict[str, float]
    before: list[Margin]
    after: list[Margin]


def detuning_file(rig: str | Path) -> Path:
    """Return the rig's own ``detuning.yaml``; RigError when its folder has none."""
    path = find_config("rigs", rig).parent / FILE
    if not path.is_file():
        raise RigError(
            f"--detune: the folder {path.parent} has no {FILE}; name a file with the values that may change (docs/how_to/modes.md)"
        )
    return path


def read_detuning(path: str | Path, config: RigConfig) -> Detuning:
    """Read the task of a detuning.

    Parameters
    ----------
    path : str or Path
        The file.
    config : RigConfig
        The rig.

    Returns
    -------
    Detuning
        The task.

    Raises
    ------
    RigError
        With file and line, when something in the file is not right.
    """
    node = load_yaml(path)
    check_keys(path, node, KEYS, ("settings", "away"), "a detuning", str(path))
    settings = _settings(path, node, config)
    away = quantity(node["away"], "ratio", f"{where_of(path, node, 'away')}: away")
    if not 0.0 < away < 1.0:
        raise RigError(f"{where_of(path, node, 'away')}: away is {brief(str(node['away']))}, expected above 0 % and below 100 %")
    bands = [*_orders(path, node), *_bands(path, node)]
    if not bands:
        raise RigError(f"{path}: there is nothing to keep away from; give orders with speeds, or bands")
    try:
        exciting_body(config, node.get("body"))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'body')}: {str(error).partition(': ')[2]}") from None
    return Detuning(settings, away, tuple(bands), _states(path, node, config))


def _settings(path: str | Path, node: Map, config: RigConfig) -> tuple[Moved, ...]:
    entries = node["settings"]
    where = where_of(path, node, "settings")
    if not isinstance(entries, dict) or not entries:
        raise RigError(f"{where}: settings names what may move, e.g. flywheel.inertia: {{low: 1e-3 kg m2, high: 2e-3 kg m2}}")
    allowed = {f"{body}.inertia" for body in config.structure.bodies} | {
        f"{shaft.name}.stiffness" for shaft in config.structure.shafts
    }
    out = []
    for name, one in entries.items():
        at = where_of(path, entries, name)
        if name not in allowed or not _has(config, name):
            raise RigError(
                f"{at}: {brief(str(name))} is no inertia of a body and no stiffness of a shaft of the rig '{config.name}'"
            )
        check_keys(path, one, ("low", "high"), ("low", "high"), str(name), at)
        setting = config.settings.find(name)
        low, high = (setting.value_of(one[key], f"{where_of(path, one, key)}: {name}.{key}") for key in ("low", "high"))
        if not 0.0 < low < high:
            raise RigError(
                f"{where_of(path, one, 'low')}: {name}.low is {brief(str(one['low']))}; it is to be above 0 and below high"
            )
        out.append(Moved(name, low, high))
    return tuple(out)


def _has(config: RigConfig, name: str) -> bool:
    owner, _, key = name.partition(".")
    return owner in config.sections and getattr(config.sections[owner], key, None) is not None


def _orders(path: str | Path, node: Map) -> list[tuple[str, float, float]]:
    """The band of each order over the speeds."""
    if ("orders" in node) != ("speeds" in node):
        given = "orders" if "orders" in node else "speeds"
        raise RigError(f"{where_of(path, node, given)}: {given} stands alone; orders and speeds go together")
    if "orders" not in node:
        return []
    low, high = _pair(path, node, "speeds", "angular velocity", "[5000 rpm, 9000 rpm]")
    orders = node["orders"]
    if not isinstance(orders, list) or not orders:
        raise RigError(f"{where_of(path, node, 'orders')}: orders is {brief(str(orders))}, expected a list, e.g. [1, 2]")
    out = []
    for k, order in enumerate(orders):
        value = quantity(order, "ratio", f"{where_of(path, orders, k)}: orders")
        if value <= 0.0:
            raise RigError(f"{where_of(path, orders, k)}: an order is {brief(str(order))}, expected above 0")
        out.append((f"order {value:g}", value * low / TURN, value * high / TURN))
    return out


def _bands(path: str | Path, node: Map) -> list[tuple[str, float, float]]:
    bands = node.get("bands", [])
    if not isinstance(bands, list):
        raise RigError(f"{where_of(path, node, 'bands')}: bands is {brief(str(bands))}, expected a list, e.g. [[90 Hz, 110 Hz]]")
    out = []
    for k in range(len(bands)):
        low, high = _pair(path, bands, k, "frequency", "[90 Hz, 110 Hz]", "bands")
        out.append((f"{low:g} to {high:g} Hz", low, high))
    return out


def _pair(path: str | Path, node: object, key: object, dimension: str, example: str, called: str = "") -> tuple[float, float]:
    """Two rising values above 0."""
    value, where, called = node[key], where_of(path, node, key), called or str(key)  # type: ignore[index]
    if not isinstance(value, list) or len(value) != 2:
        raise RigError(f"{where}: {called} is {brief(str(value))}, expected two values, e.g. {example}")
    low, high = (quantity(one, dimension, f"{where}: {called}") for one in value)
    if not 0.0 < low < high:
        raise RigError(f"{where}: {called} is {brief(str(value))}, expected two rising values above 0, e.g. {example}")
    return low, high


def _states(path: str | Path, node: Map, config: RigConfig) -> tuple[State, ...]:
    if "states" not in node:
        return (chosen_state(config, None, None),)
    states = node["states"]
    if not isinstance(states, list) or not states or not all(isinstance(one, list) for one in states):
        raise RigError(
            f"{where_of(path, node, 'states')}: states is {brief(str(states))}, expected a list with what is locked in each, "
            "e.g. [[clutch], []]"
        )
    out = []
    for k, one in enumerate(states):
        try:
            out.append(chosen_state(config, None, [str(name) for name in one]))
        except RigError as error:
            raise RigError(f"{where_of(path, states, k)}: states: {str(error).partition(': ')[2]}") from None
    return tuple(out)


def margins(config: RigConfig, task: Detuning) -> list[Margin]:
    """Return the margin of each natural frequency above 0 Hz to the band nearest to it.

    Parameters
    ----------
    config : RigConfig
        The rig.
    task : Detuning
        The bands and the states.

    Returns
    -------
    list of Margin
        The margins, state by state, slowest mode first.
    """
    system, out = system_of(config), []
    for state in task.states:
        found = modes(system, state.locked)
        for f, damping in zip(found.frequencies, found.damping):
            if f > 0.0 and abs(damping) < 1.0:
                margin, name = min((_away(f, low, high), name) for name, low, high in task.bands)
                out.append(Margin(state.name, float(f), name, margin))
    return out


def _away(f: float, low: float, high: float) -> float:
    """Distance from a band as a share of its nearer end, negative inside it."""
    if f < low:
        return 1.0 - f / low
    if f > high:
        return f / high - 1.0
    return -min(f / low - 1.0, 1.0 - f / high)


def detune(config: RigConfig, task: Detuning) -> Detuned:
    """Choose the settings so that no margin is below the wanted one, or as little as possible, and change them no more than needed.

    The sum of the squares by which margins fall short is minimised, with the squares of the logarithms of the settings' changes at
    a small weight, by scipy.optimize.differential_evolution with a fixed seed.

    Parameters
    ----------
    config : RigConfig
        The rig.
    task : Detuning
        What may move and what is to be reached.

    Returns
    -------
    Detuned
        Old and new values and margins. The new values are rounded to the six digits with which a setting is written.

    Raises
    ------
    RigError
        When no state has a natural frequency above 0 Hz.
    """
    old = {one.name: _value(config, one.name) for one in task.settings}
    before = margins(config, task)
    if not before:
        raise RigError(f"the rig '{config.name}' has no natural frequency above 0 Hz in these states; there is nothing to detune")
    bounds = [(math.log(one.low), math.log(one.high)) for one in task.settings]
    found = optimize.differential_evolution(
        partial(_missing, config, task, old),
        bounds,
        seed=_SEED,
        tol=_TOLERANCE,
        atol=_TOLERANCE,
        popsize=12,
        maxiter=60,
        polish=False,
    )
    refined = optimize.minimize(partial(_missing, config, task, old), found.x, method="Nelder-Mead", bounds=bounds)
    best = refined.x if refined.fun < found.fun else found.x
    new = {one.name: float(f"{min(max(math.exp(x), one.low), one.high):.6g}") for one, x in zip(task.settings, best)}
    return Detuned(old, new, before, margins(config.with_values(new), task))


def _missing(config: RigConfig, task: Detuning, old: Mapping[str, float], logs: Floats) -> float:
    """The objective, as a function of the logarithms of the settings."""
    values = {one.name: math.exp(x) for one, x in zip(task.settings, logs)}
    lacks = [max(0.0, task.away - one.margin) for one in margins(config.with_values(values), task)]
    moves = [math.log(values[name] / old[name]) for name in values]
    return float(np.sum(np.square(lacks)) + STEADY * np.mean(np.square(moves)))


def _value(config: RigConfig, name: str) -> float:
    owner, _, key = name.partition(".")
    return float(getattr(config.sections[owner], key))
