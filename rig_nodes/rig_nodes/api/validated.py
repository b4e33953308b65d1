# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig held against its validation rows from Python, what `rig validate` does; it is ``rig_nodes.validate``."""

from __future__ import annotations

import contextlib
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base import RigError, not_written
from ..rig import check_gearbox
from ..runs import Workers, start_server
from ..studies import check_settings, chosen_rows, counts, load_rows, programme_of, rows_by_run, rows_file, validate_rows
from .given import path_of, texts, whole
from .rig import Rig, rig_from
from .table import Table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from ..studies import Row

    Progress = Callable[[str, int, int], None]  # procedure, numbers of its finished and of all its runs
    Watch = Callable[[dict[str, tuple[int, float]]], Progress]  # procedure -> number of its runs and length of one

SHOWN = ("id", "basis", "verdict", "value", "low", "high", "unit")
COLUMNS = (*SHOWN, "judged_by", "count", "inside", "at", "reason", "procedure", "quantity", "where", "text")


class Validated(NamedTuple):
    """What a validation gave.

    Parameters
    ----------
    rows : list of Row
        The judged rows.
    summary : dict
        How many rows of each basis have each verdict, and more of the laboratory's programme.
    programme : str or None
        The package of the laboratory's programme; None for rows of the rig's own.
    procedures : list of str
        Its procedures that ran.
    trips : list of str
        A sentence on each of its runs that tripped.
    figures : int
        Number of figures that were written.
    """

    rows: list[Row]
    summary: dict[str, Any]
    programme: str | None = None
    procedures: Sequence[str] = ()
    trips: Sequence[str] = ()
    figures: int = 0


def validate(
    rig: Rig | str,
    rows: Sequence[str] | None = None,
    *,
    procedures: Sequence[str] | None = None,
    pictures: str | Path | None = None,
    jobs: int = 1,
) -> Table:
    """Compare a rig with its validation rows, as `rig validate`.

    Parameters
    ----------
    rig : Rig or str
        The rig, with its settings.
    rows : sequence of str, optional
        Names of rows, or patterns such as ``up_t_*``; all by default.
    procedures : sequence of str, optional
        Of the laboratory's programme, only the rows of these procedures.
    pictures : str or Path, optional
        A folder for the figures of the laboratory's chapters as SVG.
    jobs : int
        Processes that run series.

    Returns
    -------
    Table
        A row for each, with ``verdict``, ``value`` and the accepted ``low`` and ``high`` in SI with their ``unit``, and the
        ``reason`` of one that was not compared; all that `rig validate --json` writes of a row but its lists.

    Raises
    ------
    RigError
        When the rig has no rows, none of a name, or a row sets one of the rig's settings itself.

    Examples
    --------
    >>> rig_nodes.validate("three_speed", ["ratio_*"])
    id       basis      verdict  value  low  high  unit
    ratio_1  predicted  inside ...
    >>> rig_nodes.validate("clutch_bench")
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: the rig 'clutch_bench' has no validation.yaml...
    """
    folder = None if pictures is None else path_of("pictures", pictures)
    found = validated(rig_from(rig), texts("rows", rows), texts("procedures", procedures), folder, whole("jobs", jobs, 1))
    return Table(dict.fromkeys(COLUMNS, ""), [row.as_dict() for row in found.rows], SHOWN)


def validated(
    rig: Rig, rows: list[str], procedures: list[str], pictures: Path | None, jobs: int, watch: Watch | None = None
) -> Validated:
    """Judge rows of a rig; the arguments are as of :func:`validate`.

    ``watch`` is called with the procedures that will run, "" for rows of the rig's own, and returns what is called as they do.
    """
    path = rows_file(rig.source)
    package = programme_of(path)
    if package is None:
        if given := next((name for name, value in (("pictures", pictures), ("procedures", procedures)) if value), None):
            raise RigError(f"{given} belongs to the laboratory's programme; the rows of {path} have none")
        return _own_rows(rig, path, rows, jobs, watch)
    if jobs > 1:
        start_server(f"{package}.programme", rigs=[rig.source])
    programme = import_module(f"{package}.programme")
    targets = programme.choose(rows, procedures)
    check_gearbox(rig.config, "validate --rig")  # errors in the rig are reported before anything runs
    needed = programme.needed(targets)
    programme.check_settings(needed, rig.settings)
    if pictures is not None:
        try:
            pictures.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise not_written(f"pictures {pictures}: the folder", error) from None
    progress, drawn = watch(programme.runs_of(needed)) if watch else None, []
    # rows that only inform need no processes
    with Workers(jobs) if needed else contextlib.nullcontext() as workers:
        result = programme.validate(targets, workers, rig.source, rig.settings, progress)
        if pictures is not None and needed:
            drawn = import_module(f"{package}.time_courses").time_courses(needed, workers, rig.source, rig.settings)
    count = 0
    if pictures is not None:
        from ..view import write_charts

        count = len(write_charts([*import_module(f"{package}.pictures").figures(result.records), *drawn], pictures))
    return Validated(result.rows, programme.summary(result), package, result.procedures, result.trips, count)


def _own_rows(rig: Rig, path: Path, patterns: list[str], jobs: int, watch: Watch | None) -> Validated:
    """Judge the rows of a rig's folder."""
    if jobs > 1:
        start_server("rig_nodes.studies.validation.own_rows", rigs=[rig.source])
    rows = chosen_rows(load_rows(path, rig.source, rig.config), patterns)
    check_settings(rows, rig.settings)
    progress = watch({"": (len(rows_by_run(rows)), 1.0)}) if watch else lambda *_: None
    with Workers(jobs) as workers:
        found = validate_rows(rows, rig.source, rig.settings, workers, lambda done, of: progress("", done, of))
    return Validated(found, counts(found))
