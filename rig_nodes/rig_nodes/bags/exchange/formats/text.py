# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of CSV and other text files, which is taken for what no other format claims.

Facts about a file that are not given (encoding, delimiter, decimal sign, lines of the head) are found from its content.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....base import RigError
from ... import limits
from ..cells import Cells, Signs, signs_of
from ..foreign import Channel, Foreign, Form
from ..provenance import CSV_DIGEST, KEY, csvw_path, digest_of, read_provenance
from ..units import split_head, unit_of
from .format import Format
from .text_form import Layout, behind_values, fields, found_form, last_row_is_cut, names_of, stated_period

if TYPE_CHECKING:
    from ....base import Floats

FIRST_ROWS = 2000  # by which the kind of a column is judged
PADDING = "\x1a\0"  # end of file of old systems, and what a logger that lost its power leaves

# a cell of several lines in quotes, as Excel writes remarks and heads with line breaks
_BROKEN = re.compile(r'(?<![^;,\t|\r\n])"(?:[^"\r\n]|"")*(?:\r?\n(?:[^"\r\n]|"")*){1,20}"(?=[;,\t|\r\n]|\Z)')


def read_text(path: Path, form: Form) -> Foreign:
    """Read a text file.

    Parameters
    ----------
    path : Path
        The file.
    form : Form
        What is known of its form.

    Returns
    -------
    Foreign
        Its channels, with the whole form.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    text = _decoded(path, form)
    text, breaks = _BROKEN.subn(lambda match: " ".join(match[0].split()), text) if '"' in text else (text, 0)
    lines = text.rstrip(f"{PADDING}\r\n").splitlines()
    whole = text.rstrip(PADDING).endswith("\n")
    del text
    while lines and not lines[-1].strip(f"{PADDING} "):
        lines.pop()
    form, layout = found_form(path, lines, form)
    notes = _without_end(lines, form, layout, whole)
    if breaks:
        notes.append(f"{breaks} cell{'s have' if breaks > 1 else ' has'} a line break in quotes, which is counted as no line here")
    heads = names_of(lines[form.header - 1], form.delimiter)
    units = [""] * len(heads)
    if form.units:
        units = [*names_of(lines[form.units - 1], form.delimiter), *units][: len(heads)]
    period = stated_period(lines[: form.data - 1])
    body = _Body(path, lines[form.data - 1 :], form, layout, len(heads))
    channels = []
    for i, (head, (name, unit)) in enumerate(zip(_told_apart(heads), _names_and_units(heads, units))):
        cells = Cells(head, partial(body.texts, i), body.place, body.signs, quick=partial(body.table.get, i))
        cells.some = partial(body.texts, i, FIRST_ROWS)
        channels.append(Channel(head, name, unit, cells))
    form = replace(form, decimal=body.signs.decimal if body.signs.sure else None, thousands=body.signs.thousands)
    stated = (period[0], f"line {period[1]}, '{period[2][:60]}'") if period else None
    return Foreign(path, channels, form, _csvw(path), notes, stated)


def _without_end(lines: list[str], form: Form, layout: Layout, whole: bool) -> list[str]:
    """Take lines that are no rows from the end, and return notes that name them."""
    notes = []
    if count := behind_values(lines, form, layout):
        first = len(lines) - count + 1
        short = count == 1 and len(fields(lines[-1], form.delimiter)) < layout.columns
        why = "ends before its last column" if short else "no rows of values" if count > 1 else "no row of values"
        where = (
            f"line {first} {why}"
            if short
            else f"line {first} is {why}"
            if count == 1
            else f"lines {first} to {len(lines)} are {why}"
        )
        notes.append(
            f"{where} and {'was' if count == 1 else 'were'} left out: '{next(filter(str.strip, lines[-count:]), '').strip()[:40]}'"
        )
        del lines[-count:]
    elif not whole and last_row_is_cut(lines, form, layout):
        notes.append(f"line {len(lines)} is cut in its last number and was left out: '...{lines[-1].strip()[-20:]}'")
        lines.pop()
    return notes


def _told_apart(heads: Sequence[str]) -> list[str]:
    """Return the heads, with a number behind those that are there more than once, and for an empty one its column."""
    counts, seen = Counter(heads), Counter()
    out = []
    for n, head in enumerate(heads, 1):
        seen[head] += 1
        out.append(f"column {n}" if not head else f"{head} ({seen[head]})" if counts[head] > 1 else head)
    return out


def _names_and_units(heads: Sequence[str], units: Sequence[str]) -> list[tuple[str, str]]:
    found = [(head, unit_of(unit) or unit.strip("[]() ")) if unit else split_head(head) for head, unit in zip(heads, units)]
    return list(zip(_told_apart([name for name, _ in found]), [unit for _, unit in found]))


class _Body:
    """The rows of a file; ``table`` has the columns of plain numbers, which are read at once."""

    def __init__(self, path: Path, lines: list[str], form: Form, layout: Layout, columns: int) -> None:
        if len(lines) < 2:
            raise RigError(f"{path}: has {len(lines)} rows below its header; a recording needs more")
        self._path, self._lines, self._form = path, lines, form
        self._sign = form.delimiter or ";"
        text = "\n".join(lines)
        self._quoted = '"' in text
        self._check(columns)
        self.signs = signs_of(text, self._sign, Signs(thousands=form.thousands, missing=form.missing), form.decimal)
        self.table = self._at_once(text, [i for i in layout.numbers if i < columns])

    def place(self, row: int) -> str:
        return f"{self._path}: line {self._form.data + row}"

    def texts(self, column: int, rows: int | None = None) -> list[str]:
        sign, lines = self._sign, self._lines[:rows]
        if self._quoted:
            found = list(csv.reader(lines, delimiter=sign, skipinitialspace=sign == " "))
            if len(found) != len(lines):  # a quote that is not closed ends with its line, and swallows none of the next ones
                found = [fields(line, sign) for line in lines]
            return [row[column].strip() for row in found]
        if sign == " ":
            return [line.split()[column] for line in lines]
        return [line.split(sign, column + 1)[column].strip() for line in lines]

    def _check(self, columns: int) -> None:
        """Refuse rows that have not one cell for each name."""
        sign = self._sign
        for n, line in enumerate(self._lines):
            if not self._quoted and sign != " " and line.count(sign) == columns - 1 and (columns > 1 or line):
                continue
            cells = fields(line, sign)
            while len(cells) > columns and not cells[-1]:
                cells.pop()
            if not any(cells):
                raise RigError(f"{self.place(n)} is empty; rows must follow each other")
            if len(cells) != columns:
                hint = "; where ',' is between columns it cannot be the decimal sign too, unless the numbers are in quotes"
                raise RigError(
                    f"{self.place(n)} has {len(cells)} fields where the header names {columns}"
                    f"{hint if sign == ',' and len(cells) > columns else ''}"
                )

    def _at_once(self, text: str, columns: list[int]) -> dict[int, Floats]:
        """Return those of the columns that hold nothing but plain numbers and empty cells."""
        sign, signs = self._sign, self.signs
        if not columns or not signs.sure or (signs.decimal == sign):
            return {}
        if signs.decimal == ",":
            text = text.replace(".", "!").replace(",", ".")  # a point is no part of a number here, and must not become one
        if sign != " " and (sign * 2 in text or f"{sign}\n" in text or f"\n{sign}" in text or sign in (text[0], text[-1])):
            text = f"\n{text}\n".replace(sign * 2, f"{sign}nan{sign}").replace(sign * 2, f"{sign}nan{sign}")
            text = text.replace(f"\n{sign}", f"\nnan{sign}").replace(f"{sign}\n", f"{sign}nan\n").strip("\n")
        try:
            table = np.loadtxt(
                io.StringIO(text),
                delimiter=None if sign == " " else sign,
                ndmin=2,
                comments=None,
                usecols=columns,
                quotechar='"' if self._quoted else None,
            )
        except ValueError:  # other cells are among them, and each column is converted by itself
            return {}
        if len(table) != len(self._lines):
            return {}
        return {i: np.ascontiguousarray(column) for i, column in zip(columns, table.T) if not np.isinf(column).any()}


def _csvw(path: Path) -> dict | None:
    about = csvw_path(path)
    if not about.is_file() or about.stat().st_size > limits.JSON:
        return None
    try:
        found = json.loads(about.read_text(encoding="utf-8"))
    except (ValueError, RecursionError, OSError):
        return None
    provenance = read_provenance(json.dumps(found.get(KEY))) if isinstance(found, dict) else None
    if provenance is not None and found.get(CSV_DIGEST) != digest_of(path):
        raise RigError(
            f"{about}: describes a run whose CSV file had another content; delete it if {path.name} is another recording, or "
            "export the run again"
        )
    return provenance


def _decoded(path: Path, form: Form) -> str:
    data = path.read_bytes()
    if form.encoding:
        try:
            return data.decode(form.encoding)
        except LookupError:
            raise RigError(
                f"{path}: there is no encoding '{form.encoding}'; known are e.g. utf-8, cp1252, cp1250, utf-16"
            ) from None
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            raise RigError(f"{path}: line {line} is not text in {form.encoding}; is it e.g. cp1252 or cp1250?") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data[:4096].rstrip(b"\0"):
        raise RigError(f"{path}: is not text, although its ending is {path.suffix}; export it from the logger's program as CSV")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1250", errors="replace")  # German and Polish letters are the same in it as in cp1252


FORMAT = Format("text", lambda _path, _head: False, read_text, damage=())  # what nothing else claims
