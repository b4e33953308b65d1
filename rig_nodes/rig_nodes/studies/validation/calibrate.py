# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search for the rig's unknown parameters on the rows whose role is to calibrate, stage by stage.

Used by `rig calibrate`; `rig tune` takes the spreads of the parameters. calibration.yaml of a rig lists what may change and how
far; the rows' values for a rig come from its own rows or from the programme of its laboratory.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, least_squares

from ...base import UNITS, RigError, check_keys, load_yaml, quantity, where_of
from ...rig import RigConfig, Setting
from ...runs import Tripped, Workers

if TYPE_CHECKING:
    from ...base import Floats, Map

UNSHIFTED = 10.0  # tolerances for a shift that does not end


@dataclass(frozen=True)
class Miss:
    """How far a row is from the printed value.

    Parameters
    ----------
    row : str
        Name of the row.
    value : float
        The rig's value [SI].
    tolerances : float
        Distance from the printed value [tolerances].
    parts : tuple of float
        For a curve, its distances in tolerances over the root of their number, so that their squares sum up to that of
        ``tolerances``. A search by slopes gets more from them than from their sum.
    """

    row: str
    value: float
    tolerances: float
    parts: tuple[float, ...] = ()

    @property
    def residuals(self) -> tuple[float, ...]:
        """The numbers that a least squares search makes small."""
        return self.parts or (self.tolerances,)


@dataclass(frozen=True)
class Parameter:
    """One unknown of the calibration.

    Parameters
    ----------
    name : str
        Name of the unknown.
    of : dict of str to float
        The rig's values that it sets, each with the factor by which it is multiplied.
    low, high : float
        Bounds [SI].
    why : str
        Why it is searched within these bounds.
    """

    name: str
    of: dict[str, float]
    low: float
    high: float
    why: str


@dataclass(frozen=True)
class Calibration:
    """What is searched for a rig.

    Parameters
    ----------
    stages : dict of str to dict
        Stage -> name -> parameter.
    rows : mapping of str to callable
        Stage -> function that takes a rig and gives the misses of the stage's rows.
    """

    stages: dict[str, dict[str, Parameter]]
    rows: Mapping[str, Callable[[RigConfig], list[Miss]]]

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The parameters of all stages, by "stage.name"."""
        return {f"{stage}.{name}": p for stage, those in self.stages.items() for name, p in those.items()}


def load_stages(path: Path, config: RigConfig) -> dict[str, dict[str, Parameter]]:
    """Return the parameters of calibration.yaml.

    Parameters
    ----------
    path : Path
        The file.
    config : RigConfig
        The rig whose values the parameters are.

    Returns
    -------
    dict of str to dict
        Stage -> name -> parameter.

    Raises
    ------
    RigError
        With file and line, when the file is not right.
    """
    node = load_yaml(path)
    check_keys(path, node, ("stages",), ("stages",), "the calibration")
    stages = node["stages"]
    for stage in stages if isinstance(stages, dict) and stages else (None,):
        if stage is None or not isinstance(stages[stage], dict) or not stages[stage]:
            raise RigError(
                f"{where_of(path, node, 'stages')}: stages must be a map of names, each of the parameters that it searches"
            )
    return {str(stage): {str(name): _parameter(path, parts, name, config) for name in parts} for stage, parts in stages.items()}


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


def with_values(config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float]) -> RigConfig:
    """Return the rig with these values [SI] of its parameters."""
    for name, value in values.items():
        for place, times in parameters[name].of.items():
            config = config.with_values({place: times * value})
    return config


# ---- the search


@dataclass
class Found:
    """What a calibration found.

    Parameters
    ----------
    values : dict of str to float
        Value of each parameter [SI], by "stage.name".
    before, after : dict of str to list of Miss
        The rows' misses of each stage before and after the search.
    spread : dict of str to float
        How well each parameter is determined: the change [SI] that moves the sum of squared misses by 1 with the others held.
    profile : dict of str to float
        The same with the others fitted again, so that what one parameter can do in place of another is counted.
    sensitivities : dict of str to dict
        Parameter -> row -> change of its miss [tolerances] by a tenth of the parameter's bounds.
    """

    values: dict[str, float]
    before: dict[str, list[Miss]]  # misses of each stage
    after: dict[str, list[Miss]]
    spread: dict[str, float] = field(default_factory=dict)
    profile: dict[str, float] = field(default_factory=dict)
    sensitivities: dict[str, dict[str, float]] = field(default_factory=dict)


def at_shares(config: RigConfig, parameters: dict[str, Parameter], shares: Floats) -> tuple[RigConfig, dict[str, float]]:
    """Return the rig with parameters at shares of their bounds.

    Parameters
    ----------
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    shares : (n,) array of float
        Share of the bounds for each parameter, clipped to 0 to 1.

    Returns
    -------
    config : RigConfig
        The rig with these values.
    values : dict of str to float
        Values of the parameters [SI].
    """
    values = {p.name: float(p.low + (p.high - p.low) * u) for p, u in zip(parameters.values(), np.clip(shares, 0.0, 1.0))}
    return with_values(config, parameters, values), values


def residuals(
    shares: Floats, config: RigConfig, parameters: dict[str, Parameter], misses: Callable, scale: dict[str, float] | None = None
) -> np.ndarray:
    """Return the misses of all rows with parameters at shares of their bounds.

    Parameters
    ----------
    shares : (n,) array of float
        Share of the bounds (0 to 1) for each parameter.
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    misses : callable
        Takes a rig and gives the misses of its rows.
    scale : dict of str to float or None
        Factors for the misses of some rows.

    Returns
    -------
    array of float
        Misses [tolerances]; a curve has several.
    """
    found = misses(at_shares(config, parameters, shares)[0])
    return np.concatenate([(scale or {}).get(miss.row, 1.0) * np.array(miss.residuals) for miss in found])


def nearby(
    shares: Floats,
    config: RigConfig,
    parameters: dict[str, Parameter],
    misses: Callable,
    scale: dict[str, float] | None = None,
    bounded: bool = True,
) -> np.ndarray:
    """Return shares near these that cost less, found by least squares, or the same shares when there are none.

    Parameters
    ----------
    shares : (n,) array of float
        Share of the bounds (0 to 1) for each parameter.
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    misses : callable
        Takes a rig and gives the misses of its rows.
    scale : dict of str to float or None
        Factors for the misses of some rows.
    bounded : bool
        True when a miss costs as in :func:`total`; False when it costs its square.

    Returns
    -------
    (n,) array of float
        The shares.
    """
    plain = partial(residuals, config=config, parameters=parameters, misses=misses, scale=scale)
    try:
        here = plain(shares)
    except Tripped:
        return np.asarray(shares)

    def cost(x: Floats) -> np.ndarray:
        try:
            return plain(x)
        except Tripped:
            return np.full(len(here), UNSHIFTED)  # unrealistic values, which a long step of the search can reach

    start = np.clip(shares, 1e-3, 1.0 - 1e-3)  # the method needs a start inside the bounds
    found = least_squares(cost, start, bounds=(0.0, 1.0), diff_step=0.02, max_nfev=20, loss="arctan" if bounded else "linear").x
    after, before = (total(of) if bounded else np.sum(of**2) for of in (cost(found), here))
    return found if after < before else np.asarray(shares)


def total(misses: np.ndarray) -> float:
    """Return the cost of misses [tolerances]: their squares while they are small, and each at most pi/2.

    Without this limit, a row that contradicts other rows would move the values away from those at which the others are met. A
    curve's misses come for each millisecond; each is a small part of its whole miss and costs nearly its square.
    """
    return float(np.sum(np.arctan(misses**2)))


def anywhere(
    best: Floats, starts: int, jobs: int, seed: int, config: RigConfig, parameters: dict[str, Parameter], misses: Callable
) -> np.ndarray:
    """Return the best of these shares and of those that :func:`nearby` finds from random places.

    Valves and pistons have many minima, each narrow in some directions. Least squares find their floors, which a search by
    populations of an affordable size does not.

    Parameters
    ----------
    best : (n,) array of float
        The best shares so far.
    starts : int
        Number of random places.
    jobs : int
        Number of worker processes.
    seed : int
        Seed of the places.
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    misses : callable
        Takes a rig and gives the misses of its rows.

    Returns
    -------
    (n,) array of float
        The shares.
    """
    places = np.random.default_rng(seed).uniform(size=(starts, len(parameters)))
    with Workers(jobs) as workers:
        found = workers.map(partial(nearby, config=config, parameters=parameters, misses=misses), places)
    return min([np.asarray(best), *found], key=partial(_cost, config=config, parameters=parameters, misses=misses))


def _cost(shares: Floats, config: RigConfig, parameters: dict[str, Parameter], misses: Callable) -> float:
    try:
        return total(residuals(shares, config, parameters, misses))
    except Tripped:
        return math.inf  # a rig that trips has no rows to compare


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
    """Find values that make the misses cost little (:func:`total`); an interrupt is passed on.

    The search is differential evolution over the bounds and then least squares from its best; without generations it is least
    squares alone, from the rig as it is. It ends with least squares from random places. The same seed finds the same values
    for any number of jobs.

    Parameters
    ----------
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    misses : callable
        Takes a rig and gives the misses of its rows.
    generations : int
        Generations of the differential evolution.
    jobs : int
        Number of worker processes.
    seed : int
        Seed of the search.
    progress : callable or None
        Takes the generation and the cost of its best.
    starts : int
        Number of random places.

    Returns
    -------
    dict of str to float
        Values of the parameters [SI].
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
    """Return the parameters of the rig as it is, as (n,) shares of their bounds, clipped to 0 to 1."""
    shares = []
    for p in parameters.values():
        place, times = next(iter(p.of.items()))
        part, _, key = place.partition(".")
        now = getattr(config.values(part), key) / times
        shares.append((now - p.low) / (p.high - p.low))
    return np.clip(shares, 0.0, 1.0)


def sensitivities(
    config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float], misses: Callable
) -> tuple[dict[str, dict[str, float]], dict[str, float], dict[str, float]]:
    """Determine how much the rows' misses depend on each parameter, by differences to both sides.

    The spread of a parameter is the change that moves the sum of squared misses by 1, to second order and with the others held; its
    profile is the change that does so with the others fitted again. Both are at most the width of the bounds, which a parameter
    without any effect on the rows has.

    Parameters
    ----------
    config : RigConfig
        The rig.
    parameters : dict of str to Parameter
        The parameters.
    values : dict of str to float
        Their values [SI].
    misses : callable
        Takes a rig and gives the misses of its rows.

    Returns
    -------
    rows : dict of str to dict
        Parameter -> row -> change of its miss [tolerances] by a tenth of the parameter's bounds.
    spread, profile : dict of str to float
        Spread and profile of each parameter [SI].
    """
    step = 0.02
    rows: dict[str, dict[str, float]] = {}
    slopes = []
    for name, p in parameters.items():
        width = p.high - p.low
        below, above = (misses(with_values(config, parameters, {name: values[name] + way * step * width})) for way in (-1.0, 1.0))
        rows[name] = {one.row: 0.1 * (other.tolerances - one.tolerances) / (2.0 * step) for one, other in zip(below, above)}
        # A curve counts by its milliseconds: its mean distance has no slope where it is least, and would allow any value.
        one, other = (np.concatenate([miss.residuals for miss in side]) for side in (below, above))
        slopes.append((other - one) / (2.0 * step))
    return rows, *_determined(np.array(slopes), parameters)


def _determined(slopes: Floats, parameters: dict[str, Parameter]) -> tuple[dict[str, float], dict[str, float]]:
    """Return spread and profile [SI] of parameters by the (n, m) slopes of m misses over the n shares of their bounds."""
    spread, profile = {}, {}
    for k, (name, p) in enumerate(parameters.items()):
        own, others = slopes[k], np.delete(slopes, k, 0).T
        rest = own - others @ np.linalg.lstsq(others, own, rcond=1e-9)[0] if len(slopes) > 1 else own
        spread[name], profile[name] = ((p.high - p.low) / max(1.0, float(np.linalg.norm(slope))) for slope in (own, rest))
    return spread, profile


def calibrate(
    config: RigConfig,
    calibration: Calibration,
    generations: int,
    jobs: int,
    seed: int,
    stages: list[str] | None = None,
    progress: Callable[[str, int, float], None] | None = None,
    starts: int = 0,
) -> tuple[Found, RigConfig]:
    """Search the stages one after the other, each on its own rows.

    Parameters
    ----------
    config : RigConfig
        The rig.
    calibration : Calibration
        What is searched, and on which rows.
    generations : int
        Generations of each search.
    jobs : int
        Number of worker processes.
    seed : int
        Seed of the searches.
    stages : list of str or None
        Names of the stages to search; None for all.
    progress : callable or None
        Takes the stage, the generation and the cost of its best.
    starts : int
        Number of random places in each search.

    Returns
    -------
    found : Found
        What was found.
    config : RigConfig
        The rig with the found values.

    Raises
    ------
    RigError
        When a value that is tried is refused.
    """
    found = Found({}, {}, {})
    for stage, those in calibration.stages.items():
        if stages is not None and stage not in stages:
            continue
        misses = calibration.rows[stage]
        found.before[stage] = misses(config)
        tell = partial(progress, stage) if progress else None
        turns = generations if len(those) > 4 else min(generations, 15)
        values = search(config, those, misses, turns, jobs, seed, tell, starts)
        config = with_values(config, those, values)
        found.after[stage] = misses(config)
        changes, spread, profile = sensitivities(config, those, values, misses)
        found.values |= {f"{stage}.{name}": value for name, value in values.items()}
        found.sensitivities |= {f"{stage}.{name}": row for name, row in changes.items()}
        found.spread |= {f"{stage}.{name}": value for name, value in spread.items()}
        found.profile |= {f"{stage}.{name}": value for name, value in profile.items()}
    return found, config


def write_values(values: dict[str, float], parameters: dict[str, Parameter], rig_file: Path, controller_file: Path) -> None:
    """Write values into the YAML files of rig and controller, in the units that stand there; the rest of the files stays as it is.

    Parameters
    ----------
    values : dict of str to float
        Values [SI] by "stage.name".
    parameters : dict of str to Parameter
        The parameters by "stage.name".
    rig_file : Path
        File of the rig.
    controller_file : Path
        File of its controller.

    Raises
    ------
    RigError
        When a value has no line of its own there.
    """
    texts = {rig_file: rig_file.read_text(), controller_file: controller_file.read_text()}
    for full, value in values.items():
        for place, times in parameters[full].of.items():
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
