# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pressures of the clutches tell of a shift: the kiss point, and for how long both clutches have capacity.

analysis.shift uses it, and analysis.clutch_torques where a clutch is open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .edges import first_true, odd_width, running_mean

if TYPE_CHECKING:
    from ..rig import Clutch
    from .shift import CutShift

KISS_MEAN = 5e-3  # s
CLOSED_MEAN = 0.1  # s at the end of the search, from which the pressure of the closed clutch is taken
MATTERS = 0.1  # share of its closed capacity with which a clutch counts in the overlap


@dataclass(frozen=True)
class Passed:
    """A time by the pressures [s], and the rate [MPa/s] at which they pass the levels that decide it; None when not found."""

    value: float | None = None
    rate: float | None = None


def pressed(shift: CutShift, clutches: tuple[Clutch, ...]) -> np.ndarray:
    """Return where all of some clutches have more than their kiss pressure, from the order on."""
    width = odd_width(KISS_MEAN, shift.period)
    smooth = [running_mean(shift.raw[clutch.pressure], width)[shift.order :] for clutch in clutches]
    return np.logical_and.reduce([p > clutch.kiss_pressure for p, clutch in zip(smooth, clutches)])


def overlap_of(shift: CutShift) -> Passed:
    """Return the time in which both the releasing and the engaging clutches have capacity that matters [s].

    That is a tenth of what each has when it is closed, because capacity grows with the pressure above the kiss pressure. Just
    above that, the springs hold the pressure of a released clutch for a second without force on the plates. The time is
    negative when there is one in which neither have it.
    """
    open_ones = [clutch for clutch in shift.shift.engaging if not pressed(shift, (clutch,)).any()]
    shift.why += [f"{clutch.pressure} never rose above {clutch.kiss_pressure / 1e6:.2f} MPa" for clutch in open_ones]
    if open_ones or not shift.shift.engaging or not shift.shift.releasing:
        return Passed()
    masks, steepness = [], []
    for clutches, falling in ((shift.shift.releasing, True), (shift.shift.engaging, False)):
        found = [_capable(shift, clutch, falling) for clutch in clutches]
        if None in (rate for _, rate in found):
            return Passed()  # it never passes its level, for which start_of() gives the reason
        masks.append(np.logical_and.reduce([mask for mask, _ in found]))
        steepness.append(min(rate for _, rate in found if rate is not None))
    old, up = masks
    both, neither = np.count_nonzero(up & old), np.count_nonzero(~up & ~old)
    return Passed(float((both if both else -neither) * shift.period), 1e-6 / sum(1.0 / one for one in steepness))


def _capable(shift: CutShift, clutch: Clutch, falling: bool) -> tuple[np.ndarray, float | None]:
    """Return where a clutch has a tenth of its closed capacity from the order on, and the rate at its last fall or first rise."""
    raw = shift.raw[clutch.pressure]
    closed = float(np.median(raw[: shift.order] if falling else raw[-shift.samples(CLOSED_MEAN) :]))
    level = clutch.kiss_pressure + MATTERS * max(closed - clutch.kiss_pressure, 0.0)
    pressure = running_mean(raw, odd_width(KISS_MEAN, shift.period))
    mask = pressure[shift.order :] > level
    turns = np.flatnonzero(mask[:-1] & ~mask[1:] if falling else mask[1:] & ~mask[:-1])
    if not turns.size:
        return mask, None
    return mask, _rate(shift, pressure, int(turns[-1 if falling else 0]) + shift.order)


def _rate(shift: CutShift, pressure: np.ndarray, at: int) -> float:
    """Return how fast a pressure changes around a sample [Pa/s]."""
    first, last = max(0, at - shift.samples(KISS_MEAN)), min(pressure.size - 1, at + shift.samples(KISS_MEAN))
    return max(abs(float(pressure[last] - pressure[first])) / ((last - first) * shift.period), 1.0)


def kiss_of(shift: CutShift) -> Passed:
    """Return the time from the order until all engaging clutches have more than their kiss pressure [s]; None when never.

    :func:`overlap_of` gives the reason for a clutch that never has it. The pressure rises slowly through the kiss point while the
    piston still moves; its rate is the mean from 0.7 of it on.
    """
    at = first_true(pressed(shift, shift.shift.engaging)) if shift.shift.engaging else None
    if at is None:
        return Passed()
    slow = []
    for clutch in shift.shift.engaging:
        pressure = running_mean(shift.raw[clutch.pressure], odd_width(KISS_MEAN, shift.period))[shift.order : shift.order + at + 1]
        low = np.flatnonzero(pressure < 0.7 * clutch.kiss_pressure)
        since = (at - int(low[-1]) if low.size else at) * shift.period
        slow.append(0.3 * clutch.kiss_pressure / max(since, shift.period))
    return Passed(at * shift.period, 1e-6 * min(slow))
