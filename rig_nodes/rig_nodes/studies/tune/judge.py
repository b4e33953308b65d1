# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The value of found settings where they were not sought: at other operating points, on other rigs, and at the largest load.

Used by studies.tune.run after the search.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from ...analysis import shifts
from ...base import RigError
from ...rig import Alfa46Config, RigConfig
from ...runs import Workers, load_sequence, record
from .bench import RPM, Bench, Point, Shift
from .problem import Ground, Task, excess, share

if TYPE_CHECKING:
    from collections.abc import Callable

ENGINE = 271.0  # Nm, the engine that the gearbox was made for (thesis 1, John Deere 4045TF280)
LOAD_FROM, LOAD_WITHIN = 20.0, 2.0  # Nm: load at which the search for the largest load begins, and how near that search comes


DETAILS = {"peak": ("rise",), "time": ("t_c", "t_dt")}  # objective -> shares that are counted beside its own share


@dataclass(frozen=True)
class Verdict:
    """Comparison of settings with the compared ones, shift by shift.

    Each pair is a shift with these settings and the same one with the compared settings, on one rig at one operating point.

    Parameters
    ----------
    pairs : int
        Number of pairs.
    better : int
        Pairs in which every share is below 1.
    failed : int
        Pairs in which these settings have no shift.
    missed : int
        Pairs in which a bound is not kept.
    left_out : int
        Shifts that the compared settings do not make, so that nothing can be compared.
    rigs : int
        Number of rigs with a pair.
    better_rigs : int
        Rigs on which every share is below 1 in the mean over the operating points, and the highest peak is no higher.
    shares : dict of str to (float, float)
        Worst and mean share of each objective and of its DETAILS.
    highest_peak : float
        Highest peak torque of these settings [Nm].
    compared_peak : float
        Highest peak torque of the compared settings [Nm].
    """

    pairs: int
    better: int
    failed: int
    missed: int
    left_out: int
    rigs: int
    better_rigs: int
    shares: dict[str, tuple[float, float]]
    highest_peak: float
    compared_peak: float

    @property
    def dominates(self) -> bool:
        """True when the settings are better in every single shift, with no shift failed and all bounds kept."""
        return 0 < self.pairs == self.better and not self.missed

    def as_dict(self) -> dict:
        """Return the counts and shares by the names that they have in the tuning's folder."""
        return {
            "pairs": self.pairs,
            "better": self.better,
            "failed": self.failed,
            "bounds_missed": self.missed,
            "left_out": self.left_out,
            "rigs": self.rigs,
            "better_rigs": self.better_rigs,
            "dominates": self.dominates,
            "highest_peak_nm": self.highest_peak,
            "compared_highest_peak_nm": self.compared_peak,
            "shares": {name: {"worst": worst, "mean": mean} for name, (worst, mean) in self.shares.items()},
        }


def verdicts(task: Task, candidates: list[Alfa46Config], workers: Workers) -> list[Verdict]:
    """Judge settings on all rigs and points of a task.

    Parameters
    ----------
    task : Task
        Rigs, points and the settings to compare with.
    candidates : list of Alfa46Config
        The settings.
    workers : Workers
        The worker processes.

    Returns
    -------
    list of Verdict
        One verdict for each of the settings.
    """
    items = [(place, rig) for place in range(len(candidates)) for rig in range(len(task.rigs))]
    parts = workers.map(partial(_on_rig, task.pickled(), candidates), items)
    found: list[list[list]] = [[] for _ in candidates]
    for (place, _), pairs in zip(items, parts):
        found[place].append(pairs)
    return [_verdict(task, rigs) for rigs in found]


def _on_rig(pickled: bytes, candidates: list[Alfa46Config], item: tuple[int, int]) -> list[tuple[Shift, Shift]]:
    place, rig = item
    return Ground.of(pickled).pairs(rig, candidates[place])


def _verdict(task: Task, rigs: list[list[tuple[Shift, Shift]]]) -> Verdict:
    names = [name for name in task.objectives if name != "dip"]
    share_names = [*task.objectives, *(detail for name in names for detail in DETAILS.get(name, ()))]
    shares: dict[str, list[float]] = {name: [] for name in share_names}
    better = failed = missed = better_rigs = 0
    for pairs in rigs:
        good = [pair for pair in pairs if pair[0].valid]
        of_rig = {name: [share(name, *pair) for pair in good] for name in share_names}
        for name, values in of_rig.items():
            shares[name] += values
        failed += len(pairs) - len(good)
        missed += sum(excess(task, *pair) > 0.0 for pair in good)
        better += sum(all(of_rig[name][k] < 1.0 for name in names) for k in range(len(good)))
        better_rigs += (
            bool(good)
            and all(sum(of_rig[name]) < len(good) for name in names)
            and (max(shift.number("peak") for shift, _ in good) <= max(compared.number("peak") for _, compared in good))
        )
    every = [pair for pairs in rigs for pair in pairs]
    return Verdict(
        len(every),
        better,
        failed,
        missed,
        len(rigs) * len(task.points) - len(every),
        sum(bool(pairs) for pairs in rigs),
        better_rigs,
        {name: (max(x), sum(x) / len(x)) for name, x in shares.items() if x},
        max((shift.number("peak") for shift, _ in every if shift.valid), default=float("nan")),
        max((compared.peak for _, compared in every), default=float("nan")),
    )


def is_measurable(config: RigConfig) -> bool:
    """Return whether the sequence of :func:`as_measured` is of this rig's signals and devices."""
    try:
        load_sequence("grid_point").check_rig(config)
    except RigError:
        return False
    return True


def as_measured(
    config: RigConfig, settings: Iterable[Alfa46Config], points: Iterable[Point], workers: Workers, seed: int
) -> list[list[dict | None]]:
    """Measure shifts with the sequence ``grid_point`` and its transducers, as the laboratory would have measured them.

    Parameters
    ----------
    config : RigConfig
        The rig.
    settings : iterable of Alfa46Config
        Settings of the controller.
    points : iterable of Point
        Operating points.
    workers : Workers
        The worker processes.
    seed : int
        Seed of the first point; each further point has the next one.

    Returns
    -------
    list of list of (dict or None)
        Metrics for each of the settings and each of the points; None where the sequence failed.
    """
    settings, points = list(settings), list(points)
    items = [(one, point, seed + number) for one in settings for number, point in enumerate(points)]
    rows = iter(workers.map(partial(_measured, config), items))
    return [[next(rows) for _ in points] for _ in settings]


def _measured(config: RigConfig, item: tuple[Alfa46Config, Point, int]) -> dict | None:
    from dataclasses import replace

    settings, point, seed = item
    gears = config.transmission.ways()[point.way]
    up, down = (point.output_torque, point.output_torque) if gears[1] > gears[0] else (40.0, point.output_torque)
    sequence = load_sequence(
        "grid_point", {"speed": f"{point.speed / RPM!r} rpm", "load_up": f"{up!r} Nm", "load_down": f"{min(down, 240.0)!r} Nm"}
    )
    run = record(replace(config, alfa46=settings), sequence, seed)
    rows = [row for row in shifts(run.recording) if (row["from_gear"], row["to_gear"]) == gears and row["input_speed_rpm"]]
    return rows[-1] if rows and rows[-1]["t_c_s"] is not None else None


# ---- the largest load


@dataclass(frozen=True)
class Heavy:
    """Downshifts at one speed, with the settings sought for the least peak and with the compared ones.

    Parameters
    ----------
    speed : float
        Speed of the input [rad/s].
    load : float
        Largest load [Nm].
    before : float
        Torque of the input at this load before the shift [Nm].
    least : float or None
        Peak with the settings sought for this [Nm].
    compared : float or None
        Peak with the compared settings [Nm].
    before_load : float
        Largest load at which ``before`` stays within the engine's torque [Nm].
    least_load : float
        Largest load at which ``least`` stays within the engine's torque [Nm].
    compared_load : float
        Largest load at which ``compared`` stays within the engine's torque [Nm].
    """

    speed: float
    load: float
    before: float
    least: float | None
    compared: float | None
    before_load: float
    least_load: float
    compared_load: float

    def as_dict(self) -> dict:
        """Return speeds [rpm] and torques [Nm] by the names that they have in the tuning's folder."""
        return {
            "input_speed_rpm": self.speed / RPM,
            "load_nm": self.load,
            "input_torque_before_nm": self.before,
            "least_peak_nm": self.least,
            "compared_peak_nm": self.compared,
            "engine_nm": ENGINE,
            "load_within_engine_nm": {
                "before_the_shift": self.before_load,
                "least_peak": self.least_load,
                "compared": self.compared_load,
            },
        }


def heavy(config: RigConfig, best: Alfa46Config, compared: Alfa46Config, points: list[Point], workers: Workers) -> list[Heavy]:
    """Examine downshifts on the rig itself.

    Parameters
    ----------
    config : RigConfig
        The rig.
    best : Alfa46Config
        Settings sought for the least peak.
    compared : Alfa46Config
        Settings to compare with.
    points : list of Point
        Operating points, all of one way down.
    workers : Workers
        The worker processes.

    Returns
    -------
    list of Heavy
        One result for each point.
    """
    return workers.map(partial(_heavy, config, best, compared), points)


def _heavy(config: RigConfig, best: Alfa46Config, compared: Alfa46Config, point: Point) -> Heavy:
    bench = Bench(config)
    ours, theirs = bench.shift(point, best), bench.shift(point, compared)

    def within(read: Callable[[float], float]) -> float:
        """Return the largest load at which ``read`` stays within the engine's torque, found by halving."""
        low, high = LOAD_FROM, point.output_torque
        if read(high) <= ENGINE:
            return high
        while high - low > LOAD_WITHIN:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if read(middle) <= ENGINE else (low, middle)
        return low

    def peak(settings: Alfa46Config) -> Callable[[float], float]:
        def read(load: float) -> float:
            shift = bench.shift(Point(point.way, point.speed, load), settings)
            return shift.number("peak") if shift.valid else float("inf")

        return read

    return Heavy(
        point.speed,
        point.output_torque,
        ours.before,
        ours.peak,
        theirs.peak,
        within(lambda load: bench.shift(Point(point.way, point.speed, load), compared).before),
        within(peak(best)),
        within(peak(compared)),
    )
