# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips of a run with their resets, and its warnings, from its events; the report shows them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..rig import ENDED_EARLY, RED_BUTTON, STATUS, TRIPPED, TRIPS, WARNING, WATCHED, trips_named

MOST_WARNINGS = 12  # that are lines of a report


def without_trips(run: Mapping) -> str:
    """Return a sentence when the trips of a run were off; empty otherwise."""
    trips = (run.get("configuration") or {}).get(TRIPS) or {}
    return "" if trips.get(WATCHED, True) else "the trips were off: nothing kept the machine within its limits"


def trips_in(events: Iterable[tuple[float, str, str, str, float]]) -> list[dict]:
    """Return the trips of a run.

    Parameters
    ----------
    events : iterable of (float, str, str, str, float)
        Time [s], topic, name, text and value of each event of its bag.

    Returns
    -------
    list of dict
        For each trip its ``name``, empty where its reason is not known, its ``reason``, and the times of its beginning and of the
        reset, ``from_s`` and ``to_s``, the latter None for one that stayed.
    """
    found: list[dict] = []
    for t, _, name, text, _ in events:
        there = [one for one in found if one["to_s"] is None]
        if name in (TRIPPED, RED_BUTTON):
            named = ", ".join(trips_named(text))
            if named == ENDED_EARLY:
                continue  # it is how the run ended, and nothing that the rig noticed
            same = [one for one in there if one["name"] == named or name == TRIPPED]
            if same:  # what its controller has told of it since, or the red button's own trip
                same[-1].update(name=named, reason=text)
            else:
                found.append({"name": named, "reason": text, "from_s": t, "to_s": None})
        elif name.startswith(STATUS) and name != WARNING:
            for one in there:
                one["to_s"] = t
    return found


def warnings_in(events: Iterable[tuple[float, str, str, str, float]]) -> list[dict]:
    """Return the warnings of a run, from events as for :func:`trips_in`: for each trip that was near the first ``text``, its time
    ``at_s``, and how many ``times`` it came.
    """
    found: dict[str, dict] = {}
    for t, _, name, text, _ in events:
        if name == WARNING:
            found.setdefault(text.partition(":")[0], {"text": text, "at_s": t, "times": 0})["times"] += 1
    return list(found.values())


def trip_lines(run: Mapping) -> list[str]:
    """Return a line on each warning and on each trip in the run part of a report, without the trip that is the run's end."""
    warned, end = run.get("trip_warnings") or [], run.get("end")
    reason = end.get("reason") if isinstance(end, Mapping) else end
    lines = [one["text"] + (f" and {one['times'] - 1} times more" if one["times"] > 1 else "") for one in warned[:MOST_WARNINGS]]
    if len(warned) > MOST_WARNINGS:
        lines.append(f"{len(warned) - MOST_WARNINGS} more trips gave a warning")
    for one in run.get("trips") or ():
        if one["to_s"] is not None or one["reason"] != reason:
            until = "" if one["to_s"] is None else f", reset at {one['to_s']:.3f} s"
            lines.append(f"tripped at {one['from_s']:.3f} s: {one['reason']}{until}")
    return lines
