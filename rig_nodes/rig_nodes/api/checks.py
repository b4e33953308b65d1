# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assertions on a run, for tests: results of shifts, events and their order, and signals that stay within bounds.

Each failure is one message with what was measured, what was expected, when, and in which shift.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import Limit, judged, number, results_of, shift_name, shown, shown_transmission
from ..base import UNITS, RigError, brief, dimension_of_text, meant, quantity, unknown

if TYPE_CHECKING:
    from .run import Run

SIGNS = {"<": "..{}", "<=": "..{}", ">": "{}..", ">=": "{}.."}  # how a limit's range is written (rig report --limit)
MOST = 8  # events that a failure lists
# names of the events that the rig sends; nodes and controllers of others may send more
EVENTS = (
    *("step", "sequence_done", "sequence_failed", "sequence_cancelled", "shift_ordered", "shift_done", "shift_refused"),
    *("shift_aborted", "shift_withdrawn", "cancel_refused", "command_refused", "controller_failed", "controller_silent"),
    *("setting_changed", "fault_ordered", "fault_on", "fault_off", "gear_was", "e_stop", "reset"),
    *("rig_starting", "rig_ready", "rig_running", "rig_tripped", "rig_warning"),
)
ALIKE = 0.88  # share of letters from which on a name is one of these that was mistyped


def assert_shift(run: Run, way: str, **limits: str) -> None:
    """Assert that the run has a shift, and that every shift of this kind is valid and within limits.

    Parameters
    ----------
    run : Run
        The run.
    way : str
        The kind of shift, e.g. "I-II".
    **limits
        For each result by its name or key (``rig list metrics``) "< 600 ms", "> 0.9" or "0.9 .. 1.0".

    Raises
    ------
    AssertionError
        When there is no such shift, or one that is not valid or not within a limit.
    RigError
        When the gearbox has no such shift, there is no such result, or a limit is not written so.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> rig_nodes.assert_shift(run, "I-II", t_c="< 700 ms", k="> 0.9")
    >>> rig_nodes.assert_shift(run, "I-II", t_c="< 600 ms")
    Traceback (most recent call last):
    AssertionError: shift 1, I -> II at 3.85 s: t_c is 672 +- 1 ms, expected < 600 ms
    """
    __tracebackhide__ = True
    report = run.report
    if not report.get("shifts"):
        raise AssertionError(f"the run has no shift {way}; it has no shifts")
    box = shown_transmission(report)
    if way not in box.ways():
        raise RigError(unknown("shift", way, box.ways()))
    rows = {shift_name(i, row, box): row for i, row in enumerate(report["shifts"], 1)}
    ours = {place: row for place, row in rows.items() if box.way(row["from_gear"], row["to_gear"], "-") == way}
    if not ours:
        raise AssertionError(f"the run has no shift {way}; it has {'; '.join(rows)}")
    faults = [f"{place}: it is not valid: {'; '.join(row['why'])}" for place, row in ours.items() if not row["valid"]]
    texts = {name: _limit(name, way, text) for name, text in limits.items()}
    for name, limit in texts.items():
        for one in judged(results_of(report), [limit]):
            found, row = one.result, ours[one.result.place]
            if found.value is None:
                if row["valid"]:
                    faults.append(f"{found.place}: {name} has no value: {(row['undefined'] or {}).get(found.key, 'not found')}")
            elif (one.low is not None and found.value < one.low) or (one.high is not None and found.value > one.high):
                error = "" if found.error is None else f" +- {number(found.error, found.digits)}"
                value = f"{shown(found.value, found.error, found.digits)}{error} {found.unit}".removesuffix(" -")
                faults.append(f"{found.place}: {name} is {value}, expected {limits[name].strip()}")
    if faults:
        raise AssertionError("\n".join(faults))


def _limit(name: str, way: str, text: str) -> Limit:
    """Return a limit of a result from "< 600 ms" or "0.9 .. 1.0"."""
    found = re.fullmatch(r"\s*(<=?|>=?)\s*(.+?)\s*", str(text))
    if not found and ".." not in str(text):
        raise RigError(f"{name} is {brief(text)}, expected e.g. '< 600 ms', '> 0.9' or '0.9 .. 1.0'")
    return Limit(name, way, SIGNS[found[1]].format(found[2]) if found else text, name)


def assert_events(run: Run, *expected: str) -> None:
    """Assert that events came in this order; others may lie between them.

    Parameters
    ----------
    run : Run
        The run.
    *expected
        For each event its name, e.g. "shift_done", or a part of its text, e.g. "shift to II ordered".

    Raises
    ------
    AssertionError
        When one of them did not come behind the one before it.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> rig_nodes.assert_events(run, "shift to II ordered", "shift_done", "sequence_done")
    >>> rig_nodes.assert_events(run, "sequence_done", "shift_done")
    Traceback (most recent call last):
    AssertionError: no 'shift_done' after 'sequence_done' at 13.295 s; after it came nothing
    """
    __tracebackhide__ = True
    events, place, after = list(run.events), 0, "the start"
    for wanted in expected:
        at = next((i for i in range(place, len(events)) if _is(events[i], wanted)), None)
        if at is None:
            came = [f"{one['time']:.3f} s {one['text']}" for one in events[place : place + MOST]]
            more = f"; and {len(events) - place - MOST} more" if len(events) > place + MOST else ""
            nowhere = not any(_is(one, wanted) for one in events)
            hint = f"; {meant(wanted, dict.fromkeys(one['name'] for one in events))}" if nowhere else ""
            raise AssertionError(f"no '{wanted}' after {after}; after it came {'; '.join(came) or 'nothing'}{more}{hint}")
        place, after = at + 1, f"'{wanted}' at {events[at]['time']:.3f} s"


def assert_never(run: Run, *unwanted: str) -> None:
    """Assert that none of these events came.

    Parameters
    ----------
    run : Run
        The run.
    *unwanted
        Names of events or parts of their texts, as for :func:`assert_events`.

    Raises
    ------
    AssertionError
        When one of them came.
    RigError
        When a name is nearly that of an event, so that no run could ever fail.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> rig_nodes.assert_never(run, "rig_tripped", "controller_failed")
    """
    __tracebackhide__ = True
    came = [one for one in run.events if any(_is(one, wanted) for wanted in unwanted)]
    if came:
        raise AssertionError("\n".join(f"{one['name']} at {one['time']:.3f} s, which must not come: {one['text']}" for one in came))
    for wanted in unwanted:
        if "_" in wanted and wanted not in EVENTS and get_close_matches(wanted, EVENTS, 1, ALIKE):
            raise RigError(unknown("event", wanted, EVENTS))


def _is(event: dict, wanted: str) -> bool:
    return wanted == event["name"] or wanted in event["text"]


def assert_stays(
    run: Run, signal: str, *, below: str | None = None, above: str | None = None, start: float = 0.0, end: float = np.inf
) -> None:
    """Assert that a signal stays below or above values.

    Parameters
    ----------
    run : Run
        The run.
    signal : str
        Name of the signal.
    below, above : str, optional
        Bounds with their unit, e.g. "300 Nm".
    start, end : float
        The time in which it is looked at [s]; the whole run by default.

    Raises
    ------
    AssertionError
        When a value is not between the bounds.
    RigError
        When there is no such signal or time in the run, no bound, or a bound is not of the signal's dimension.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> rig_nodes.assert_stays(run, "M_wej", below="300 Nm", above="-100 Nm")
    >>> rig_nodes.assert_stays(run, "p_p", above="3.5 MPa", start=1.0, end=10.0)
    """
    __tracebackhide__ = True
    values = run.signals[signal]
    inside = values[(values.time >= start) & (values.time <= end) & ~np.isnan(np.asarray(values))]
    if not len(inside):
        raise RigError(f"{signal} has no values from {start:g} to {end:g} s")
    if below is None and above is None:
        raise RigError(f"{signal} has no bound; give e.g. below='300 Nm'")
    faults = []
    for word, text, sign in (("below", below, 1.0), ("above", above, -1.0)):
        if text is None:
            continue
        bound = quantity(text, UNITS[values.unit][0] if values.unit in UNITS else "ratio", f"{signal} {word}")
        excess = sign * (np.asarray(inside) - bound)
        outside = excess > 0.0
        if outside.any():
            worst, first = int(np.nanargmax(excess)), int(outside.argmax())
            unit = text.strip().rpartition(" ")[2] if dimension_of_text(text) else ""
            shown_as = inside.to(unit) if unit in UNITS else inside
            faults.append(
                f"{signal} is {float(shown_as[worst]):.4g} {unit} at {inside.time[worst]:.3f} s{_where(run, inside.time[worst])}, "
                f"expected {word} {text}; it is beyond from {inside.time[first]:.3f} s on, for {int(outside.sum())} of "
                f"{len(inside)} values"
            )
    if faults:
        raise AssertionError("\n".join(faults))


def _where(run: Run, time: float) -> str:
    """Return in which shift a time is; empty before the first order and on a rig without shifts."""
    report = run.report
    rows = [row for row in report.get("shifts") or () if row["t_order_s"] <= time]
    if not rows:
        return ""
    return f" (after the order of {shift_name(len(rows), rows[-1], shown_transmission(report))})"
