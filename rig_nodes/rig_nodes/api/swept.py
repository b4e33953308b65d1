# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sweep from Python: what `rig sweep` runs, as one table; it is ``rig_nodes.sweep``."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis import SHORT, loop_columns, named_metrics
from ..base import SI, STARTING, UNITS, RigError, brief, waiting
from ..runs import Workers, sequence_of
from ..studies import Plan, Store, Varied, make_plan, manifest_of, rows_of, run_sweep
from .rig import Rig, load
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
    repeats: int = 1,
    seed: int = 1,
    jobs: int = 1,
    folder: str | Path | None = None,
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
        Members that a Latin hypercube draws from the ranges; by default every value is run with every other.
    repeats : int
        Runs of each point, with other noise.
    seed : int
        Seed of the first member; those of the others follow.
    jobs : int
        Processes; with one the members run in this process.
    folder : str or Path, optional
        Folder of the sweep, as `rig sweep --out`, in which one that was interrupted goes on; by default it is not kept.

    Returns
    -------
    Table
        A row for each shift: ``member``, what was varied in SI, the names of the gears, ``end`` and the metrics.

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
    if not isinstance(jobs, int) or jobs < 1:
        raise RigError(f"jobs is {brief(jobs)}, expected a whole number of at least 1")
    rig = rig if isinstance(rig, Rig) else load(rig)
    steps = not isinstance(sequence, str | Path)
    if steps and folder is not None:
        raise RigError(f"folder is {folder}: a sweep that is kept takes a sequence's name or file; write the steps to one")
    given = {name: spec if isinstance(spec, str) else [rig.text_of(name, one) for one in spec] for name, spec in vary.items()}
    with contextlib.ExitStack() as stack:
        own = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rig-sweep-")))
        what = _written(own / "steps.yaml", sequence, rig) if steps else str(sequence)
        draft = Plan(what, rig.source, samples=samples, repeats=repeats, seed=seed, fixed=rig.settings)
        plan = make_plan(draft, given, {name: f"vary {name}" for name in given})
        place = Path(folder or own / "sweep")
        store = stack.enter_context(Store(place, manifest_of(plan, False)))
        starting = stack.enter_context(contextlib.ExitStack())
        starting.enter_context(waiting(STARTING))
        stream = _one_by_one if jobs == 1 else stack.enter_context(Workers(jobs)).stream
        run_sweep(plan, store, stream, lambda _done, _entry: starting.close())
        entries = sorted(store.entries(), key=lambda entry: entry["member"])
    return _table(plan, rig, entries)


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
    varied = list(units)
    shown = ["member", *varied, "shift", "from_gear", "to_gear", *(one.key for one in named_metrics(SHORT)), "valid", "end"]
    columns = dict.fromkeys(key for row in rows for key in row)
    return Table({name: units.get(name, column_unit(name)) for name in columns}, rows, shown, figures)


def _written(path: Path, steps: Any, rig: Rig) -> str:
    """Write steps to a sequence's file and return its path; RigError when they are none."""
    sequence_of(steps, {}, rig.config, rig.source)
    content = steps if isinstance(steps, Mapping) else {"steps": list(steps)}
    path.write_text(json.dumps({"description": "steps given in Python", **content}, default=str), encoding="utf-8")
    return str(path)


def _figures(plan: Plan, rows: list[dict], box: Transmission) -> list[Description]:
    """Describe the figures of a sweep's rows, whose gears are numbers and whose conditions are as they were varied."""
    from ..view import campaign_of_sweep, figures_of_campaign

    found = campaign_of_sweep(plan, rows, box)
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


def _one_by_one(function: Callable[[Any], Any], items: Iterable) -> Iterator[tuple[int, Any, Exception | None]]:
    """Run the members in this process, in the form of Workers.stream."""
    for place, item in enumerate(items):
        yield place, function(item), None
