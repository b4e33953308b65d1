# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sweep from Python: what `rig sweep` runs, as one table; it is ``rig_nodes.sweep``."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis import SHORT, loop_columns, named_metrics
from ..base import SI, STARTING, UNITS, RigError, brief, waiting
from ..runs import Workers, sequence_of, start_server
from ..studies import (
    Plan,
    Store,
    Varied,
    column_of,
    dask_stream,
    forget_unfinished,
    make_plan,
    manifest_of,
    parquet,
    plugged_of,
    rows_of,
    run_sweep,
)
from .given import path_of, seed_of, texts_of, whole
from .rig import Rig, rig_from, spec_of
from .table import GEARS, Table, column_unit

if TYPE_CHECKING:
    from ..rig import Transmission
    from ..view import Description


def sweep(
    rig: Rig | str,
    sequence: str | Path | Sequence[Mapping] | Mapping,
    vary: Mapping[str, str | Sequence],
    *,
    samples: int | None = None,
    method: str = "",
    repeats: int = 1,
    seed: int = 1,
    parameters: Mapping[str, Any] | None = None,
    controller: str | type | None = None,
    level: str | None = None,
    delay: int = 1,
    calculate: str = "",
    jobs: int = 1,
    dask: str | None = None,
    folder: str | Path | None = None,
    bags: bool = False,
) -> Table:
    """Run a sequence for many values of its parameters or of the rig's settings.

    Parameters
    ----------
    rig : Rig or str
        The rig, whose settings all members share.
    sequence : str, Path, list of dict or dict
        Name of a sequence, its file, or its steps as of :meth:`Rig.simulate`; steps only without ``folder``, as who goes on
        with a sweep needs them in a file.
    vary : mapping
        By the name of a parameter or setting the values that it takes: a list of texts with units, of a setting also
        of numbers in SI, or a text as after ``--vary``: ``"20 Nm .. 100 Nm in 5"``, ``"-250 ms .. -150 ms step 10 ms"``.
    samples : int, optional
        Members that ``"random"`` and ``"lhs"`` draw from the ranges.
    method : str, optional
        ``"grid"``, every value with every other; ``"list"``, the values row by row; ``"random"``; ``"lhs"``, a Latin hypercube.
        By default a grid, with ``samples`` a Latin hypercube.
    repeats : int
        Runs of each point, with other noise.
    seed : int
        Seed of the first member; those of the others follow.
    parameters : mapping, optional
        Parameters of the sequence that all members share, as after ``--with``.
    controller : str or type, optional
        A controller in place of the rig's own, as of :meth:`Rig.simulate`, which each member begins anew; a class must be found
        by its module's name where ``jobs`` or ``dask`` are given.
    level, delay : str or None, int
        As of :meth:`Rig.simulate`.
    calculate : str, optional
        A calculation of the rig's folder that is made of each run in place of the metrics of shifts.
    jobs : int
        Processes; with one the members run in this process.
    dask : str, optional
        A Dask cluster in their place: address of its scheduler, or ``"local:N"``.
    folder : str or Path, optional
        Folder of the sweep with its results as Parquet, as `rig sweep --out`, in which one that was interrupted goes on; by
        default it is not kept.
    bags : bool
        True to keep in ``folder`` a bag with its report of each member.

    Returns
    -------
    Table
        A row for each shift: ``member``, what was varied in SI, the names of the gears, ``end`` and the metrics. With
        ``calculate`` a row for each of the calculation's, whose columns begin with ``table.`` and have its units.

    Raises
    ------
    RigError
        When a name, a unit or a value does not fit the rig or the sequence, or processes were killed before they had finished a
        member; with ``folder``, the next call goes on.

    Examples
    --------
    >>> table = rig_nodes.sweep("hydmag", "demo", {"alfa46.t12": [-0.24, -0.18]})
    >>> table["alfa46.t12"], table.units["alfa46.t12"], table["t_c_s"].shape
    (array([-0.24, -0.24, -0.18, -0.18]), 's', (4,))
    """
    jobs, rig = whole("jobs", jobs, 1), rig_from(rig)
    steps = not isinstance(sequence, str | Path)
    if steps and folder is not None:
        raise RigError(f"folder is {folder}: a sweep that is kept takes a sequence's name or file; write the steps to one")
    if bags and folder is None:
        raise RigError("bags are kept in the sweep's folder; give folder too")
    given = _varied(rig, vary)
    fixed_with = texts_of("parameters", parameters)
    samples = None if samples is None else whole("samples", samples, 1)
    seed, repeats, delay = seed_of(seed), whole("repeats", repeats, 1), whole("delay", delay)
    plugged = plugged_of(spec_of(controller), level, delay)
    with contextlib.ExitStack() as stack:
        own = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rig-sweep-")))
        what = _written(own / "steps.yaml", sequence, rig) if steps else str(sequence)
        draft = Plan(what, rig.source, method, samples, seed, repeats, fixed=rig.settings, fixed_with=fixed_with)
        draft = replace(draft, plugged=plugged, calculation=calculate)
        plan = make_plan(draft, given, {name: f"vary {name}" for name in given})
        starting = stack.enter_context(contextlib.ExitStack())
        starting.enter_context(waiting(STARTING))
        place, kept = own / "sweep" if folder is None else path_of("folder", folder), folder is not None
        found = run_plan(plan, place, bags, jobs, dask, lambda _of, _begun: lambda _done, _entry: starting.close(), kept)
    if found.interrupted is not None:
        raise found.interrupted
    return _table(plan, rig, found.entries)


def _varied(rig: Rig, vary: object) -> dict[str, str | list[str]]:
    """Return what is varied, as texts after ``--vary``; RigError when it is no dict of texts or lists."""
    if not isinstance(vary, Mapping) or not all(isinstance(name, str) for name in vary):
        raise RigError(f"vary is {brief(vary)}, expected a dict of names and values")
    for name, spec in vary.items():
        if not isinstance(spec, str | Iterable):
            raise RigError(f'vary {name} is {brief(spec)}, expected a list of values or a text such as "LOW .. HIGH"')
    return {name: spec if isinstance(spec, str) else [rig.text_of(name, one) for one in spec] for name, spec in vary.items()}


@dataclass(frozen=True)
class Members:
    """The members of a sweep that are finished.

    Parameters
    ----------
    entries : list of dict
        What is recorded of each, by their numbers.
    of : int
        Number of all members.
    begun : int
        How many were finished already when the sweep began.
    interrupted : KeyboardInterrupt or None
        What has ended it before all of them were.
    """

    entries: list[dict]
    of: int
    begun: int
    interrupted: KeyboardInterrupt | None


def run_plan(
    plan: Plan,
    folder: Path,
    bags: bool = False,
    jobs: int = 1,
    dask: str | None = None,
    watch: Callable[[int, int], Callable[[int, dict], None]] | None = None,
    results: bool = True,
) -> Members:
    """Run the members of a plan that its folder lacks; :func:`sweep` and `rig sweep` do.

    Parameters
    ----------
    plan : Plan
        The plan.
    folder : Path
        Folder of the sweep.
    bags, jobs, dask : bool, int, str or None
        As of :func:`sweep`.
    watch : callable, optional
        Called with the numbers of all members and of those that are finished already, it returns what is called with the number
        of finished members and with what is recorded of each.
    results : bool
        True to write the results as Parquet, if nothing interrupts.

    Returns
    -------
    Members
        The finished members.

    Raises
    ------
    RigError
        When the folder holds something else, or processes were killed before they had finished a member.
    """
    if results:
        parquet()
    if jobs > 1 and not dask:
        start_server("rig_nodes.studies.sweep.run", rigs=[plan.rig])
    with Store(folder, manifest_of(plan, bags)) as store:
        of, begun, interrupted = store.manifest["members"], len(store.done), None
        progress = watch(of, begun) if watch else None
        if begun < of:
            try:
                with _stream(jobs, dask) as stream:
                    run_sweep(plan, store, stream, progress)
            except KeyboardInterrupt as stop:
                interrupted = stop
                forget_unfinished(store)
        if results and interrupted is None:
            store.write_results(plan)
        return Members(sorted(store.entries(), key=lambda entry: entry["member"]), of, begun, interrupted)


@contextlib.contextmanager
def _stream(jobs: int, dask: str | None) -> Iterator[Callable[..., Iterator[tuple[int, Any, Exception | None]]]]:
    """Give the function that runs the members, on a cluster or with the allowed number of processes."""
    if dask:
        with dask_stream(dask) as stream:
            yield stream
        return
    with Workers(jobs) as workers:
        yield workers.stream


def _table(plan: Plan, rig: Rig, entries: list[dict]) -> Table:
    """Return what is recorded of finished members, a row for each shift."""
    rows = [row for entry in entries for row in rows_of(plan, entry)]
    box = rig.config.transmission if rig.config.structure.gears else None
    figures = partial(_figures, plan, [dict(row) for row in rows], box) if box else None
    for row in rows:
        row |= {name: box.short(row[name]) for name in GEARS if box and row.get(name) is not None}
    units = {}
    for one in plan.varied:
        units[one.name] = _to_si(rows, one)
    for entry in entries:
        units |= {name: unit for row in entry["shifts"] for name, (_, unit) in loop_columns(row).items() if name not in units}
        units |= {column_of(name): unit for name, unit in entry.get("table", {"columns": {}})["columns"].items()}
    of_shifts = ["shift", "from_gear", "to_gear", *(one.key for one in named_metrics(SHORT)), "valid"]
    shown = ["member", *units, *([] if plan.calculation else of_shifts), "end"]
    columns = dict.fromkeys(key for row in rows for key in row)
    return Table({name: units.get(name, column_unit(name)) for name in columns}, rows, shown, figures)


def _written(path: Path, steps: Any, rig: Rig) -> str:
    """Write steps to a sequence's file and return its path; RigError when they are none."""
    sequence_of(steps, {}, rig.config, rig.source)
    content = steps if isinstance(steps, Mapping) else {"steps": list(steps)}
    path.write_text(json.dumps({"description": "steps given in Python", **content}, default=str), encoding="utf-8")
    return str(path)


def _figures(plan: Plan, rows: list[dict], box: Transmission, places: range) -> list[Description]:
    """Describe the figures of the rows at some places of a sweep, whose gears are numbers and whose conditions are as varied."""
    from ..view import campaign_of_sweep, figures_of_campaign

    found = campaign_of_sweep(plan, [rows[place] for place in places], box)
    return figures_of_campaign(found) if found else []


def _to_si(rows: list[dict], one: Varied) -> str:
    """Convert what was varied in all rows to SI where its unit can be written, and return the unit."""
    if not one.unit:
        return ""
    dimension, factor = UNITS[one.unit]
    if dimension not in SI:
        return one.unit
    for row in rows:
        row[one.name] *= factor
    return SI[dimension].strip("-")
