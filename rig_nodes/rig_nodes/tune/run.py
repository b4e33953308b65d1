"""A whole tuning: searches for both ways and for the largest load, judgement elsewhere, fronts and controllers written.

Used by the verb ``tune``.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from .. import __version__
from ..alfa46.settings import Alfa46Config, read_alfa46
from ..compiled import sources_key
from ..errors import RigError
from ..sweep.store import Journal, write_atomically
from ..testbench.campaign import Workers
from ..testbench.configuration import RigConfig
from ..validation.pictures import write_pictures
from . import folder as files
from . import judge, search
from .bench import Bench, Point
from .problem import Range, Task, held
from .space import DELAY, FAST_FILL, settings, values_of
from .uncertainty import sampled_rigs

LEAST = "least"  # the search for the smallest peak at the largest load of II-I
BUDGET = {"I-II": 0.45, "II-I": 0.40, LEAST: 0.15}  # shares of the time of search
DRAWS = 10  # times the rigs wanted that are sampled at most
CANDIDATES = 20  # of a front, at most, that are judged elsewhere
CHOICES = ("soft", "balanced", "fast")


@dataclass(frozen=True)
class Problem:
    """What was asked for. ranges: way -> Range; rigs, judge_rigs: how many sampled rigs there are beside the rig
    itself, in the search and in the judgement; points: operating points of each way in the judgement; oil: [degC].
    """

    rig: str
    config: RigConfig
    ranges: dict[str, Range]
    objectives: tuple[str, ...]
    bounds: dict[str, float]
    spreads: dict[str, float]
    oil: tuple[float, float]
    rigs: int
    judge_rigs: int
    points: int
    seed: int
    generations: int | None
    seconds: float

    def manifest(self) -> dict:
        """What decides a tuning but for its length; no clock, host or folder."""
        return {"rig": self.rig, "configuration": self.config.as_dict(),
                "ranges": {way: vars(one) for way, one in self.ranges.items()}, "objectives": list(self.objectives),
                "bounds": self.bounds, "spreads": self.spreads, "oil_degc": list(self.oil), "rigs": self.rigs,
                "judge_rigs": self.judge_rigs, "points": self.points, "seed": self.seed,
                "versions": {"rig_nodes": __version__, "plant": sources_key(), "python": platform.python_version(),
                             **{name: version(name) for name in ("numpy", "scipy", "numba", "optuna")}}}

    def task(self, points: list[Point], rigs: int, seed: int, objectives: tuple[str, ...] | None = None) -> Task:
        """Shifts on the rig itself and on sampled ones on which the compared settings shift in all points, as they did
        in the laboratory: a rig on which they do not is none that its rows allow. RigError when hardly any is.
        """
        chosen: list[RigConfig] = []
        for turn in range(DRAWS if rigs else 0):
            for rig in sampled_rigs(self.config, self.spreads, self.oil, rigs, seed + 1000 * turn):
                bench = Bench(rig)
                if len(chosen) < rigs and all(bench.shift(point, self.config.alfa46).valid for point in points):
                    chosen.append(rig)
            if len(chosen) == rigs:
                break
        else:
            if rigs:
                raise RigError(f"of {DRAWS * rigs} sampled rigs only {len(chosen)} shift with the settings that are "
                               "there; the spreads are too wide, give others with --spreads")
        return Task((self.config, *chosen), tuple(points), self.config.alfa46, objectives or self.objectives,
                    tuple(sorted(self.bounds.items())))


def tune(problem: Problem, folder: Path, workers: Workers, journal: Journal,
         progress: Callable[[float, str], None] | None = None) -> dict:
    """Search, judge, write; the summary. progress(share of the search that is done, what it is at). An interrupt is
    passed on: what is noted in the journal is not done again.
    """
    said: list[str] = []
    known: dict[str, list[dict]] = {}
    spent = 0.0
    for note in journal.entries():
        known.setdefault(note["study"], []).extend(note["entries"])
        spent = note["spent"]
    clock = search.Clock(problem.seconds, spent)
    studies: dict[str, search.Study] = {}
    used = 0.0
    for name, budget in BUDGET.items():
        way = "II-I" if name == LEAST else name
        if way not in problem.ranges:
            continue
        used += budget
        study = studies[name] = _study(problem, name, way, known.get(name, []), studies.get("II-I"), said)
        end = used / sum(share for n, share in BUDGET.items() if ("II-I" if n == LEAST else n) in problem.ranges)

        def until(end=end, study=study) -> bool:
            if progress:
                progress(min(clock.spent / clock.seconds, 1.0), f"{study.name}: {study.generation} generations, "
                                                               f"{len(study.front())} settings on the front")
            done = problem.generations is not None and study.generation >= problem.generations
            return done or (clock.spent >= end * clock.seconds and study.generation > 0)

        def note(entries: list[dict], study=study) -> None:
            journal.add({"study": study.name, "spent": round(clock.spent, 3), "entries": entries})

        search.run(study, workers, note, until)
    if progress:
        progress(1.0, "judging the fronts")
    return _finish(problem, folder, studies, workers, said, clock.spent)


def _study(problem: Problem, name: str, way: str, known: list[dict], down: search.Study | None,
           said: list[str]) -> search.Study:
    where, config = problem.ranges[way], problem.config
    base = values_of(config.alfa46, way, config.wiring)
    seed = problem.seed * 10 + list(BUDGET).index(name)
    if name == LEAST:
        points, _ = held(config, where.heaviest(way))
        task = problem.task([p for p in points if p.m_wyj == max(q.m_wyj for q in points)], 0, seed, ("peak", "time"))
        start = [base, *(entry["values"] for entry in down.front()[:12])]
    else:
        points, lowered = held(config, where.corners(way))
        said += lowered
        task, start = problem.task(points, problem.rigs, seed), [base, FAST_FILL]
    return search.Study(name, way, config, config.alfa46, task, start, seed, known)


def _finish(problem: Problem, folder: Path, studies: dict[str, search.Study], workers: Workers, said: list[str],
            spent: float) -> dict:
    config, base = problem.config, problem.config.alfa46
    rows: list[dict] = []
    chosen: dict[str, dict[str, dict]] = {}
    for way, study in studies.items():
        if way == LEAST:
            continue
        mine = _judged_front(problem, study, workers)
        chosen[way] = choose(mine, problem.objectives)
        rows += mine
    manifest = problem.manifest()
    files.write_front(folder, rows, manifest)
    write_pictures([(f"{files.FRONT}_{way}", files.picture(way, [row for row in rows if row["way"] == way],
                                                           list(problem.objectives), chosen[way]))
                    for way in chosen], folder)
    controllers = _write_controllers(problem, folder, chosen)
    verdict = _last_verdict(problem, controllers, workers)
    summary = {
        "folder": str(folder), "search_seconds": round(spent, 1), "said": said,
        "searches": {name: {"generations": study.generation, "settings": len(study.entries),
                            "shifts_like": f"{len(study.task.rigs)} rigs x {len(study.task.points)} points",
                            "front": len(study.front())} for name, study in studies.items()},
        "front": {way: {"settings": sum(row["way"] == way for row in rows),
                        "dominating": sum(row["way"] == way and row["dominates"] for row in rows)} for way in chosen},
        "chosen": {way: {name: row for name, row in of.items()} for way, of in chosen.items()},
        "verdict": verdict,
        "measured": _measured(problem, controllers, workers),
    }
    if LEAST in studies:
        summary["largest_load"] = _largest_load(studies[LEAST], config, base, workers)
    write_atomically(folder / f"{files.FRONT}.json", _json({**manifest, **summary, "rows": rows}))
    return summary


def _json(data: dict) -> str:
    import json

    from ..analysis.report import plain

    return json.dumps(plain(data), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _judged_front(problem: Problem, study: search.Study, workers: Workers) -> list[dict]:
    """Rows of a front, its members judged on other rigs and in other points."""
    front = study.front()
    if len(front) > CANDIDATES:
        front = [front[k] for k in np.unique(np.linspace(0, len(front) - 1, CANDIDATES).round().astype(int))]
    points, _ = held(problem.config, problem.ranges[study.way].inside(study.way, problem.points, problem.seed * 10 + 3))
    task = problem.task(points, problem.judge_rigs, problem.seed * 10 + 4)
    candidates = [settings(study.base, study.way, entry["values"], problem.config.wiring) for entry in front]
    rows = []
    for entry, verdict in zip(front, judge.verdicts(task, candidates, workers)):
        row = {"way": study.way, "dominates": verdict.dominates,
               **{name: getattr(verdict, name) for name in files.COUNTS}}
        for name, value in zip(problem.objectives, entry["objectives"]):
            row[name] = value
            row[f"{name}_worst"], row[f"{name}_mean"] = verdict.shares.get(name, (None, None))
        rows.append({**row, **entry["values"]})
    return rows


def choose(rows: list[dict], objectives) -> dict[str, dict]:
    """Three settings of a judged front: soft (least mean of the first objective elsewhere), fast (of the second),
    balanced (least of the larger one); of those that dominate, else of those that are better on the most rigs.
    """
    if not rows:
        return {}
    most = max((row["dominates"], row["better_rigs"] - row["failed"]) for row in rows)
    kept = [row for row in rows if (row["dominates"], row["better_rigs"] - row["failed"]) == most]
    first, second = (f"{name}_mean" for name in objectives[:2])

    def value(row, key):
        return float("inf") if row[key] is None else row[key]

    return {"soft": min(kept, key=lambda row: (value(row, first), value(row, second))),
            "balanced": min(kept, key=lambda row: max(value(row, first), value(row, second))),
            "fast": min(kept, key=lambda row: (value(row, second), value(row, first)))}


def _write_controllers(problem: Problem, folder: Path, chosen: dict) -> dict[str, Alfa46Config]:
    """Controllers with the settings of both ways, as files; what was read back from them."""
    out = {}
    for name in CHOICES:
        controller = problem.config.alfa46
        for way, of in chosen.items():
            if name in of:
                controller = settings(controller, way, of[name], problem.config.wiring)
        path = folder / f"{name}.yaml"
        write_atomically(path, files.controller_yaml(controller, f"Alfa46, '{name}', found by rig tune"))
        write_atomically(folder / f"rig_{name}.yaml", files.rig_yaml(
            problem.rig, path.name, f"{problem.config.name} with the controller '{name}' of rig tune"))
        out[name] = read_alfa46(path)
    return out


def _last_verdict(problem: Problem, controllers: dict[str, Alfa46Config], workers: Workers) -> dict:
    """The written controllers on rigs and in points that nothing was sought or chosen by."""
    out: dict[str, dict] = {name: {} for name in controllers}
    for way, where in problem.ranges.items():
        points, _ = held(problem.config, where.inside(way, problem.points, problem.seed * 10 + 5))
        task = problem.task(points, problem.judge_rigs, problem.seed * 10 + 6)
        for name, verdict in zip(controllers, judge.verdicts(task, list(controllers.values()), workers)):
            out[name][way] = verdict.as_dict()
    return out


def _measured(problem: Problem, controllers: dict[str, Alfa46Config], workers: Workers) -> list[dict]:
    """Some shifts through sequence, transducers and logger, with the compared settings and the balanced ones."""
    both = {"compared": problem.config.alfa46, "balanced": controllers["balanced"]}
    points = []
    for way, where in problem.ranges.items():
        points += held(problem.config, where.inside(way, 3, problem.seed * 10 + 7))[0]
    found = judge.as_measured(problem.config, both.values(), points, workers, 1)
    keys = ("m_wej_max_nm", "t_dt_s", "t_c_s", "k")
    return [{"point": point.text(), **{name: None if row is None else {key: row[key] for key in keys}
                                       for name, row in zip(both, rows)}} for point, *rows in zip(points, *found)]


def _largest_load(study: search.Study, config: RigConfig, base: Alfa46Config, workers: Workers) -> dict:
    """The least peak found at the largest load, and up to which load each speed stays within the engine's torque."""
    front = study.front()
    best = front[0]["values"] if front else values_of(base, study.way, config.wiring)
    found = judge.heavy(config, settings(base, study.way, best, config.wiring), base, list(study.task.points), workers)
    return {"settings": best, "tried": len(study.entries), "speeds": [one.as_dict() for one in found]}


def text(summary: dict, objectives) -> str:
    """The summary for the terminal."""
    lines = [*summary["said"]]
    for name, one in summary["searches"].items():
        lines.append(f"{name}: {one['settings']} settings in {one['generations']} generations, each on "
                     f"{one['shifts_like']}; {one['front']} on the front")
    for way, front in summary["front"].items():
        lines.append(f"{way}: {front['dominating']} of {front['settings']} settings of the front are better than the "
                     "compared ones on every other rig, in operating points that were not searched")
        for name, row in summary["chosen"][way].items():
            shares = ", ".join(f"{key} {row[f'{key}_mean']:.3f}" for key in objectives
                               if row[f"{key}_mean"] is not None)
            lines.append(f"  {name:<9} mean there: {shares}; {DELAY[way]} {row['delay']} ms")
    lines.append("last check, rigs and points that nothing was sought or chosen by (shares of the compared settings):")
    for name, ways in summary["verdict"].items():
        for way, verdict in ways.items():
            shares = ", ".join(f"{key} mean {one['mean']:.3f} worst {one['worst']:.3f}"
                               for key, one in verdict["shares"].items())
            says = "dominates" if verdict["dominates"] else "does not dominate"
            highest, compared = verdict["highest_peak_nm"], verdict["compared_highest_peak_nm"]
            lines.append(f"  {name:<9} {way:<5} {says}: better on {verdict['better_rigs']} of {verdict['rigs']} rigs, "
                         f"in {verdict['better']} of {verdict['pairs']} shifts ({verdict['failed']} failed); {shares}; "
                         f"highest peak {highest:.0f} Nm, compared {compared:.0f} Nm")
    lines.append("as measured on the rig itself (sequence grid_point): compared, then balanced")
    for row in summary["measured"]:
        lines.append(f"  {row['point']:<22} {_cell(row['compared'])}  |  {_cell(row['balanced'])}")
    for one in summary.get("largest_load", {}).get("speeds", []):
        within = one["load_within_engine_nm"]
        kept = one["least_peak_nm"] is not None and one["least_peak_nm"] <= one["engine_nm"]
        lines.append(
            f"II-I at {one['n_wej_rpm']:.0f} rpm, {one['load_nm']:.0f} Nm: least peak found "
            f"{one['least_peak_nm']:.0f} Nm (compared {one['compared_peak_nm']:.0f} Nm), "
            f"{one['m_wej_before_nm']:.0f} Nm before the shift already; {one['engine_nm']:.0f} Nm {'can' if kept else 'cannot'} be kept. Up to "
            f"{within['least_peak']:.0f} Nm of load it can (compared {within['compared']:.0f} Nm; gear II alone "
            f"reaches it at {within['before_the_shift']:.0f} Nm)")
    folder = summary["folder"]
    lines.append(f"written to {folder}; try: ./rig simulate demo --rig {folder}/rig_balanced.yaml")
    return "\n".join(lines)


def _cell(row: dict | None) -> str:
    """One shift in the table of what was measured."""
    if row is None:
        return "no shift"
    return (f"{row['m_wej_max_nm']:.0f} Nm, t_d {row['t_dt_s'] * 1e3:.0f} ms, t_c {row['t_c_s'] * 1e3:.0f} ms, "
            f"k {row['k']:.3f}")
