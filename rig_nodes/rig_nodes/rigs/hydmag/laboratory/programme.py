# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's measuring programme on the rig: the procedures that chosen rows need are run and turned into records.

Used by the verb ``validate``; the series are those of runs.procedure, and rigs.hydmag.laboratory.readers evaluates each run.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from math import pi

from rig_nodes.base import RigError, unknown
from rig_nodes.runs import Run, Series, Workers, load_procedure, run_campaign
from rig_nodes.studies import Row, Target, counts, listed

from . import bench_records, readers
from .derived import derive
from .evaluate import evaluate
from .records import Record, average, same
from .score import balanced_accuracy, trivial
from .side_by_side import comparisons
from .targets import load_targets

RPM = pi / 30.0
FOLDER = re.compile(r"\S*/(?=\S+\.ya?ml:\d)")
# procedure -> function that turns (conditions, run) into repeats of records
READERS: dict[str, Callable[[dict, Run], list[list[Record]]]] = {
    "valve_response": readers.valve_response,
    "coast_down": readers.coast_down,
    "profile_series": readers.profile_series,
    "delay_series": readers.delay_series,
    "grid_up": readers.grid_up,
    "grid_down": readers.grid_down,
    "chapter9": readers.chapter9,
    "clutch_bench": bench_records.clutch_bench,
    "spring_bench": bench_records.spring_bench,
}
# procedures on rigs of their own, which the gearbox rig's settings do not change -> files of their series
BENCHES = {"clutch_bench": ("clutch_bench_series",), "spring_bench": ("spring_bench_series", "cylinder_bench_series")}
WETTING = "1 s"  # the plant has no oil film that would need the 10 s of 8.1.6, which the laboratory's own series have
PROCEDURES = tuple(READERS)
SIMULATION = "chapter9"  # rig of the thesis's own simulation, and the procedure of the rows on it
SIMULATED_SPEEDS = (1200.0, 1500.0)  # rpm, 9.2
# rows that compare an upshift with a downshift need both grids, whichever procedure they name
GRIDS = ("grid_up", "grid_down")
BEYOND_T21 = ("-240 ms", "-260 ms")  # delays for which the laboratory only states an expectation, 7.3.3
INERTIA_AT = (1500.0, 240.0)  # rpm and Nm: the point of the grid with the highest peaks, which is shifted with other inertias too
OUTPUT_INERTIAS = ("0.1273 kg m2", "0.6365 kg m2")  # on the z5 axis: the laboratory's (7.4.1.4), and five times as much
# approximate seconds of one run on one core; only their ratios matter
SIZES = {
    "valve_response": 5.0,
    "coast_down": 0.4,
    "profile_series": 0.35,
    "delay_series": 0.9,
    "grid_up": 0.4,
    "grid_down": 0.5,
    "chapter9": 0.3,
    "clutch_bench": 1.2,
    "spring_bench": 1.0,
}


@dataclass(frozen=True)
class Result:
    """What a programme gave.

    Parameters
    ----------
    rows : list of Row
        The judged rows in the order of the targets.
    records : list of Record
        The records by which they were judged.
    procedures : tuple of str
        The procedures that ran.
    trips : list of str
        A sentence on each run that tripped.
    """

    rows: list[Row]
    records: list[Record]
    procedures: tuple[str, ...]
    trips: list[str]


class Trip(str):
    """Reason of a run that gave no records because the rig tripped."""


@cache
def _targets() -> tuple[Target, ...]:
    return tuple(load_targets())


def choose(patterns: Iterable[str] = (), procedures: Iterable[str] = ()) -> list[Target]:
    """Return the targets whose id matches one of some patterns and that belong to one of some procedures.

    Parameters
    ----------
    patterns : iterable of str
        Patterns with shell wildcards; empty for all ids.
    procedures : iterable of str
        Names of procedures; empty for all.

    Returns
    -------
    list of Target
        The targets.

    Raises
    ------
    RigError
        For a pattern that matches nothing, an unknown procedure, and when no target matches both.
    """
    targets = _targets()
    for name in procedures:
        if name not in PROCEDURES:
            raise RigError(unknown("procedure", name, PROCEDURES))
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(target.id, pattern) for target in targets):
            raise RigError(f"{unknown('row', pattern, [target.id for target in targets])} (* matches any text)")
    chosen = [
        target
        for target in targets
        if (not patterns or any(fnmatch.fnmatchcase(target.id, p) for p in patterns))
        and (not procedures or target.procedure in procedures)
    ]
    if not chosen:
        raise RigError(f"no row of {', '.join(procedures)} is called {' or '.join(patterns)}")
    return chosen


def needed(targets: Iterable[Target]) -> tuple[str, ...]:
    """Return the procedures that must run for these targets, in the order in which they run.

    Rows for information do not need a run.
    """
    wanted = set()
    for target in targets:
        if target.role == "information":
            continue
        wanted.add(target.procedure)
        if target.procedure == SIMULATION:
            wanted.update(GRIDS)  # the simulation is compared with them
        if target.procedure in GRIDS:
            shifts = {shift for side in (target.conditions, target.of, target.to) for shift in listed(side.get("shift", ()))}
            wanted.update(grid for grid, shift in zip(GRIDS, readers.laboratory()[0].ways()) if shift in shifts)
    return tuple(name for name in PROCEDURES if name in wanted)


def series_of(procedure: str) -> list[Series]:
    """Return the procedure's own series and those that rows need beyond the laboratory's."""
    if procedure == SIMULATION:
        return _simulated()
    if procedure in BENCHES:
        return _on_benches(procedure)
    series = load_procedure(procedure).series()
    if procedure == "grid_up":
        # 7.4.1.1 describes what an upshift without load should be like; it was not measured
        lowest = {one.conditions["n_wej"]: one for one in reversed(series)}
        series += [
            _further(one, f"{one.label} without load", {"m_wyj": 0.0}, {"load_up": "0 Nm", "load_down": "0 Nm"})
            for one in lowest.values()
        ]
    if procedure == "grid_down":
        # 7.4.2.2 expects lower peaks with more inertia at the output; it was not measured
        point = {"n_wej": INERTIA_AT[0] * RPM, "m_wyj": INERTIA_AT[1]}
        one = next(one for one in series if all(same(one.conditions[name], value) for name, value in point.items()))
        for inertia in OUTPUT_INERTIAS:
            further = _further(one, f"{one.label} with {inertia}", {"inertia": float(inertia.split()[0])}, {})
            series.append(replace(further, overrides={**one.overrides, "z5.inertia": inertia}))
    if procedure == "delay_series":
        last = next(one for one in series if one.conditions["series"] == 19)
        for t21 in BEYOND_T21:
            further = _further(last, f"t21 {t21}", {"t21": float(t21.split()[0]) * 1e-3}, {})
            del further.conditions["series"]
            series.append(replace(further, overrides={**last.overrides, "alfa46.t21": t21}))
    return series


def _simulated() -> list[Series]:
    """Return the grids' points at the speeds of 9.2, once each, for the rig of the simulation."""
    return [
        replace(
            one, procedure=SIMULATION, label=f"{name} {one.label}", repeats=1, conditions={**one.conditions, "source": "simulated"}
        )
        for name in GRIDS
        for one in load_procedure(name).series()
        if any(same(one.conditions["n_wej"], rpm * RPM) for rpm in SIMULATED_SPEEDS)
    ]


def _on_benches(procedure: str) -> list[Series]:
    """Return the series of one or two benches under the procedure's name; the packs are wetted for less time."""
    out = [replace(one, procedure=procedure) for name in BENCHES[procedure] for one in load_procedure(name).series()]
    if procedure == "clutch_bench":
        out = [replace(one, parameters={**one.parameters, "wetting": WETTING}) for one in out]
    return out


def _further(one: Series, label: str, conditions: dict, parameters: dict) -> Series:
    return replace(one, label=label, conditions={**one.conditions, **conditions}, parameters={**one.parameters, **parameters})


def measure(series: Series, run: Run) -> list[list[Record]] | str:
    """Return repeats of records of one run, or the reason why it gave none; called in the process in which the run's rows are."""
    if run.end["state"] != "ended":
        reason = FOLDER.sub("", run.end["reason"])  # the folder in which the rig is installed does not belong to a result
        return Trip(reason) if run.end["state"] == "tripped" else reason
    try:
        return READERS[series.procedure](series.conditions, run)
    except RigError as reason:
        return str(reason)


def measure_procedure(
    procedure: str,
    workers: Workers | None = None,
    rig: str | None = "hydmag",
    settings: dict[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
    trips: list[str] | None = None,
) -> list[Record]:
    """Run one procedure and return its records, with repeats averaged.

    Parameters
    ----------
    procedure : str
        Name of the procedure.
    workers : Workers or None
        The worker processes.
    rig : str or None
        Name or file of the rig; simulation and benches have their own.
    settings : dict of str to str or None
        Changes of the rig.
    progress : callable or None
        Takes the number of finished runs and that of all.
    trips : list of str or None
        A sentence on each run that tripped is appended to it.

    Returns
    -------
    list of Record
        The records; a series that failed has the reason in place of each value.
    """
    series = series_of(procedure)
    if procedure == SIMULATION:
        rig, settings = SIMULATION, None  # the rig's own changes do not apply to the simulation
    elif procedure in BENCHES:
        rig, settings = None, None
    records: list[Record] = []
    for one, runs in zip(series, run_campaign(series, measure, rig, settings, workers, progress)):
        reason = next((run for run in runs if isinstance(run, str)), None)
        if trips is not None:
            trips += [f"{procedure} {one.label}: {run}" for run in runs if isinstance(run, Trip)]
        if reason is not None:
            records += readers.failed(procedure, one.conditions, f"{one.label}: {reason}")
        else:
            records += average([repeat for run in runs for repeat in run])
    if procedure == "clutch_bench":
        records += bench_records.off_in_most(records)
    return records


def check_settings(procedures: Iterable[str], settings: dict[str, str]) -> None:
    """Raise RigError when a series sets one of these values of the rig itself."""
    for name in procedures:
        for one in series_of(name) if name not in (SIMULATION, *BENCHES) else ():
            both = sorted(set(settings) & set(one.overrides))
            if both:
                raise RigError(f"setting {both[0]}: series '{one.label}' of {name} sets it itself; choose other --procedures")


def runs_of(procedures: Iterable[str]) -> dict[str, tuple[int, float]]:
    """Return for each procedure the number of its runs and the size of one, from which the remaining time is estimated."""
    return {name: (sum(one.repeats for one in series_of(name)), SIZES[name]) for name in procedures}


def validate(
    targets: list[Target],
    workers: Workers | None = None,
    rig: str = "hydmag",
    settings: dict[str, str] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Result:
    """Run what the targets need and judge them.

    Parameters
    ----------
    targets : list of Target
        The targets.
    workers : Workers or None
        The worker processes.
    rig : str
        Name or file of the rig.
    settings : dict of str to str or None
        Changes of the rig.
    progress : callable or None
        Takes the procedure, the number of its finished runs and that of all its runs.

    Returns
    -------
    Result
        The judged rows and what they were judged by.
    """
    procedures = needed(targets)
    records: list[Record] = []
    trips: list[str] = []
    for name in procedures:
        own_progress = None if progress is None else lambda done, of, name=name: progress(name, done, of)
        records += measure_procedure(name, workers, rig, settings, own_progress, trips)
    records += derive(records)
    holding: dict[str, list[Record]] = {}
    for record in records:
        for quantity in record.values:
            holding.setdefault(quantity, []).append(record)
    return Result([evaluate(target, holding.get(target.quantity, [])) for target in targets], records, procedures, trips)


def summary(result: Result) -> dict:
    """Return what a programme comes to, for programs.

    Parameters
    ----------
    result : Result
        Rows and records of the programme.

    Returns
    -------
    dict
        The :func:`counts` of each basis; hold_balanced_accuracy (series 21 left aside), the same with all series, and that of
        "always hold"; groups, from :func:`score.trivial`; chapter9, from :func:`side_by_side.comparisons`.
    """
    return {
        **counts(result.rows),
        "hold_balanced_accuracy": balanced_accuracy(result.rows),
        "hold_balanced_accuracy_all_series": balanced_accuracy(result.rows, ()),
        "hold_balanced_accuracy_always_hold": 0.5,
        "groups": trivial(result.rows, result.records),
        "chapter9": comparisons(result.records),
    }
