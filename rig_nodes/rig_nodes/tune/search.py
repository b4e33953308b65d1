"""The search itself: NSGA-II of optuna over whole ms and mA, a generation at a time, judged in worker processes.

Used by the verb ``tune``. Each generation is noted in the journal when it is whole; from there a search goes on as if
it had not been interrupted, because every generation draws with a seed of its own.
"""

from __future__ import annotations

import random
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from ..testbench.campaign import Workers
from ..testbench.configuration import RigConfig
from .problem import INVALID, REFUSED, Ground, Task, dominates, front_of, judged
from .space import BOUNDS, refused, settings

POPULATION = 40
NEAR = 1.05  # times the front: further away, settings are judged on the rig itself and on no other
SEEDS_NEARBY = 0.12  # standard deviation of the first settings around those given, as a share of the bounds


@dataclass
class Study:
    """One search. name: in the journal; way: whose settings are sought; start: settings to begin around."""

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
        """The next one."""
        return len(self.entries) // POPULATION

    def front(self) -> list[dict]:
        """The settings that were judged on all rigs, keep all bounds and are dominated by none of the others."""
        good = [entry for entry in self.entries if entry["whole"] and entry["excess"] <= 0.0]
        return front_of(good, lambda entry: entry["objectives"])


def run(study: Study, workers: Workers, note: Callable[[list[dict]], None], until: Callable[[], bool]) -> None:
    """Generations until ``until()`` says so; ``note`` takes each as a list of entries."""
    optuna = load_optuna()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optuna calls its SBX crossover and polynomial mutation experimental
        _run(optuna, study, workers, note, until)


def _run(optuna, study: Study, workers: Workers, note, until) -> None:
    count = len(study.task.objectives)
    search = optuna.create_study(directions=["minimize"] * count)
    ranges = {name: optuna.distributions.IntDistribution(*bounds) for name, bounds in BOUNDS.items()}
    for entry in study.entries:
        search.add_trial(optuna.trial.create_trial(
            params=entry["values"], distributions=ranges, values=entry["objectives"], system_attrs=entry["attrs"]))
    while not until():
        generation = study.generation
        search.sampler = _sampler(optuna, study.seed * 100_003 + generation)
        if generation == 0:
            for values in first_settings(study):
                search.enqueue_trial(values)
        trials = [search.ask(ranges) for _ in range(POPULATION)]
        best = [entry["objectives"] for entry in study.front()]
        judge = partial(evaluate, study.task.pickled(), study.way, study.base, best)
        entries = []
        for trial, found in zip(trials, workers.map(judge, [trial.params for trial in trials])):
            trial.set_constraint("bounds", found["excess"])
            search.tell(trial, found["objectives"])
            attrs = search.trials[trial.number].system_attrs
            entries.append({"study": study.name, "number": trial.number, "values": trial.params, **found,
                            "attrs": {k: v for k, v in attrs.items() if "fixed_params" not in k}})
        study.entries += entries
        note(entries)


def _sampler(optuna, seed: int):
    genetic = optuna.samplers.nsgaii
    return optuna.samplers.NSGAIISampler(
        population_size=POPULATION, crossover=genetic.SBXCrossover(eta=5.0),
        mutation=genetic.PolynomialMutation(eta=15.0), mutation_prob=0.15, seed=seed % 2**32)


def first_settings(study: Study) -> list[dict[str, int]]:
    """The first generation: the given settings, and others around them."""
    draw = random.Random(study.seed)
    out = [dict(values) for values in study.start[:POPULATION]]
    while len(out) < POPULATION:
        around = study.start[len(out) % len(study.start)]
        out.append({name: min(max(around[name] + round(draw.gauss(0.0, SEEDS_NEARBY) * (high - low)), low), high)
                    for name, (low, high) in BOUNDS.items()})
    return [{name: min(max(values[name], low), high) for name, (low, high) in BOUNDS.items()} for values in out]


def evaluate(pickled: bytes, way: str, base: Alfa46Config, best: list[list[float]], values: dict[str, int]) -> dict:
    """Objectives of settings, in a worker process.

    ``whole``: they were judged on all rigs. Settings that ask too much of the hardware are not tried: REFUSED and by
    how much [s]. A shift that has no end gives INVALID and the share of such shifts. Others are judged on one rig after
    the other, until settings of the front ``best`` are better than what was found so far by more than NEAR in everything.
    """
    ground = Ground.of(pickled)
    task = ground.task
    count = len(task.objectives)
    too_much = refused(task.rigs[0], way, values)
    if too_much > 0.0:
        return {"objectives": [REFUSED + too_much] * count, "excess": REFUSED + too_much, "whole": False}
    config = settings(base, way, values, task.rigs[0].wiring)
    pairs = []
    for rig in range(len(task.rigs)):
        pairs += ground.pairs(rig, ground.shifts(rig, config))
        found = judged(task, pairs)
        if found is None:
            bad = sum(not shift.valid for _, shift, _ in pairs) / len(pairs)
            return {"objectives": [INVALID + bad] * count, "excess": INVALID + bad, "whole": False}
        if rig < len(task.rigs) - 1 and any(dominates([NEAR * value for value in one], found[0]) for one in best):
            return {"objectives": found[0], "excess": found[1], "whole": False}
    return {"objectives": found[0], "excess": found[1], "whole": True}


def load_optuna():
    """optuna, quiet; RigError when it is not installed."""
    try:
        import optuna
    except ImportError:
        raise RigError("rig tune searches with optuna, which is not installed; install the extra 'rig_nodes[sweep]'"
                       ) from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


class Clock:
    """Seconds of search that are left, over interruptions. ``spent`` before this start."""

    def __init__(self, seconds: float, spent: float = 0.0):
        self.end = time.monotonic() + seconds - spent
        self.seconds = seconds

    @property
    def left(self) -> float:
        return self.end - time.monotonic()

    @property
    def spent(self) -> float:
        return self.seconds - self.left
