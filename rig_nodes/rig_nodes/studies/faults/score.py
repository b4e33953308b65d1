# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of a fault detector on the runs of the benchmark: rates of detection and of false alarms, time, isolation, smallest sizes.

Detection says that something is wrong, isolation what (Isermann, Fault-Diagnosis Systems, 2006).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import RigError, brief
from ...rig import faults_of
from ...runs import Workers
from .baseline import Alarm, Baseline, residuals
from .cases import SIZES, Case, Course, cases_of, course_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...rig import RigConfig

LEARNED = 1 << 40  # added to the seed of the runs from which the baseline learns
CONFUSED = 0.2  # share of a fault's runs that are taken for another one, from which the two cannot be told apart
NOTHING = "nothing"


@dataclass(frozen=True)
class Judged:
    """A run and what the detector said of it; ``alarm`` is None where it said nothing."""

    case: Case
    alarm: Alarm | None

    @property
    def detected(self) -> bool:
        """True for an alarm on an ill run after its fault began."""
        return bool(self.case.fault) and self.alarm is not None and self.alarm.t >= self.case.onset

    @property
    def size(self) -> float:
        """Its fault's size over the usual one, as the scores count it: the ends of ranges are no round ones."""
        return round(self.case.size, 3)


def _run(item: tuple[RigConfig, Case]) -> Course:
    return course_of(*item)


def learned(
    config: RigConfig, seed: int, healthy: int, workers: Workers, tell: Callable[[int, int], None] | None = None
) -> Baseline:
    """Return the baseline detector, which has learned from other runs than those of the same seed.

    Parameters
    ----------
    config : RigConfig
        The rig.
    seed : int
        Seed of the benchmark.
    healthy : int
        Healthy runs from which it learns its thresholds; of each fault it learns one run of the usual size.
    workers : Workers
        Processes for the runs.
    tell : callable, optional
        It is called with the numbers of done and of all runs.
    """
    cases = cases_of(config, seed + LEARNED, healthy, 1, (1.0,))
    found = [residuals(course) for course in workers.map(_run, [(config, case) for case in cases], tell)]
    detector = Baseline()
    detector.learn_healthy(one for case, one in zip(cases, found) if not case.fault)
    detector.learn_ill((case.fault, one) for case, one in zip(cases, found) if case.fault)
    return detector


def judged(
    config: RigConfig,
    detector: Callable[[Course], Any],
    cases: Sequence[Case],
    workers: Workers,
    tell: Callable[[int, int], None] | None = None,
) -> list[Judged]:
    """Return what a detector says of each run.

    Parameters
    ----------
    config : RigConfig
        The rig.
    detector : callable
        detector(course) returns None for a healthy run, or the time of its alarm [s] and the names of faults, the likeliest first.
    cases : sequence of Case
        The runs.
    workers : Workers
        Processes for the runs; the detector is called in this one.
    tell : callable, optional
        As for :func:`learned`.

    Raises
    ------
    RigError
        When the detector returns something else.
    """
    courses = workers.map(_run, [(config, case) for case in cases], tell)
    return [Judged(case, _alarm(detector(course))) for case, course in zip(cases, courses)]


def _alarm(said: Any) -> Alarm | None:
    if said is None or isinstance(said, Alarm):
        return said
    try:
        t, names = said
        return Alarm(float(t), (names,) if isinstance(names, str) else tuple(map(str, names)))
    except (TypeError, ValueError):
        raise RigError(
            f"the detector returned {brief(said)}; expected None, or the time of its alarm and the names of faults"
        ) from None


def scores(config: RigConfig, results: Sequence[Judged]) -> dict[str, Any]:
    """Return the scores, each rate as [how many, of how many].

    Parameters
    ----------
    config : RigConfig
        The rig.
    results : sequence of Judged
        What the detector said.

    Returns
    -------
    dict
        ``false_alarms`` and those of healthy runs; ``detected`` by size over the usual one; ``time_s`` from onset to alarm, median
        and 90 %; ``isolated``: the fault itself first, among the first three, and its type first; ``confusion``: type of fault to
        what was said first; ``ambiguous``: groups of types that are taken for each other; ``smallest``: size over the usual one
        of each type from which on all runs were detected, None where not even the largest were, and for every type where a
        healthy run has an alarm: whoever always gives one would find the smallest.
    """
    kinds = {name: f"{one.fault.part}.{one.fault.name}" for name, one in faults_of(config).items()}
    ill = [one for one in results if one.case.fault]
    found = [one for one in ill if one.detected]
    healthy = [one for one in results if not one.case.fault]
    early = [one for one in ill if one.alarm is not None and not one.detected]
    times = [one.alarm.t - one.case.onset for one in found]
    alarmed = sum(one.alarm is not None for one in healthy)
    sizes = sorted({one.size for one in ill})
    said = {id(one): (one.alarm.faults or (NOTHING,)) for one in found}
    confusion: dict[str, Counter] = {}
    for one in ill:
        first = kinds.get(said[id(one)][0], said[id(one)][0]) if one.detected else NOTHING
        confusion.setdefault(kinds[one.case.fault], Counter())[first] += 1
    return {
        "false_alarms": [alarmed + len(early), len(healthy) + len(ill)],
        "false_alarms_healthy": [alarmed, len(healthy)],
        "detected": {str(size): _of(one.detected for one in ill if one.size == size) for size in sizes},
        "time_s": {"median": float(np.median(times)), "p90": float(np.quantile(times, 0.9))} if times else None,
        "isolated": {
            "first": _of(said[id(one)][0] == one.case.fault for one in found),
            "first_three": _of(one.case.fault in said[id(one)][:3] for one in found),
            "type": _of(kinds.get(said[id(one)][0]) == kinds[one.case.fault] for one in found),
        },
        "confusion": {kind: dict(counts.most_common()) for kind, counts in confusion.items()},
        "ambiguous": _groups(confusion),
        "smallest": {
            kind: None if alarmed else _smallest([one for one in ill if kinds[one.case.fault] == kind]) for kind in confusion
        },
    }


def _of(true: Any) -> list[int]:
    values = list(true)
    return [sum(values), len(values)]


def _groups(confusion: dict[str, Counter]) -> list[list[str]]:
    """Return the types that are taken for each other, by chains of pairs."""
    group = {kind: {kind} for kind in confusion}
    for kind, counts in confusion.items():
        for other, count in counts.items():
            if other != kind and other in group and count >= CONFUSED * sum(counts.values()):
                joined = group[kind] | group[other]
                for one in joined:
                    group[one] = joined
    return [sorted(one) for one in {id(one): one for one in group.values() if len(one) > 1}.values()]


def _smallest(runs: list[Judged]) -> float | None:
    smallest = None
    for size in sorted({one.size for one in runs}, reverse=True):
        if not all(one.detected for one in runs if one.size == size):
            break
        smallest = size
    return smallest


def bench_faults(
    config: RigConfig,
    seed: int = 1,
    healthy: int = 200,
    repeats: int = 1,
    sizes: Sequence[float] = SIZES,
    detector: Callable[[Course], Any] | None = None,
    jobs: int = 2,
    tell: Callable[[str, int, int], None] | None = None,
) -> dict[str, Any]:
    """Return the scores of a detector on the runs of a seed, with what they are.

    Parameters
    ----------
    config : RigConfig
        The rig.
    seed, healthy, repeats, sizes : int, int, int, sequence of float
        As for cases.cases_of.
    detector : callable, optional
        As for :func:`judged`; by default the baseline, which learns first.
    jobs : int
        Number of processes.
    tell : callable, optional
        It is called with what is done, and the numbers of done and of all runs.

    Raises
    ------
    RigError
        When the rig or the detector does not fit.
    """

    def telling(what: str) -> Callable[[int, int], None] | None:
        return None if tell is None else lambda done, of: tell(what, done, of)

    cases = cases_of(config, seed, healthy, repeats, sizes)
    with Workers(jobs) as workers:
        used = detector or learned(config, seed, healthy, workers, telling("learning"))
        results = judged(config, used, cases, workers, telling("judging"))
    return {"rig": config.name, "seed": seed, "runs": len(cases), "healthy": healthy, **scores(config, results)}


def lines_of_faults(result: dict[str, Any]) -> list[str]:
    """Return the scores as lines of text; rates stand with the runs that they are of."""

    def rate(pair: list[int]) -> str:
        return f"{pair[0]} of {pair[1]}" + (f" ({100.0 * pair[0] / pair[1]:.0f} %)" if pair[1] else "")

    time, isolated, alarmed = result["time_s"], result["isolated"], result["false_alarms_healthy"]
    out = [
        f"false alarms: {rate(result['false_alarms'])} runs, {rate(alarmed)} of the healthy ones",
        *(["no smallest size is stated, as a healthy run has an alarm"] if alarmed[0] else []),
        *(f"detected at {size} of the usual size: {rate(pair)}" for size, pair in result["detected"].items()),
        f"time to detect: median {1e3 * time['median']:.0f} ms, 90 % within {1e3 * time['p90']:.0f} ms"
        if time
        else "nothing detected",
        f"isolated: the fault itself first {rate(isolated['first'])}, among three {rate(isolated['first_three'])}, its type first "
        f"{rate(isolated['type'])}",
        "",
    ]
    rows = [["type of fault", "smallest size", "taken for (runs)"]]
    for kind, counts in result["confusion"].items():
        smallest = result["smallest"][kind]
        said = ", ".join(f"{'itself' if name == kind else name} {count}" for name, count in counts.items())
        rows.append([kind, "-" if smallest is None else f"{smallest:g}", said])
    widths = [max(len(row[k]) for row in rows) for k in range(2)]
    out += ["  ".join([row[0].ljust(widths[0]), row[1].ljust(widths[1]), row[2]]) for row in rows]
    return [*out, "", *(f"not told apart: {', '.join(group)}" for group in result["ambiguous"])]


def page_of_faults(result: dict[str, Any]) -> str:
    """Return the page of the scores: the lines, and the confusion matrix with a column for each type that was said."""
    said = list(dict.fromkeys(name for counts in result["confusion"].values() for name in counts))
    said = sorted(said, key=lambda name: (name != NOTHING, name))
    lines = lines_of_faults(result)
    rates = lines[: lines.index("")]
    apart = [line for line in lines if line.startswith("not told apart")]
    seed, healthy = result["seed"], result["healthy"]
    command = f"./rig faults bench --seed {seed} --healthy {healthy} --json FILE"
    head = (
        f"# The baseline detector's scores\n\nMade by `{command}` on {result['runs']} runs of the rig `{result['rig']}`.\n"
        "A rate stands with the sizes that it is of; the smallest size is that, over the usual one, from which on every run was\n"
        "detected while no healthy run had an alarm, and - where there is none. The best published rates of detection on real\n"
        "machines are 66 to 87 %.\n"
    )
    rows = [["type of fault", "smallest size", *(str(k) for k in range(1, len(said) + 1))]]
    for kind, counts in result["confusion"].items():
        smallest = result["smallest"][kind]
        rows.append([f"`{kind}`", "-" if smallest is None else f"{smallest:g}", *(str(counts.get(name, "")) for name in said)])
    table = ["| " + " | ".join(row) + " |" for row in rows]
    table.insert(1, "|" + " --- |" * len(rows[0]))
    legend = ", ".join(f"{k} {name}" for k, name in enumerate(said, 1))
    bullets = "\n".join(f"- {line}" for line in [*rates, *apart])
    return (
        f"{head}\n{bullets}\n\nConfusion: runs of the type of a row for which a column's type was said first. {legend}.\n\n"
        + "\n".join(table)
        + "\n"
    )
