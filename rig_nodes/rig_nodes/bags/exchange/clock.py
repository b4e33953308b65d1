# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock of equal steps on which the rows of a file are laid, and what of these rows is doubled, missing or out of order.

bags.exchange.imported makes the measurement on it, bags.exchange.time_columns checks a stated period by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError
from .foreign import Channel, Foreign
from .stamps import FASTEST, HOUR, SLOWEST, Stamps

if TYPE_CHECKING:
    from ...base import Floats, Ints

EMPTIER = 20  # largest number of steps of the clock per row of the file; with more, the file is not a recording of equal steps
REPEATED = 0.2  # share of rows with the time of the row before them, above which the times have too few digits
SUREST = 100  # steps of the last digit that such times need between first and last row
AROUND = 12  # times of few digits before and after a gap, from which its length is found
GAPS_SHOWN = 3
SUMMER = "as a clock does when summer time begins or ends; give them in UTC or with their offsets, or cut the file there"


class Clock:
    """The rows of a file on a clock of equal steps.

    Attributes
    ----------
    t0, period : float
        Time of row 0 and between rows [s].
    rows : int
        Number of rows, with those that are missing in the file.
    first, last : float
        Time of the first and last row of the file [s].
    notes : list of str
        What was found: gaps, rows that are there twice, times of few digits, as sentences.
    """

    def __init__(self, foreign: Foreign, stamps: Stamps, bridge: float, columns: Sequence[Floats]) -> None:
        """Fit the clock.

        Parameters
        ----------
        foreign : Foreign
            The file, for errors.
        stamps : Stamps
            Times of its rows.
        bridge : float
            Longest gap [s] that becomes a straight line.
        columns : sequence of (rows,) array of float
            The values; rows without any are left out.

        Raises
        ------
        RigError
            When the times are no clock of equal steps.
        """
        self._foreign, self._bridge, self._dated = foreign, bridge, stamps.dated
        self._all = times = np.asarray(stamps.seconds, float)
        self.notes: list[str] = []
        timed = np.isfinite(times)
        # lines without a value of any of these signals are left out; an exported run has such lines at the times of other signals
        filled = np.any(np.isfinite(np.stack(columns)), axis=0) if columns else np.ones(len(times), bool)
        self._held = timed & filled
        if timeless := int((filled & ~timed).sum()):
            first = foreign.row(int(np.argmax(filled & ~timed)))
            self.notes.append(f"{_rows(timeless)} left out for want of a time, the first in {first}")
        self._drop_doubled(columns)
        times = times[self._held]
        if len(times) < 2:
            raise RigError(f"{foreign.path}: has {len(times)} rows with a time and a value; a recording needs more")
        self.first, self.last = float(times[0]), float(times[-1])
        self.t0, self.period, self._row = self._steps(times)
        self.rows = int(self._row[-1]) + 1
        if self.rows > EMPTIER * len(times):
            raise RigError(
                f"{foreign.path}: has only {len(times)} rows in a time of {self.rows} steps of {self.period * 1e3:g} ms; it is not "
                "a recording of equal steps"
            )
        self._note_gaps()
        if not FASTEST <= self.period < SLOWEST:
            self.notes.append(f"its rows are {self.period:.4g} s apart, which is unusual; is the unit of its times right?")

    def _line(self, number: int) -> str:
        """Return the place of a row with a time and values."""
        return self._foreign.row(int(np.flatnonzero(self._held)[number]))

    def _drop_doubled(self, columns: Sequence[Floats]) -> None:
        """Leave out rows that repeat the one before them, unless the times have few digits and the values go on."""
        at = np.flatnonzero(self._held)
        same = np.flatnonzero(np.diff(self._all[at]) == 0.0) + 1
        if not len(same):
            return
        before, behind = at[same - 1], at[same]
        identical = np.ones(len(same), bool)
        for values in columns:
            identical &= (values[before] == values[behind]) | (np.isnan(values[before]) & np.isnan(values[behind]))
        if columns and identical.all():
            self._held[behind] = False
            again = "repeats" if len(same) == 1 else "repeat"
            self.notes.append(
                f"{_rows(len(same))} left out that {again} time and values of the row before, the first in "
                f"{self._foreign.row(int(behind[0]))}"
            )
        elif len(same) < REPEATED * len(at):
            k = int(np.argmin(identical)) if columns else 0
            one, other = (self._foreign.row(int(at[k])) for at in (before, behind))
            raise RigError(
                f"{self._foreign.path}: {one} and {other} have the same time, {self._all[behind[k]]:.10g} s"
                f"{', and different values' if columns else ''}; remove the wrong row"
            )

    def _steps(self, times: Floats) -> tuple[float, float, Ints]:
        steps = np.diff(times)
        if np.any(steps < 0.0):
            self._refuse_back(times, steps)
        if np.any(steps == 0.0):
            return self._through_repeated(times)
        mean = float(times[-1] - times[0]) / len(steps)
        number = np.arange(len(times))
        if not np.all(steps <= 1.5 * mean):
            single = float(np.median(steps))
            alike = steps[np.rint(steps / single) == 1.0]
            if not len(alike):
                self._refuse_uneven(times, int(np.argmax(steps)))
            single = float(alike.mean())
            self._refuse_hour(times, steps, single)
            number = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / single), 1.0))]).astype(np.int64)
        period, rest = _line_through(number, times)
        if (rest.max() - rest.min()) > 1.1 * period:
            self._refuse_uneven(times, int(np.argmax(np.abs(np.diff(rest)))))
        t0 = float((rest.max() + rest.min()) / 2.0)
        return (round(t0, 9) if rest.max() - rest.min() < 1e-8 else t0) + 0.0, period, number  # no -0.0

    def _through_repeated(self, times: Floats) -> tuple[float, float, Ints]:
        """Return the clock of times with so few digits that several rows have the same.

        Rows that are missing show as times that stand for fewer rows than the others around them do.
        """
        begins = np.flatnonzero(np.append(True, np.diff(times) > 0.0))
        distinct, counts = times[begins], np.diff(np.append(begins, len(times)))
        steps = np.diff(distinct)
        digit = float(steps.min()) if len(steps) else 0.0
        span = float(distinct[-1] - distinct[0])
        if len(steps) < 3 or span < SUREST * digit:
            raise RigError(
                f"{self._foreign.path}: its {len(times)} rows have only {len(distinct)} different times from {distinct[0]:.10g} s "
                "on, too few for a clock; export more digits (from Excel: a format with milliseconds), or give --period, in "
                "Python period="
            )
        self._refuse_hour(times, np.diff(times), digit)
        usual = steps[1:] < 1.5 * digit
        period = float(steps[1:][usual].sum() / counts[1:-1][usual].sum()) if usual.any() else span / len(times)
        lacking = np.append(0.0, np.cumsum(steps / period - counts[:-1]))  # rows that are missing up to each time
        gaps = np.zeros(len(distinct), np.int64)
        fewer = np.flatnonzero(np.diff(lacking) >= 1.5) + 1
        for n in fewer:  # not the first: a recording begins within a digit
            if n > 1 and not gaps[max(n - 3, 0) : n].any():  # a gap may show in several times
                behind = np.median(lacking[min(n + 2, len(lacking) - 1) : n + 2 + AROUND])
                gaps[n] = max(0, round(float(behind - np.median(lacking[max(n - AROUND, 0) : n]))))
        extra = np.cumsum(np.where(gaps >= 2, gaps, 0))
        number = np.arange(len(times)) + np.repeat(extra, counts)
        period, rest = _line_through(number, times)
        if rest.max() - rest.min() > max(2.0 * digit, digit + 3.0 * period):
            self._refuse_uneven(times, int(np.argmax(np.abs(np.diff(rest)))))
        self.notes.append(
            f"its times have steps of {digit * 1e3:.4g} ms, the same for up to {counts.max()} rows; the clock of "
            f"{period * 1e3:.7g} ms was fitted through them, and "
            f"is sure to {max(digit / span * 1e6, 1.0):.0f} ppm, and each time to {digit * 1e3:.3g} ms"
        )
        return max(float((rest.max() + rest.min()) / 2.0), float(times[0])), period, number

    def _note_gaps(self) -> None:
        missing = np.diff(self._row) - 1
        places = np.flatnonzero(missing)
        if not len(places):
            return
        longest = sorted(places[np.argsort(-missing[places], kind="stable")][:GAPS_SHOWN])
        ends = [(missing[n], self.t0 + self.period * self._row[n], self._line(int(n) + 1)) for n in longest]
        shown = ", ".join(f"{count} ({count * self.period * 1e3:.4g} ms) after {t:.5f} s, before {line}" for count, t, line in ends)
        more = f", and at {len(places) - GAPS_SHOWN} more places" if len(places) > GAPS_SHOWN else ""
        self.notes.append(f"{_rows(int(missing.sum()), 'is', 'are')} missing: {shown}{more}")

    def _refuse_back(self, times: Floats, steps: Floats) -> None:
        places = np.flatnonzero(steps < 0.0)
        at = int(places[0])
        if self._dated and abs(steps[at] + HOUR) < 0.01 * HOUR:
            raise RigError(f"{self._foreign.path}: the times go back by an hour at {self._line(at + 1)}, {SUMMER}")
        more = f", and at {len(places) - 1} more places" if len(places) > 1 else ""
        raise RigError(
            f"{self._foreign.path}: rows are out of order: the times go from {times[at]:.10g} to {times[at + 1]:.10g} s at "
            f"{self._line(at + 1)}{more}; put the rows in order of time, or cut the file where a second recording begins"
        )

    def _refuse_hour(self, times: Floats, steps: Floats, single: float) -> None:
        hours = np.abs(steps - HOUR) < max(0.01 * HOUR, 2.0 * single)
        if self._dated and hours.any():
            at = int(np.argmax(hours))
            raise RigError(f"{self._foreign.path}: the times jump by an hour at {self._line(at + 1)}, {SUMMER}")

    def _refuse_uneven(self, times: Floats, at: int) -> None:
        raise RigError(
            f"{self._foreign.path}: the times must grow in equal steps, but go from {times[at]:.10g} to {times[at + 1]:.10g} s at "
            f"{self._line(at + 1)}, where most steps are {np.median(np.diff(times)):.4g} s"
        )

    def times(self) -> Floats:
        """Time of each row [s]."""
        return self.t0 + self.period * np.arange(self.rows, dtype=float)

    def times_of(self, channel: Channel, count: int) -> Floats:
        """Return the times of the ``count`` values of a channel [s], as the file has them."""
        times = self._all if channel.times is None else channel.times
        if len(times) != count:
            raise RigError(f"{self._foreign.path}: '{channel.head}' has {count} values and no times of its own")
        return times

    def placed(self, values: Floats, counts: dict[str, int]) -> Floats:
        """Return a column on the clock, with short gaps bridged, and count them."""
        out = np.full(self.rows, np.nan)
        out[self._row] = values[self._held]
        known = np.flatnonzero(np.isfinite(out))
        if len(known) < 2:
            counts["missing"] += self.rows - len(known)
            return out
        gaps = np.diff(known)
        own = int(np.median(gaps))  # usual number of rows from one value to the next, more than 1 for a slower signal
        longest = max(round(self._bridge / self.period), int(1.5 * own) if own > 1 else 1)
        every = np.arange(self.rows)
        filled = np.interp(every, known, out[known])
        # length of the gap around each row; beyond the ends, where the nearest value is kept, the distance to this value
        after = np.searchsorted(known, every)
        inside = np.append(np.insert(gaps, 0, 0), 0)[after]
        near = (
            np.where((every > known[0]) & (every < known[-1]), inside, np.maximum(known[0] - every, every - known[-1])) <= longest
        )
        empty = ~np.isfinite(out)
        counts["missing"] += int(
            (empty if own == 1 else empty & ~near).sum()
        )  # between the values of a slower signal none is missing
        counts["bridged"] += int((empty & near).sum()) if own == 1 else 0
        return np.where(empty & near, filled, out)

    def carried(self, channel: Channel, values: Floats, held: bool, counts: dict[str, int]) -> Floats:
        """Return a signal with times of its own on the clock: by its last value if it is ``held``, else by straight lines.

        As in ``placed``, rows in gaps over the bridge stay empty, and are counted, as are those before its first and behind its
        last value; values before and behind the clock are left out, which is noted.
        """
        times = self.times_of(channel, len(values))
        known = np.isfinite(values) & np.isfinite(times)
        times, values, own = times[known], values[known], self.times()
        if len(times) < 2 or not np.all(np.diff(times) > 0.0):
            raise RigError(
                f"{self._foreign.path}: '{channel.head}' with times of its own has {len(times)} values, or times that do not grow"
            )
        if times[0] > own[-1] or (not held and times[-1] < own[0]):
            raise RigError(
                f"{self._foreign.path}: '{channel.head}' has times from {times[0]:.10g} to {times[-1]:.10g} s, and the "
                f"other signals from {own[0]:.10g} to {own[-1]:.10g} s; a recording needs a time that is common to all"
            )
        if not held:
            usual, at = 1.5 * float(np.median(np.diff(times))), np.clip(np.searchsorted(times, own), 1, len(times) - 1)
            before, behind = own - times[at - 1], times[at] - own
            lacking = (before + behind > usual) & (np.minimum(before, behind) > 1e-3 * self.period)
            outside = np.maximum(-before, -behind) > usual
            empty = (lacking & (before + behind > self._bridge + 1e-3 * self.period)) | outside
            lacking |= outside
            if cut := int(((times < own[0] - usual) | (times > own[-1] + usual)).sum()):
                self.notes.append(
                    f"{cut} values of '{channel.head}' are before or behind the times of the others, and were left out"
                )
            counts["missing"] += int(lacking.sum())
            counts["bridged"] += int((lacking & ~empty).sum())
            return np.where(empty, np.nan, np.interp(own, times, values, np.nan, np.nan))
        at = np.searchsorted(times, own, "right") - 1
        return np.where(at >= 0, values[np.maximum(at, 0)], np.nan)


def _line_through(number: Ints, times: Floats) -> tuple[float, Floats]:
    """Return the period of numbered rows [s], and what their times have beyond it."""
    centre = number.mean()
    period = float(np.dot(number - centre, times - times[0]) / np.dot(number - centre, number - centre))
    round_one = round(period, 12)
    period = round_one if abs(round_one - period) * number[-1] < 1e-7 else period
    return period, times - period * number


def _rows(count: int, one: str = "was", more: str = "were") -> str:
    return f"{count} row{'' if count == 1 else 's'} {one if count == 1 else more}"
