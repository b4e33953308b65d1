# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The faults that were injected in a run, from its events; report and figures show them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..rig import FAULT_OFF, FAULT_ON


def faults_in(events: Iterable[tuple[float, str, str, str, float]]) -> list[dict]:
    """Return the faults of a run.

    Parameters
    ----------
    events : iterable of (float, str, str, str, float)
        Time [s], topic, name, text and value of each event of its bag.

    Returns
    -------
    list of dict
        For each fault its ``name``, its ``text`` with parameter and size, its ``size`` [SI], and the times of its beginning and
        its end, ``from_s`` and ``to_s``, the latter None for one that stayed.
    """
    found: list[dict] = []
    for t, _, name, text, value in events:
        if name == FAULT_ON:
            found.append({"name": text.partition(":")[0], "text": text, "size": value, "from_s": t, "to_s": None})
        elif name == FAULT_OFF:
            ended = text.partition(" ")[0]
            for one in found:
                if one["name"] == ended and one["to_s"] is None:
                    one["to_s"] = t
    return found


def fault_lines(faults: Iterable[Mapping]) -> list[str]:
    """Return a line on each of :func:`faults_in`."""
    return [
        f"fault injected: {one['text']}, from {one['from_s']:.3f} s {'on' if one['to_s'] is None else 'to %.3f s' % one['to_s']}"
        for one in faults
    ]


def never_begun(injected: Iterable[Mapping], ordered: Iterable[str]) -> list[str]:
    """Return a line on each fault of an order, as ``--fault`` takes it, that is none of :func:`faults_in`."""
    begun = {one["name"] for one in injected}
    return [f"fault ordered, but never begun: {text}" for text in ordered if text.partition(",")[0].strip() not in begun]


def faults_at(faults: Iterable[Mapping], start: float, end: float) -> list[str]:
    """Return the names of the faults that act at some time from ``start`` to ``end`` [s]."""
    return [one["name"] for one in faults if one["from_s"] <= end and (one["to_s"] is None or one["to_s"] >= start)]
