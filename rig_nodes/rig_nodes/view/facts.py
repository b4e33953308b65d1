# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is told of a run beside its shifts: how it was made and ended, what is wrong with it, and its energy.

view.document and view.page_of_report show it. A report that others have written is told as far as it can be read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from ..analysis import energy_names, fixed, without_trips

if TYPE_CHECKING:
    from ..rig import Transmission

HOW = {"simulate": "simulated without messages", "run": "run on the node graph"}
LATE = {"p50": "median", "p99": "p99", "max": "largest"}
MADE = ("rig", "sequence", "parameters", "how", "controller", "duration", "end")  # facts on what was run; the others are its origin


def facts_of(report: Mapping) -> dict[str, str]:
    """Return name and value of each fact that the report of a run has, with units."""
    run = report["run"]
    controller, end, late, parent = (_map(run, key) for key in ("controller", "end", "lateness_ms", "parent"))
    shown = [f"{word} {number:.2f}" for key, word in LATE.items() if (number := _number(late, key)) is not None]
    overruns = f"; {run.get('overruns')} of {run.get('ticks')} ticks more than one tick late"
    delay = "" if controller.get("delay") in (None, 1) else f", answers act {controller['delay']} samples later"
    duration, begun = (_number(run, key) for key in ("duration_s", "recorded_from_s"))
    known = any(value is not None for value in run.values())  # no run of the rig is known of a logger's file
    found = {
        "rig": _map(run, "configuration").get("name"),
        "sequence": run.get("sequence"),
        "parameters": ", ".join(f"{name} = {value}" for name, value in _map(run, "parameters").items()),
        "how": HOW.get(str(run.get("mode")), run.get("mode")),
        "controller": controller and f"{controller.get('name')} at level {controller.get('level')}{delay}",
        "duration": duration and f"{duration:.2f} s",
        "end": end.get("reason") if end else run.get("end"),
        **{f"version of {name}": version for name, version in _map(run, "versions").items()},
        "seed": None if run.get("seed") is None else f"{run['seed']}",
        "messages lost": known and ("unknown" if run.get("lost") is None else f"{run['lost']}"),
        "recorded from": begun and f"{begun:.3f} s",
        "lateness of ticks": shown and f"{', '.join(shown)} ms{overruns}",
        "parent": parent and f"{parent.get('bag')}, run again through {parent.get('through')}",
        "hash of the parent": parent.get("hash"),
    }
    return {name: str(value) for name, value in found.items() if value}


def problems_of(report: Mapping, warnings: Iterable[str]) -> list[str]:
    """Return sentences on what is wrong with a run: the given ones, how it ended, and the problems of its report."""
    run, end = report["run"], _map(report["run"], "end")
    found = list(warnings)
    if end.get("state") not in (None, "ended"):
        found.append(f"The run did not end as planned: {end.get('reason') or 'the reason is unknown'}.")
    if off := without_trips(run):
        found.append(f"{off[0].upper()}{off[1:]}.")
    return [*found, *map(str, run.get("problems") or ())]


def energy_rows(accounts: Sequence[Mapping], box: Transmission) -> list[list[str]]:
    """Return name and values [J] of each energy that one of some accounts has (analysis.energy)."""
    names = energy_names(box) | {"residual": "unaccounted"}
    digits = {"residual": 2}
    return [
        [text, *(fixed(one.get(f"{name}_j"), 1.0, digits.get(name, 0)) for one in accounts)]
        for name, text in names.items()
        if any(one.get(f"{name}_j") is not None for one in accounts)
    ]


def _map(run: Mapping, key: str) -> Mapping:
    return value if isinstance(value := run.get(key), Mapping) else {}


def _number(run: Mapping, key: str) -> float | None:
    return value if isinstance(value := run.get(key), (int, float)) else None
