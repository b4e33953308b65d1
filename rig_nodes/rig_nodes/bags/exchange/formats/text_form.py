# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds the form of a text file from its content: delimiter, lines of names, units and first values, and what is behind the values.

bags.exchange.formats.text reads the file by it.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ....base import RigError
from ..cells import MINUS, OBVIOUS
from ..foreign import Form
from ..stamps import is_stamp
from ..units import TIME_UNITS, time_unit_of, unit_of

DELIMITERS = (";", "\t", "|", ",", " ")
HEAD_LINES = 200  # lines in which the first row of values is looked for
LOOKED_AT = 20  # last lines by which delimiter and columns are found, and as many before them
MOST_BEHIND = 100  # lines behind the values
NUMBER, STAMP, EMPTY, WORD = "number", "stamp", "empty", "word"
COMMENT = re.compile(r"\A\s*(?:#|%|//)+\s*")  # what makes a line a comment; the signs may be in heads too
_NUMBER = re.compile(
    rf"[-+{MINUS}]?(?:\d{{1,3}}(?:[.,'\u2019 \u00a0\u202f\u2009]\d{{3}})+(?:[.,]\d*)?|\d+(?:[.,]\d*)?|[.,]\d+)(?:[eEdD][-+]?\d+)?",
    re.ASCII,
)
_TYPE = re.compile(r"[fiu]\d{1,2}|u?int(?:\d\d?)?|float(?:\d\d)?|double|real|single|number|numeric", re.IGNORECASE)
# a line that states how often a logger took its rows; frequencies of filters and signals have other words
_SAMPLED = re.compile(
    r"sample|sampling|pr[óo]bk|abtast|\bscan|mess?-?(?:rate|interval|takt)|erfassung|\bd[_ ]?t\b|delta[_ ]?t|zeitschritt|time ?step"
    r"|\bokres\b|\binterval",
    re.IGNORECASE,
)
_QUANTITY = re.compile(
    r"(?:[\[(]\s*(?P<before>[a-zµμ/]+)\s*[\])])?[\s;:,=|\"]*"
    r"(?P<number>\d{1,3}(?:(?P<group>[' \u2019\u00a0\u202f\u2009])\d{3})(?:(?P=group)\d{3})*(?:[.,]\d+)?"
    r"|\d+(?:[.,]\d+)?(?:e[-+]?\d+)?)"
    r"(?P<over>\s*/\s*\d)?[\s;,|\"\[(]*(?P<unit>[a-zµμ]+(?:/s)?)?",
    re.IGNORECASE,
)
_RATES = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "ks/s": 1e3, "sps": 1.0, "ksps": 1e3}
csv.field_size_limit(1 << 30)  # a long text is no reason to refuse a file


@dataclass(frozen=True)
class Layout:
    """Columns of the rows of a file: how many there are, and which hold numbers and which times, judged by some of the rows."""

    columns: int
    numbers: tuple[int, ...]
    stamps: tuple[int, ...]

    @property
    def first(self) -> int:
        """The first column that holds values."""
        return min((*self.numbers, *self.stamps))


def fields(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of a line; a blank stands for any number of blanks."""
    if delimiter == " ":
        return line.split() if '"' not in line else next(csv.reader([" ".join(line.split())], delimiter=" "), [])
    return [one.strip() for one in next(csv.reader([line], delimiter=delimiter or "\t"), [])]


def names_of(line: str, delimiter: str | None) -> list[str]:
    """Return the heads in a line of names; with blanks between columns, a unit in brackets belongs to the name before it."""
    found = fields(COMMENT.sub("", line, count=1), delimiter)
    if delimiter == " ":
        heads: list[str] = []
        for one in found:
            if heads and one[0] in "[(":
                heads[-1] += f" {one}"
            else:
                heads.append(one)
        found = heads
    while found and not found[-1]:
        found.pop()  # a delimiter at the end of the line
    return found


def kind_of(cell: str, missing: Sequence[str]) -> str:
    """Return what a cell looks like: NUMBER, STAMP, EMPTY or WORD."""
    if cell in missing or OBVIOUS.fullmatch(cell):
        return EMPTY
    return NUMBER if _NUMBER.fullmatch(cell) else STAMP if is_stamp(cell) else WORD


def found_form(path: Path, lines: Sequence[str], form: Form) -> tuple[Form, Layout]:
    """Complete what is known of a form.

    Parameters
    ----------
    path : Path
        The file, for errors.
    lines : sequence of str
        Its lines, the last one not empty.
    form : Form
        What was given.

    Returns
    -------
    (Form, Layout)
        The form with delimiter, header, units and data, and the columns.

    Raises
    ------
    RigError
        When the file has no rows or no names, or a line that was given is none of it.
    """
    for name, number in (("header", form.header), ("units", form.units), ("data", form.data)):
        if number is not None and not 1 <= number <= len(lines):
            raise RigError(f"{path}: has {len(lines)} lines, and line {number} is given as that of the {name}")
    some = [line for line in (*lines[-4 * LOOKED_AT : -LOOKED_AT : 3], *lines[-LOOKED_AT:]) if line.strip()]
    if form.delimiter is None:
        form = replace(form, delimiter=_delimiter(some, form))
    layout = _layout(some, form)
    if form.data is None:
        form = replace(form, data=_first_row(path, lines, form, layout))
    if layout is None:
        raise RigError(f"{path}: no row of numbers is among its last lines, with delimiter '{form.delimiter}'")
    if form.header is None:
        form = _with_names(path, lines, form, layout)
    if not form.header < form.data or (form.units and not form.units < form.data):
        raise RigError(
            f"{path}: the values are given as beginning in line {form.data}, which is not below the names in line {form.header}"
        )
    return form, layout


def _delimiter(some: Sequence[str], form: Form) -> str:
    """Return the sign that leaves the most cells that are numbers or times; a blank in lines with tabs groups thousands."""
    best, most = ";", -1e9
    for sign in DELIMITERS if any("\t" not in line for line in some) else DELIMITERS[:-1]:
        rows = [fields(line, sign) for line in some]
        if max((len(row) for row in rows), default=1) < 2:
            continue
        kinds = Counter(kind_of(cell, form.missing) for row in rows for cell in row)
        if (score := kinds[NUMBER] + kinds[STAMP] - kinds[WORD]) > most:
            best, most = sign, score
    return best


def _layout(some: Sequence[str], form: Form) -> Layout | None:
    rows = [fields(line, form.delimiter) for line in some]
    rows = [row for row in rows if any(kind_of(cell, form.missing) in (NUMBER, STAMP) for cell in row)]
    if not rows:
        return None
    columns = Counter(len(row) for row in rows[::-1]).most_common(1)[0][0]
    numbers, stamps = [], []
    for i in range(columns):
        kinds = Counter(kind_of(row[i], form.missing) for row in rows if len(row) > i)
        if kinds[NUMBER] + kinds[STAMP] > kinds[WORD]:
            (numbers if kinds[NUMBER] >= kinds[STAMP] else stamps).append(i)
    return Layout(columns, tuple(numbers), tuple(stamps)) if numbers or stamps else None


def _first_row(path: Path, lines: Sequence[str], form: Form, layout: Layout | None) -> int:
    def is_row(line: str) -> bool:
        cells = fields(line, form.delimiter)
        kinds = Counter(kind_of(cells[i], form.missing) if i < len(cells) else WORD for i in (*layout.numbers, *layout.stamps))
        return kinds[NUMBER] + kinds[STAMP] > kinds[WORD]

    for n, line in enumerate(lines[:HEAD_LINES] if layout else []):
        if line.strip() and is_row(line) and all(is_row(other) for other in lines[n + 1 : n + 2]):
            return n + 1
    raise RigError(
        f"{path}: no row of numbers is among its first {min(len(lines), HEAD_LINES)} lines, with delimiter '{form.delimiter}'; a "
        "profile can state delimiter, header and data"
    )


def _with_names(path: Path, lines: Sequence[str], form: Form, layout: Layout) -> Form:
    above = []
    for n in range(form.data - 1, 0, -1):
        line = lines[n - 1]
        names = names_of(line, form.delimiter)
        if not names or (COMMENT.match(line) and not (len(names) == layout.columns > 1)):
            continue
        if not all(_TYPE.fullmatch(one) for one in names):  # a line of the types of the columns, as some tools write it
            above.append(n)
    if not above:
        raise RigError(
            f"{path}: has no line with the names of its columns above the values in line {form.data}; put one there, e.g. 't [s]' "
            "and 'torque [Nm]' with the delimiter between them"
        )
    if form.units is None and len(above) > 1:
        units, names = (fields(COMMENT.sub("", lines[n - 1], count=1), form.delimiter) for n in above[:2])
        is_unit = [not one or one[:1] in "[(" or unit_of(one) or time_unit_of(one) for one in units]
        if len(units) >= len(names) > 1 and any(units) and all(is_unit):
            form = replace(form, units=above[0])
    return replace(form, header=next(n for n in above if n != form.units))


def behind_values(lines: Sequence[str], form: Form, layout: Layout) -> int:
    """Return how many lines at the end are no rows: averages and other texts of a logger, empty lines, and a last row that was cut.

    Parameters
    ----------
    lines : sequence of str
        All lines of the file.
    form : Form
        The form.
    layout : Layout
        The columns.

    Returns
    -------
    int
        Number of lines.
    """
    for n in range(min(MOST_BEHIND, len(lines) - form.data - 1)):
        cells = fields(lines[-1 - n], form.delimiter)
        whole = len(cells) >= layout.columns or (len(cells) == layout.columns - 1 and layout.columns - 1 not in layout.numbers)
        if whole and kind_of(cells[layout.first], form.missing) != WORD and any(cells):
            return n
    return 0


def last_row_is_cut(lines: Sequence[str], form: Form, layout: Layout) -> bool:
    """Return True when the last cell of the last row has fewer decimals than all of the rows above have in this column."""
    if layout.columns - 1 not in layout.numbers:
        return False

    def decimals(line: str) -> int:
        cells = fields(line, form.delimiter)
        cell = cells[layout.columns - 1] if len(cells) >= layout.columns else ""
        return len(re.split(r"[.,]", cell)[1]) if re.search(r"[.,]", cell) else -1

    above = {decimals(line) for line in lines[-1 - LOOKED_AT : -1]}
    return len(lines) > LOOKED_AT and len(above) == 1 and decimals(lines[-1]) < above.pop()


def stated_period(lines: Sequence[str]) -> tuple[float, int, str] | None:
    """Return the time between rows [s] that a line states, as in ``Sample rate: 10000 Hz``, with the line's number and text.

    Parameters
    ----------
    lines : sequence of str
        The lines above the values.

    Returns
    -------
    (float, int, str) or None
        Period, number from 1 and text; None when no line states one without doubt.
    """
    for n, line in enumerate(lines, 1):
        if (word := _SAMPLED.search(line)) is None or "filter" in line.lower():
            continue
        if match := _QUANTITY.search(line, word.end()):  # what stands behind the first number of the line is about something else
            unit, number = match["unit"] or match["before"] or "", match["number"].replace(match["group"] or " ", "")
            value = float(number.replace(",", "."))
            if match["over"] or not value > 0.0 or re.fullmatch(r"[1-9]\d{0,2}[.,]\d{3}", number):
                continue  # 1/2500 s; 10,000 Hz or 10.000 Hz: thousands or thousandths
            if (rate := _RATES.get(unit.lower())) is not None:
                return 1.0 / (value * rate), n, line.strip()
            if (known := time_unit_of(unit)) is not None:
                return value * TIME_UNITS[known], n, line.strip()
    return None
