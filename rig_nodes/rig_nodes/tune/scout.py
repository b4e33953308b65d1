# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the search begins: settings whose worst shifts are good, found by the covariance matrix adaptation (CMA-ES).

Used by tune.run ahead of tune.search. NSGA-II, begun at the settings that are there, stays with them: close by nothing
is better in every shift, and what is, has another filling. One smooth number over all rigs leads there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..alfa46.settings import Alfa46Config
from ..testbench.campaign import Workers
from .problem import INVALID, REFUSED, Ground, Task, excess, hardest_first, sought
from .space import BOUNDS, refused, settings

POPULATION = 16
SIGMA, DONE = 0.03, 0.004  # standard deviation at first, and with which it is over, as shares of the bounds
POWER = 32.0  # of the mean over shifts: close to the worst, but every shift counts
BOUND_WEIGHT = 2.0


class Cma:
    """CMA-ES (Hansen, The CMA evolution strategy: a tutorial, 2016) over shares of the bounds: ask, then tell."""

    def __init__(self, start: np.ndarray, sigma: float, seed: int) -> None:
        n = len(start)
        self.mean, self.sigma, self.seed, self.generation = np.array(start, dtype=float), sigma, seed, 0
        half = POPULATION // 2
        weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
        self.weights = weights / weights.sum()
        self.mu = 1.0 / np.sum(self.weights**2)
        self.c_sigma = (self.mu + 2.0) / (n + self.mu + 5.0)
        self.damping = 1.0 + self.c_sigma + 2.0 * max(0.0, np.sqrt((self.mu - 1.0) / (n + 1.0)) - 1.0)
        self.c_path = (4.0 + self.mu / n) / (n + 4.0 + 2.0 * self.mu / n)
        self.c_one = 2.0 / ((n + 1.3) ** 2 + self.mu)
        self.c_mu = min(1.0 - self.c_one, 2.0 * (self.mu - 2.0 + 1.0 / self.mu) / ((n + 2.0) ** 2 + self.mu))
        self.length = np.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n))  # of a normal vector
        self.covariance = np.eye(n)
        self.path, self.path_sigma = np.zeros(n), np.zeros(n)

    def ask(self) -> np.ndarray:
        """(POPULATION, n) places to try, the same each time until ``tell``."""
        values, vectors = np.linalg.eigh(self.covariance)
        self._axes, self._vectors = np.sqrt(np.maximum(values, 1e-14)), vectors
        normal = np.random.default_rng([self.seed, self.generation]).standard_normal((POPULATION, len(self.mean)))
        self._steps = normal * self._axes @ vectors.T
        return self.mean + self.sigma * self._steps

    def tell(self, found: list[float]) -> None:
        """What was found there; less is better."""
        n = len(self.mean)
        best = self._steps[np.argsort(found, kind="stable")[: len(self.weights)]]
        step = self.weights @ best
        self.mean = self.mean + self.sigma * step
        white = self._vectors @ ((self._vectors.T @ step) / self._axes)
        self.path_sigma = (1.0 - self.c_sigma) * self.path_sigma + np.sqrt(self.c_sigma * (2.0 - self.c_sigma) * self.mu) * white
        length = np.linalg.norm(self.path_sigma)
        self.generation += 1
        steady = length / np.sqrt(1.0 - (1.0 - self.c_sigma) ** (2 * self.generation)) < (1.4 + 2.0 / (n + 1.0)) * self.length
        self.path = (1.0 - self.c_path) * self.path + steady * np.sqrt(self.c_path * (2.0 - self.c_path) * self.mu) * step
        one = np.outer(self.path, self.path) + (1.0 - steady) * self.c_path * (2.0 - self.c_path) * self.covariance
        self.covariance = (
            (1.0 - self.c_one - self.c_mu) * self.covariance + self.c_one * one + self.c_mu * (best.T * self.weights) @ best
        )
        self.sigma *= float(np.exp(self.c_sigma / self.damping * (length / self.length - 1.0)))


@dataclass
class Scout:
    """One such search; as tune.search.Study. start: settings to begin at."""

    name: str
    way: str
    base: Alfa46Config
    task: Task
    start: dict[str, int]
    seed: int
    entries: list[dict] = field(default_factory=list)

    @property
    def generation(self) -> int:
        """The next one."""
        return len(self.entries) // POPULATION

    def order(self) -> list[int]:
        """As tune.search.Study's: those first that were the worst of the most settings."""
        return hardest_first(self.entries, self.task)

    def cut(self) -> float:
        """What half of the last generation stayed below: settings beyond it are tried no further."""
        last = sorted(entry["value"] for entry in self.entries[-POPULATION:])
        return last[POPULATION // 2 - 1] if last else INVALID

    @property
    def shifts(self) -> int:
        """How many were tried so far."""
        return sum(entry["tried"] for entry in self.entries)

    def best(self, count: int) -> list[dict[str, int]]:
        """The best settings so far, each once."""
        out: list[dict[str, int]] = []
        for entry in sorted(self.entries, key=lambda e: e["value"]):
            if entry["value"] < INVALID and entry["values"] not in out:
                out.append(entry["values"])
        return out[:count]


def run(scout: Scout, workers: Workers, note: Callable[[list[dict], float], None], until: Callable[[], bool]) -> None:
    """Generations until ``until()`` says so or the search has come to its end; ``note`` as in tune.search."""
    low, high = (np.array(column, dtype=float) for column in zip(*BOUNDS.values()))
    cma = Cma((np.array([scout.start[name] for name in BOUNDS]) - low) / (high - low), SIGMA, scout.seed)
    known = list(scout.entries)
    while cma.sigma > DONE and (known or not until()):
        shares = cma.ask()
        if known:
            entries, known = known[:POPULATION], known[POPULATION:]
        else:
            tries = [
                {name: int(value) for name, value in zip(BOUNDS, row)}
                for row in np.rint(low + np.clip(shares, 0.0, 1.0) * (high - low))
            ]
            judge = partial(evaluate, scout.task.pickled(), scout.way, scout.base, scout.cut(), scout.order())
            found = workers.map(judge, tries)
            cpu = sum(one.pop("cpu") for one in found)
            entries = [{"values": values, **one} for values, one in zip(tries, found)]
            scout.entries += entries
            note(entries, cpu)
        outside = np.sum(np.maximum(0.0, shares - 1.0) + np.maximum(0.0, -shares), axis=1)
        cma.tell([entry["value"] + float(far) for entry, far in zip(entries, outside)])


def evaluate(pickled: bytes, way: str, base: Alfa46Config, cut: float, order: list[int], values: dict[str, int]) -> dict:
    """``value``: the POWER mean over all shifts, tried in this order, of the largest share in each, with what bounds are
    missed by; where that is beyond ``cut``, by the share of shifts that were left to try. REFUSED and INVALID as in
    tune.search; ``tried``: shifts, ``hardest``: number of the worst one, ``cpu``: seconds.
    """
    begun = time.process_time()
    ground = Ground.of(pickled)
    task = ground.task

    def found(value: float, tried: int, hardest: int | None) -> dict:
        return {"value": value, "tried": tried, "hardest": hardest, "cpu": time.process_time() - begun}

    too_much = refused(task.rigs[0], way, values)
    if too_much > 0.0:
        return found(REFUSED + too_much, 0, None)
    config = settings(base, way, values, task.rigs[0].transmission)
    places = [place for place in order if ground.compared_at(place).valid]
    total, most, hardest = 0.0, 0.0, None
    for tried, place in enumerate(places, 1):
        shift, compared = ground.shift_at(place, config), ground.compared_at(place)
        left = 1.0 - tried / len(places)
        if not shift.valid:
            return found(INVALID + left, tried, place)
        worst = max(sought(name, shift, compared) for name in task.objectives)
        worst = max(0.0, worst + BOUND_WEIGHT * excess(task, shift, compared))
        if worst > most:
            most, hardest = worst, place
        total += worst**POWER / len(places)
        if left and total > cut**POWER:
            return found(cut + left, tried, hardest)
    return found(total ** (1.0 / POWER), len(places), hardest)
