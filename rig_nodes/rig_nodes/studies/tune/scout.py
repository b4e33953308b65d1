# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The start of the search: settings whose worst shifts are good, found by the covariance matrix adaptation (CMA-ES).

Used by studies.tune.run ahead of studies.tune.search. NSGA-II alone, started at the existing settings, stays with them: no settings
near them are better in every shift, and those that are have another filling. One smooth number over all rigs leads there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...base import optional
from ...rig import Alfa46Config
from ...runs import Workers
from .problem import INVALID, REFUSED, Ground, Task, excess, hardest_first, sought
from .space import BOUNDS, refused, settings

if TYPE_CHECKING:
    pass

POPULATION = 16
SIGMA, DONE = 0.03, 0.004  # standard deviation of the first and of the last generation, as shares of the bounds
POWER = 32.0  # exponent of the mean over shifts: the mean is close to the worst shift, but every shift counts
BOUND_WEIGHT = 2.0


@dataclass
class Scout:
    """One such search, with the fields of studies.tune.search.Study; ``start`` holds the settings to begin at."""

    name: str
    way: str
    base: Alfa46Config
    task: Task
    start: dict[str, int]
    seed: int
    entries: list[dict] = field(default_factory=list)

    @property
    def generation(self) -> int:
        """Number of the next generation."""
        return len(self.entries) // POPULATION

    def order(self) -> list[int]:
        """Return the order of the shifts, as in studies.tune.search.Study: those first that were the worst of the most settings."""
        return hardest_first(self.entries, self.task)

    def cut(self) -> float:
        """Return the value that half of the last generation stayed below; settings beyond it are tried no further."""
        last = sorted(entry["value"] for entry in self.entries[-POPULATION:])
        return last[POPULATION // 2 - 1] if last else INVALID

    @property
    def shifts(self) -> int:
        """Number of shifts tried so far."""
        return sum(entry["tried"] for entry in self.entries)

    def best(self, count: int) -> list[dict[str, int]]:
        """Return a number of the best settings so far, each once."""
        out: list[dict[str, int]] = []
        for entry in sorted(self.entries, key=lambda e: e["value"]):
            if entry["value"] < INVALID and entry["values"] not in out:
                out.append(entry["values"])
        return out[:count]


def run(scout: Scout, workers: Workers, note: Callable[[list[dict], float], None], until: Callable[[], bool]) -> None:
    """Run generations until the search has come to its end or is to stop.

    Parameters
    ----------
    scout : Scout
        The search; its entries of an earlier run are taken over.
    workers : Workers
        The worker processes.
    note : callable
        Takes each new generation as a list of entries, and its CPU time [s].
    until : callable
        Returns True when the search is to stop.

    Raises
    ------
    RigError
        When cmaes is not installed.
    """
    low, high = (np.array(column, dtype=float) for column in zip(*BOUNDS.values()))
    shares = np.array([scout.start[name] for name in BOUNDS] - low) / (high - low)
    within = np.tile([0.0, 1.0], (len(BOUNDS), 1))
    cma = optional("cmaes").CMA(shares, SIGMA, bounds=within, seed=scout.seed % 2**32, population_size=POPULATION)
    known = list(scout.entries)
    spread = SIGMA
    while spread > DONE and (known or not until()):
        asked = [cma.ask() for _ in range(POPULATION)]
        spread = float(np.std(asked, axis=0).mean())
        if known:
            entries, known = known[:POPULATION], known[POPULATION:]
        else:
            tries = [{name: int(value) for name, value in zip(BOUNDS, np.rint(low + one * (high - low)))} for one in asked]
            judge = partial(evaluate, scout.task.pickled(), scout.way, scout.base, scout.cut(), scout.order())
            found = workers.map(judge, tries)
            cpu = sum(one.pop("cpu") for one in found)
            entries = [{"values": values, **one} for values, one in zip(tries, found)]
            scout.entries += entries
            note(entries, cpu)
        cma.tell([(one, entry["value"]) for one, entry in zip(asked, entries)])


def evaluate(pickled: bytes, way: str, base: Alfa46Config, cut: float, order: list[int], values: dict[str, int]) -> dict:
    """Judge settings by one number, in a worker process.

    Parameters
    ----------
    pickled : bytes
        The pickled task.
    way : str
        Name of the shift, e.g. I-II.
    base : Alfa46Config
        Settings that the values replace in part.
    cut : float
        Value beyond which no more shifts are tried.
    order : list of int
        Numbers of the shifts in the order in which they are tried.
    values : dict of str to int
        The settings, by the names of studies.tune.space.BOUNDS.

    Returns
    -------
    dict
        ``value`` is the POWER mean over all shifts of the largest share in each plus the weighted excess over the bounds;
        where it is beyond ``cut``, it is ``cut`` plus the share of shifts that were left to try. REFUSED and INVALID are as
        in studies.tune.search. ``tried`` is the number of shifts, ``hardest`` the number of the worst one, ``cpu`` the time [s].
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
