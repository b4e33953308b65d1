# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings side by side on one clock: metrics and signals with their differences in units of the measuring error.

`rig compare` uses it, and the view draws its result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from ..bags import Recording
from ..rig import Transmission
from .alignment import Clock, align
from .measured_error import instruments_of
from .moved import REST, differences
from .phases import times_of
from .run_report import plain, report_of_recording
from .state_at_order import unlike
from .trips import without_trips

POINTS = 4000  # at most, of a drawn curve of a whole run
BEFORE, AFTER, UNKNOWN = 0.1, 0.15, 1.5  # s before an order, after the settled torque, and after an order without an end


@dataclass(frozen=True)
class Source:
    """A recording to compare: its name for people, its rows and orders, and the record of its rig.

    ``report`` holds its shifts, where they were found in more rows than ``recording`` has; ``faults`` sentences on the faults of
    its run, None where nothing tells them.
    """

    name: str
    recording: Recording
    record: Mapping
    report: Mapping | None = None
    faults: Sequence[str] | None = None


@dataclass(frozen=True)
class Curve:
    """A signal of all recordings on the first clock.

    Attributes
    ----------
    name : str
        Name of the signal.
    time : (n,) array of float
        Times of the first clock [s].
    values : list of (n,) array of float
        Values of each recording [SI]; NaN where it has none.
    """

    name: str
    time: np.ndarray
    values: list[np.ndarray]


@dataclass(frozen=True)
class ShiftCurves:
    """A shift of all recordings, each from its own order on.

    Attributes
    ----------
    number : int
        Its number in the first recording, from 1 on.
    rows : list of (mapping or None)
        Its metrics in each recording; None in one that does not hold it.
    time : (n,) array of float
        Times after the order [s].
    values : dict of str to list of (n,) array of float
        Values of each recording [SI] by signal; NaN where it has none.
    """

    number: int
    rows: list[Mapping | None]
    time: np.ndarray
    values: dict[str, list[np.ndarray]]


@dataclass(frozen=True)
class Comparison:
    """The result: names, clocks, rows of metrics and signals, curves, and what else differed: faults, trips, states."""

    names: list[str]
    clocks: list[Clock]
    metrics: list[dict]
    signals: list[dict]
    curves: list[Curve]
    shifts: list[ShiftCurves]
    starts: list[str]

    def as_dict(self) -> dict:
        """Return plain values for JSON; ``offset_s`` and ``drift_ppm`` are in the order of the recordings."""
        return plain(
            {
                "runs": self.names,
                "offset_s": [clock.offset for clock in self.clocks],
                "drift_ppm": [clock.drift * 1e6 for clock in self.clocks],
                "aligned_by": [clock.by for clock in self.clocks],
                "notes": [list(clock.notes) for clock in self.clocks],
                "metrics": self.metrics,
                "signals": self.signals,
                "starts": self.starts,
            }
        )


def compare(sources: Sequence[Source], by: str | None = None) -> Comparison:
    """Compare recordings with the first one.

    Parameters
    ----------
    sources : sequence of Source
        Two or more recordings; one without orders of gears takes those of the first one.
    by : str, optional
        How to align, as for alignment.align.

    Returns
    -------
    Comparison
        The rows; ``run`` in them is the number of the recording from 1 on.

    Raises
    ------
    RigError
        When a recording cannot be aligned.
    """
    first = sources[0]
    clocks = [Clock(), *(align(first.recording, one.recording, by) for one in sources[1:])]
    recordings = [first.recording]
    for clock, one in zip(clocks[1:], sources[1:]):
        moved = [(float(clock.of_first(np.array(t))), a, b) for t, a, b in first.recording.orders]
        orders = one.recording.orders or [order for order in moved if _covers(one.recording, order[0])]
        recordings.append(replace(one.recording, orders=orders))
    reports = [
        one.report if one.report and one.recording.orders else _report_of(recording, one.record)
        for recording, one in zip(recordings, sources)
    ]
    metrics = []
    shifts_of = [_numbered(reports[0], range(len(reports[0]["shifts"])))]
    for n, (one, clock, report) in enumerate(zip(sources[1:], clocks[1:], reports[1:]), 1):
        numbers = list(range(len(reports[0]["shifts"])))
        if not one.recording.orders:  # it has the orders of the first one, of which it may not hold all
            times = [float(clock.of_first(np.array(row["t_order_s"]))) for row in reports[0]["shifts"]]
            numbers = [i for i in numbers if _covers(one.recording, times[i])]
        mine = {key: [reports[0][key][i] for i in numbers] for key in ("shifts", "uncertainty") if key in reports[0]}
        shifts_of.append(_numbered(report, numbers))
        metrics += [{"run": n, **row, "shift": numbers[row["shift"] - 1] + 1} for row in differences(mine, report)]
    errors = [_errors(one.record, one.recording.transmission) for one in sources]
    names = [name for name in first.recording.channels if all(name in one.channels for one in recordings[1:])]
    signals, curves = [], []
    for name in names:
        t = first.recording.t0 + first.recording.period * np.arange(len(first.recording.channels[name]))
        values = [first.recording.channels[name], *(_on(t, one, clock, name) for one, clock in zip(recordings[1:], clocks[1:]))]
        for n, other in enumerate(values[1:], 1):
            found = _difference(values[0], other, errors[0].get(name), errors[n].get(name))
            signals.append({"run": n, "signal": name, **found})
        every = max(1, len(t) // POINTS)
        # copies, because a view would keep all rows of every signal in memory
        curves.append(Curve(name, t[::every].copy(), [one[::every].copy() for one in values]))
    shifts = [_aligned(number, recordings, shifts_of, names) for number in shifts_of[0]]
    return Comparison([one.name for one in sources], clocks, metrics, signals, curves, shifts, _starts(sources, shifts_of))


def _aligned(
    number: int, recordings: Sequence[Recording], shifts_of: Sequence[Mapping[int, tuple[dict, dict]]], names: Sequence[str]
) -> ShiftCurves:
    """Return the curves of a shift; ``number`` is its place among those of the first recording."""
    rows = [found[number][0] if number in found else None for found in shifts_of]
    ends = [one.end - row["t_order_s"] for row in rows if row for one in times_of(row)]
    time = np.arange(-BEFORE, max(ends, default=UNKNOWN) + AFTER, recordings[0].period)
    values: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for row, one in zip(rows, recordings):
        there = time + (row["t_order_s"] if row else np.nan)
        for name in names:
            channel = one.channels[name]
            values[name].append(np.interp(there, one.t0 + one.period * np.arange(len(channel)), channel, np.nan, np.nan))
    return ShiftCurves(number + 1, rows, time, values)


def _starts(sources: Sequence[Source], shifts_of: Sequence[Mapping[int, tuple[dict, dict]]]) -> list[str]:
    """Return sentences on the faults of the recordings, on those whose trips were off, and on the shifts that began differently.

    Parameters
    ----------
    sources : sequence of Source
        The recordings.
    shifts_of : sequence of mapping of int to (dict, dict)
        Of each one, metrics and their errors by the shift's place among those of the first one.
    """
    names = short_names([one.name for one in sources])
    lines = []
    if any(one.faults for one in sources):
        told = [(name, one.faults) for name, one in zip(names, sources) if one.faults is not None]
        lines = [f"{name}: {'; '.join(faults) or 'no fault injected'}" for name, faults in told]
    off = [without_trips({"configuration": one.record}) for one in sources]
    lines += [f"{name}: {sentence}" for name, sentence in zip(names, off) if sentence]
    for number in shifts_of[0]:
        same = [(name, *found[number]) for name, found in zip(names, shifts_of) if number in found]
        lines += unlike(same, sources[0].recording.transmission, f"shift {number + 1},")
    return lines


def _numbered(report: Mapping, numbers: Sequence[int]) -> dict[int, tuple[dict, dict]]:
    return {number: (row, errors) for number, row, errors in zip(numbers, report["shifts"], report.get("uncertainty", []))}


def short_names(names: Sequence[str]) -> list[str]:
    """Return the last parts of the recordings' paths by which they can be told apart."""
    parts = [PurePath(name).parts or (name,) for name in names]
    for count in range(1, max(map(len, parts)) + 1):
        short = ["/".join(one[-count:]) for one in parts]
        if len(set(short)) == len(short):
            return short
    return [f"{name} ({number})" for number, name in enumerate(names, 1)]


def _report_of(recording: Recording, record: Mapping) -> Mapping:
    return report_of_recording(recording, record) if recording.orders else {"shifts": []}


def _covers(recording: Recording, t: float) -> bool:
    """Return True when a time of its own clock [s] lies in a recording."""
    return recording.t0 <= t <= recording.t0 + recording.period * recording.rows


def _on(t: np.ndarray, recording: Recording, clock: Clock, name: str) -> np.ndarray:
    """Return a channel at times of the first clock; NaN outside the recording."""
    values = recording.channels[name]
    own = recording.t0 + recording.period * np.arange(len(values))
    return np.interp(clock.of_first(t), own, values, np.nan, np.nan)


def _errors(record: Mapping, box: Transmission) -> dict[str, float]:
    """Return the largest error of each measured signal [SI]."""
    use = instruments_of(record)
    out = {clutch.pressure: use[clutch.pressure].error for clutch in box.clutches if clutch.pressure}
    out |= {end.torque: use["torque"].error for end in (box.input, box.output)}
    return out | {end.speed: use["speed"].error for end in (box.input, box.output)}


def _difference(first: np.ndarray, other: np.ndarray, *errors: float | None) -> dict:
    """Return mean, root mean square and largest difference [SI], the larger error, the root mean square over it, and reasons.

    ``reason`` is why there is no difference or no error; empty where both are there.
    """
    rest = other - first
    rest = rest[np.isfinite(rest)]
    error = max((one for one in errors if one), default=None)
    if not len(rest):
        return dict.fromkeys(("mean", "rms", "largest", "in_errors")) | {"error": error, "reason": "no time has a value of both"}
    if np.abs(rest).max() <= REST * np.nanmax(np.abs(first)):
        rest = np.zeros(1)
    reason = "" if error else "no measuring error of it is known"
    rms = float(np.sqrt(np.mean(rest**2)))
    return {
        "mean": float(rest.mean()),
        "rms": rms,
        "largest": float(np.abs(rest).max()),
        "error": error,
        "in_errors": rms / error if error else None,
        "reason": reason,
    }
