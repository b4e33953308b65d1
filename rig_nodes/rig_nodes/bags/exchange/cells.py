# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cells of a column as they stand in a file (texts, numbers, dates), and the numbers that they mean.

Readers of text, Parquet and spreadsheets make a channel's content of them. Nothing is converted before it is asked for, so that a
column that nobody uses cannot spoil a file. bags.exchange.stamps reads times from them.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import RigError

if TYPE_CHECKING:
    from ...base import Floats

MISSING = ("", "nan", "NaN", "---")
BLANKS = " \u00a0\u202f\u2009"  # blank, no-break space, narrow one, thin space: each may group thousands
APOSTROPHES = "'\u2019"
MINUS = "\u2212"
GROUPS = {" ": BLANKS, "'": APOSTROPHES, ".": ".", ",": ","}  # signs that a profile can name for thousands
# what loggers and Excel write where there is no value, beside MISSING
OBVIOUS = re.compile(
    r"-+|\*+|\?+|#\S*|[-+]?nan(?:\(\w*\))?|n/?a|n\.\s?v\.|null|none|[-+]?1[.,]#(?:qnan|snan|ind)\d*"
    r"|(?:over|under)[ -]?(?:range|flow|load)",
    re.IGNORECASE,
)
_EXPONENT = r"(?:[eEdD][-+]?\d+)?"
_PLAIN = b"0123456789+-.eE"
SHOWN_LETTERS = 40


class CellError(RigError):
    """A cell that is asked for is no number, or has two readings; a profile can say what it means."""


@dataclass(frozen=True)
class Signs:
    """How the numbers of a file are written.

    Attributes
    ----------
    decimal : str
        The decimal sign, ``.`` or ``,``.
    thousands : str or None
        A point or comma that groups thousands; blanks and apostrophes always may.
    sure : bool
        False when no cell of the file shows whether ``decimal`` is the decimal sign or groups thousands.
    missing : tuple of str
        Texts of cells that have no value, beside the obvious ones.
    """

    decimal: str = "."
    thousands: str | None = None
    sure: bool = True
    missing: tuple[str, ...] = MISSING

    @property
    def other(self) -> str:
        """The one of point and comma that is not the decimal sign."""
        return "," if self.decimal == "." else "."

    @cached_property
    def patterns(self) -> tuple[re.Pattern, re.Pattern, re.Pattern]:
        """Patterns of a plain number, of one with grouped thousands, and of one that has two readings."""
        sign, groups = re.escape(self.decimal), re.escape(BLANKS + APOSTROPHES + GROUPS.get(self.thousands or "", ""))
        doubtful = re.escape(self.other) if self.sure else "[.,]"
        return (
            re.compile(rf"[-+]?(?:\d+(?:{sign}\d*)?|{sign}\d+){_EXPONENT}", re.ASCII),
            re.compile(rf"[-+]?\d{{1,3}}([{groups}])\d{{3}}(?:\1\d{{3}})*(?:{sign}\d*)?", re.ASCII),
            re.compile(rf"[-+]?[1-9]\d{{0,2}}{doubtful}\d{{3}}", re.ASCII),
        )

    def number(self, text: str) -> float | None:
        """Return the number of a text, NaN where it says that there is none; None for anything else.

        Raises
        ------
        ValueError
            When the text is a number that can be read in two ways; its message has both.
        """
        text = text.strip()
        if text in self.missing:
            return np.nan
        text = text.replace(MINUS, "-")
        plain, grouped, doubtful = self.patterns
        if not self.sure or self.other in text:
            if doubtful.fullmatch(text) and (self.thousands is None or self.thousands not in text):
                sign = "," if "," in text else "."
                whole, fraction = text.replace(sign, ""), text.replace(sign, ".")
                way = f'a profile says it with thousands: "{sign}" or decimal: "{sign}"'
                if self.sure:
                    way = f'a profile says the first with thousands: "{sign}"; the second needs a file with one decimal sign'
                raise ValueError(
                    f"which is {whole} if '{sign}' groups thousands, and {float(fraction):g} if it is the decimal sign; {way}"
                )
        if plain.fullmatch(text):
            return float(text.replace(self.decimal, ".").replace("d", "e").replace("D", "e"))
        if match := grouped.fullmatch(text):
            return float(text.replace(match[1], "").replace(self.decimal, "."))
        return np.nan if OBVIOUS.fullmatch(text) else None


def numbers_in(texts: Sequence[str], decimal: str | None) -> tuple[float, ...]:
    """Return the numbers among texts, by their decimal sign where it is known; those that could be two numbers are left out."""
    found = set()
    for text in texts:
        with suppress(ValueError):
            number = Signs(decimal or ("," if "," in text else "."), missing=()).number(text)
            found |= set() if number is None or number != number else {number}
    return tuple(sorted(found))


def _in_cells(text: str, core: str, delimiter: str, quoted: bool) -> bool:
    """Return True when a whole cell of a text matches; ``quoted`` demands its quotes."""
    edge, quote = re.escape(delimiter), '"' if quoted else '"?'
    blank = "" if delimiter == " " else "[ \\t]*"
    pattern = rf"(?:^|{edge}){blank}{quote}[-+{MINUS}]?(?:{core}){quote}{blank}(?=$|{edge})"
    return re.search(pattern, text, re.ASCII | re.MULTILINE) is not None


def _decimal(sign: str) -> str:
    """Return the pattern of numbers in which a sign can only be the decimal one."""
    s, groups = re.escape(sign), re.escape(BLANKS + APOSTROPHES + ("," if sign == "." else "."))
    return (
        rf"(?:(?:0\d*|\d{{4,}}){s}\d*|{s}\d+|\d{{1,3}}{s}(?:\d{{0,2}}|\d{{4,}})|\d{{1,3}}(?:[{groups}]\d{{3}})+{s}\d*)"
        rf"{_EXPONENT}|\d+{s}\d+[eEdD][-+]?\d+"
    )


def _grouping(sign: str) -> str:
    """Return the pattern of numbers in which a sign can only group thousands."""
    s, other = re.escape(sign), re.escape("," if sign == "." else ".")
    return rf"\d{{1,3}}(?:{s}\d{{3}}){{2,}}(?:{other}\d*)?|\d{{1,3}}(?:{s}\d{{3}})+{other}\d*"


def signs_of(text: str, delimiter: str, given: Signs | None = None, decimal: str | None = None) -> Signs:
    """Find how numbers are written from all cells of a file.

    Parameters
    ----------
    text : str
        The rows of the file, one a line.
    delimiter : str
        The sign between cells.
    given : Signs, optional
        Thousands and missing texts that were stated.
    decimal : str, optional
        The decimal sign, when it was stated.

    Returns
    -------
    Signs
        The signs; ``sure`` is False when the cells leave it open what they mean.
    """
    given = given or Signs()
    there = [sign for sign in ",." if sign in text and (sign != delimiter or '"' in text)]
    if decimal is None and given.thousands in (",", "."):
        decimal = "," if given.thousands == "." else "."
    sure = True
    if decimal is None:
        shown = [sign for sign in there if _in_cells(text, _decimal(sign), delimiter, sign == delimiter)]
        if len(shown) == 2:  # texts beside the numbers, or a file of two minds: each cell is checked against the more frequent sign
            shown.sort(key=text.count, reverse=True)
        grouped = [] if shown else [sign for sign in there if _in_cells(text, _grouping(sign), delimiter, sign == delimiter)]
        if shown:
            decimal = shown[0]
        elif grouped:
            decimal = "," if grouped[0] == "." else "."
        else:
            decimal, sure = (there or ["."])[0], not there
    found = replace(given, decimal=decimal, sure=sure)
    if (
        given.thousands is None
        and found.other in there
        and _in_cells(text, _grouping(found.other), delimiter, found.other == delimiter)
    ):
        found = replace(found, thousands=found.other)
    return found


@dataclass
class Cells:
    """A column as it stands in a file; converted when it is asked for.

    Attributes
    ----------
    head : str
        Head of the column, for errors.
    load : callable
        Returns the cells: a list of str, numbers, dates, times, durations or None, or an array; None for a kind of which no
        numbers can be made.
    place : callable
        Returns the place of a row (from 0) for errors, with the file's name.
    signs : Signs
        How numbers in texts are written.
    stated : str
        Kind of the column where the file states one, e.g. ``decimal128(18, 2)``.
    quick : callable, optional
        Returns all numbers at once, or None when only the cells can be converted.
    some : callable, optional
        Returns the first cells, where this is cheaper than all.
    words : dict of str to int
        After a conversion: texts that were taken as "no value" and that nobody declared, with their numbers.
    """

    head: str
    load: Callable[[], Any]
    place: Callable[[int], str]
    signs: Signs = field(default_factory=Signs)
    stated: str = ""
    quick: Callable[[], Floats | None] | None = None
    some: Callable[[], Any] | None = None
    words: dict[str, int] = field(default_factory=dict)

    @property
    def cells(self) -> Sequence[Any] | np.ndarray:
        """The cells; CellError when the kind of column has none that could be used."""
        found = self.load()
        if found is None:
            raise CellError(
                f"{self.place(0)}: column '{self.head}' is of type {self.stated}, of which no numbers can be made; write it as "
                "numbers or as text"
            )
        return found

    @property
    def beginning(self) -> Sequence[Any] | np.ndarray:
        """The first cells of the column, or all."""
        return self.some() if self.some else self.cells

    @cached_property
    def kind(self) -> str:
        """What the column holds, for notes: ``numbers``, ``text``, ``dates and times``, or the type that the file states."""
        if self.stated:
            return self.stated
        if self.quick and self.quick() is not None:
            return "numbers"
        cells = self.beginning
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "Mm":
            return "dates and times"
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "fiub":
            return "numbers"
        some = [cell for cell in cells[:2000] if cell is not None and str(cell).strip() not in self.signs.missing]
        if some and all(isinstance(cell, (datetime.date, datetime.time, datetime.timedelta)) for cell in some):
            return "dates and times"
        if not some:
            return "no values"
        own = self._own_signs(some) or self.signs
        words = sum(_is_text(cell, self.signs) and _is_text(cell, own) for cell in some)
        return "text" if words > len(some) / 2 else "numbers"  # a single word among numbers is told when the column is used

    def numbers(self) -> Floats:
        """Return the numbers, (rows,), NaN where a cell has no value.

        Raises
        ------
        CellError
            When a cell is no number, or one that can be read in two ways; the error has line, column and text.
        """
        found = self.quick() if self.quick else None
        if found is not None:
            return found
        cells = self.cells
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "fiub":
            return cells.astype(float)
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "Mm":
            raise CellError(f"{self.place(0)} has a date or time in column '{self.head}' where a number is expected")
        try:
            return self._at_once(cells, self.signs)
        except CellError:
            own = self._own_signs(cells)
            if own is None:
                raise
            return self._at_once(cells, own)  # the cells of this column show by themselves that their decimal sign is the other one

    def texts(self) -> list[str]:
        """Return the cells as texts, ``1`` for the number 1.0; empty where there is none."""
        cells = self.cells
        if isinstance(cells, np.ndarray) and cells.dtype.kind in "fiub":
            return [f"{cell:g}" if cell == cell else "" for cell in cells.tolist()]
        return [
            "" if cell is None else f"{cell:g}" if isinstance(cell, float) else str(cell).strip()
            for cell in (cells.tolist() if isinstance(cells, np.ndarray) else cells)
        ]

    def _at_once(self, cells: Sequence[Any], signs: Signs) -> Floats:
        try:
            text = "".join(cells) if signs.sure else signs.other
            if signs.other not in text and not text.encode("ascii").translate(None, delete=_PLAIN + b","):
                return np.fromiter((float(cell.replace(signs.decimal, ".")) for cell in cells), float, len(cells))
        except (TypeError, ValueError):  # not only texts, not only numbers, or empty ones
            pass
        return self._one_by_one(cells, signs)

    def _one_by_one(self, cells: Sequence[Any], signs: Signs) -> Floats:
        out, known, words = np.empty(len(cells)), {}, {}
        for n, cell in enumerate(cells):
            if cell not in known:
                known[cell] = self._number(n, cell, signs)
            number = out[n] = known[cell]
            if number != number and isinstance(cell, str) and (word := cell.strip()) not in signs.missing:
                words[word] = words.get(word, 0) + 1
            if len(known) > 100_000:
                known.clear()
        self.words = words
        return out

    def _number(self, row: int, cell: Any, signs: Signs) -> float:
        if cell is None:
            return np.nan
        if not isinstance(cell, str):
            with suppress(TypeError, ValueError):
                if not isinstance(cell, bool):  # TRUE of a workbook is no 1
                    return float(cell)
            raise CellError(f"{self._where(row, cell)} where a number is expected")
        try:
            number = signs.number(cell)
        except ValueError as error:
            raise CellError(f"{self._where(row, cell)}, {error}") from None
        if number is None:
            raise CellError(
                f"{self._where(row, cell)} where a number with decimal '{signs.decimal}' is expected; if it says that a value is "
                "missing, add it to 'missing' in a profile"
            )
        return number

    def _where(self, row: int, cell: Any) -> str:
        return f"{self.place(row)} has '{str(cell).strip()[:SHOWN_LETTERS]}' in column '{self.head}'"

    def _own_signs(self, cells: Sequence[Any]) -> Signs | None:
        """Return the signs that the column shows by itself; None when they are those of the file, or not sure."""
        texts = "\n".join(cell for cell in cells if isinstance(cell, str))
        own = signs_of(texts, "\n", Signs(missing=self.signs.missing))
        return own if own.sure and own.decimal in texts and own.decimal != self.signs.decimal else None


def text_cells(head: str, texts: Sequence[str], where: object) -> Cells:
    """Return the cells of a channel of texts; ``where`` is its file or variable, for errors."""
    return Cells(head, lambda: texts, lambda row: f"{where}: row {row + 1}", stated="text")


def _is_text(cell: Any, signs: Signs) -> bool:
    if not isinstance(cell, str):
        return not isinstance(cell, (int, float, np.number)) and not hasattr(cell, "as_integer_ratio")
    try:
        return signs.number(cell) is None
    except ValueError:
        return False
