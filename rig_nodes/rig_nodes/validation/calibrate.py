# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds the rig's unknown parameters on the rows of targets.yaml whose role is to calibrate, all in one set.

Used by `rig calibrate`: losses, valve and cylinder of each clutch, then what holds a released clutch. Friction stays as
printed. calibration.yaml says what may change and how far, calibration_rows.py what a rig makes of the rows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, least_squares

from ..config import load_yaml
from ..config.schema import check_keys, where_of
from ..config.units import UNITS, quantity
from ..description.settings import Setting
from ..errors import RigError
from ..testbench.campaign import Workers
from ..testbench.configuration import RigConfig, load_rig
from ..testbench.rig_base import Tripped
from .calibration_rows import ROWS, Miss, calibrating
from .which_rows import CALIBRATION_FILE, LABORATORY_FOLDER, LABORATORY_RIG

if TYPE_CHECKING:
    from ..arrays import Floats
    from ..config.yaml_file import Map

STAGES_FILE = LABORATORY_FOLDER / CALIBRATION_FILE


@dataclass(frozen=True)
class Parameter:
    """One unknown: the values of the rig that it is, each so many times, and its bounds (SI)."""

    name: str
    of: dict[str, float]
    low: float
    high: float
    why: str


def load_stages(path: Path = STAGES_FILE, config: RigConfig | None = None) -> dict[str, dict[str, Parameter]]:
    """The parameters of calibration.yaml, stage -> name -> parameter; RigError with file and line when it is not right.

    config: of the rig whose values they are; the laboratory's by default, whose stages have rows of their own each.
    """
    node = load_yaml(path)
    check_keys(path, node, ("stages",), ("stages",), "the calibration")
    stages = node["stages"]
    if config is None:
        check_keys(path, stages, ROWS, ROWS, "stages")
    for stage in stages if isinstance(stages, dict) and stages else (None,):
        if stage is None or not isinstance(stages[stage], dict) or not stages[stage]:
            raise RigError(
                f"{where_of(path, node, 'stages')}: stages must be a map of names, each of the parameters that it searches"
            )
    rig = config or _laboratory()
    return {str(stage): {str(name): _parameter(path, parts, name, rig) for name in parts} for stage, parts in stages.items()}


def _parameter(path: Path, node: Map, name: str, config: RigConfig) -> Parameter:
    where, body = where_of(path, node, name), node[name]
    check_keys(path, body, ("of", "low", "high", "why"), ("of", "low", "high", "why"), name, where)
    times = isinstance(body["of"], dict)
    of = {str(place): float(body["of"][place]) if times else 1.0 for place in body["of"]}
    dimensions = {_setting(config, place, where).dimension for place in of}
    low, high = (quantity(body[key], "ratio" if times else min(dimensions), f"{where}: {name}.{key}") for key in ("low", "high"))
    if not low < high:
        raise RigError(f"{where}: {name}: low must be below high")
    return Parameter(str(name), of, low, high, str(body["why"]))


def _setting(config: RigConfig, name: str, where: str) -> Setting:
    try:
        setting = config.settings.find(name)
        setting.check_kept()
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
    if not setting.is_number:
        raise RigError(f"{where}: {name} is no number that a search could change")
    return setting


@cache
def _laboratory() -> RigConfig:
    """The rig whose values calibration.yaml names."""
    return load_rig(LABORATORY_RIG)


def with_values(config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float]) -> RigConfig:
    """The rig with these values (SI) of parameters."""
    for name, value in values.items():
        for place, times in parameters[name].of.items():
            config = config.with_values({place: times * value})
    return config


# ---- the search


@dataclass
class Found:
    """What a calibration found: value of each parameter (SI), the rows' misses before and after, and how well each
    parameter is determined: ``spread`` is the change that moves the sum of squares by 1 with the others held.
    """

    values: dict[str, float]
    before: dict[str, list[Miss]]  # of each stage
    after: dict[str, list[Miss]]
    spread: dict[str, float] = field(default_factory=dict)
    sensitivities: dict[str, dict[str, float]] = field(default_factory=dict)


def at_shares(config: RigConfig, parameters: dict[str, Parameter], shares: Floats) -> tuple[RigConfig, dict[str, float]]:
    """The rig with parameters at shares (0 to 1) of their bounds, and their values (SI)."""
    values = {p.name: float(p.low + (p.high - p.low) * u) for p, u in zip(parameters.values(), np.clip(shares, 0.0, 1.0))}
    return with_values(config, parameters, values), values


def residuals(
    shares: Floats, config: RigConfig, parameters: dict[str, Parameter], misses: Callable, scale: dict[str, float] | None = None
) -> np.ndarray:
    """Misses [tolerances] of all rows with parameters at shares of their bounds, some rows' scaled."""
    found = misses(at_shares(config, parameters, shares)[0], calibrating())
    return np.concatenate([(scale or {}).get(miss.row, 1.0) * np.array(miss.residuals) for miss in found])


def nearby(
    shares: Floats,
    config: RigConfig,
    parameters: dict[str, Parameter],
    misses: Callable,
    scale: dict[str, float] | None = None,
    bounded: bool = True,
) -> np.ndarray:
    """Shares near these that cost less, by least squares; the same ones where there are none.

    bounded: a miss costs what :func:`total` says, else its square.
    """
    cost = partial(residuals, config=config, parameters=parameters, misses=misses, scale=scale)
    start = np.clip(shares, 1e-3, 1.0 - 1e-3)  # the method wants a start inside
    found = least_squares(cost, start, bounds=(0.0, 1.0), diff_step=0.02, max_nfev=20, loss="arctan" if bounded else "linear").x
    after, before = (total(cost(x)) if bounded else np.sum(cost(x) ** 2) for x in (found, shares))
    return found if after < before else np.asarray(shares)


def total(misses: np.ndarray) -> float:
    """What misses [tolerances] cost: their squares while they are small, each at most pi/2. A row that others do not let
    be met would else move all of them away from what they ask for. A curve comes by its milliseconds, each a small part
    of its miss, and costs nearly its square.
    """
    return float(np.sum(np.arctan(misses**2)))


def anywhere(
    best: Floats, starts: int, jobs: int, seed: int, config: RigConfig, parameters: dict[str, Parameter], misses: Callable
) -> np.ndarray:
    """The best of these shares and of those that :func:`nearby` finds from as many random places as ``starts``.

    Valves and pistons have many minima, each narrow in some directions: steps find their floors, where a search by
    populations of a size that can be paid does not.
    """
    places = np.random.default_rng(seed).uniform(size=(starts, len(parameters)))
    with Workers(jobs) as workers:
        found = workers.map(partial(nearby, config=config, parameters=parameters, misses=misses), places)
    return min([np.asarray(best), *found], key=partial(_cost, config=config, parameters=parameters, misses=misses))


def _cost(shares: Floats, config: RigConfig, parameters: dict[str, Parameter], misses: Callable) -> float:
    try:
        return total(residuals(shares, config, parameters, misses))
    except Tripped:
        return math.inf  # no rig that could be looked at


def search(
    config: RigConfig,
    parameters: dict[str, Parameter],
    misses: Callable,
    generations: int,
    jobs: int,
    seed: int,
    progress: Callable[[int, float], None] | None = None,
    starts: int = 0,
) -> dict[str, float]:
    """Values that make the misses cost little (:func:`total`); an interrupt is passed on.

    Differential evolution over the bounds, then least squares from its best; the latter alone, from the rig as it is,
    with no generations; and from ``starts`` random places. misses: of calibration_rows.ROWS. The same seed finds the
    same values for any number of jobs.
    """
    cost = partial(_cost, config=config, parameters=parameters, misses=misses)
    turn = [0]

    def tell(intermediate_result: OptimizeResult) -> None:
        turn[0] += 1
        if progress:
            progress(turn[0], float(intermediate_result.fun))

    best = shares_of(config, parameters)
    if generations:
        with Workers(jobs) as workers:
            best = differential_evolution(
                cost,
                [(0.0, 1.0)] * len(parameters),
                x0=best,
                popsize=4,
                maxiter=generations,
                tol=1e-4,
                seed=seed,
                mutation=(0.4, 0.9),
                recombination=0.8,
                polish=False,
                callback=tell,
                workers=workers.map,
                updating="deferred",
            ).x
    best = nearby(best, config, parameters, misses)
    if starts:
        best = anywhere(best, starts, jobs, seed, config, parameters, misses)
    if progress:
        progress(turn[0] + 1, cost(best))
    return at_shares(config, parameters, best)[1]


def shares_of(config: RigConfig, parameters: dict[str, Parameter]) -> np.ndarray:
    """The rig as it is, as shares of the bounds."""
    shares = []
    for p in parameters.values():
        place, times = next(iter(p.of.items()))
        part, _, key = place.partition(".")
        now = getattr(config.values(part), key) / times
        shares.append((now - p.low) / (p.high - p.low))
    return np.clip(shares, 0.0, 1.0)


def sensitivities(
    config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float], misses: Callable
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """(change of each row's miss [tolerances] by a tenth of each parameter's bounds, spread of each parameter).

    Differences to both sides; the spread is what moves the sum of squared misses by 1 to second order, the others held,
    at most the width of the bounds: a parameter that the rows do not see has that.
    """
    targets, step = calibrating(), 0.02
    rows: dict[str, dict[str, float]] = {}
    spread = {}
    for name, p in parameters.items():
        width = p.high - p.low
        below, above = (
            misses(with_values(config, parameters, {name: values[name] + way * step * width}), targets) for way in (-1.0, 1.0)
        )
        rows[name] = {one.row: 0.1 * (other.tolerances - one.tolerances) / (2.0 * step) for one, other in zip(below, above)}
        # a curve by its milliseconds: where its mean distance is least, that has no slope, and would allow anything
        one, other = (np.concatenate([miss.residuals for miss in side]) for side in (below, above))
        curvature = np.sum(((other - one) / (2.0 * step)) ** 2)
        spread[name] = width * min(1.0, 1.0 / np.sqrt(curvature)) if curvature > 0.0 else width
    return rows, spread


def calibrate(
    config: RigConfig,
    generations: int,
    jobs: int,
    seed: int,
    stages: list[str] | None = None,
    progress: Callable[[str, int, float], None] | None = None,
    starts: int = 0,
    known: dict[str, dict[str, Parameter]] | None = None,
    rows: Mapping[str, Callable] = ROWS,
) -> tuple[Found, RigConfig]:
    """(what was found, the rig with it): the stages, all or some, one after the other, each on its rows; RigError when
    calibration.yaml is not right. known, rows: stages and what gives the misses in each, by default the laboratory's.
    """
    targets, found = calibrating(), Found({}, {}, {})
    for stage, those in (known or load_stages()).items():
        if stages is not None and stage not in stages:
            continue
        misses = rows[stage]
        found.before[stage] = misses(config, targets)
        tell = partial(progress, stage) if progress else None
        turns = generations if len(those) > 4 else min(generations, 15)
        values = search(config, those, misses, turns, jobs, seed, tell, starts)
        config = with_values(config, those, values)
        found.after[stage] = misses(config, targets)
        rows, spread = sensitivities(config, those, values, misses)
        found.values |= {f"{stage}.{name}": value for name, value in values.items()}
        found.sensitivities |= {f"{stage}.{name}": row for name, row in rows.items()}
        found.spread |= {f"{stage}.{name}": value for name, value in spread.items()}
    return found, config


def write_values(
    values: dict[str, float], rig_file: Path, controller_file: Path, stages: dict[str, dict[str, Parameter]] | None = None
) -> None:
    """Put values ("stage.name" -> SI) into the YAML files of rig and controller, in the units that stand there.

    The rest of the files stays as it is. RigError when a value has no line of its own there. stages: the laboratory's by
    default.
    """
    stages = stages or load_stages()
    texts = {rig_file: rig_file.read_text(), controller_file: controller_file.read_text()}
    for full, value in values.items():
        stage, _, name = full.partition(".")
        for place, times in stages[stage][name].of.items():
            part, _, key = place.partition(".")
            file = controller_file if part == "alfa46" else rig_file
            texts[file] = _replaced(texts[file], "" if part == "alfa46" else part, key, times * value, file)
    for file, text in texts.items():
        file.write_text(text)


def _replaced(text: str, part: str, key: str, value: float, file: Path) -> str:
    indent, begin, end = "", 0, len(text)
    if part:  # among the bodies, shafts or parts of the rig
        head = re.search(rf"^  {part}:\s*$", text, re.M)
        begin = len(text) if head is None else head.end()
        after = re.compile(r"^ {0,2}\w", re.M).search(text, begin)
        indent, end = "    ", after.start() if after else len(text)
    match = re.compile(rf"^{indent}{key}: \[([^,]*?), \"(.*)\"\]", re.M).search(text, begin, end)
    if match is None:
        raise RigError(f"{file}: no line '{key}: [value, \"source\"]' in {part or 'the controller'}")
    unit = match[1].split(" ", 1)[1]
    number = value / UNITS[unit][1]
    new = f'{indent}{key}: [{number:.5g} {unit}, "calibrated: rig calibrate"]'
    return text[: match.start()] + new + text[match.end() :]
