# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search itself: NSGA-II of optuna over whole ms and mA, one generation at a time, judged in worker processes.

Used by studies.tune.run. Each generation is noted in the journal when it is complete. From there an interrupted search continues
as if it had not been interrupted, because every generation draws with a seed of its own.
"""

from __future__ import annotations

import random
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from ...base import optional
from ...rig import Alfa46Config, RigConfig
from ...runs import Workers
from .problem import INVALID, REFUSED, Ground, Task, dominates, excess, front_of, hardest_first, sought
from .space import BOUNDS, inside, refused, settings

if TYPE_CHECKING:
    from types import ModuleType

    from optuna.samplers import NSGAIISampler

POPULATION = 40
NEAR = 1.01  # times the front: settings further away than this are not tried in any more shifts
SEEDS_NEARBY = 0.04  # standard deviation of the first settings around those given, as a share of the bounds


@dataclass
class Study:
    """One search.

    Parameters
    ----------
    name : str
        Name in the journal.
    way : str
        The shift whose settings are sought.
    rig : RigConfig
        The rig.
    base : Alfa46Config
        Settings that the sought ones replace in part.
    task : Task
        The shifts by which settings are judged.
    start : list of dict
        Settings to begin around.
    seed : int
        Seed of the draws.
    entries : list of dict
        Judged settings, as they stand in the journal and in its order.
    """

    name: str
    way: str
    rig: RigConfig
    base: Alfa46Config
    task: Task
    start: list[dict[str, int]]
    seed: int
    entries: list[dict] = field(default_factory=list)  # as they stand in the journal, in order

    @property
    def generation(self) -> int:
        """Number of the next generation."""
        return len(self.entries) // POPULATION

    def order(self) -> list[int]:
        """Return the numbers of all shifts (rig by rig, point by point), those first that were the worst of the most settings."""
        return hardest_first(self.entries, self.task)

    def cut(self) -> float:
        """Return how far bounds may be missed: settings that miss them by more do not get among the POPULATION that continues."""
        missed = sorted(entry["excess"] for entry in self.entries)
        return missed[POPULATION - 1] if len(missed) >= POPULATION else INVALID

    @property
    def shifts(self) -> int:
        """Number of shifts tried so far."""
        return sum(entry["tried"] for entry in self.entries)

    def front(self) -> list[dict]:
        """Return the settings that were tried in all shifts, keep all bounds and are dominated by no others.

        They include settings whose worst shift is beyond the task's limit, because the limit only leads the search.
        """
        limit = self.task.limit
        good = [
            entry
            for entry in self.entries
            if entry["whole"] and entry["excess"] <= (0.0 if limit is None else max(0.0, max(entry["objectives"]) - limit))
        ]
        return front_of(good, lambda entry: entry["objectives"])


def run(study: Study, workers: Workers, note: Callable[[list[dict], float], None], until: Callable[[], bool]) -> None:
    """Run generations until the search is to stop.

    Parameters
    ----------
    study : Study
        The search.
    workers : Workers
        The worker processes.
    note : callable
        Takes each generation as a list of entries, and its CPU time [s].
    until : callable
        Returns True when the search is to stop.

    Raises
    ------
    RigError
        When optuna is not installed.
    """
    optuna = load_optuna()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optuna calls its SBX crossover and polynomial mutation experimental
        _run(optuna, study, workers, note, until)


def _run(
    optuna: ModuleType, study: Study, workers: Workers, note: Callable[[list[dict], float], None], until: Callable[[], bool]
) -> None:
    count = len(study.task.objectives)
    search = optuna.create_study(directions=["minimize"] * count)
    ranges = {name: optuna.distributions.IntDistribution(*bounds) for name, bounds in BOUNDS.items()}
    for entry in study.entries:
        search.add_trial(
            optuna.trial.create_trial(
                params=entry["values"], distributions=ranges, values=entry["objectives"], system_attrs=entry["attrs"]
            )
        )
    while not until():
        generation = study.generation
        search.sampler = _sampler(optuna, study.seed * 100_003 + generation)
        if generation == 0:
            for values in first_settings(study):
                search.enqueue_trial(values)
        trials = [search.ask(ranges) for _ in range(POPULATION)]
        best = [entry["objectives"] for entry in study.front()]
        judge = partial(evaluate, study.task.pickled(), study.way, study.base, best, study.cut(), study.order())
        entries, cpu = [], 0.0
        for trial, found in zip(trials, workers.map(judge, [trial.params for trial in trials])):
            cpu += found.pop("cpu")
            trial.set_constraint("bounds", found["excess"])
            search.tell(trial, found["objectives"])
            attrs = search.get_trials(deepcopy=False)[trial.number].system_attrs  # copying all trials took seconds
            entries.append(
                {
                    "study": study.name,
                    "number": trial.number,
                    "values": trial.params,
                    **found,
                    "attrs": {k: v for k, v in attrs.items() if "fixed_params" not in k},
                }
            )
        study.entries += entries
        note(entries, cpu)


def _sampler(optuna: ModuleType, seed: int) -> NSGAIISampler:
    genetic = optuna.samplers.nsgaii
    return optuna.samplers.NSGAIISampler(
        population_size=POPULATION,
        crossover=genetic.SBXCrossover(eta=5.0),
        mutation=genetic.PolynomialMutation(eta=15.0),
        mutation_prob=0.15,
        seed=seed % 2**32,
    )


def first_settings(study: Study) -> list[dict[str, int]]:
    """Return the first generation: the given settings, and others around them."""
    draw = random.Random(study.seed)
    out = [dict(values) for values in study.start[:POPULATION]]
    while len(out) < POPULATION:
        around = study.start[len(out) % len(study.start)]
        out.append(
            {name: around[name] + round(draw.gauss(0.0, SEEDS_NEARBY) * (high - low)) for name, (low, high) in BOUNDS.items()}
        )
    return [inside(values) for values in out]


def evaluate(
    pickled: bytes, way: str, base: Alfa46Config, best: list[list[float]], cut: float, order: list[int], values: dict[str, int]
) -> dict:
    """Return the objectives of settings, each the worst of all shifts; called in a worker process.

    Trying ends early where bounds are missed by more than ``cut``, and, when ``cut`` is 0, where settings of the front are
    better in every objective by more than NEAR, as the worst values only grow.

    Parameters
    ----------
    pickled : bytes
        The pickled task.
    way : str
        Name of the shift, e.g. I-II.
    base : Alfa46Config
        Settings that the values replace in part.
    best : list of list of float
        Objectives of the front.
    cut : float
        How far bounds may be missed.
    order : list of int
        Numbers of the shifts in the order in which they are tried.
    values : dict of str to int
        The settings, by the names of studies.tune.space.BOUNDS.

    Returns
    -------
    dict
        ``objectives``; ``excess``, how far bounds are missed, and with the task's limit also how far the worst share is
        beyond it; ``whole``, whether all shifts were tried; ``tried``, their number; ``hardest``, the number of the worst
        shift; ``cpu``, the time [s]. Settings that ask too much of the hardware are not tried: their objectives are REFUSED
        plus by how much [s]. A shift without an end gives INVALID plus the share of shifts that were left to try.
    """
    begun = time.process_time()
    ground = Ground.of(pickled)
    task = ground.task
    count = len(task.objectives)

    def found(objectives: list[float], missed: float, tried: int, hardest: int | None, whole: bool = False) -> dict:
        return {
            "objectives": objectives,
            "excess": missed,
            "whole": whole,
            "tried": tried,
            "hardest": hardest,
            "cpu": time.process_time() - begun,
        }

    too_much = REFUSED + refused(task.rigs[0], way, values)
    if too_much > REFUSED:
        return found([too_much] * count, too_much, 0, None)
    config = settings(base, way, values, task.rigs[0].transmission)
    worst, missed, beyond, hardest, most = [0.0] * count, 0.0, 0.0, None, 0.0
    places = [place for place in order if ground.compared_at(place).valid]
    for tried, place in enumerate(places, 1):
        shift, compared = ground.shift_at(place, config), ground.compared_at(place)
        if not shift.valid:
            bad = INVALID + 1.0 - tried / len(places)
            return found([bad] * count, bad, tried, place)
        shares = [sought(name, shift, compared) for name in task.objectives]
        over = excess(task, shift, compared)
        worst, missed = [max(pair) for pair in zip(worst, shares)], max(missed, over)
        beyond = 0.0 if task.limit is None else max(0.0, max(worst) - task.limit)
        if max(shares) + over > most:
            most, hardest = max(shares) + over, place
        # as long as settings that miss bounds take part, it must be known how far they miss them
        behind = cut == 0.0 and any(dominates([NEAR * value for value in one], worst) for one in best)
        if missed + beyond > cut or behind:
            return found(worst, missed + beyond, tried, hardest)
    return found(worst, missed + beyond, len(places), hardest, True)


def load_optuna() -> ModuleType:
    """Return optuna, with its messages switched off below warnings; RigError when it is not installed."""
    optuna = optional("optuna", "sweep")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna
