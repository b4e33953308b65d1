# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of a rig's controller for an operating range from Python, what `rig tune` does; it is ``rig_nodes.tune``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base import RigError, brief, quantity, unknown
from ..plant import LoadConfig
from ..plant import part as parts
from ..rig import check_gearbox
from ..runs import Workers
from ..studies import (
    BOUNDS,
    OBJECTIVES,
    TUNING,
    TUNING_JOURNAL,
    Problem,
    Range,
    begun,
    calibration_for,
    delay_of,
    load_optuna,
    open_journal,
    parquet,
    read_beginnings,
    read_spreads,
    run_tuning,
    spreads_of,
)
from .given import path_of, seed_of, texts, whole
from .rig import Rig, rig_from
from .table import Table

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..rig import RigConfig

    Limits = str | tuple[float, float]  # "LOW .. HIGH" with units, or two numbers in SI

DIMENSIONS = {"peak": "torque", "time": "time", "dip": "ratio", "energy": "energy"}  # jerk has none that a unit is known of


class Tuned(NamedTuple):
    """What a tuning gave.

    Parameters
    ----------
    front : Table
        A row for each setting of the fronts: its ``way``, objectives as shares of the compared settings', whether it
        ``dominates`` these, and the settings in whole ms and mA.
    summary : dict
        What `rig tune --json` prints.
    folder : Path
        The folder with the fronts, their charts, and controllers and rigs to use.
    """

    front: Table
    summary: dict[str, Any]
    folder: Path


def tune(
    rig: Rig | str,
    folder: str | Path,
    *,
    ways: Sequence[str] | None = None,
    speeds: Limits = "1000 rpm .. 2000 rpm",
    load_up: Limits = "40 Nm .. 120 Nm",
    load_down: Limits = "40 Nm .. 240 Nm",
    objectives: Sequence[str] = ("peak", "time"),
    bounds: Mapping[str, str | float] | None = None,
    oil: Limits = "20 degC .. 60 degC",
    rigs: int = 11,
    judge_rigs: int = 12,
    points: int = 8,
    fresh: int = 3,
    spreads: str | Path | None = None,
    shifts: int = 90_000,
    generations: int | None = None,
    seed: int = 1,
    jobs: int = 1,
    watch: Callable[[float, str], None] | None = None,
) -> Tuned:
    """Find valve profiles and delays for an operating range, as `rig tune`.

    Parameters
    ----------
    rig : Rig or str
        The rig, whose controller is what is compared with.
    folder : str or Path
        Folder of the tuning; in one that holds the same tuning, which was interrupted, it goes on.
    ways : sequence of str, optional
        Shifts by the names of both gears, ``"I-II"``; every shift to the next gear by default.
    speeds : str or (float, float)
        Of the input shaft, as ``"LOW .. HIGH"`` with units or as two numbers [rad/s].
    load_up, load_down : str or (float, float)
        Torque at the output before a shift up and down [Nm].
    objectives : sequence of str
        Two or more of peak, time, dip, energy and jerk; the first two are drawn and chosen by.
    bounds : mapping, optional
        Largest value of an objective in any shift, as text with its unit or as number in SI.
    oil : str or (float, float)
        Temperatures of the oil [degC].
    rigs, judge_rigs : int
        Sampled rigs beside the rig itself to search and to judge on.
    points : int
        Operating points to judge in.
    fresh : int
        Judgements of the written controllers, each on rigs and in points of its own.
    spreads : str or Path, optional
        File of `rig calibrate --json` with the spreads of the calibrated parameters; they are determined anew by default.
    shifts : int
        Shifts that the search tries.
    generations : int, optional
        At most so many of each search.
    seed : int
        Seed of search and sampled rigs.
    jobs : int
        Processes.
    watch : callable, optional
        Called with the share of the search that is done and a text.

    Returns
    -------
    Tuned
        The ``front``, the ``summary`` and the ``folder``.

    Raises
    ------
    RigError
        When the rig has no gears or does not shift with its own settings, a range, a name or a number does not fit, or the
        folder holds something else.
    KeyboardInterrupt
        After Ctrl-C; the same call goes on.

    Examples
    --------
    >>> rig_nodes.tune("hydmag", "tuned", objectives=["peak"])
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: objectives: expected two or more different ones
    """
    used, path, jobs = rig_from(rig), path_of("folder", folder), whole("jobs", jobs, 1)
    config = used.config
    sought = _objectives(texts("objectives", objectives))
    check_gearbox(config, "tune")
    ranges = _ranges(config, texts("ways", ways), [("speeds", speeds), ("load_up", load_up), ("load_down", load_down)])
    if config.cut_out:
        raise RigError("rig tune searches on a whole rig; give it one without source: topic")
    if config.prescribed:
        raise RigError(f"rig '{config.name}' has prescribed pressures, which no setting of the controller changes")
    if not isinstance(config.values(config.structure.of_role(parts.LOAD)[0].name), LoadConfig):
        raise RigError(f"rig tune sets the load in steps by a load pump's relief valve, and rig '{config.name}' has another load")
    most, temperatures = _bounds(bounds or {}), _range("oil", oil, "temperature")
    calibration, begin = calibration_for(used.source, config), read_beginnings(used.source, config.transmission)
    known = {} if spreads is None else read_spreads(path_of("spreads", spreads), calibration)
    parquet()
    load_optuna()
    of_file = "/" in used.source or used.source.endswith((".yaml", ".yml"))
    source = str(Path(used.source).absolute()) if of_file else used.source
    problem = Problem(
        source,
        config,
        calibration,
        begin,
        ranges,
        sought,
        most,
        known,
        temperatures,
        whole("rigs", rigs),
        whole("judge_rigs", judge_rigs),
        whole("points", points, 1),
        whole("fresh", fresh, 1),
        seed_of(seed),
        None if generations is None else whole("generations", generations, 1),
        whole("shifts", shifts, 1),
    )
    # what open_journal would refuse is refused before the spreads are determined, which takes some seconds
    begun(path, TUNING, problem.manifest(), "tuning", () if spreads else ("spreads",))
    with Workers(jobs) as workers:
        if not spreads:
            problem = replace(problem, spreads=spreads_of(config, calibration, workers))
        journal = open_journal(path, TUNING, TUNING_JOURNAL, problem.manifest(), "tuning")
        try:
            summary = run_tuning(problem, path, workers, journal, watch, partial(_draw, path, list(sought)))
        finally:
            journal.close()
    rows = json.loads((path / "front.json").read_text(encoding="utf-8"))["rows"]
    units = {name: "mA" if name.endswith("current") else "ms" for name in BOUNDS}
    columns = dict.fromkeys(name for row in rows for name in row)
    return Tuned(Table({name: units.get(name, "") for name in columns}, rows), summary, path)


def _draw(folder: Path, objectives: list[str], name: str, way: str, rows: Sequence[Mapping], chosen: Mapping[str, Mapping]) -> None:
    """Write the chart of a way's front."""
    from ..view import front, write_charts

    write_charts([(name, front(way, rows, objectives, chosen))], folder)


def _objectives(names: list[str]) -> tuple[str, ...]:
    for name in names:
        if name not in OBJECTIVES:
            raise RigError(f"objectives: {unknown('objective', name, OBJECTIVES)}")
    if len(names) < 2 or len(set(names)) < len(names):
        raise RigError("objectives: expected two or more different ones")
    return tuple(names)


def _ranges(config: RigConfig, wanted: list[str], given: list[tuple[str, Limits]]) -> dict[str, Range]:
    """Return the operating range of each wanted way, of all for none, from the speeds and the loads up and down."""
    ways = config.transmission.ways()
    if not ways:
        raise RigError(f"'{config.name}' has one gear only, and what is tuned are changes between gears")
    for way in wanted:
        if way not in ways:
            raise RigError(f"ways: {unknown('way', way, ways)}")
    chosen = {way: gears for way, gears in ways.items() if not wanted or way in wanted}
    for way in chosen:
        delay_of(config.transmission, way)
    of = ("angular velocity", "torque", "torque")
    speeds, up, down = (_range(name, limits, dimension) for (name, limits), dimension in zip(given, of))
    return {way: Range(*speeds, *(up if new > old else down)) for way, (old, new) in chosen.items()}


def _range(name: str, limits: Limits, dimension: str) -> tuple[float, float]:
    """Return the ends of a range in SI."""
    if isinstance(limits, str):
        low, dots, high = limits.partition("..")
        if not dots:
            raise RigError(f'{name} {limits}: expected "LOW .. HIGH", each with its unit')
        values = quantity(low.strip(), dimension, name), quantity(high.strip(), dimension, name)
    elif isinstance(limits, Sequence) and len(limits) == 2 and all(isinstance(one, Real) for one in limits):
        values = float(limits[0]), float(limits[1])
    else:
        raise RigError(f'{name} is {brief(limits)}, expected "LOW .. HIGH", each with its unit, or two numbers in SI')
    if not 0.0 <= values[0] < values[1]:
        raise RigError(f"{name} {limits}: the range must rise from 0 or more")
    return values


def _bounds(given: Mapping[str, str | float]) -> dict[str, float]:
    """Return the largest value of objectives in SI."""
    if not isinstance(given, Mapping):
        raise RigError(f"bounds is {brief(given)}, expected a dict of objectives and values")
    out = {}
    for name, value in given.items():
        what = f"bound {name}={value}"
        if name not in OBJECTIVES:
            raise RigError(f"{what}: expected NAME=VALUE, the name one of {', '.join(OBJECTIVES)}")
        if isinstance(value, Real):
            out[name] = float(value)
        elif not isinstance(value, str):
            raise RigError(f"{what}: expected a text with its unit, or a number in SI")
        elif name in DIMENSIONS:
            out[name] = quantity(value, DIMENSIONS[name], f"bound {name}")
        else:
            number, _, unit = value.strip().partition(" ")
            try:
                out[name] = float(number)
            except ValueError:
                unit = ""
            if unit.strip() != "rad/s3":
                raise RigError(f'{what}: expected a number with its unit, e.g. "5e4 rad/s3"')
        if not math.isfinite(out[name]) or out[name] < 0.0 or (out[name] == 0.0 and name != "dip"):
            raise RigError(f"{what}: expected {'0 or more' if name == 'dip' else 'more than 0'}")
    return out
