# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Series of a measuring procedure from Python, what `rig procedure` runs; it is ``rig_nodes.procedure``."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ..analysis import ENDS, build_report, gather, member_of, write_procedure, write_report
from ..base import SI, UNITS, waiting
from ..runs import load_procedure, prepare, run_folder, simulate
from .given import path_of, texts
from .rig import Rig, rig_from
from .table import Table, column_unit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from ..analysis import Member, Result
    from ..rig import RigConfig
    from ..runs import Procedure, Series
    from ..runs import Sequence as Steps


def procedure(
    name: str | Path, series: Sequence[str] | None = None, *, rig: Rig | str | None = None, folder: str | Path | None = None
) -> Table:
    """Run series of a measuring procedure, each as often as the procedure repeats it.

    Parameters
    ----------
    name : str or Path
        Name of an installed procedure, or its file.
    series : sequence of str, optional
        Labels or numbers of series, which :func:`procedure_series` lists; all by default.
    rig : Rig or str, optional
        The rig, whose settings hold for all series; by default the one that the procedure's sequence is of.
    folder : str or Path, optional
        A new or empty folder, in which each run is kept with its report, and the procedure in ``procedure.json``, as by
        `rig procedure --out`; by default they are not kept.

    Returns
    -------
    Table
        A row for each run: ``label`` of its series, name of the ``run``, conditions of the series in SI, ``end`` (``"ended"``, or
        why it did not end as planned), and the results of its report by what they are of and their name, such as
        ``I-II.t_c_s``, a mean where there are several.

    Raises
    ------
    RigError
        When there is no such procedure or series, the rig does not fit it or a series sets one of its settings itself, or the
        folder is not empty.
    KeyboardInterrupt
        After Ctrl-C; ``folder`` then holds the runs that were begun.

    Examples
    --------
    >>> rig_nodes.procedure("grid_up", ["1000 rpm"])
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: procedure 'grid_up': there is no series '1000 rpm'; ...
    """
    used = None if rig is None else rig_from(rig)
    found = _loaded(name, used)
    chosen = found.series(None if series is None else texts("series", series))
    source, settings = (used.source, used.settings) if used else (None, {})
    ready = [(one, *prepare(one, source, settings)) for one in chosen]
    members = []
    with tempfile.TemporaryDirectory(prefix="rig-procedure-") as own:
        kept = Path(own) if folder is None else run_folder(str(path_of("folder", folder)), found.name)
        for report, member in run_series(found, ready, kept):
            members.append(member)
            if (end := report["run"]["end"])["state"] == "interrupted":
                raise KeyboardInterrupt(end["reason"])
    return _table(chosen, members)


def procedure_series(name: str | Path, series: Sequence[str] | None = None, *, rig: Rig | str | None = None) -> Table:
    """Return series of a measuring procedure without running them, as `rig procedure --labels`; the arguments are as there.

    Returns
    -------
    Table
        A row for each series: its ``label``, conditions in SI, and ``repeats``.

    Raises
    ------
    RigError
        When there is no such procedure or series.

    Examples
    --------
    >>> table = rig_nodes.procedure_series("grid_up")
    >>> len(table), table[0]["shift"], table.units["n_wej"]
    (30, 'I-II', 'rad/s')
    """
    chosen = _loaded(name, None if rig is None else rig_from(rig)).series(None if series is None else texts("series", series))
    units = {"label": "", **_units(chosen), "repeats": ""}
    return Table(units, [{"label": one.label, **one.conditions, "repeats": one.repeats} for one in chosen])


def run_series(
    procedure: Procedure,
    ready: Sequence[tuple[Series, RigConfig, Steps]],
    folder: Path,
    begins: Callable[[Series, int], None] | None = None,
) -> Iterator[tuple[dict, Member]]:
    """Run series one after the other and yield each run's report and results; after one that was interrupted no other follows.

    Parameters
    ----------
    procedure : Procedure
        The procedure.
    ready : sequence of (Series, RigConfig, Sequence)
        The series, each with the rig and the sequence of runs.prepare.
    folder : Path
        The folder of the runs, which is there and empty.
    begins : callable, optional
        Called with the series and the number of the repeat, from 0 on, before each run.
    """
    members: list[Member] = []
    about = [series.about for series, *_ in ready]
    for series, config, sequence in ready:
        for repeat in range(series.repeats):
            if begins is not None:
                begins(series, repeat)
            run_into = folder / f"{series.label}-{repeat + 1}"
            run_into.mkdir()
            with waiting("computing the run"):
                run = simulate(config, sequence, run_into, series.first_seed + repeat)
            report = build_report(gather(run_into, run), run)
            write_report(run_into, report)
            members.append(member_of(series.label, run_into.name, report))
            # after each run, so that an interrupted procedure keeps what it found
            write_procedure(folder, procedure.about, about, members)
            yield report, members[-1]
            if run["end"]["state"] == "interrupted":
                return


def _loaded(name: object, rig: Rig | None) -> Procedure:
    return load_procedure(path_of("name", name), rig.source if rig else None)


def _units(chosen: Sequence[Series]) -> dict[str, str]:
    return {name: one.units.get(name, "") for one in chosen for name in one.conditions}


def _table(chosen: Sequence[Series], members: Sequence[Member]) -> Table:
    """Return a row for each run."""
    conditions, rows = {one.label: one.conditions for one in chosen}, []
    units = {"label": "", "run": "", **_units(chosen), "end": ""}
    for member in members:
        found: dict[str, list[float]] = {}
        for one in member.results:
            if one.value is not None and one.kind not in ENDS:
                unit, factor = _unit_of(one)
                units.setdefault(column := f"{one.kind}.{one.key}", unit)
                found.setdefault(column, []).append(factor * one.value)
        means = {column: sum(values) / len(values) for column, values in found.items()}
        end = {"label": member.label, "run": member.name, "end": member.failed or "ended"}
        rows.append({**conditions[member.label], **means, **end})
    return Table(units, rows)


def _unit_of(one: Result) -> tuple[str, float]:
    """Return the unit that a result has in a table, and the factor to it from the one in which a report shows it."""
    shown = [part for part in one.unit.strip("-").split("/") if part in UNITS]
    if unit := column_unit(one.key):
        return unit, UNITS[one.unit][1] / UNITS[unit][1] if unit != one.unit else 1.0
    if "/".join(shown) != one.unit:
        return one.unit.strip("-"), 1.0
    factors = [UNITS[part][1] for part in shown]
    return "/".join(SI.get(UNITS[part][0], part) for part in shown), factors[0] / math.prod(factors[1:])
