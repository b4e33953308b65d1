# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Characteristics that are linear between their points: values, slopes and exact means over an interval.

Used by driveline/laws.py and its steps. A mean over an interval is that of the characteristic itself, not of its values at
the ends, so that bends and jumps inside a step do not lower the order of accuracy, and a spring gives back exactly the energy
that it stores.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig_nodes.base import INLINED, INNER, RigError, njit
from rig_nodes.driveline.algebra import noinline

if TYPE_CHECKING:
    from rig_nodes.base import Floats


class Tables(NamedTuple):
    """Several tables in one set of arrays.

    Table k has the points x, y from first[k] to first[k + 1]. Beyond them it goes on with the slopes `ends` (k, 2), before the
    first and after the last point, or it repeats itself after period[k] > 0.
    """

    first: np.ndarray
    x: np.ndarray
    y: np.ndarray
    ends: np.ndarray
    period: np.ndarray


class Table(NamedTuple):
    """One table that has been checked.

    It has points x, y. Beyond its ends it goes on "flat" or "straight", or it repeats itself after `period`, which is 0 for none.
    """

    x: np.ndarray
    y: np.ndarray
    beyond: str = "flat"
    period: float = 0.0


def table_of(what: str, given: tuple[Sequence[float], Sequence[float]], beyond: str = "flat", period: float | None = None) -> Table:
    """Check a table and return it.

    Parameters
    ----------
    what : str
        What messages call the element of the table.
    given : pair of sequences of float
        Points and values.
    beyond : str
        How the table goes on beyond its ends, "flat" or "straight".
    period : float, optional
        Length after which it repeats itself.

    Returns
    -------
    Table
        The table.

    Raises
    ------
    RigError
        When the points and values are not a table, or do not span the period.
    """
    try:
        x, y = (np.array(one, float) for one in given)
    except (TypeError, ValueError):
        x, y = np.zeros(0), np.zeros(1)
    if x.ndim != 1 or x.shape != y.shape or len(x) == 0 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RigError(f"driveline: the table of {what} needs as many values as points, at least one, all finite")
    if np.any(np.diff(x) < 0.0) or np.any((x[2:] == x[1:-1]) & (x[1:-1] == x[:-2])):
        raise RigError(f"driveline: the points of the table of {what} fall, or one is given more than twice")
    if period is not None and not (len(x) > 1 and math.isclose(x[-1] - x[0], period, rel_tol=1e-12)):
        raise RigError(f"driveline: the table of {what} reaches over {x[-1] - x[0]:g}; its period is {period:g}")
    return Table(x, y, beyond, 0.0 if period is None else float(x[-1] - x[0]))


class Grid(NamedTuple):
    """A checked table over two arguments: a curve over the first for each value of the second, between which it is linear.

    Parameters
    ----------
    curves : tuple of Table
        The curves, which have the same points.
    rows : Table
        Values of the second argument, and the number of the curve for each. Beyond its ends it is flat, or it repeats itself.
    """

    curves: tuple[Table, ...]
    rows: Table


def grid_of(what: str, given: tuple, periods: tuple[float | None, float | None]) -> Grid:
    """Check a table over two arguments and return it.

    Parameters
    ----------
    what : str
        What messages call the element of the table.
    given : (points (p,), points (r,), values (p, r))
        Points of both arguments, and the values on the grid of these.
    periods : (float or None, float or None)
        Lengths after which it repeats itself over each argument.

    Returns
    -------
    Grid
        The table.

    Raises
    ------
    RigError
        When these are not a grid, jump, or do not span a period.
    """
    try:
        first, second, values = (np.array(one, float) for one in given)
    except (TypeError, ValueError):
        first, second, values = np.zeros(0), np.zeros(0), np.zeros((0, 1))
    if first.ndim != 1 or second.ndim != 1 or values.shape != (len(first), len(second)):
        raise RigError(
            f"driveline: the table of {what} over two quantities needs the points of both and a value for each pair of these, in "
            "as many rows as the first has points and as many columns as the second"
        )
    if len(first) < 2 or len(second) < 2 or np.any(np.diff(first) <= 0.0) or np.any(np.diff(second) <= 0.0):
        raise RigError(f"driveline: the table of {what} needs two points or more of each quantity, all rising; it cannot jump")
    rows = table_of(what, (second, np.arange(len(second))), "flat", periods[1])
    for period, one, other in ((periods[0], values[0], values[-1]), (periods[1], values[:, 0], values[:, -1])):
        if period is not None and np.any(one != other):
            raise RigError(f"driveline: the table of {what} ends with other values than it begins with; with a period it may not")
    return Grid(tuple(table_of(what, (first, column), "flat", periods[0]) for column in values.T), rows)


def tables_of(tables: Sequence[Table]) -> Tables:
    """Return the tables in the form that the compiled code reads."""
    ends = np.zeros((len(tables), 2))
    for k, one in enumerate(tables):
        if one.beyond == "straight" and len(one.x) > 1:
            ends[k] = (one.y[1] - one.y[0]) / (one.x[1] - one.x[0]), (one.y[-1] - one.y[-2]) / (one.x[-1] - one.x[-2])
    return Tables(
        np.cumsum([0, *(len(one.x) for one in tables)]),
        np.concatenate([np.zeros(0), *(one.x for one in tables)]),
        np.concatenate([np.zeros(0), *(one.y for one in tables)]),
        ends,
        np.array([one.period for one in tables]),
    )


def value_at(table: Table, x: float) -> float:
    """Return the value of a table at one point."""
    return float(value(tables_of([table]), 0, float(x)))


def slope_at(table: Table, x: Floats | Sequence[float]) -> np.ndarray:
    """Return the slopes of a table at some points, to their right."""
    tables = tables_of([table])
    return np.array([line(tables, 0, piece(tables, 0, float(at)))[4] for at in x])


def stored_in(table: Table, x: np.ndarray) -> np.ndarray:
    """Return the integral of a table from 0 to each x."""
    left, right = tables_of([table]).ends[0]
    knots, y = table.x, table.y

    def area(at: Floats) -> Floats:
        inside = np.clip(at, knots[0], knots[-1])
        i = np.clip(np.searchsorted(knots, inside, "right") - 1, 0, max(len(knots) - 2, 0))
        sums = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(knots))])
        wide = np.diff(knots, append=knots[-1] + 1.0)
        along = inside - knots[i]
        rise = np.diff(y, append=y[-1])[i] / np.where(wide[i] > 0.0, wide[i], 1.0)
        below, above = np.minimum(at - knots[0], 0.0), np.maximum(at - knots[-1], 0.0)
        return (
            sums[i]
            + along * (y[i] + 0.5 * rise * along)
            + below * (y[0] + 0.5 * left * below)
            + above * (y[-1] + 0.5 * right * above)
        )

    return area(np.asarray(x, float)) - area(np.zeros(1))[0]


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def piece(tables: Tables, k: int, x: float) -> int:
    """Return the number of the straight piece of table k that reaches from x to the right; -1 is before the first point."""
    noinline()
    first, last = tables.first[k], tables.first[k + 1] - 1
    turns = 0
    if tables.period[k] > 0.0:
        turns = int(math.floor((x - tables.x[first]) / tables.period[k]))
        x -= turns * tables.period[k]
    low, high = first - 1, last
    if x >= tables.x[last]:
        low = last
    while high - low > 1 and low < last:
        middle = (low + high) // 2
        if tables.x[middle] <= x:
            low = middle
        else:
            high = middle
    if tables.period[k] > 0.0:
        return turns * (last - first) + min(max(low - first, 0), last - first - 1)
    return low - first


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def line(tables: Tables, k: int, number: int) -> tuple[float, float, float, float, float]:
    """Return (begin, end, value at one of its points, this point, slope) of a straight piece of table k."""
    noinline()
    return line_here(tables, k, number)


@njit(**INLINED)
def line_here(tables: Tables, k: int, number: int) -> tuple[float, float, float, float, float]:
    """Return what :func:`line` does, without the time of a call, which is as long again."""
    first, last = tables.first[k], tables.first[k + 1] - 1
    shift = 0.0
    if tables.period[k] > 0.0:
        turns = int(math.floor(number / (last - first)))
        number -= turns * (last - first)
        shift = turns * tables.period[k]
    elif number < 0:
        return -np.inf, tables.x[first], tables.y[first], tables.x[first], tables.ends[k, 0]
    elif number >= last - first:
        return tables.x[last], np.inf, tables.y[last], tables.x[last], tables.ends[k, 1]
    i = first + number
    wide = tables.x[i + 1] - tables.x[i]
    slope = (tables.y[i + 1] - tables.y[i]) / wide if wide > 0.0 else 0.0
    return tables.x[i] + shift, tables.x[i + 1] + shift, tables.y[i], tables.x[i] + shift, slope


@njit(**INNER)
def curves_at(tables: Tables, rows: int, u: float) -> tuple[int, int, float, float]:
    """Return the two curves of a Grid beside u, the share of the second, and its slope over u; table ``rows`` has their numbers."""
    noinline()
    _, _, curve, at, slope = line(tables, rows, piece(tables, rows, u))
    first = int(curve)
    return first, first + 1 if slope > 0.0 else first, min(max(slope * (u - at), 0.0), 1.0), slope


@njit(**INNER)
def over_two(tables: Tables, rows: int, x: float, u: float) -> tuple[float, float, float]:
    """Return (value, slope over x, slope over u) of a Grid, whose table ``rows`` has the numbers of its curves."""
    noinline()
    first, other, share, rise = curves_at(tables, rows, u)
    _, _, y, at, slope = line(tables, first, piece(tables, first, x))
    _, _, beside, _, steeper = line(tables, other, piece(tables, other, x))
    more = beside - y + (steeper - slope) * (x - at)
    return y + slope * (x - at) + share * more, slope + share * (steeper - slope), rise * more


LEAST = 1e-150  # least length of an interval whose square is still a normal number


@njit(cache=True, error_model="numpy", nogil=True, forceinline=False, _nrt=False)
def value(tables: Tables, k: int, x: float) -> float:
    """Return the value of table k at x."""
    noinline()
    _, _, y, at, slope = line(tables, k, piece(tables, k, x))
    return y + slope * (x - at)


@njit(**INNER)
def along(tables: Tables, k: int, x: float, dx: float) -> tuple[float, float]:
    """Return (value at x, slope) of the line that begins on table k at x and has the table's mean from x to x + dx."""
    noinline()
    number = piece(tables, k, x)
    begin, end, y, at, slope = line(tables, k, number)
    if dx < 0.0 and x == begin:
        number -= 1
        begin, end, y, at, slope = line(tables, k, number)
        if begin == end:
            number -= 1
            begin, end, y, at, slope = line(tables, k, number)
    start = y + slope * (x - at)
    if begin <= x + dx <= end or not LEAST < abs(dx) < np.inf:
        return start, slope
    # sums the distance of the mean from the start value piece by piece, so that no large sums are subtracted
    total = 0.0
    here = x
    to = x + dx
    while True:
        there = min(end, to) if dx > 0.0 else max(begin, to)
        total += (there - here) * (y + slope * (0.5 * (here + there) - at) - start)
        here = there
        if here == to:
            break
        number += 1 if dx > 0.0 else -1
        begin, end, y, at, slope = line(tables, k, number)
    return start, 2.0 * total / (dx * dx)
