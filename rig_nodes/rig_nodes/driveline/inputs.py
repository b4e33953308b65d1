# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torques, capacities and factors over time as users give them: numbers, functions and tables.

Used by driveline/run.py, which takes from each the times at which steps must end and its values at both ends of every
step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from rig_nodes.base import RigError, brief
from rig_nodes.driveline.described import is_number

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base import Floats

Signal = float | Callable[[float], float] | tuple[Sequence[float], Sequence[float]]

SAME = 1e-6  # share of a step: times that are closer than this count as one
_FEW = 100  # a table with at most this many points ends a step at each of them, whatever the step's length
_SPARSE = 10  # least number of steps per point with which a longer table ends a step at each of its points


class _Number:
    def __init__(self, name: str, value: float) -> None:
        self.name, self.points = name, np.zeros(0)
        try:
            self.value = float(value)
        except (TypeError, ValueError):
            raise RigError(
                f"driveline: the input '{name}' is {brief(value)}; "
                "a number, a function of time or a table (times, values) is needed"
            ) from None

    def ends(self, t: Floats, step: float, stops: Floats) -> Floats:
        return np.full((len(t) - 1, 2), self.value)


class _Function:
    def __init__(self, name: str, function: Callable[[float], float]) -> None:
        self.name, self.function, self.points = name, function, np.zeros(0)

    def ends(self, t: Floats, step: float, stops: Floats) -> Floats:
        at = np.array([self._value(x) for x in t])
        out = np.column_stack([at[:-1], at[1:]])
        near = 1e-9 * step + 4.0 * np.spacing(t[-1])
        for i in np.flatnonzero(_near(t, stops, SAME * step)[1]):
            if i < len(t) - 1:
                out[i, 0] = self._value(t[i] + near)
            if i > 0:
                out[i - 1, 1] = self._value(t[i] - near)
        return out

    def _value(self, t: float) -> float:
        value = self.function(t)
        if not is_number(value):
            raise RigError(f"driveline: the input '{self.name}' gives {brief(value)} at {t:g} s; a number is needed")
        return float(value)


class _Table:
    """A table that is linear between its points and has its first and last value beyond them; a jump has its time twice.

    A step ends at every point, unless the points are as close as the steps: then each step takes the mean of the table over its
    length.
    """

    def __init__(self, name: str, table: tuple[Sequence[float], Sequence[float]], step: float) -> None:
        self.name = name
        try:
            self.times, self.values = (np.asarray(one, float) for one in table)
        except (TypeError, ValueError):
            self.times, self.values = np.zeros(1), np.zeros(0)
        times, values = self.times, self.values
        if times.ndim != 1 or times.shape != values.shape or len(times) == 0 or np.any(np.diff(times) < 0.0):
            raise RigError(f"driveline: the table for '{name}' needs as many values as times, times not falling")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise RigError(f"driveline: the table for '{name}' is not finite at some point; finite numbers are needed")
        self.dense = len(times) > max(_FEW, (times[-1] - times[0]) / step / _SPARSE)
        self.points = np.zeros(0) if self.dense else times
        if self.dense:
            self._level = values.mean()  # subtracted, so that the sum stays small and its differences exact
            rest = values - self._level
            self._sum = np.concatenate([[0.0], np.cumsum(0.5 * (rest[1:] + rest[:-1]) * np.diff(times))])

    def ends(self, t: Floats, step: float, stops: Floats) -> Floats:
        at, _ = _near(t, self.times, SAME * step)
        out = np.column_stack([self._limit(at[:-1], "right"), self._limit(at[1:], "left")])
        if self.dense:
            lacks = self._level + np.diff(self._integral(t)) / np.diff(t) - out.mean(axis=1)
            lacks[np.abs(lacks) < 1e-12 * np.abs(self.values).max()] = 0.0
            out += lacks[:, None]
        return out

    def _limit(self, t: Floats, side: Literal["left", "right"]) -> Floats:
        out = np.interp(t, self.times, self.values)
        last = len(self.times) - 1
        i = np.searchsorted(self.times, t, side)
        i = np.clip(i - 1 if side == "right" else i, 0, last)
        on = self.times[i] == t
        out[on] = self.values[i[on]]
        return out

    def _integral(self, t: Floats) -> Floats:
        """Return the integral of the table less its mean level."""
        times, rest = self.times, self.values - self._level
        inside = np.clip(t, times[0], times[-1])
        i = np.clip(np.searchsorted(times, inside, "right") - 1, 0, len(times) - 2)
        along = inside - times[i]
        wide = np.maximum(times[i + 1] - times[i], np.finfo(float).tiny)
        inner = self._sum[i] + along * (rest[i] + 0.5 * (rest[i + 1] - rest[i]) * along / wide)
        return inner + np.minimum(t - times[0], 0.0) * rest[0] + np.maximum(t - times[-1], 0.0) * rest[-1]


def _near(t: Floats, points: Floats, within: float) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return t with each time that is close to a point moved to that point, and whether it was."""
    if len(points) == 0:
        return t, np.zeros(len(t), bool)
    i = np.searchsorted(points, t)
    below, above = points[np.maximum(i - 1, 0)], points[np.minimum(i, len(points) - 1)]
    nearest = np.where(np.abs(t - below) < np.abs(above - t), below, above)
    found = np.abs(nearest - t) <= within
    return np.where(found, nearest, t), found


class Input:
    """One input over time.

    Parameters
    ----------
    name : str
        Name of the input.
    signal : number, function or table
        The signal that the user gives.
    step : float
        Length of a step [s].

    Attributes
    ----------
    points : array of float
        Times at which steps must end [s].

    Raises
    ------
    RigError
        When the signal is not a number, a function or a valid table.
    """

    def __init__(self, name: str, signal: Signal, step: float) -> None:
        self.name = name
        if callable(signal):
            self._signal = _Function(name, signal)
        elif isinstance(signal, tuple):
            self._signal = _Table(name, signal, step) if len(signal) == 2 else _Table(name, ([0.0], []), step)
        else:
            self._signal = _Number(name, signal)
        self.points = self._signal.points
        self._step = step

    def ends(self, t: np.ndarray, stops: np.ndarray, least: float = -np.inf) -> np.ndarray:
        """Return the values at both ends of each step: the right limit at its start and the left limit at its end.

        Parameters
        ----------
        t : (k + 1,) array of float
            Ends of the k steps [s].
        stops : array of float
            Times at which functions jump [s].
        least : float
            Smallest value that is allowed.

        Returns
        -------
        (k, 2) array of float
            Values at the start and at the end of each step.

        Raises
        ------
        RigError
            When a value is not finite or is below `least`.
        """
        out = self._signal.ends(t, self._step, stops)
        if not np.isfinite(out).all():
            at = t[np.flatnonzero(~np.isfinite(out).all(axis=1))[0]]
            raise RigError(f"driveline: the input '{self.name}' is not finite at {at:g} s; finite numbers are needed")
        lowest = self._signal.values.min() if isinstance(self._signal, _Table) else out.min(initial=np.inf)
        if lowest < least:
            raise RigError(f"driveline: the capacity of '{self.name}' falls to {lowest:g} Nm; it must be at least 0")
        return np.maximum(out, least)

    def middle(self, t: np.ndarray) -> np.ndarray:
        """Return the values in the middle of each step.

        Parameters
        ----------
        t : (k + 1,) array of float
            Ends of the k steps [s].

        Returns
        -------
        (k,) array of float
            Values; of a table, which is a straight line in each step, the mean of the ends.

        Raises
        ------
        RigError
            When a value is not finite.
        """
        if not isinstance(self._signal, _Function):
            return self.ends(t, np.zeros(0)).mean(axis=1)
        return self.ends(np.concatenate([t[:1], 0.5 * (t[:-1] + t[1:])]), np.zeros(0))[:, 1]


def step_ends(begin: float, end: float, step: float, points: np.ndarray) -> np.ndarray:
    """Return the ends of the steps from `begin` to `end`.

    These are the whole multiples of the step, the points in between, and the end if it is none of these.

    Parameters
    ----------
    begin, end : float
        First and last time [s].
    step : float
        Length of a step [s].
    points : array of float
        Times at which a step must end as well [s].

    Returns
    -------
    array of float
        Times in rising order [s], `begin` included.
    """
    near = SAME * step
    first, last = int(np.floor(begin / step + SAME)) + 1, int(np.floor(end / step + SAME))
    t = np.arange(first, last + 1) * step
    if len(t) == 0 or end - t[-1] > near:
        t = np.append(t, end)
    t = np.concatenate([[begin], t])
    inside = np.unique(points[(points > begin + near) & (points < t[-1] - near)])
    inside = inside[~_near(inside, t, near)[1]]
    return np.union1d(t, inside) if len(inside) else t
