# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A file of a logger that is laid over the shifts of the operator's page: its signals by the rig's names, in the page's units.

nodes.panel.pictures reads it, by what `rig import` knows of heads, units, signs and times.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...bags import orders_in, proposed, read_foreign, read_measurement, read_profile
from ...base import RigError
from ...rig import catalogue, transmission_of
from ...view import Envelope

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...bags import Measurement
    from ...rig import Signal

BEFORE, AFTER = 0.1, 5.0  # s around an order of the file
MOST = 12  # orders of a file that are shown
POINTS, ALL = 600, 4000  # stretches of a curve around an order, and of a whole file


def measured(path: Path, record: Mapping[str, Any]) -> dict[str, Any]:
    """Read a file for the page.

    Parameters
    ----------
    path : Path
        The file; beside it a proposed profile may be written.
    record : mapping
        Record of the rig whose signals it has.

    Returns
    -------
    dict
        ``notes`` and ``parts``: one around each order of a gear in the file, or the whole file, whose first value is at 0. Each has
        ``way``, ``text`` and ``curves``, by signal: ``t`` [ms] and ``v`` in the unit that people read.

    Raises
    ------
    RigError
        When the file cannot be used; the sentence names it without its folder.
    """
    try:
        found = _read(path, record)
    except RigError as error:
        raise RigError(str(error).replace(f"{path.parent}/", "")) from None
    signals, box = catalogue(record).signals, transmission_of(record) if record["structure"]["gears"] else None
    end = found.t0 + found.period * len(next(iter(found.channels.values())))
    orders = orders_in(found.events)[:MOST] if box else []
    parts = [
        {
            "way": box.way(before, after),
            "text": f"{box.way(before, after)} at {t:.3f} s",
            "curves": _curves(found, signals, (max(found.t0, t - BEFORE), min(end, t + AFTER)), t, POINTS),
        }
        for t, before, after in orders
        if box
    ]
    whole = {"way": "", "text": "the whole file", "curves": _curves(found, signals, (found.t0, end), found.t0, ALL)}
    return {"parts": parts or [whole], "notes": found.notes}


def _read(path: Path, record: Mapping[str, Any]) -> Measurement:
    """Return what the file has by its heads, or by the guess of a profile when these are not all of the rig's own names."""
    refused = None
    try:
        found = read_measurement(path, None, record, "the page")
        if found is not None:
            return found
    except RigError as error:
        refused = error
    profile = path.with_name("profile.yaml")
    profile.write_text(proposed(read_foreign(path), record, str(record["name"]))[0], encoding="utf-8")
    try:
        read = read_profile(profile)
    except RigError:
        lacking = f"{path}: no column has name and unit of a signal of this rig, as 'NAME [rpm]', beside one of times, 't [s]'"
        raise refused or RigError(lacking) from None
    try:
        found = read_measurement(path, read, record, "the page")
    except RigError as error:
        raise refused or error from None
    assert found is not None
    return found


def _curves(
    found: Measurement, signals: Mapping[str, Signal], span: tuple[float, float], zero: float, points: int
) -> dict[str, dict[str, list[float]]]:
    """The signals in a span of the file [s], as times [ms] after ``zero`` [s] and values, of at most so many points."""
    curves: dict[str, dict[str, list[float]]] = {}
    for name, values in found.channels.items():
        t = found.t0 + found.period * np.arange(len(values))
        known = np.isfinite(values) & (t >= span[0]) & (t < span[1])
        if known.sum() > points:
            kept = Envelope(*span, points)
            kept.add(t[known], signals[name].shown(values[known]))
            t, shown = kept.times[kept.filled], kept.middle[kept.filled]
        else:
            t, shown = t[known], signals[name].shown(values[known])
        if len(t):
            curves[name] = {"t": [_brief(1e3 * (one - zero)) for one in t], "v": [_brief(one) for one in shown]}
    return curves


def _brief(value: float) -> float:
    return float(f"{value:.7g}")
