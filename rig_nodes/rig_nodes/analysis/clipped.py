# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Signals at the end of their transducer's range, where the true value lies beyond what is shown.

analysis.shift infers nothing from such a signal in a shift, and analysis.run_report names every one of a run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from ..rig import catalogue, ranges_of
from .metrics import LOAD_BEFORE, PRESSURES, SPEED_BEFORE, SPEEDS, TORQUE_AFTER, TORQUE_IN, TORQUE_OUT, every_metric

if TYPE_CHECKING:
    from ..bags import Bag
    from ..rig import Signal, Transmission
    from .gathered import Gathered
    from .shift import CutShift

RPM = 30.0 / np.pi
BEYOND = "its true values lie beyond, and nothing is concluded from it"
ROOM = 1e-3  # share of the range that counts as its end: two steps of a converter of 12 bits with a sign


def at_an_end(values: np.ndarray, ends: tuple[float, float], from_zero: bool = False) -> np.ndarray:
    """Return where a signal shows an end of its range.

    The lower end counts for a transducer that measures both signs. The one of a transducer that begins at zero is where a
    pressure or a speed rests; it counts when the true value is known to go below. A signal that goes beyond an end is of another
    transducer than the rig's.

    Parameters
    ----------
    values : (n,) array of float
        The signal [SI].
    ends : (float, float)
        What its transducer can show (Transmission.ranges).
    from_zero : bool
        True to count the lower end in any case.

    Returns
    -------
    (n,) array of bool
        Where it is at an end.
    """
    low, high = ends
    room = ROOM * (high - low)
    out = np.zeros(len(values), dtype=bool)
    if not len(values) or not np.nanmax(np.abs(values)) <= high + room:
        return out
    out = np.asarray(values) >= high - room
    if from_zero or low <= -high:
        out = out | (np.asarray(values) <= low + room)
    return out


def _reached(values: np.ndarray, ends: tuple[float, float]) -> list[float]:
    """Return the ends of a range at which values lie that :func:`at_an_end` has found, the lower one first."""
    middle = 0.5 * sum(ends)
    return [end for end, there in zip(ends, (values < middle, values > middle)) if there.any()]


def drop_clipped(shift: CutShift, row: dict) -> None:
    """Take out of ``row`` what a channel at the end of its range would decide, with the reason in place of its inferences."""
    into, out, last = shift.box.input, shift.box.output, shift.last
    backwards = any(shift.box.ratios.get(gear, 1.0) < 0.0 for gear in (shift.old, shift.new))
    moved = [clutch.pressure for clutch in (*shift.shift.releasing, *shift.shift.engaging)]
    for name in (into.speed, out.speed, into.torque, out.torque, *moved):  # a speed takes all other reasons away
        if (ends := shift.box.ranges.get(name)) is None:
            continue
        clipped = at_an_end(shift.raw[name][: last + 1], ends, name == out.speed and backwards)
        if not clipped.any():
            continue
        row["clipped"] = [*(row["clipped"] or []), name]
        shift.why[:] = [] if name in (into.speed, out.speed) else [one for one in shift.why if not one.startswith(f"{name} ")]
        decided = _decides(shift.box, name, bool(clipped[: shift.order].any()), bool(clipped[-1]))
        row.update(dict.fromkeys(metric.key for metric in every_metric() if decided & {*metric.decided_by}))
        if decided & {SPEEDS, TORQUE_IN}:
            row["torques"] = row["peak"] = None
        if SPEEDS in decided:
            row["in_gear"] = None
        reached = _reached(shift.raw[name][: last + 1][clipped], ends)
        if name == into.torque and ends[1] in reached:
            row["input_torque_at_least_nm"] = ends[1]
        spoken = " and ".join(_spoken(shift, name, end) for end in reached)
        seconds = np.count_nonzero(clipped) * shift.period
        shift.why.append(f"{name} is at the end of its range, {spoken}, for {seconds:.3f} s; {BEYOND}")


def _decides(box: Transmission, name: str, before: bool, after: bool) -> set[str]:
    """Return which channels of metrics.Metric a clipped one is; ``before`` the order or ``after`` the shift, these too."""
    if name in (box.input.speed, box.output.speed):
        return {SPEEDS, *([SPEED_BEFORE] if name == box.input.speed and before else [])}
    if name == box.input.torque:
        return {TORQUE_IN, *([TORQUE_AFTER] if after else [])}
    if name == box.output.torque:
        return {TORQUE_OUT, *([LOAD_BEFORE] if before else [])}
    return {PRESSURES}


def _spoken(shift: CutShift, name: str, value: float) -> str:
    """Return a value of a channel in the unit in which people read it."""
    into, out = shift.box.input, shift.box.output
    if name in (into.torque, out.torque):
        return f"{value:z.4g} Nm"
    return f"{value * RPM:z.4g} rpm" if name in (into.speed, out.speed) else f"{value / 1e6:z.4g} MPa"


class Clipping:
    """Counts the rows of a run's logger in which a signal is at the end of its range, piece by piece."""

    def __init__(self, ranges: Mapping[str, tuple[float, float]]) -> None:
        """Prepare; ``ranges`` is that of the transmission or of transmission.ranges_of."""
        self._ranges = ranges
        self._seconds: dict[str, float] = {}
        self._reached: dict[str, set[float]] = {}  # ends at which each signal was
        self._whole: dict[str, float] = {}  # time in which each signal has values [s]
        self._beyond: set[str] = set()

    def add(self, channels: Mapping[str, np.ndarray], period: float) -> None:
        """Add rows of the logger's channels [SI], ``period`` seconds apart."""
        for name, ends in self._ranges.items():
            values = np.asarray(channels.get(name, ()), dtype=float)
            values = values[np.isfinite(values)]
            if not len(values):
                continue
            if np.abs(values).max() > ends[1] + ROOM * (ends[1] - ends[0]):
                self._beyond.add(name)
            there = values[at_an_end(values, ends)]
            self._seconds[name] = self._seconds.get(name, 0.0) + len(there) * period
            self._reached.setdefault(name, set()).update(_reached(there, ends))
            self._whole[name] = self._whole.get(name, 0.0) + len(values) * period

    def sentences(self, signals: Mapping[str, Signal]) -> list[str]:
        """Return a sentence on each signal that was at an end of its range; ``signals`` is the catalogue's."""
        out = []
        for name, seconds in self._seconds.items():
            if seconds and name not in self._beyond and (one := signals.get(name)):
                ends = one.shown(np.array(sorted(self._reached[name])))
                spoken = " and ".join(f"{float(end):z.4g} {one.display_unit}" for end in ends)
                out.append(
                    f"{name} was at the end of its range, {spoken}, for {seconds:.4g} s, "
                    f"{100.0 * seconds / self._whole[name]:.3g} % of the run: its true values there lie beyond"
                )
        return out


def clipped_in(bag: Bag | Gathered, record: Mapping) -> list[str]:
    """Return a sentence on each signal of a bag's logger that was at an end of its range; none for a bag without rows.

    Parameters
    ----------
    bag : Bag or Gathered
        The bag.
    record : mapping
        The record of its rig.
    """
    clipping = getattr(bag, "clipping", None)
    if clipping is None:
        clipping = Clipping(ranges_of(bag.structure, record))
        try:
            logger = bag.logger(fill=True)
        except RigError:
            return []  # the report gives the reason
        clipping.add(logger.channels, logger.period)
    return clipping.sentences(catalogue(record).signals)
