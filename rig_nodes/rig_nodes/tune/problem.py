# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is tuned: the operating range, the objectives with their bounds, and the rigs over which it must hold.

Used by tune.search and tune.judge; plain data that goes to worker processes and into the folder.
"""

from __future__ import annotations

import pickle
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc

from ..alfa46.settings import Alfa46Config
from ..testbench.configuration import RigConfig
from .bench import Bench, NotHeld, Point, Shift

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import TypeVar

    Entry = TypeVar("Entry")

# objective -> (what it is, unit). All but the dip are shares of what the compared settings give in the same shift
OBJECTIVES = {
    "peak": ("highest torque of the input from the order until everything is at rest", "Nm"),
    "time": ("t_c, from the order to the new gear; as a share, the larger one of t_c and t_dt", "s"),
    "dip": ("by how much k lies below 1", "-"),
    "energy": ("heat of both clutches", "J"),
    "jerk": ("largest change of the output's acceleration", "rad/s3"),
}
FIELDS = {"peak": "peak", "time": "time", "t_c": "time", "t_dt": "t_dt", "dip": "dip", "energy": "heat", "jerk": "jerk"}
DIP = 0.05  # what Annex A calls a dip: no settings may dip further than this, or than the compared ones
# objectives of settings that are no shift at all, all the same, so that nothing that shifts is worse
REFUSED, INVALID = 10.0, 5.0
RISE = 15.0  # Nm: a smaller rise of that torque counts as this much, or a Nm would be the most of what is sought
LOAD_STEP = 10.0  # Nm in which a load that the rig does not hold is lowered


@dataclass(frozen=True)
class Range:
    """Speeds of the input [rad/s] and torques at the output [Nm] of one way."""

    low_speed: float
    high_speed: float
    low_load: float
    high_load: float

    def grid(self, way: str) -> list[Point]:
        """Lowest, middle and highest of speeds and loads, each with each."""
        speeds, loads = (self.low_speed, self.high_speed), (self.low_load, self.high_load)
        return [Point(way, n, m) for n in (speeds[0], 0.5 * sum(speeds), speeds[1]) for m in (loads[0], 0.5 * sum(loads), loads[1])]

    def heaviest(self, way: str) -> list[Point]:
        """The largest load at three speeds."""
        return [Point(way, n, self.high_load) for n in np.linspace(self.low_speed, self.high_speed, 3).tolist()]

    def inside(self, way: str, count: int, seed: int) -> list[Point]:
        """``count`` points by a Latin hypercube; the first one has the largest load."""
        places = qmc.LatinHypercube(2, seed=np.random.default_rng(seed)).random(count).tolist()
        points = [
            Point(
                way, self.low_speed + a * (self.high_speed - self.low_speed), self.low_load + b * (self.high_load - self.low_load)
            )
            for a, b in places
        ]
        return [Point(way, points[0].speed, self.high_load), *points[1:]]


@dataclass(frozen=True)
class Task:
    """Shifts to be judged: rigs (the first is the rig itself), points, the settings that all others are compared with,
    objectives and bounds (name -> largest value, SI). limit: the largest share that is wanted in any shift, None: any.
    """

    rigs: tuple[RigConfig, ...]
    points: tuple[Point, ...]
    compared: Alfa46Config
    objectives: tuple[str, ...]
    bounds: tuple[tuple[str, float], ...]
    limit: float | None = None

    def pickled(self) -> bytes:
        """What goes to worker processes, for :meth:`Ground.of`."""
        return pickle.dumps(self)


class Ground:
    """A task with its rigs warm, and what the compared settings give; one for each process."""

    def __init__(self, task: Task) -> None:
        self.task, self.benches = task, [Bench(config) for config in task.rigs]
        self.compared = [[bench.shift(point, task.compared) for point in task.points] for bench in self.benches]

    @staticmethod
    def of(pickled: bytes) -> Ground:
        """The ground of a pickled task, kept for the next call."""
        return _ground(pickled)

    def compared_at(self, place: int) -> Shift:
        """What the compared settings give in a shift by its number: rig by rig, point by point."""
        rig, point = divmod(place, len(self.task.points))
        return self.compared[rig][point]

    def shift_at(self, place: int, settings: Alfa46Config) -> Shift:
        """The same shift with other settings."""
        rig, point = divmod(place, len(self.task.points))
        return self.benches[rig].shift(self.task.points[point], settings)

    def pairs(self, rig: int, settings: Alfa46Config) -> list[tuple[Shift, Shift]]:
        """(shift, the compared one) of one rig in all points in which the compared settings shift at all."""
        return [
            (self.benches[rig].shift(point, settings), compared)
            for point, compared in zip(self.task.points, self.compared[rig])
            if compared.valid
        ]


@lru_cache(maxsize=4)
def _ground(pickled: bytes) -> Ground:
    return Ground(pickle.loads(pickled))


def held(config: RigConfig, points: list[Point]) -> tuple[list[Point], list[str]]:
    """(points, loads lowered until the rig holds them; a sentence for each that was); NotHeld where none helps,
    Tripped where the rig trips.
    """
    bench, out, said = Bench(config), [], []
    for point in points:
        chosen = point
        while True:
            try:
                bench.check_held(chosen)
                break
            except NotHeld:
                if chosen.output_torque <= LOAD_STEP:
                    raise
                chosen = Point(point.way, point.speed, chosen.output_torque - LOAD_STEP)
        if chosen != point:
            said.append(f"{point.text()} is more than the rig holds; {chosen.text()} in its place")
        if chosen not in out:
            out.append(chosen)
    return out, said


def share(name: str, shift: Shift, compared: Shift) -> float:
    """An objective of one shift: a share of the compared one's, the dip as it is. Beside the objectives ``rise``, of
    the peak above the torque before the shift (by how much the peaks differ, over the compared rise or RISE), and ``t_c`` and
    ``t_dt`` by themselves.
    """
    if name == "dip":
        return shift.dip
    if name == "rise":
        return 1.0 + (shift.peak - compared.peak) / max(compared.peak - compared.before, RISE)
    if name == "time":
        return max(share("t_c", shift, compared), share("t_dt", shift, compared))
    return getattr(shift, FIELDS[name]) / getattr(compared, FIELDS[name])


def excess(task: Task, shift: Shift, compared: Shift) -> float:
    """By how much a shift misses the bounds; 0: not at all."""
    limits = dict(task.bounds)
    dip = limits.pop("dip", max(DIP, compared.dip))
    return max(0.0, shift.dip - dip) + sum(max(0.0, getattr(shift, FIELDS[name]) / limit - 1.0) for name, limit in limits.items())


def sought(name: str, shift: Shift, compared: Shift) -> float:
    """What the search lowers: the share, of the peak that of its rise above the torque before the shift. No settings change
    what it is before, and against that a heavy load's few Nm would not be seen. Either is below 1 when the other is.
    """
    return share("rise" if name == "peak" else name, shift, compared)


def hardest_first(entries: list[dict], task: Task) -> list[int]:
    """Numbers of all shifts (rig by rig, point by point), those first that were the worst of the most entries."""
    counts = Counter(entry["hardest"] for entry in entries)
    return sorted(range(len(task.rigs) * len(task.points)), key=lambda place: (-counts[place], place))


def dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether objectives are nowhere worse and somewhere better."""
    return all(a <= b for a, b in zip(one, other)) and any(a < b for a, b in zip(one, other))


def front_of(entries: list[Entry], values: Callable[[Entry], Sequence[float]]) -> list[Entry]:
    """The entries whose ``values(entry)`` nobody else's dominate, each value once, sorted by the first objective."""
    kept, seen = [], set()
    for entry in sorted(entries, key=lambda e: tuple(values(e))):
        mine = tuple(values(entry))
        if mine not in seen and not any(dominates(values(other), mine) for other in kept):
            kept.append(entry)
            seen.add(mine)
    return [e for e in kept if not any(dominates(values(o), values(e)) for o in kept)]
