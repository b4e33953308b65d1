# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a figure consists of, without any drawing: panels with curves, phases, marks, limits and numbers.

view.figure_of_shift and view.figure_of_run describe one, view.draw draws it; colours are names of view.palette.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from .pages import Pages

SOLID, DASHED, DOTTED, POINTS = "solid", "dashed", "dotted", "points"
STYLES = SOLID, DASHED, DOTTED  # of lines, in the order in which they are taken
GAP = 1e-6  # s by which a sample may lie outside a window, from rounding of its time
ROOM = 0.03  # share of a column left free at both ends of its values
TALL = 380  # px of the one plot of a figure


class Series(Protocol):
    """Values (n,) of a signal [SI] with their times (n,) [s]."""

    time: np.ndarray

    def __array__(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Curve:
    """A curve.

    Attributes
    ----------
    signal : str
        Name of the signal.
    text, short : str
        Its label in a wide and in a narrow column; empty for a curve that its colour and the panel's note explain.
    colour : str
        Name of the colour of curve and label (palette.CURVES).
    style : str
        SOLID, DASHED, DOTTED or POINTS.
    t, y : (n,) array of float
        Times, or what else the columns show, in the figure's unit, and values in the panel's unit.
    scales : bool
        True when the panel's axis must hold all of it.
    band : ((n,) array, (n,) array), optional
        Lowest and highest values around it: an envelope, or a spread.
    column : int, optional
        The only column that shows it.
    """

    signal: str
    text: str
    short: str
    colour: str
    style: str
    t: np.ndarray
    y: np.ndarray
    scales: bool = True
    band: tuple[np.ndarray, np.ndarray] | None = None
    column: int | None = None


@dataclass(frozen=True)
class Ring:
    """A marked point of a curve with its number."""

    t: float
    y: float
    text: str
    colour: str


@dataclass(frozen=True)
class Level:
    """A horizontal line: a limit, or what the load asks, with a shorter text for where there is little room; a limit is red."""

    y: float
    text: str
    limit: bool = True
    short: str = ""


@dataclass(frozen=True)
class Hatch:
    """The area between a curve and zero over the times (n,) at which it matters, with its sentence and a shorter one."""

    t: np.ndarray
    y: np.ndarray
    text: str
    short: str


@dataclass(frozen=True)
class Panel:
    """A plot: title and unit of its axis, curves, marks and levels, a note on its line styles, and whether it is logarithmic.

    ``across`` is its horizontal axis where it has one of its own.
    """

    title: str
    unit: str
    curves: tuple[Curve, ...]
    rings: tuple[Ring, ...] = ()
    levels: tuple[Level, ...] = ()
    hatches: tuple[Hatch, ...] = ()
    note: str = ""
    log: bool = False
    across: Column | None = None


@dataclass(frozen=True)
class Stretch:
    """A phase: its kind, texts from the longest to the shortest for the strip, beginning and end."""

    kind: str
    texts: tuple[str, ...]
    start: float
    end: float


@dataclass(frozen=True)
class Moment:
    """An instant with its sign in the strip and the words that explain the sign; empty words are not explained.

    One that is a limit of time has no sign, and its text stands beside its line.
    """

    t: float
    sign: str
    text: str
    limit: bool = False


@dataclass(frozen=True)
class Number:
    """A result at the foot: its name, value with unit, limit, and whether that is met (None without a verdict)."""

    key: str
    name: str
    value: str
    limit: str
    met: bool | None


@dataclass(frozen=True)
class Column:
    """A column of the panels: first and last value of its axis, its title, share of the width, and whether it is logarithmic.

    ``names`` stand at 0, 1, 2, ... in place of numbers.
    """

    first: float
    last: float
    title: str
    share: float = 1.0
    log: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Description:
    """A figure.

    Attributes
    ----------
    title, conditions, sentence : str
        What it shows, under which conditions, and what came of it.
    grade : str
        The verdict in a word; empty when nothing was judged.
    columns : tuple of Column
        Its columns, which have the same scale.
    panels : tuple of Panel
        Its plots, one below the other.
    stretches, moments : tuple
        Phases and instants.
    numbers : tuple of Number
        The results at its foot.
    high : int
        Height of a plot [px].
    """

    title: str
    conditions: str
    sentence: str
    grade: str
    columns: tuple[Column, ...]
    panels: tuple[Panel, ...]
    stretches: tuple[Stretch, ...] = ()
    moments: tuple[Moment, ...] = ()
    numbers: tuple[Number, ...] = ()
    high: int = 136


def column_of(values: np.ndarray, title: str, log: bool = False) -> Column:
    """Return a column that holds some values (n,) with room at both ends."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if log:
        return Column(low * (low / high) ** ROOM, high * (high / low) ** ROOM, title, log=True)
    room = ROOM * (high - low) or 0.5 * abs(high) or 1.0
    return Column(low - room, high + room, title)


def cut(
    signals: Mapping[str, Series], name: str, pages: Pages, window: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times (n,) [s] and values (n,) of a signal in a window, in the unit that people read.

    Parameters
    ----------
    signals : mapping of str to Series
        The signals of the run.
    name : str
        The signal.
    pages : Pages
        The pages of its rig.
    window : (float, float)
        First and last time [s].

    Returns
    -------
    tuple or None
        None when the run has nothing of it there.
    """
    if name not in signals or name not in pages.known.signals:
        return None
    whole = signals[name]
    first, last = np.searchsorted(whole.time, (window[0] - GAP, window[1] + GAP))
    part = slice(max(0, first - 1), last + 1)
    values = pages.signal(name).shown(np.asarray(whole)[part])
    return None if not np.isfinite(values).any() else (whole.time[part], values)
