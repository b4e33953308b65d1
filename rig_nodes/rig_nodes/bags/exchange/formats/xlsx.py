# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of xlsx workbooks; a column becomes numbers, texts or times when it is asked for.

The table of a sheet and the lines of its names and units are found from the cells.
"""

from __future__ import annotations

import datetime
import io
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from ....base import RigError, optional, unknown
from ..cells import OBVIOUS, Cells, Signs, signs_of
from ..foreign import Channel, Foreign, Form
from ..units import split_head, unit_of
from .format import ARCHIVE, Format, in_archive
from .heads import apart

LAST_ROWS = 20  # by which the number of columns of values is found
LITTLE = 20  # a table with so many times fewer rows than another sheet's is no recording beside it
FIRST_ROWS = 200  # in which the first row of values is looked for
DATES = (datetime.date, datetime.time, datetime.timedelta)  # a datetime is a date too

Row = Sequence[Any]


def read_xlsx(path: Path, form: Form) -> Foreign:
    """Read a workbook.

    Parameters
    ----------
    path : Path
        The file.
    form : Form
        The sheet and its lines, as far as they are known, and how numbers in texts are written.

    Returns
    -------
    Foreign
        The columns of one sheet: of that of ``form``, or the first visible one with a table that is not small beside the others';
        a note names it.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    package = optional("openpyxl", "mdf")
    # by its path, openpyxl would judge it by its ending
    book = package.load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
    sheets = {sheet.title: sheet for sheet in book.worksheets if sheet.title == form.sheet or sheet.sheet_state == "visible"}
    if form.sheet is not None and form.sheet not in sheets:
        raise RigError(f"{path}: {unknown('sheet', form.sheet, sheets)}")
    names = [form.sheet] if form.sheet is not None else list(sheets)
    tables = {name: found for name in names if (found := _rows(sheets[name])) and (form.sheet or _first_row(found) is not None)}
    book.close()
    if not tables:
        raise RigError(
            f"{path}: no sheet has a table of numbers; formulas have values only after Excel or LibreOffice has saved the workbook"
        )
    most = max(map(len, tables.values()))
    name, rows = next((name, rows) for name, rows in tables.items() if LITTLE * len(rows) >= most)
    others = [f"'{one}'" for one in tables if one != name]
    note = f"read from the sheet '{name}'" + (
        f"; others with tables are {', '.join(others)}, for 'sheet' in a profile" if others else ""
    )
    return _table(path, name, rows, form, note)


def _rows(sheet: Any) -> list[Row]:
    """Return the rows of a sheet without the empty ones at its end."""
    sheet.reset_dimensions()  # some programs state other ones than they write
    rows = list(sheet.iter_rows(values_only=True))
    while rows and not any(cell is not None and cell != "" for cell in rows[-1]):
        rows.pop()
    return rows


def _is_value(cell: object) -> bool:
    if isinstance(cell, str):
        return cell.strip().replace(",", ".", 1).lstrip("+-").replace(".", "", 1).isdigit()
    return isinstance(cell, (int, float, *DATES)) and not isinstance(cell, bool)


def _is_word(cell: object) -> bool:
    """Return True for a text such as ``Mean``, which is no value and says no value is missing."""
    return isinstance(cell, str) and bool(cell.strip()) and not _is_value(cell) and not OBVIOUS.fullmatch(cell.strip())


def _values(row: Row) -> int:
    return sum(map(_is_value, row))


def _first_row(rows: Sequence[Row]) -> int | None:
    """Return the number of the first row of values, from 0; None when there is none."""
    most = max(1.0, median(map(_values, rows[-LAST_ROWS:])) / 2.0)
    filled = [_values(row) >= most for row in rows[: FIRST_ROWS + 1]]
    return next((n for n in range(len(filled) - 1) if filled[n] and filled[n + 1]), None)


def _text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).split())


def _is_units(row: Row, names: Row) -> bool:
    """Return True for a row of units: it is not longer than the names, and each of its texts is a unit or in brackets."""
    texts = [_text(cell) for cell in row]
    fits = all(_text(name) for name, text in zip(names, texts) if text) and any(texts)
    return fits and all(not text or text[:1] in "[(" or unit_of(text) is not None for text in texts)


def _table(path: Path, sheet: str, rows: list[Row], form: Form, note: str) -> Foreign:
    data = form.data - 1 if form.data else _first_row(rows)
    if data is None or not 0 < data < len(rows) - 1:
        raise RigError(f"{path}: sheet '{sheet}' has no rows of values below a row of names")
    above = [n for n in range(data - 1, -1, -1) if any(map(_text, rows[n]))]
    units = form.units - 1 if form.units else None
    if units is None and form.header is None and len(above) > 1 and _is_units(rows[above[0]], rows[above[1]]):
        units = above[0]
    header = form.header - 1 if form.header else next((n for n in above if n != units), None)
    if header is None or not header < data:
        raise RigError(f"{path}: sheet '{sheet}' has no names of its columns above the values in row {data + 1}")
    body, notes = rows[data:], [note]
    least = max(1.0, median(map(_values, body[:LAST_ROWS])) / 2.0)
    first = next((i for i, cell in enumerate(body[0]) if _is_value(cell)), 0)
    while len(body) > 2 and (_values(body[-1]) < least or _is_word(_at(body[-1], first))):
        row = body.pop()
        if any(map(_text, row)):
            notes.append(
                f"row {data + len(body) + 1} is no row of values and was left out: '{_text(next(filter(_text, row)))[:40]}'"
            )
    place = partial(_place, path, sheet, data)
    found, given = [], Signs(thousands=form.thousands, missing=form.missing)
    whole = signs_of(_texts(cell for row in body for cell in row), "\n", given, form.decimal)
    for i in range(max(len(rows[header]), len(body[0]))):
        cell = _at(rows[header], i)
        head, stated = _text(cell), _text(_at(rows[units], i)) if units is not None else ""
        column = [_at(row, i) for row in body]
        if not head:
            if all(one is None for one in column):
                continue
            head = f"column {i + 1}"
        name, unit = (head, unit_of(stated) or stated.strip("[]() ")) if stated else split_head(head)
        own = signs_of(_texts(column), "\n", given, form.decimal)
        signs = own if own.sure else whole  # the other columns may show what this one leaves open
        found.append(([f"column {i + 1}"], Channel(head, name, unit, Cells(head, column.copy, place, signs))))
    form = replace(form, sheet=sheet, header=header + 1, units=None if units is None else units + 1, data=data + 1)
    return Foreign(path, apart(found), form, notes=notes)


def _texts(cells: Iterable[Any]) -> str:
    return "\n".join({text for text in cells if isinstance(text, str) and "\n" not in text})


def _at(row: Row, column: int) -> Any:
    return row[column] if column < len(row) else None


def _place(path: Path, sheet: str, data: int, row: int) -> str:
    return f"{path}: sheet '{sheet}' row {data + row + 1}"


FORMAT = Format("a workbook", lambda path, head: head.startswith(ARCHIVE) and "xl/workbook.xml" in in_archive(path)[0], read_xlsx)
