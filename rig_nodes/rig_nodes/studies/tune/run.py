# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A whole tuning: searches for both ways and for the largest load, judgement elsewhere, and the files of fronts and controllers.

Used by the verb ``tune``.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ... import __version__
from ...base import RigError, atomic_write, quoted, sources_key
from ...rig import Alfa46Config, RigConfig, read_alfa46
from ...runs import Tripped, Workers
from ..sweep.store import Journal
from ..validation.calibrate import Calibration
from . import folder as files
from . import judge, scout, search
from .bench import Bench, Point, Shift
from .problem import Range, Task, held
from .space import inside, settings, values_of
from .uncertainty import misses_now, sampled_rigs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Draw = Callable[[str, str, Sequence[Mapping], Mapping[str, Mapping]], None]

LEAST = "least"  # the search for the smallest peak at the largest load, in the first of the ways down
SCOUT = "scout "  # prefix of a way's name, for its scout
# parts of the tried shifts: of each way's scout, of the search of a way up, of that of a way down, and of the least peak's search
SCOUTING, UP, DOWN, LEAST_PART = 33, 10, 11, 3
SCOUT_POINTS = slice(None, None, 2)  # of the search's points: corners and middle of the grid
FOUND = 20  # settings that a search takes over from its scout
LIMIT = 1.0  # largest share of any shift, so that no gain costs a shift that is worse than the compared one
DRAWS = 10  # draws of sampled rigs at most
SHIFTING = 0.75  # share of the points in which the compared settings must shift on a sampled rig
SEARCH, JUDGE, FRESH, SHOWN = range(4)  # uses for which rigs and points are drawn, each with seeds of its own
CANDIDATES = 20  # settings of a front that are judged elsewhere, at most
CHOICES = ("soft", "balanced", "fast")


@dataclass(frozen=True)
class Problem:
    """What a tuning was asked for.

    Parameters
    ----------
    rig : str
        Name or file of the rig.
    config : RigConfig
        The rig.
    calibration : Calibration
        Its calibration, without stages for a rig that was never calibrated.
    begin : dict of str to dict of str to int
        Settings at which the search for a way begins, by way; without them, those nearest to the controller's that it tries.
    ranges : dict of str to Range
        Operating range of each way.
    objectives : tuple of str
        Names of the objectives.
    bounds : dict of str to float
        Largest values of objectives [SI].
    spreads : dict of str to float
        Spreads of the calibrated parameters [SI].
    oil : (float, float)
        Lowest and highest temperature of the oil [degC].
    rigs : int
        Number of sampled rigs beside the rig itself in the search.
    judge_rigs : int
        Number of sampled rigs beside the rig itself in a judgement.
    points : int
        Operating points of each way in a judgement.
    fresh : int
        Number of judgements of the written controllers, each on rigs and in points of its own.
    seed : int
        Seed of all draws.
    generations : int or None
        Generations of each search at most; None for any number.
    shifts : int
        Shifts that the search may try; it then ends with the generation that it is in.
    """

    rig: str
    config: RigConfig
    calibration: Calibration
    begin: dict[str, dict[str, int]]
    ranges: dict[str, Range]
    objectives: tuple[str, ...]
    bounds: dict[str, float]
    spreads: dict[str, float]
    oil: tuple[float, float]
    rigs: int
    judge_rigs: int
    points: int
    fresh: int
    seed: int
    generations: int | None
    shifts: int

    def beginning(self, way: str) -> tuple[dict[str, int], list[str]]:
        """Return the settings at which the search for a way begins, and a note where they are not those that the rig has."""
        if way in self.begin:
            return self.begin[way], []
        own = values_of(self.config.alfa46, way, self.config.transmission)
        nearest = inside(own)
        units = {name: "mA" if name.endswith("current") else "ms" for name in own if own[name] != nearest[name]}
        there, tried = (", ".join(f"{name} {of[name]} {unit}" for name, unit in units.items()) for of in (own, nearest))
        why = f"{way}: the search tries no {there}, which the controller has, and begins at {tried}"
        return nearest, [f"{why}, or where tuning.yaml in the rig's folder says"] if units else []

    @cached_property
    def _misses(self) -> dict[str, float]:
        return misses_now(self.config, self.calibration, self.spreads)

    def manifest(self) -> dict:
        """Return everything that decides a tuning except its length; no clock, host or folder is in it."""
        return {
            "rig": self.rig,
            "configuration": self.config.as_dict(),
            "begin": self.begin,
            "ranges": {way: vars(one) for way, one in self.ranges.items()},
            "objectives": list(self.objectives),
            "bounds": self.bounds,
            "spreads": self.spreads,
            "oil_degc": list(self.oil),
            "rigs": self.rigs,
            "judge_rigs": self.judge_rigs,
            "points": self.points,
            "fresh": self.fresh,
            "seed": self.seed,
            "versions": {
                "rig_nodes": __version__,
                "plant": sources_key(),
                "python": platform.python_version(),
                **{name: version(name) for name in ("numpy", "scipy", "numba", "optuna")},
            },
        }

    def drawn(self, *use: int) -> int:
        """Return the seed of what is drawn for a use."""
        return int(np.random.SeedSequence([self.seed, *use]).generate_state(1)[0])

    def task(self, points: list[Point], rigs: list[RigConfig]) -> Task:
        """Return the task of shifts in these points, on the rig itself and on these rigs, compared with the rig's own settings."""
        return Task(
            (self.config, *rigs), tuple(points), self.config.alfa46, self.objectives, tuple(sorted(self.bounds.items())), LIMIT
        )

    def sampled(self, points: dict[str, list[Point]], count: int, workers: Workers, *use: int) -> list[RigConfig]:
        """Sample rigs on which the compared settings shift in at least SHIFTING of the points, those of all ways taken together.

        The laboratory's rows do not allow a rig on which they shift in fewer.

        Parameters
        ----------
        points : dict of str to list of Point
            Operating points of each way.
        count : int
            Number of rigs.
        workers : Workers
            The worker processes.
        *use : int
            What the rigs are drawn for.

        Returns
        -------
        list of RigConfig
            The rigs.

        Raises
        ------
        RigError
            When too few sampled rigs shift.
        """
        every = [point for those in points.values() for point in those]
        chosen: list[RigConfig] = []
        for turn in range(DRAWS):
            missing = count - len(chosen)
            if missing <= 0:
                return chosen
            rigs = sampled_rigs(
                self.config, self.calibration, self.spreads, self._misses, self.oil, missing, self.drawn(*use, turn), workers.map
            )
            shifting = workers.map(partial(_shifting, every, self.config.alfa46), rigs)
            chosen += [rig for rig, share in zip(rigs, shifting) if share >= SHIFTING]
        if len(chosen) < count:
            raise RigError(
                f"in {DRAWS} draws of sampled rigs only {len(chosen)} shift with the settings that are "
                "there; the spreads are too wide, give others with --spreads"
            )
        return chosen


def _compared(points: list[Point], compared: Alfa46Config, rig: RigConfig) -> list[Shift]:
    bench = Bench(rig)
    return [bench.shift(point, compared) for point in points]


def _shifting(points: list[Point], compared: Alfa46Config, rig: RigConfig) -> float:
    return sum(shift.valid for shift in _compared(points, compared, rig)) / len(points)


def run_tuning(
    problem: Problem,
    folder: Path,
    workers: Workers,
    journal: Journal,
    progress: Callable[[float, str], None] | None = None,
    draw: Draw | None = None,
) -> dict:
    """Search, judge and write the folder of a tuning.

    An interrupt is passed on; what the journal holds is not done again.

    Parameters
    ----------
    problem : Problem
        What is asked for.
    folder : Path
        Folder of the tuning.
    workers : Workers
        The worker processes.
    journal : Journal
        The folder's journal, with the entries of an interrupted run.
    progress : callable or None
        Takes the share of the search that is done, and a text on what is done.
    draw : callable or None
        draw(name, way, rows, chosen) draws the front of a way into that file of the folder.

    Returns
    -------
    dict
        The summary.

    Raises
    ------
    RigError
        When the rig does not hold a point, the compared settings shift in none of a way's points, or too few sampled rigs shift.
    Tripped
        When the rig trips in the first point of a way in which no shift succeeds.
    """
    notes: list[str] = []
    known, cpu = _held(journal)
    points: dict[str, list[Point]] = {}
    for way, where in problem.ranges.items():
        points[way], lowered = held(problem.config, where.grid(way))
        notes += lowered + problem.beginning(way)[1]
        shifts = _compared(points[way], problem.config.alfa46, problem.config)
        notes += [
            f"{point.text()} with the settings that are there: {shift.why}"
            for point, shift in zip(points[way], shifts)
            if shift.tripped
        ]
        if not any(shift.valid for shift in shifts):
            raise (Tripped if shifts[0].tripped else RigError)(
                f"with the settings that are there the rig shifts {way} in none of {len(points[way])} operating "
                f"points ({shifts[0].why}), so there is nothing to compare with; choose another range or rig"
            )
    rigs = problem.sampled(points, problem.rigs, workers, SEARCH)
    studies: dict[str, search.Study | scout.Scout] = {}
    ways, parts = searches(problem.config)
    names = [name for name, way in ways.items() if way in problem.ranges]
    for name in names:
        study = _study(problem, name, ways[name], points[ways[name]], rigs, known.get(name, []), studies)
        studies[name] = study
        budget = problem.shifts * parts[name] / sum(parts[other] for other in names)

        def until(study: search.Study | scout.Scout = study, budget: float = budget) -> bool:
            if progress:
                share = min(sum(one.shifts for one in studies.values()) / problem.shifts, 1.0)
                progress(share, f"{study.name}: {study.generation} generations")
            return study.shifts >= budget or (problem.generations is not None and study.generation >= problem.generations)

        def note(entries: list[dict], seconds: float, study: search.Study | scout.Scout = study) -> None:
            cpu.append(seconds)
            journal.add({"study": study.name, "cpu": round(seconds, 3), "entries": entries})

        (scout if isinstance(study, scout.Scout) else search).run(study, workers, note, until)
    if progress:
        progress(1.0, "judging the fronts")
    return _finish(problem, folder, studies, workers, notes, sum(cpu), draw)


def searches(config: RigConfig) -> tuple[dict[str, str], dict[str, int]]:
    """Return the searches of a rig in their order.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    ways : dict of str to str
        Each search with its way.
    parts : dict of str to int
        Each search with its part of the shifts.
    """
    ways, parts = {}, {}
    for way, (of, to) in config.transmission.ways().items():
        ways |= {SCOUT + way: way, way: way}
        parts |= {SCOUT + way: SCOUTING, way: UP if to > of else DOWN}
    heavy = next(way for way, (of, to) in config.transmission.ways().items() if to < of)
    return ways | {LEAST: heavy}, parts | {LEAST: LEAST_PART}


def _study(
    problem: Problem, name: str, way: str, points: list[Point], rigs: list[RigConfig], known: list[dict], studies: dict
) -> search.Study | scout.Scout:
    config = problem.config
    seed = problem.seed * 10 + list(searches(config)[0]).index(name)
    base = values_of(config.alfa46, way, config.transmission)
    if name.startswith(SCOUT):
        task = problem.task(points[SCOUT_POINTS], rigs)
        return scout.Scout(name, way, config.alfa46, task, problem.beginning(way)[0], seed, known)
    if name == LEAST:
        points, _ = held(config, problem.ranges[way].heaviest(way))
        points = [point for point in points if point.output_torque == max(other.output_torque for other in points)]
        task = replace(problem.task(points, []), objectives=("peak", "time"), limit=None)
        start = [base, *(entry["values"] for entry in studies[way].front()[:12])]
    else:
        # The compared settings are not among them: with a share of 1 in every shift they would lead a search that is not there yet.
        task, start = problem.task(points, rigs), studies[SCOUT + way].best(FOUND) or [base]
    return search.Study(name, way, config, config.alfa46, task, start, seed, known)


def _held(journal: Journal) -> tuple[dict[str, list[dict]], list[float]]:
    """Return what a journal holds: the entries of each study, and the processor times [s]."""
    known: dict[str, list[dict]] = {}
    cpu: list[float] = []
    for note in journal.entries():
        known.setdefault(note["study"], []).extend(note["entries"])
        cpu.append(note["cpu"])
    return known, cpu


def _elsewhere(problem: Problem, workers: Workers, *use: int) -> dict[str, Task]:
    """Return for each way a judgement in operating points and on rigs that are drawn for this use alone."""
    points = {
        way: held(problem.config, where.inside(way, problem.points, problem.drawn(*use, number)))[0]
        for number, (way, where) in enumerate(problem.ranges.items())
    }
    rigs = problem.sampled(points, problem.judge_rigs, workers, *use, len(points))
    return {way: problem.task(those, rigs) for way, those in points.items()}


def _finish(
    problem: Problem,
    folder: Path,
    studies: dict[str, search.Study],
    workers: Workers,
    notes: list[str],
    cpu: float,
    draw: Draw | None,
) -> dict:
    config, base = problem.config, problem.config.alfa46
    rows: list[dict] = []
    chosen: dict[str, dict[str, dict]] = {}
    judgement = _elsewhere(problem, workers, JUDGE)
    for way, study in studies.items():
        if way not in problem.ranges:
            continue
        mine = _judged_front(problem, study, judgement[way], workers)
        chosen[way] = choose(mine, problem.objectives)
        rows += mine
    manifest = problem.manifest()
    files.write_front(folder, rows, manifest)
    if draw is not None:
        for way in chosen:
            draw(f"{files.FRONT}_{way}", way, [row for row in rows if row["way"] == way], chosen[way])
    controllers = _write_controllers(problem, folder, chosen)
    summary = {
        "folder": str(folder),
        "search_cpu_seconds": round(cpu, 1),
        "notes": notes,
        "searches": {
            name: {
                "generations": study.generation,
                "settings": len(study.entries),
                "shifts": study.shifts,
                "shifts_like": f"{len(study.task.rigs)} rigs x {len(study.task.points)} points",
                "front": len(study.front()) if isinstance(study, search.Study) else None,
            }
            for name, study in studies.items()
        },
        "front": {
            way: {
                "settings": sum(row["way"] == way for row in rows),
                "dominating": sum(row["way"] == way and row["dominates"] for row in rows),
            }
            for way in chosen
        },
        "chosen": {way: dict(of.items()) for way, of in chosen.items()},
        "verdicts": [
            _verdict(_elsewhere(problem, workers, FRESH, number), controllers, workers) for number in range(problem.fresh)
        ],
        "measured": _measured(problem, controllers, workers),
    }
    if LEAST in studies:
        summary["largest_load"] = _largest_load(studies[LEAST], config, base, workers)
    atomic_write(folder / f"{files.FRONT}.json", _json({**manifest, **summary, "rows": rows}))
    return summary


def _json(data: dict) -> str:
    import json

    from ...analysis import plain

    return json.dumps(plain(data), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _judged_front(problem: Problem, study: search.Study, task: Task, workers: Workers) -> list[dict]:
    """Return the rows of a front, whose settings are judged on other rigs and in other points."""
    front = study.front()
    if len(front) > CANDIDATES:
        front = [front[k] for k in np.unique(np.linspace(0, len(front) - 1, CANDIDATES).round().astype(int))]
    candidates = [settings(study.base, study.way, entry["values"], problem.config.transmission) for entry in front]
    rows = []
    for entry, verdict in zip(front, judge.verdicts(task, candidates, workers)):
        row = {"way": study.way, "dominates": verdict.dominates, **{name: getattr(verdict, name) for name in files.COUNTS}}
        for name, value in zip(problem.objectives, entry["objectives"]):
            row[name] = value
            row[f"{name}_worst"], row[f"{name}_mean"] = verdict.shares.get(name, (None, None))
        row["rise_worst"] = verdict.shares.get("rise", (None, None))[0]
        rows.append({**row, **entry["values"]})
    return rows


def choose(rows: list[dict], objectives: Sequence[str]) -> dict[str, dict]:
    """Choose three settings of a judged front.

    Soft has the least mean of the first objective elsewhere, fast that of the second. Balanced has its worst value, as sought
    and elsewhere, furthest below 1. They are chosen from those that dominate, else from those that are better in the most shifts.

    Parameters
    ----------
    rows : list of dict
        Rows of the front.
    objectives : sequence of str
        Names of the objectives.

    Returns
    -------
    dict of str to dict
        Row of each choice; empty when there are no rows.
    """
    if not rows:
        return {}
    most = max((row["dominates"], row["better"] - row["missed"]) for row in rows)
    kept = [row for row in rows if (row["dominates"], row["better"] - row["missed"]) == most]
    first, second = objectives[:2]

    def value(row: dict, key: str) -> float:
        return float("inf") if row[key] is None else row[key]

    def worst(row: dict) -> float:
        elsewhere = ["rise_worst" if name == "peak" else f"{name}_worst" for name in (first, second)]
        return max(*(value(row, key) for key in elsewhere), row[first], row[second])

    return {
        "soft": min(kept, key=lambda row: (value(row, f"{first}_mean"), value(row, f"{second}_mean"))),
        "balanced": min(kept, key=worst),
        "fast": min(kept, key=lambda row: (value(row, f"{second}_mean"), value(row, f"{first}_mean"))),
    }


def _write_controllers(problem: Problem, folder: Path, chosen: dict) -> dict[str, Alfa46Config]:
    """Write controllers with the settings of both ways as files; return what was read back from them."""
    out = {}
    for name in CHOICES:
        controller = problem.config.alfa46
        for way, of in chosen.items():
            if name in of:
                controller = settings(controller, way, of[name], problem.config.transmission)
        path = folder / f"{name}.yaml"
        atomic_write(path, files.controller_yaml(controller, f"Alfa46, '{name}', found by rig tune"))
        atomic_write(
            folder / f"rig_{name}.yaml",
            files.rig_yaml(problem.rig, path.name, f"{problem.config.name} with the controller '{name}' of rig tune"),
        )
        out[name] = read_alfa46(path)
    return out


def _verdict(tasks: dict[str, Task], controllers: dict[str, Alfa46Config], workers: Workers) -> dict:
    """Return the verdicts on the written controllers, by name and way."""
    out: dict[str, dict] = {name: {} for name in controllers}
    for way, task in tasks.items():
        for name, verdict in zip(controllers, judge.verdicts(task, list(controllers.values()), workers)):
            out[name][way] = verdict.as_dict()
    return out


def _measured(problem: Problem, controllers: dict[str, Alfa46Config], workers: Workers) -> list[dict]:
    """Measure some shifts through sequence, transducers and logger, with the compared settings and with the balanced ones.

    None where the laboratory's sequence is not of the rig.
    """
    if not judge.is_measurable(problem.config):
        return []
    both = {"compared": problem.config.alfa46, "balanced": controllers["balanced"]}
    points = []
    for way, where in problem.ranges.items():
        points += held(problem.config, where.inside(way, 3, problem.drawn(SHOWN)))[0]
    found = judge.as_measured(problem.config, both.values(), points, workers, 1)
    keys = ("input_torque_high_nm", "t_dt_s", "t_c_s", "k")
    return [
        {"point": point.text(), **{name: None if row is None else {key: row[key] for key in keys} for name, row in zip(both, rows)}}
        for point, *rows in zip(points, *found)
    ]


def _largest_load(study: search.Study, config: RigConfig, base: Alfa46Config, workers: Workers) -> dict:
    """Return the least peak found at the largest load, and the load up to which each speed stays within the engine's torque."""
    front = study.front()
    best = front[0]["values"] if front else values_of(base, study.way, config.transmission)
    sought = settings(base, study.way, best, config.transmission)
    found = judge.heavy(config, sought, base, list(study.task.points), workers)
    return {"way": study.way, "settings": best, "tried": len(study.entries), "speeds": [one.as_dict() for one in found]}


def tuning_text(summary: dict, objectives: Sequence[str]) -> str:
    """Return the summary of a tuning with these objectives as text for the terminal."""
    lines = [*summary["notes"]]
    for name, one in summary["searches"].items():
        lines.append(
            f"{name}: {one['settings']} settings in {one['generations']} generations on "
            f"{one['shifts_like']}, {one['shifts']} shifts" + ("" if one["front"] is None else f"; {one['front']} on the front")
        )
    for way, front in summary["front"].items():
        lines.append(
            f"{way}: {front['dominating']} of {front['settings']} settings of the front are better than the "
            "compared ones on every other rig, in operating points that were not searched"
        )
        for name, row in summary["chosen"][way].items():
            shares = ", ".join(f"{key} {row[f'{key}_mean']:.3f}" for key in objectives if row[f"{key}_mean"] is not None)
            lines.append(f"  {name:<9} mean there: {shares}; delay {row['delay']} ms")
    lines.append("fresh rigs and points, that nothing was sought or chosen by (shares of the compared settings):")
    for number, verdict in enumerate(summary["verdicts"], 1):
        for name, ways in verdict.items():
            lines += [f"  draw {number}: {name:<9} {way:<5} {_verdict_text(one)}" for way, one in ways.items()]
    if summary["measured"]:
        lines.append("as measured on the rig itself (sequence grid_point): compared, then balanced")
    for row in summary["measured"]:
        lines.append(f"  {row['point']:<22} {_cell(row['compared'])}  |  {_cell(row['balanced'])}")
    for one in summary.get("largest_load", {}).get("speeds", []):
        within = one["load_within_engine_nm"]
        kept = one["least_peak_nm"] is not None and one["least_peak_nm"] <= one["engine_nm"]
        lines.append(
            f"{summary['largest_load']['way']} at {one['input_speed_rpm']:.0f} rpm, {one['load_nm']:.0f} Nm: least peak found "
            f"{one['least_peak_nm']:.0f} Nm (compared {one['compared_peak_nm']:.0f} Nm), "
            f"{one['input_torque_before_nm']:.0f} Nm before the shift already; {one['engine_nm']:.0f} Nm "
            f"{'can' if kept else 'cannot'} be kept. Up to "
            f"{within['least_peak']:.0f} Nm of load it can (compared {within['compared']:.0f} Nm; the gear before the shift alone "
            f"reaches it at {within['before_the_shift']:.0f} Nm)"
        )
    folder = summary["folder"]
    lines.append(f"written to {folder}; try: ./rig simulate demo --rig {quoted(folder)}/rig_balanced.yaml")
    return "\n".join(lines)


def _verdict_text(verdict: dict) -> str:
    """Return one verdict as text for the terminal."""
    shares = ", ".join(f"{key} mean {one['mean']:.3f} worst {one['worst']:.3f}" for key, one in verdict["shares"].items())
    return (
        f"{'dominates' if verdict['dominates'] else 'does not dominate'}: better in {verdict['better']} of "
        f"{verdict['pairs']} shifts ({verdict['failed']} failed) and on {verdict['better_rigs']} of "
        f"{verdict['rigs']} rigs; {shares}; highest peak {verdict['highest_peak_nm']:.0f} Nm, compared "
        f"{verdict['compared_highest_peak_nm']:.0f} Nm"
    )


def _cell(row: dict | None) -> str:
    """Return one shift as a cell of the table of measured shifts."""
    if row is None:
        return "no shift"
    return (
        f"{row['input_torque_high_nm']:.0f} Nm, t_d {row['t_dt_s'] * 1e3:.0f} ms, t_c {row['t_c_s'] * 1e3:.0f} ms, k {row['k']:.3f}"
    )
