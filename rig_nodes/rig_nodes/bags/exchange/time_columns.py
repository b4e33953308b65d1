# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds the columns of a file that hold times, by name, unit and content, and which other columns belong to which of them.

bags.exchange.imported takes the times of a measurement from here, bags.exchange.propose the lines of a profile.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError
from .cells import CellError, Cells
from .clock import REPEATED, Clock
from .foreign import Channel, Foreign, column
from .profile import Profile
from .stamps import DAYS, LOOKED_AT, SINCE_1970, Stamps, are_stamps, has_date, stamps_of_cells, stamps_of_numbers, unwrapped
from .units import TIME_UNITS, time_unit_of

if TYPE_CHECKING:
    from ...base import Floats

NAME = re.compile(
    r"(?:t|time|czas|zeit|timestamps?)[\s_]+(?P<unit>ms|us|ns|s)|(?:time|czas|zeit)(?P<closed_up>ms|us|ns)"
    r"|(?:t|time|czas|zeit|timestamps?|uhrzeit|elapsed ?time)[\s_]*\(?\w{0,2}\)?",
    re.IGNORECASE,
)
AS_FAST = 1.1  # ratio of two periods from which on one clock is the faster one
EXACT = 2**53  # beyond it not every whole number is a float
CLOSE = 1e-3  # relative difference of two periods that mean the same


@dataclass(frozen=True)
class Times:
    """Columns of times: the main one, that of its dates, and where there are several, that of each other column by its head."""

    main: Channel | None = None
    date: Channel | None = None
    own: dict[str, Channel] = field(default_factory=dict)

    def all(self) -> list[Channel]:
        """Return all of the columns."""
        found = {one.head: one for one in (self.main, self.date, *self.own.values()) if one is not None}
        return list(found.values())


@dataclass(frozen=True)
class Axis:
    """The times of the rows of a measurement: the columns that they and their dates are from, and notes for its user."""

    head: str | None
    stamps: Stamps
    notes: tuple[str, ...] = ()
    date: str | None = None


def found_times(channels: Sequence[Channel]) -> Times:
    """Find the columns that hold times.

    Parameters
    ----------
    channels : sequence of Channel
        The channels of a file.

    Returns
    -------
    Times
        The columns. The columns to the right of a second time column belong to it, as oscilloscopes write them; the main one is
        the fastest.
    """
    open_ones = [one for one in channels if one.times is None]
    contents = {one.head: _content(one) for one in open_ones}
    numbers = [one for one in open_ones if not contents[one.head] and one.kind == "numbers"]
    named = [one for one in numbers if NAME.fullmatch(one.name) and (not one.unit or time_unit_of(one.unit))]
    stamped = [one for one in open_ones if contents[one.head] == "times"]
    clocks = named or stamped
    if not clocks:
        clocks = [one for one in numbers if time_unit_of(one.unit) and _grows(one)][:1]
    if not clocks:
        clocks = [one for one in numbers if not one.unit and _is_stamped_by_size(one)][:1]
    if not clocks:
        return Times()
    groups = _groups(channels, clocks)
    main = _fastest({head: _values(clock) * TIME_UNITS[unit_of_times(clock) or "s"] for head, (clock, _) in groups.items()})
    own = {
        one.head: clock
        for clock, group in groups.values()
        for one in group
        if len(groups) > 1 and one.times is None and one.kind == "numbers" and len(_values(one)) == len(clock.values)
    }
    dates = [one for one in open_ones if contents[one.head] == "dates"]
    of_day = contents[main] == "times" and not _has_dates(groups[main][0])
    return Times(groups[main][0], dates[0] if dates and of_day else None, own)


def axis_of(foreign: Foreign, profile: Profile, columns: Sequence[Channel]) -> Axis:
    """Return the times of the rows of a file.

    Parameters
    ----------
    foreign : Foreign
        The file.
    profile : Profile
        The profile by which it is read.
    columns : sequence of Channel
        The columns that are used.

    Returns
    -------
    Axis
        The times: of the column that the profile names, by the period that it states, of the channels themselves, of a column that
        holds times, or by the period that a line of the file states.

    Raises
    ------
    RigError
        When there are none, or a period contradicts the times in the file.
    """
    if profile.time is not None:
        main = column(foreign, profile.time, f"{foreign.path}: time")
        date = column(foreign, profile.date, f"{foreign.path}: date") if profile.date else None
        return replace(_axis(foreign, main, profile.time_unit, date), date=None)
    longest = max(columns, key=lambda one: len(one.values))
    if profile.period is not None:
        rows = len(longest.values)
        _check_period(foreign, profile, longest)
        return Axis(None, Stamps(profile.period * np.arange(rows)), _other_period(foreign, profile.period))
    if timed := {one.head: one.times for one in columns if one.times is not None}:
        return Axis(None, Stamps(timed[_fastest(timed)]))
    if (times := found_times(foreign.channels)).main is not None:
        return _axis(foreign, times.main, None, times.date)
    if foreign.period is not None:
        period, place = foreign.period
        note = f"the time between rows, {period * 1e3:.7g} ms, is from {place}"
        return Axis(None, Stamps(period * np.arange(len(longest.values))), (note,))
    raise RigError(f"{foreign.path}: has no time column; add one, e.g. 't [s]', or give --period, in Python period=, e.g. '0.1 ms'")


def _axis(foreign: Foreign, main: Channel, unit: str | None, date: Channel | None) -> Axis:
    stamps = stamps_of(foreign, main, unit, date)
    turns = f"'{main.head}' begins anew {stamps.turns} times, as a counter does at its end; its times go on there"
    return Axis(main.head, stamps, (turns,) if stamps.turns else (), date.head if date else None)


def _fastest(clocks: Mapping[str, Floats]) -> str:
    """Return the key of the times [s] with the shortest steps; of several with alike steps that with the most values."""
    known = {key: times[np.isfinite(times)] for key, times in clocks.items()}
    periods = {key: float(np.median(np.diff(times))) if len(times) > 1 else np.inf for key, times in known.items()}
    shortest = min((period for period in periods.values() if period > 0.0), default=np.inf)
    return max((key for key in known if periods[key] <= AS_FAST * shortest), key=lambda key: len(known[key]))


def unit_of_times(channel: Channel) -> str | None:
    """Return the unit of a column of times that its head states, in brackets or behind a blank; None when it states none."""
    match = NAME.fullmatch(channel.name)
    return time_unit_of(channel.unit or ((match["unit"] or match["closed_up"] or "").lower() if match else ""))


def stamps_of(foreign: Foreign, channel: Channel, unit: str | None = None, date: Channel | None = None) -> Stamps:
    """Return the times in a column.

    Parameters
    ----------
    foreign : Foreign
        The file.
    channel : Channel
        The column.
    unit : str, optional
        Unit of its numbers, in place of that in its head.
    date : Channel, optional
        Column of the dates of its times of day.

    Returns
    -------
    Stamps
        The times.

    Raises
    ------
    RigError
        When they are in a unit that is no time, or the column holds something else.
    """
    content = _content(channel)
    if content == "dates":
        raise RigError(f"{foreign.path}: column '{channel.head}' holds days without times; name the column of the times beside it")
    if content and isinstance(channel.content, Cells):
        days = date.content if date is not None and isinstance(date.content, Cells) else None
        return stamps_of_cells(channel.content, days)
    stated = unit or channel.unit
    known = time_unit_of(unit) if unit else unit_of_times(channel)
    if stated and known is None:
        raise RigError(
            f"{foreign.path}: column '{channel.head}' of the times is in {stated}; expected one of {', '.join(TIME_UNITS)}"
        )
    numbers, turns = unwrapped(_exact(channel))
    return replace(stamps_of_numbers(numbers, known), turns=turns)


def _content(channel: Channel) -> str:
    """Return ``times`` or ``dates`` for a column of such cells, and nothing for numbers and texts."""
    cells = channel.content
    if not isinstance(cells, Cells) or not channel.kind.startswith(("text", "dates and times")):
        return ""
    return are_stamps(cells.beginning)


def _has_dates(channel: Channel) -> bool:
    cells = channel.content
    some = cells.beginning if isinstance(cells, Cells) else []
    return isinstance(some, np.ndarray) or any(has_date(str(cell)) for cell in some[:LOOKED_AT])


def _exact(channel: Channel) -> np.ndarray:
    """Return the numbers of a column, as whole numbers where floats would lose digits."""
    cells = channel.content
    if isinstance(cells, Cells) and cells.stated and isinstance(found := cells.cells, np.ndarray) and found.dtype.kind in "iu":
        return found.astype(np.int64)
    values = channel.values
    if isinstance(cells, Cells) and np.isfinite(values).all() and np.abs(values).max(initial=0.0) >= EXACT:
        try:
            return np.array([int(text) for text in cells.texts()], np.int64)
        except (ValueError, OverflowError):
            return values
    return values


def _values(channel: Channel) -> Floats:
    """Return the numbers of a column, or none when one of its cells is no number, which is told when the column is used."""
    try:
        return channel.values
    except CellError:
        return np.empty(0)


def _grows(channel: Channel) -> bool:
    values = _values(channel)
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 0 and bool(np.all(steps >= 0.0)) and bool(np.any(steps > 0.0))


def _is_stamped_by_size(channel: Channel) -> bool:
    values = _values(channel)
    known = values[np.isfinite(values)]
    if len(known) < 2 or not _grows(channel):
        return False
    first = float(known[0])
    stamped = any(SINCE_1970[0] <= first * TIME_UNITS[unit] <= SINCE_1970[1] for unit in ("s", "ms", "us", "ns"))
    return stamped or (any(a <= first <= b for a, b in DAYS) and known[-1] - first < 10.0)


def _groups(channels: Sequence[Channel], clocks: Sequence[Channel]) -> dict[str, tuple[Channel, list[Channel]]]:
    """Return the clocks by their heads, each with the columns up to the next one; of clocks side by side the first counts."""
    heads = {one.head for one in clocks}
    groups: dict[str, tuple[Channel, list[Channel]]] = {clocks[0].head: (clocks[0], [])}
    last = clocks[0]
    for one in channels:
        if one.head in heads:
            same = one.head in groups or not groups[last.head][1] or _content(one) or _content(last)
            if not same and not np.array_equal(_values(one), _values(last), equal_nan=True):
                groups[one.head], last = (one, []), one
        else:
            groups[last.head][1].append(one)
    return groups


def _other_period(foreign: Foreign, period: float) -> tuple[str, ...]:
    """Return a note when a line above the values states another period than the one that was given."""
    if foreign.period is None or abs(foreign.period[0] / period - 1.0) <= CLOSE:
        return ()
    other, place = foreign.period
    return (f"the time between rows was given as {period * 1e3:.7g} ms, but {place} says {other * 1e3:.7g} ms; which is right?",)


def _check_period(foreign: Foreign, profile: Profile, longest: Channel) -> None:
    """Refuse a period that the file contradicts: by its times, or by a number of rows that jumps."""
    path, period, rows = foreign.path, profile.period or 1.0, len(longest.values)
    head, times = (longest.head, Stamps(longest.times)) if longest.times is not None else (None, None)
    if times is None and (found := found_times(foreign.channels)).main is not None:
        head, times = found.main.head, stamps_of(foreign, found.main, None, found.date)
    if times is None:
        _check_counter(foreign)
        return
    known = np.flatnonzero(np.isfinite(times.seconds))
    seconds = times.seconds[known]
    span, takes = (
        (float(seconds[-1] - seconds[0]) if len(known) else 0.0),
        f"with a period of {period * 1e3:.7g} ms its {rows} rows take",
    )
    rest, steps = seconds - period * known, np.diff(seconds)
    if len(steps) == rows - 1 and np.any(steps == 0.0) and _are_twice(foreign, np.flatnonzero(steps == 0.0)):
        raise RigError(
            f"{path}: {int((steps == 0.0).sum())} of its rows repeat time and values of the row before, and a period would take "
            "them for new ones; leave the period out, and they are left out"
        )
    if len(steps) and np.all(steps >= 0.0) and np.mean(steps == 0.0) > REPEATED:  # times of few digits
        digit = float(steps[steps > 0.0].min()) if np.any(steps > 0.0) else 0.0
        if not digit or rest.max() - rest.min() <= 1.01 * digit + period:
            return
        raise RigError(
            f"{path}: {takes} {rows * period:.7g} s, but the times in '{head}' show that they took {span:.7g} s, or unequal steps"
        )
    try:
        clock = Clock(foreign, times, profile.bridge, [])
    except RigError as error:
        raise RigError(f"{error}; a period in place of '{head}' would hide it, so leave the period out") from None
    if clock.rows != rows or abs(clock.period / period - 1.0) > CLOSE:
        gaps = f"; {clock.notes[0]}" if clock.notes else ""
        raise RigError(
            f"{path}: {takes} {rows * period:.7g} s, but column '{head}' has {clock.rows} steps of {clock.period * 1e3:.7g} ms in "
            f"{span:.7g} s{gaps}; take the times by leaving the period out"
        )


def _are_twice(foreign: Foreign, rows: np.ndarray) -> bool:
    """Return True when each of the rows is like the one behind it in all columns of numbers."""
    columns = [_values(one) for one in foreign.channels if one.kind == "numbers"]
    return all(np.array_equal(one[rows], one[rows + 1], equal_nan=True) for one in columns if len(one) > rows[-1] + 1)


def _check_counter(foreign: Foreign) -> None:
    for one in foreign.channels:
        values = _values(one) if not one.unit and one.kind == "numbers" else np.empty(0)
        if len(values) < 3:
            continue
        values, _ = unwrapped(values)
        steps = np.diff(values)
        single = float(np.median(steps))
        if not single > 0.0 or not np.all(steps > 0.0):
            continue
        counted = np.rint(steps / single)
        if np.all(np.abs(steps / single - counted) < 0.1 * counted) and np.any(counted > 1.0):  # a counter, or times without a unit
            at = int(np.argmax(counted > 1.0))
            raise RigError(
                f"{foreign.path}: rows are missing: '{one.head}' goes from {values[at]:.10g} to {values[at + 1]:.10g} at "
                f"{foreign.row(at + 1)}, and a period would close {int((counted - 1.0).sum())} rows up; take it as the times, "
                f"time: {{column: {one.head}, unit: UNIT}} in a profile, or add a column of times"
            )
