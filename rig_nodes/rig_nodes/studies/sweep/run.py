# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs the members of a sweep, on this machine's cores or on a Dask cluster, and records each in the sweep's folder.

The verb ``sweep`` uses it; the result of a member depends only on its own values and seed.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from ... import __version__
from ...analysis import STEP, build_report, gather, plain, put_known, put_loops, shifts, write_report
from ...bags import Bag, Recording
from ...base import RigError, find_of_rigs, sources_key
from ...controllers import Plug
from ...rig import load_rig, with_overrides
from ...runs import Lost, load_sequence, of_bag, on_recording, record, recorded_with, simulate
from .plan import Member, Plan
from .store import BAGS, Store

if TYPE_CHECKING:
    from ...rig import RigConfig
    from ...runs import Calculation, Run, Sequence, Table
    from .plugged import Plugged

FOLDER = re.compile(r"\S*/(?=\S+\.ya?ml:\d)|(?<=:)/\S*/")  # the folder of a file is no part of a result
Stream = Callable[[Callable, Iterable], Iterator[tuple[int, dict, Exception | None]]]


def manifest_of(plan: Plan, bags: bool) -> dict:
    """Return what decides the results of a sweep: plan, configuration, sequence and versions; no clock, host or folder.

    Parameters
    ----------
    plan : Plan
        The plan.
    bags : bool
        Whether the members' bags are kept.

    Returns
    -------
    dict
        Plain data.
    """
    text = find_of_rigs("sequences", plan.sequence, plan.rig).read_text(encoding="utf-8")
    return {
        "plan": plan.as_dict(),
        "members": plan.count(),
        "bags": bags,
        "configuration": load_rig(plan.rig, plan.fixed).as_dict(),
        "sequence": hashlib.sha256(text.encode()).hexdigest(),
        "controller": plan.plugged.digest() if plan.plugged else None,
        "calculation": _digest(on_recording(plan.rig, plan.calculation).path) if plan.calculation else None,
        "versions": {
            "rig_nodes": __version__,
            "plant": sources_key(),
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "scipy", "numba")},
        },
    }


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run_sweep(plan: Plan, store: Store, stream: Stream, progress: Callable[[int, dict], None] | None = None) -> int:
    """Run the members that the store lacks; a member that fails is recorded with its reason, an interrupt is passed on.

    A member that was lost with its process is not recorded, so that the folder can go on with it.

    Parameters
    ----------
    plan : Plan
        The plan.
    store : Store
        The sweep's open folder.
    stream : callable
        Runs a function on items, as Workers.stream does.
    progress : callable or None
        Called as progress(finished, entry) after each member.

    Returns
    -------
    int
        Number of members run.

    Raises
    ------
    RigError
        After all others, when a member was lost.
    """
    forget_unfinished(store)
    left = [member for member in plan.members() if member.number not in store.done]
    bags = str(store.folder.absolute() / BAGS) if store.manifest["bags"] else None
    setup = pickle.dumps((load_rig(plan.rig, plan.fixed), plan.rig, plan.sequence, bags, plan.plugged, plan.calculation))
    lost = None
    for place, entry, error in stream(partial(run_member, setup), left):
        if isinstance(error, Lost):
            lost = RigError(f"member {left[place].number}: {error}")
            continue
        if error is not None:
            entry = failed(left[place], error)
        store.add(entry)
        if progress:
            progress(len(store.done), entry)
    if lost is not None:
        raise lost
    return len(left)


def forget_unfinished(store: Store) -> None:
    """Remove the bags of members that were ended before they were finished; nobody else works on an open store."""
    for path in (store.folder / BAGS).glob(".*-*"):
        shutil.rmtree(path, ignore_errors=True)


@lru_cache(maxsize=2)
def _setup(pickled: bytes) -> tuple[RigConfig, str, str, str | None, Plugged | None, str]:
    return pickle.loads(pickled)


def run_member(setup: bytes, member: Member) -> dict:
    """Run one member.

    Parameters
    ----------
    setup : bytes
        What all members share, as run_sweep makes it.
    member : Member
        The member.

    Returns
    -------
    dict
        What is recorded of the run: its end and the metrics of its shifts, or the table of the sweep's calculation.
    """
    base, rig, name, bags, plugged, calculation = _setup(setup)
    plug, delay, table = None, plugged.delay if plugged else 1, None
    try:
        config = with_overrides(base, member.overrides)
        sequence = load_sequence(name, member.parameters, rig)
        if bags:
            plug = plugged.load(config) if plugged else None
            wanted = on_recording(rig, calculation) if calculation else None
            end, metrics, table = _into_bag(config, sequence, member, Path(bags), plug, delay, wanted)
        elif calculation:

            def make(states: tuple[str, ...]) -> Run:
                nonlocal plug
                plug = plugged.load(config) if plugged else None  # a plug serves one run
                return record(config, sequence, member.seed, plant_states=states, controller=plug, delay=delay)

            run, tables = recorded_with([on_recording(rig, calculation)], config, make)
            table = tables.get(calculation)
            end, metrics = run.end, []
        else:
            plug = plugged.load(config) if plugged else None
            run = record(config, sequence, member.seed, controller=plug, delay=delay)
            end = run.end
            metrics = shifts(run.recording) if isinstance(run.recording, Recording) else []
            if metrics:
                put_loops(metrics, sequence.loops(), ((t, value) for t, name, _, value in run.events if name == STEP))
                put_known(config.as_dict(), config.transmission, metrics, run.at_orders)
    except RigError as error:
        if plug is not None:
            plug.close()  # the run did not begin: the controller's process would stay with the worker
        return failed(member, error)
    entry = _entry(member, end["state"], end["reason"], plain(metrics))
    if plug is not None and plug.end_fault:
        entry["end"]["fault"] = FOLDER.sub("", f"controller {plug.name}: {plug.end_fault}")
    if table is not None:
        entry["table"] = {"columns": dict(table.columns), "rows": plain(table.in_units())}
    return entry


def failed(member: Member, error: Exception) -> dict:
    """Return what is recorded of a run that could not be made: refused values, or an error with its last line."""
    state = "refused" if isinstance(error, RigError) else "error"
    reason = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
    return _entry(member, state, reason, [])


def _entry(member: Member, state: str, reason: str, metrics: list[dict]) -> dict:
    return {
        "member": member.number,
        "seed": member.seed,
        "values": member.values,
        "end": {"state": state, "reason": FOLDER.sub("", reason)},
        "shifts": metrics,
    }


def _into_bag(
    config: RigConfig,
    sequence: Sequence,
    member: Member,
    bags: Path,
    controller: Plug | None,
    delay: int,
    wanted: Calculation | None,
) -> tuple[dict, list[dict], Table | None]:
    """Make the run like ``rig simulate``, in a folder that gets its final name when it is complete."""
    folder, temporary = bags / f"{member.number:06d}", bags / f".{member.number:06d}-{os.getpid()}"
    for old in (folder, temporary):
        shutil.rmtree(old, ignore_errors=True)  # left by a run that was killed before it was recorded
    temporary.mkdir(parents=True)
    run = simulate(config, sequence, temporary, member.seed, controller=controller, delay=delay)
    report = build_report(gather(temporary, run), run)
    write_report(temporary, report)
    table = wanted.table(config, of_bag(Bag(temporary))) if wanted and run["end"]["state"] == "ended" else None
    os.replace(temporary, folder)
    return run["end"], report["shifts"], table
