# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of a file's rows, recognized by what the cells hold: dates, times of day, durations, stamps since 1970, days of Excel.

bags.exchange.time_columns finds the column, bags.exchange.clock fits a clock to the times.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import RigError
from .units import TIME_UNITS

if TYPE_CHECKING:
    from ...base import Floats
    from .cells import Cells

DAY, HOUR = 86400, 3600  # s
TURNS = (2**8, 2**16, 2**24, 2**32)  # numbers of a counter
USUAL = 0.8  # share of its steps that are alike
NS = 1_000_000_000
SINCE_1970 = (9.46e8, 4.1e9)  # s; 2000 to 2099
DAYS = ((36526.0, 54788.0), (730486.0, 748749.0))  # days of Excel and of MATLAB from 2000 to 2050
FASTEST, SLOWEST = 1e-6, 1.0  # s; between rows of a plausible recording
HOLDS_DAYS = 2e-5  # s; steps that would be shorter than this, and values of DAYS, are days
LATEST = 9_000_000_000  # s from 1970, to which whole nanoseconds go
LOOKED_AT = 40  # cells by which a column of texts is taken for times
_EPOCH = datetime.date(1970, 1, 1).toordinal()
_MONTHS = ("jan", "feb", "mar mär", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez")
# hours east of Greenwich; CST and IST mean several
_HOURS = {
    0: "z utc gmt wet",
    1: "bst west cet mez",
    2: "cest mesz eet",
    3: "eest msk",
    9: "jst",
    -4: "edt",
    -5: "est cdt",
    -6: "mdt",
    -7: "mst pdt",
    -8: "pst",
}
_ZONES = {zone: 60 * hours for hours, zones in _HOURS.items() for zone in zones.split()}
_DATE = (
    r"(?P<date>\d{1,4}(?P<sep>[-./])\d{1,2}(?P=sep)\d{1,4}|\d{1,2}[-. ]+[a-zä]{3,9}[-., ]+\d{4}"
    r"|[a-zä]{3,9}\.? \d{1,2},? \d{4}|\d{8}(?=T))"
)
_TIME = (
    r"(?P<h>\d{1,4}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2})(?:(?P<point>[.,:])(?P<f>\d{1,12}))?|[.,](?P<mf>\d{1,9}))?"
    rf"\s*(?P<half>[ap]\.?\s?m\.?)?\s*(?:Uhr)?\s*(?P<zone>{'|'.join(_ZONES)}|[-+]\d{{2}}(?::?\d{{2}})?)?(?:\[[\w/+-]+\])?"
)
_STAMP = re.compile(rf"(?:{_DATE}[T ,;_]*\s*)?{_TIME}", re.IGNORECASE)
_COMPACT = re.compile(r"(\d{8}T\d{2})(\d{2})(\d{2})(.*)", re.IGNORECASE)
_BEHIND_COLON = re.compile(r"\d:\d\d:\d\d:(\d+)")
_ONLY_DATE = re.compile(rf"{_DATE}(?:[T ]+0?0:00(?::00(?:[.,]0+)?)?)?", re.IGNORECASE)
_DURATION = re.compile(
    r"(?P<sign>[-+]?)(?P<days>\d+) days?,? *(?:\+?(?P<h>\d+):(?P<m>\d{2}):(?P<s>\d{2})(?:[.,](?P<f>\d{1,12}))?)?"
)
_NUMBERS_OF_DATE = re.compile(r"\d+|[a-zä]+", re.IGNORECASE)


@dataclass(frozen=True)
class Stamps:
    """Times of the rows of a column.

    Attributes
    ----------
    seconds : (rows,) array of float
        Times [s], NaN where a row has none; of dates and times of day, from the first one on.
    dated : bool
        True for dates and times of day, whose run begins at 0.
    zero : float
        Time of day or since 1970 [s] from which ``seconds`` count.
    first : str
        The first time as it stands in the file.
    turns : int
        How often a counter of times begins anew.
    """

    seconds: Floats
    dated: bool = False
    zero: float = 0.0
    first: str = ""
    turns: int = 0


def unwrapped(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the numbers of a counter that begins anew at its end as numbers that go on, and how often it does.

    It is one when its whole numbers go back only from the end of TURNS to its beginning, and have a usual step; other numbers are
    returned as they are.
    """
    at = np.flatnonzero(np.isfinite(values))
    known = values[at].astype(float)
    steps = np.diff(known)
    back = steps < 0.0
    if not back.any() or not np.all(known == np.rint(known)):
        return values, 0
    usual, span = float(np.median(steps[~back])) if not back.all() else 0.0, float(known.max() - known.min())
    turn = next((one for one in TURNS if span < one), 0)
    if not turn or turn - span > 3.0 * usual or np.mean(np.abs(steps - usual) <= 1.0) < USUAL or np.any(steps[back] + turn <= 0.0):
        return values, 0
    goes_on = values.astype(float)
    goes_on[at] += turn * np.append(0, np.cumsum(back))
    return goes_on, int(back.sum())


def stamps_of_numbers(values: np.ndarray, unit: str | None) -> Stamps:
    """Return the times of a column of numbers.

    Parameters
    ----------
    values : (rows,) array of float or int
        The numbers.
    unit : str or None
        Their unit, a key of TIME_UNITS; None when the file does not say it and the numbers must.

    Returns
    -------
    Stamps
        The times. Whole numbers lose no digit: the first one is subtracted before they become seconds.
    """
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if not len(known):
        return Stamps(np.full(len(values), np.nan))
    unit = unit or unit_of_numbers(known)
    factor, first = TIME_UNITS[unit], known[0]
    dated = SINCE_1970[0] <= float(first) * factor <= SINCE_1970[1] or (unit == "d" and any(a <= first <= b for a, b in DAYS))
    if not dated:
        return Stamps(values.astype(float) * factor)
    shown = f"{int(first) if first == int(first) else format(first, '.15g')} {unit}"
    return Stamps((values - first).astype(float) * factor, True, float(first) * factor, shown)


def unit_of_numbers(known: np.ndarray) -> str:
    """Return the unit that numbers show by their size: since 1970, days of Excel or MATLAB, and else s."""
    first, steps = float(known[0]), np.diff(known[:10_000].astype(float) if known.dtype.kind != "f" else known[:10_000])
    grown = steps[steps > 0]
    step = float(np.median(grown)) if len(grown) else 0.0
    if any(a <= first <= b for a, b in DAYS) and step < HOLDS_DAYS:
        return "d"
    for unit in ("s", "ms", "us", "ns"):
        factor = TIME_UNITS[unit]
        if SINCE_1970[0] <= first * factor <= SINCE_1970[1] and step * factor <= 60.0:
            return unit
    return "s"


def are_stamps(cells: Sequence[Any] | np.ndarray) -> str:
    """Return what a column of cells holds by its first ones: ``times``, ``dates`` (days without a time), or nothing."""
    if isinstance(cells, np.ndarray):
        if cells.dtype.kind != "M":
            return "times" if cells.dtype.kind == "m" else ""
        some = cells[~np.isnat(cells)][:LOOKED_AT]
        return "dates" if np.all(some == some.astype("M8[D]")) else "times"
    some = [cell for cell in cells[: 50 * LOOKED_AT] if cell is not None and cell != ""][:LOOKED_AT]
    if not some:
        return ""
    if all(isinstance(cell, datetime.date) for cell in some) and not any(
        isinstance(cell, datetime.datetime) and cell.time() != datetime.time() for cell in some
    ):
        return "dates"  # days, which a workbook and pandas hold as midnights
    if all(isinstance(cell, (datetime.datetime, datetime.time, datetime.timedelta)) for cell in some):
        return "times"
    if not all(isinstance(cell, str) for cell in some):
        return ""
    texts = [cell.strip() for cell in some]
    if all(_ONLY_DATE.fullmatch(text) for text in texts) and len(set(texts)) < max(2, len(texts)):
        return "dates"
    return "times" if all(_match(text) or _DURATION.fullmatch(text) for text in texts) else ""


def is_stamp(text: str) -> bool:
    """Return True for the text of a date, a time of day or a duration."""
    return bool(_match(text) or _ONLY_DATE.fullmatch(text) or _DURATION.fullmatch(text))


def has_date(text: str) -> bool:
    """Return True for the text of a time with its date."""
    return bool((match := _match(text.strip())) and match["date"])


def stamps_of_cells(column: Cells, dates: Cells | None = None) -> Stamps:
    """Return the times of a column of dates, times of day or durations.

    Parameters
    ----------
    column : Cells
        The column, of which are_stamps is true.
    dates : Cells, optional
        The column of the dates that belong to its times of day.

    Returns
    -------
    Stamps
        The times.

    Raises
    ------
    RigError
        When a cell is no such time, or the order of day and month makes a difference and nothing shows it.
    """
    cells = column.cells
    if isinstance(cells, np.ndarray) and cells.dtype.kind in "Mm":
        return _of_array(cells, " UTC" if column.stated.endswith("UTC") else "")
    if dates is not None:
        days = dates.cells.astype("M8[D]").astype(str).tolist() if isinstance(dates.cells, np.ndarray) else dates.cells
        cells = [
            f"{str(day).strip().partition(' ')[0]} {str(time).strip()}" if day and time not in (None, "") else None
            for day, time in zip(days, cells)
        ]
    texts = [_text(cell) for cell in cells]
    first = next(text for text in texts if text)
    if _DURATION.fullmatch(first):
        return _durations(column, texts)
    return _of_texts(column, texts, first)


def _of_array(cells: np.ndarray, zone: str) -> Stamps:
    unit, count = np.datetime_data(cells.dtype)
    factor = count * {"D": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12}.get(
        unit, 1e-9
    )
    whole, empty = cells.astype(np.int64), np.isnat(cells)
    first = int(whole[~empty][0]) if not empty.all() else 0
    seconds = (whole - first) * factor if factor >= 1.0 else (whole - first) / round(1.0 / factor)
    seconds[empty] = np.nan
    if cells.dtype.kind == "m":
        return Stamps(seconds + first * factor)
    shown = str(cells[~empty][0]).replace("T", " ") + zone if not empty.all() else ""
    return Stamps(seconds, True, (first * factor) % DAY, shown)


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, datetime.timedelta):
        return (
            f"{cell.days} days {cell.seconds // HOUR}:{cell.seconds // 60 % 60:02d}:{cell.seconds % 60:02d}.{cell.microseconds:06d}"
        )
    return str(cell).strip()


def _match(text: str) -> re.Match | None:
    if compact := _COMPACT.fullmatch(text):
        text = f"{compact[1]}:{compact[2]}:{compact[3]}{compact[4]}"
    return _STAMP.fullmatch(text)


def _durations(column: Cells, texts: list[str]) -> Stamps:
    out = np.full(len(texts), np.nan)
    for n, text in enumerate(texts):
        if not text:
            continue
        match = _DURATION.fullmatch(text)
        if match is None:
            raise _no_time(column, n, text)
        out[n] = _nanoseconds(match) / NS
    return Stamps(out)


def _nanoseconds(match: re.Match) -> int:
    """Return the nanoseconds of a duration."""
    minutes = 60 * int(match["h"] or 0) + int(match["m"] or 0)
    whole = DAY * int(match["sign"] + match["days"]) + 60 * minutes + int(match["s"] or 0)
    return NS * whole + int((match["f"] or "").ljust(9, "0")[:9])


def _of_texts(column: Cells, texts: list[str], first: str) -> Stamps:
    """Return the times of texts with dates or times of day."""
    order = _order(column, [match["date"] for text in dict.fromkeys(texts) if text and (match := _match(text)) and match["date"]])
    minutes: dict[tuple, int] = {}  # ns of date, hour, minute and zone, which many rows share
    ns, empty = np.zeros(len(texts), np.int64), np.zeros(len(texts), bool)
    zoned = dated = None
    digits = _digits_behind_colon(texts)
    for n, text in enumerate(texts):
        if not text:
            empty[n] = True
            continue
        match = _match(text)
        if match is None and not dated and not zoned and (days := _DURATION.fullmatch(text)):  # Python's form from one day on
            ns[n] = _nanoseconds(days)
            continue
        if match is None:
            raise _no_time(column, n, text)
        key = match["date"], match["h"], match["m"], match["half"], match["zone"], match["mf"] is not None
        if key not in minutes:
            minutes[key] = NS * _minute(column, n, text, match, order)
            if zoned not in (None, match["zone"] is not None) or dated not in (None, match["date"] is not None):
                raise RigError(
                    f"{column.place(n)} has the time '{text}', with a date or an offset where other rows have none, or without"
                )
            zoned, dated = match["zone"] is not None, match["date"] is not None
        fraction = (match["f"] or "").rjust(digits, "0") if match["point"] == ":" else match["f"] or ""
        ns[n] = minutes[key] + NS * int(match["s"] or (match["mf"] and match["m"]) or 0) + int(fraction.ljust(9, "0")[:9] or 0)
        if match["mf"] is not None:
            ns[n] += int(match["mf"].ljust(9, "0")[:9])
    own = ns[~empty]
    if not dated:
        turn = NS * (HOUR if _match(first)["mf"] is not None else DAY)
        own = own + turn * np.cumsum(np.append(False, np.diff(own) < -turn // 2))
    elapsed = not dated and own[0] < NS * HOUR  # 00:00:03.5 may as well be the time since a start, and is kept
    seconds = np.full(len(texts), np.nan)
    seconds[~empty] = (own if elapsed else own - own[0]) / NS
    return Stamps(seconds) if elapsed else Stamps(seconds, True, (int(own[0]) % (NS * DAY)) / NS, first)


def _digits_behind_colon(texts: list[str]) -> int:
    """Return how many digits a fraction behind a colon has: those that are written, or 3 where some are short.

    Loggers write 10:00:00:9 for 9 ms where 10:00:00:10 comes next.
    """
    lengths = {len(found[1]) for text in texts if (found := _BEHIND_COLON.search(text))}
    return max(3, *lengths) if len(lengths) > 1 else 0


def _minute(column: Cells, row: int, text: str, match: re.Match, order: str) -> int:
    """Return the seconds of a cell's date, hour and minute, in UTC if it has an offset."""
    hour, minute, half = int(match["h"]), int(match["m"]), (match["half"] or "")[:1].lower()
    if match["mf"] is not None:  # minutes, seconds and a fraction
        hour, minute = 0, hour
    elif (half and not 1 <= hour <= 12) or (match["date"] and hour > 24) or minute > 59 or int(match["s"] or 0) > 60:
        raise _no_time(column, row, text)
    if half:
        hour = hour % 12 + 12 * (half == "p")
    day = 0
    if match["date"]:
        if (found := _day(match["date"], order)) is None:
            raise _no_time(column, row, text)
        day = found - _EPOCH
    zone = (match["zone"] or "z").lower()
    if (offset := _ZONES.get(zone)) is None:
        digits = zone[1:].replace(":", "")
        offset = int(f"{zone[0]}1") * (60 * int(digits[:2]) + int(digits[2:] or 0))
    seconds = DAY * day + HOUR * hour + 60 * minute - 60 * offset
    if abs(seconds) > LATEST:
        raise _no_time(column, row, text)
    return seconds


def _no_time(column: Cells, row: int, text: str) -> RigError:
    return RigError(
        f"{column.place(row)} has '{text[:40]}' in column '{column.head}' where a time is expected, as in the rows above"
    )


def _day(date: str, order: str) -> int | None:
    """Return the ordinal of a date whose numbers are in an order such as ``dmy``; None when there is no such day."""
    if len(date) == 8 and date.isdigit():
        date = f"{date[:4]}-{date[4:6]}-{date[6:]}"
    parts = _NUMBERS_OF_DATE.findall(date)
    if any(part[0].isalpha() for part in parts):
        (name,), numbers = [p for p in parts if p[0].isalpha()], [int(p) for p in parts if p[0].isdigit()]
        month = next((n for n, names in enumerate(_MONTHS, 1) if name[:3].lower() in names.split()), 0)
        values = {"d": numbers[0], "m": month, "y": numbers[1]}
    else:
        values = dict(zip(order, map(int, parts)))
    year = values["y"] + (2000 if values["y"] < 100 else 0)
    try:
        return datetime.date(year, values["m"], values["d"]).toordinal()
    except ValueError:
        return None


def _order(column: Cells, dates: list[str]) -> str:
    """Return the order of day, month and year; decided by the days themselves when the form leaves it open."""
    dates = list(dict.fromkeys(dates))
    if not dates:
        return "ymd"
    parts = _NUMBERS_OF_DATE.findall(dates[0])
    if len(parts) < 3 or len(parts[0]) == 4 or any(part[0].isalpha() for part in parts):
        return "ymd"
    if "." in dates[0]:
        return "dmy"
    could = ["dmy", "mdy"] if len(parts[2]) == 4 else ["ymd", "dmy", "mdy"] if "-" in dates[0] else ["dmy", "mdy", "ymd"]
    read = {order: [_day(date, order) for date in dates] for order in could}
    # the days of a recording follow each other; with one day only, the order makes no difference to any time
    leaps = {order: max((abs(b - a) for a, b in pairwise(days)), default=0) for order, days in read.items() if None not in days}
    best = [order for order in leaps if leaps[order] == min(leaps.values())]
    if len(best) > 1 and len(dates) > 1:
        readings = " or ".join(str(datetime.date.fromordinal(read[order][1] or 1)) for order in best)
        raise RigError(f"{column.place(0)}: '{dates[1]}' in column '{column.head}' can be {readings}; write dates as 2024-03-14")
    return best[0] if best else could[0]
