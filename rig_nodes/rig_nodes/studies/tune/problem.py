# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is tuned: the operating range, the objectives with their bounds, and the rigs on which the result must hold.

Used by studies.tune.search and studies.tune.judge; these are plain data that go to worker processes and into the folder.
"""

from __future__ import annotations

import pickle
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc

from ...analysis import unlike
from ...rig import Alfa46Config, RigConfig
from .bench import Bench, NotHeld, Point, Shift

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import TypeVar

    Entry = TypeVar("Entry")

# objective -> (what it is, unit). All but the dip are shares of the compared settings' value in the same shift.
OBJECTIVES = {
    "peak": ("highest torque of the input from the order until everything is at rest", "Nm"),
    "time": ("t_c, from the order to the new gear; as a share, the larger one of t_c and t_dt", "s"),
    "dip": ("by how much k lies below 1", "-"),
    "energy": ("heat of both clutches", "J"),
    "jerk": ("largest change of the output's acceleration", "rad/s3"),
}
FIELDS = {"peak": "peak", "time": "time", "t_c": "time", "t_dt": "t_dt", "dip": "dip", "energy": "heat", "jerk": "jerk"}
DIP = 0.05  # from here on Annex A calls it a dip: no settings may dip further than this, or than the compared ones
# value of every objective for settings that make no shift at all, so high that no settings with a shift are worse
REFUSED, INVALID = 10.0, 5.0
RISE = 15.0  # Nm: a smaller rise of the peak counts as this much; otherwise a single Nm would decide the search
LOAD_STEP = 10.0  # Nm in which a load that the rig does not hold is lowered


@dataclass(frozen=True)
class Range:
    """Speeds and torques over which one way is tuned.

    Parameters
    ----------
    low_speed, high_speed : float
        Speeds of the input [rad/s].
    low_load, high_load : float
        Torques at the output [Nm].
    """

    low_speed: float
    high_speed: float
    low_load: float
    high_load: float

    def grid(self, way: str) -> list[Point]:
        """Return the nine points at the lowest, middle and highest speeds and loads of a way."""
        speeds, loads = (self.low_speed, self.high_speed), (self.low_load, self.high_load)
        return [Point(way, n, m) for n in (speeds[0], 0.5 * sum(speeds), speeds[1]) for m in (loads[0], 0.5 * sum(loads), loads[1])]

    def heaviest(self, way: str) -> list[Point]:
        """Return points of a way with the largest load at three speeds."""
        return [Point(way, n, self.high_load) for n in np.linspace(self.low_speed, self.high_speed, 3).tolist()]

    def inside(self, way: str, count: int, seed: int) -> list[Point]:
        """Draw points within the range by a Latin hypercube.

        Parameters
        ----------
        way : str
            Name of the shift, e.g. I-II.
        count : int
            Number of points.
        seed : int
            Seed of the draw.

        Returns
        -------
        list of Point
            The points; the first one has the largest load.
        """
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
    """Shifts that are to be judged.

    Parameters
    ----------
    rigs : tuple of RigConfig
        The rigs; the first one is the rig itself.
    points : tuple of Point
        Operating points.
    compared : Alfa46Config
        Settings that all others are compared with.
    objectives : tuple of str
        Names of the objectives.
    bounds : tuple of (str, float)
        Names of objectives with their largest values [SI].
    limit : float or None
        Largest share that is wanted in any shift; None for any share.
    """

    rigs: tuple[RigConfig, ...]
    points: tuple[Point, ...]
    compared: Alfa46Config
    objectives: tuple[str, ...]
    bounds: tuple[tuple[str, float], ...]
    limit: float | None = None

    def pickled(self) -> bytes:
        """Return the task as bytes for worker processes, which give them to :meth:`Ground.of`."""
        return pickle.dumps(self)


class Ground:
    """A task with its rigs ready to shift, and the results of the compared settings; each worker process has one."""

    def __init__(self, task: Task) -> None:
        self.task, self.benches = task, [Bench(config) for config in task.rigs]
        self.compared = [[bench.shift(point, task.compared) for point in task.points] for bench in self.benches]

    @staticmethod
    def of(pickled: bytes) -> Ground:
        """Return the ground of a pickled task, which is kept for the next call."""
        return _ground(pickled)

    def compared_at(self, place: int) -> Shift:
        """Return the compared settings' shift of a number, counted rig by rig and within a rig point by point."""
        rig, point = divmod(place, len(self.task.points))
        return self.compared[rig][point]

    def shift_at(self, place: int, settings: Alfa46Config) -> Shift:
        """Make the shift of a number with other settings than the compared ones."""
        rig, point = divmod(place, len(self.task.points))
        return self.benches[rig].shift(self.task.points[point], settings)

    def pairs(self, rig: int, settings: Alfa46Config) -> list[tuple[Shift, Shift]]:
        """Make the shifts of one rig in all points in which the compared settings have a valid shift.

        Parameters
        ----------
        rig : int
            Number of the rig in the task.
        settings : Alfa46Config
            Settings of the controller.

        Returns
        -------
        list of (Shift, Shift)
            Each shift with the compared one.
        """
        return [
            (self.benches[rig].shift(point, settings), compared)
            for point, compared in zip(self.task.points, self.compared[rig])
            if compared.valid
        ]


@lru_cache(maxsize=4)
def _ground(pickled: bytes) -> Ground:
    return Ground(pickle.loads(pickled))


def held(config: RigConfig, points: list[Point]) -> tuple[list[Point], list[str]]:
    """Lower the loads of points until the rig holds them.

    Parameters
    ----------
    config : RigConfig
        The rig.
    points : list of Point
        Operating points.

    Returns
    -------
    points : list of Point
        The points that the rig holds, each once.
    notes : list of str
        A sentence for each point that was changed, and for points of one way in which the rig is not in the same state.

    Raises
    ------
    NotHeld
        When no lower load of a point is held.
    Tripped
        When the rig trips.
    """
    bench, out, notes = Bench(config), [], []
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
            notes.append(f"{point.text()} is more than the rig holds; {chosen.text()} in its place")
        if chosen not in out:
            out.append(chosen)
    return out, notes + unlike([(one.text(), bench.started(one), {}) for one in out], bench.transmission)


def share(name: str, shift: Shift, compared: Shift) -> float:
    """Return an objective of one shift as a share of the compared shift's value; the dip is returned as it is.

    Parameters
    ----------
    name : str
        An objective; also ``t_c`` and ``t_dt`` by themselves, and ``rise``, the rise of the peak above the torque before
        the shift: 1 plus the difference of the peaks over the compared rise, or over RISE when that is larger.
    shift : Shift
        A valid shift.
    compared : Shift
        The same shift with the compared settings.

    Returns
    -------
    float
        The share.
    """
    if name == "dip":
        return shift.number("dip")
    if name == "rise":
        peak, before = compared.number("peak"), compared.before
        return 1.0 + (shift.number("peak") - peak) / max(peak - before, RISE)
    if name == "time":
        return max(share("t_c", shift, compared), share("t_dt", shift, compared))
    return shift.number(FIELDS[name]) / compared.number(FIELDS[name])


def excess(task: Task, shift: Shift, compared: Shift) -> float:
    """Return by how much a shift misses the bounds of a task; 0 when it keeps all of them.

    The dip counts by its difference from the bound, every other objective by the share of the bound that it exceeds.
    """
    limits = dict(task.bounds)
    dip = limits.pop("dip", max(DIP, compared.number("dip")))
    over = sum(max(0.0, shift.number(FIELDS[name]) / limit - 1.0) for name, limit in limits.items())
    return max(0.0, shift.number("dip") - dip) + over


def sought(name: str, shift: Shift, compared: Shift) -> float:
    """Return what the search lowers: the share of the objective, for the peak that of its rise above the torque before the shift.

    No settings change the torque before the shift, and in relation to it the few Nm that matter at a heavy load would not
    be noticed. Either share is below 1 when the other is.
    """
    return share("rise" if name == "peak" else name, shift, compared)


def hardest_first(entries: list[dict], task: Task) -> list[int]:
    """Return the numbers of all shifts in the order in which they are tried.

    Parameters
    ----------
    entries : list of dict
        Entries of a search; ``hardest`` is the number of an entry's worst shift.
    task : Task
        The task of the search.

    Returns
    -------
    list of int
        Numbers of the shifts, counted rig by rig and point by point; the first ones were the worst of the most entries.
    """
    counts = Counter(entry["hardest"] for entry in entries)
    return sorted(range(len(task.rigs) * len(task.points)), key=lambda place: (-counts[place], place))


def dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    """Return whether objectives are nowhere worse and somewhere better than others."""
    return all(a <= b for a, b in zip(one, other)) and any(a < b for a, b in zip(one, other))


def front_of(entries: list[Entry], values: Callable[[Entry], Sequence[float]]) -> list[Entry]:
    """Return the entries that no other entry dominates.

    Parameters
    ----------
    entries : list
        The entries.
    values : callable
        Returns the objectives of an entry.

    Returns
    -------
    list
        The entries of the front, one for each set of values, sorted by the first objective.
    """
    kept, seen = [], set()
    for entry in sorted(entries, key=lambda e: tuple(values(e))):
        mine = tuple(values(entry))
        if mine not in seen and not any(dominates(values(other), mine) for other in kept):
            kept.append(entry)
            seen.add(mine)
    return [e for e in kept if not any(dominates(values(o), values(e)) for o in kept)]
