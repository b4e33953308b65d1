# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of loggers and of other tools as channels with a name, a unit, values and, where the file has them, times.

exchange.imported makes measurements of them. Facts about a CSV that are not given (encoding, delimiter, decimal sign, lines of the
head) are found from its content.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..bags import limits
from ..errors import RigError, no_file
from .files import pyarrow
from .kinds import MATLAB, MDF, PARQUET, TDMS, TEXT, kind_of
from .provenance import KEY, csvw_path, read_provenance
from .units import split_head, unit_of

if TYPE_CHECKING:
    from ..arrays import Floats

LARGEST = 4 << 30  # bytes of a file, which is read as a whole
DELIMITERS = (";", "\t", "|", ",")
CUT = "the file is cut off; what it holds until there was taken"
MISSING = ("", "nan", "NaN", "---")
HEAD_LINES = 200  # lines in which the first row of values is looked for
LOOKED_AT = 60  # lines from which delimiter and decimal sign are found


@dataclass(frozen=True)
class Form:
    """Form of a CSV file; a fact that is None is found from the file's content. Lines count from 1.

    Attributes
    ----------
    encoding, delimiter, decimal : str or None
        The encoding by its name in Python, and the two signs.
    header, units, data : int or None
        Lines of the names, of the units when they have a line of their own, and of the first values.
    missing : tuple of str
        Texts of cells that have no value.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    header: int | None = None
    units: int | None = None
    data: int | None = None
    missing: tuple[str, ...] = MISSING


@dataclass(frozen=True)
class Channel:
    """One channel of a file.

    Attributes
    ----------
    head, name, unit : str
        Its head, which no other channel of the file should have, and the name and unit in it.
    values : (n,) array of float
        Values in the unit; NaN where there is none.
    times : (n,) array of float, optional
        Its own times [s], where the file has them.
    over : str
        What it is recorded over in place of times, such as an angle.
    """

    head: str
    name: str
    unit: str
    values: Floats
    times: Floats | None = None
    over: str = ""


@dataclass(frozen=True)
class Foreign:
    """A file: its channels in their order, its form when it is text, and its provenance when it is an exported run.

    ``start`` is the date of time 0 [s since 1970-01-01 UTC], where the file has it beside its times; ``notes`` are
    for its user, as sentences.
    """

    path: Path
    channels: list[Channel]
    form: Form = field(default_factory=Form)
    provenance: dict | None = None
    start: float | None = None
    notes: tuple[str, ...] = ()

    def row(self, number: int) -> str:
        """Return the place of a row in the file, for errors."""
        return f"line {number + self.form.data}" if self.form.data else f"row {number + 1}"

    def digest(self) -> str:
        """Return the SHA-256 of the file."""
        with open(self.path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def read_foreign(path: str | Path, form: Form | None = None) -> Foreign:
    """Read a file.

    Parameters
    ----------
    path : str or Path
        CSV, Parquet, MDF, MAT, xlsx or TDMS, by its content.
    form : Form, optional
        Form of a CSV file.

    Returns
    -------
    Foreign
        The channels.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    path = Path(path)
    if not path.is_file():
        raise RigError(f"{path}: {no_file(path)}")
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise RigError(f"{path}: has {size} bytes, and a file is read as a whole, at most {LARGEST}; split it")
        if not size:
            raise RigError(f"{path}: is empty")
        return _read(path, form or Form())
    except OSError as error:
        raise RigError(f"{path}: cannot be read ({error.strerror or error})") from None


def _read(path: Path, form: Form) -> Foreign:
    kind = kind_of(path)
    if kind == TEXT:
        return _text(path, form)
    if kind == PARQUET:
        return _table(path)
    if kind == MDF:
        from .mdf import read_mdf

        return read_mdf(path)
    if kind == MATLAB:
        from .matlab import read_matlab

        return read_matlab(path)
    if kind == TDMS:
        from .tdms import read_tdms

        return read_tdms(path)
    from .xlsx import read_xlsx

    return read_xlsx(path, form)


def _text(path: Path, form: Form) -> Foreign:
    lines = _decoded(path, form).splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    form = _found(path, lines, form)
    heads = _fields(lines[form.header - 1], form.delimiter)
    while heads and not heads[-1]:
        heads.pop()  # a delimiter at the end of the line
    units = [""] * len(heads)
    if form.units:
        units = [*_fields(lines[form.units - 1], form.delimiter), *units][: len(heads)]
    table = _numbers(path, lines[form.data - 1 :], form, len(heads))
    channels = []
    for head, unit, values in zip(heads, units, table):
        name, own = (head, unit_of(unit) or unit.strip("[]() ")) if unit else split_head(head)
        channels.append(Channel(head, name, own, values))
    return Foreign(path, channels, form, _csvw(path))


def _csvw(path: Path) -> dict | None:
    about = csvw_path(path)
    if not about.is_file() or about.stat().st_size > limits.JSON:
        return None
    try:
        found = json.loads(about.read_text(encoding="utf-8"))
    except (ValueError, RecursionError, OSError):
        return None
    return read_provenance(json.dumps(found.get(KEY))) if isinstance(found, dict) else None


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
    if b"\0" in data[:4096]:
        raise RigError(f"{path}: is not text, although its ending is {path.suffix}; export it from the logger's program as CSV")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1250", errors="replace")  # German and Polish letters are the same in it as in cp1252


def _fields(line: str, delimiter: str | None) -> list[str]:
    return [one.strip() for one in next(csv.reader([line], delimiter=delimiter or "\t"), [])]


def _number(text: str, form: Form) -> float | None:
    """Return the number of a cell, NaN where it is empty; None when it is something else."""
    text = text.strip()
    if text in form.missing:
        return np.nan
    if form.decimal == ",":
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return _time_of_day(text)


def _time_of_day(text: str) -> float | None:
    """Return seconds of ``12:34:56.789`` with or without a date before it; None for anything else."""
    parts = text.replace("T", " ").split(" ")[-1].split(":")
    if len(parts) not in (2, 3):
        return None
    try:
        hours, minutes, seconds = float(parts[0]), float(parts[1]), float(parts[2] if len(parts) == 3 else 0.0)
    except ValueError:
        return None
    return 3600.0 * hours + 60.0 * minutes + seconds


def _found(path: Path, lines: list[str], form: Form) -> Form:
    """Return the form, completed with all that was not given."""
    last = [line for line in lines[-LOOKED_AT:] if line.strip()]
    for name, number in (("header", form.header), ("units", form.units), ("data", form.data)):
        if number is not None and not 1 <= number <= len(lines):
            raise RigError(f"{path}: has {len(lines)} lines, and line {number} is given as that of the {name}")
    if form.delimiter is None:
        counts = {sign: {len(_fields(line, sign)) for line in last[-20:]} for sign in DELIMITERS}
        sign = next((sign for sign, found in counts.items() if max(found, default=1) > 1), None)
        form = replace(form, delimiter=sign or ";")
    if form.decimal is None:
        commas = form.delimiter != "," and any("," in one for line in last for one in _fields(line, form.delimiter))
        form = replace(form, decimal="," if commas else ".")
    if form.data is None:
        form = replace(form, data=_first_row(path, lines, form))
    if form.header is None:
        above = [n for n in range(form.data - 1, 0, -1) if lines[n - 1].strip() and not lines[n - 1].lstrip().startswith("#")]
        if not above:
            raise RigError(f"{path}: has no line with the names of its columns above the values in line {form.data}")
        if form.units is None and len(above) > 1:
            units, names = (_fields(lines[n - 1], form.delimiter) for n in above[:2])
            if len(units) >= len(names) > 1 and any(units) and all(not one or one[:1] in "[(" or unit_of(one) for one in units):
                form = replace(form, units=above[0])
        form = replace(form, header=next(n for n in above if n != form.units))
    if not form.header < form.data or (form.units and not form.units < form.data):
        raise RigError(
            f"{path}: the values are given as beginning in line {form.data}, which is not below the names in line {form.header}"
        )
    return form


def _first_row(path: Path, lines: list[str], form: Form) -> int:
    def is_row(line: str) -> bool:
        numbers = [_number(one, form) for one in _fields(line, form.delimiter)]
        return bool(numbers) and None not in numbers and not np.all(np.isnan(np.array(numbers, float)))

    for n, line in enumerate(lines[:HEAD_LINES]):
        if line.strip() and is_row(line) and all(is_row(other) for other in lines[n + 1 : n + 2]):
            return n + 1
    signs = f"delimiter '{form.delimiter}' and decimal '{form.decimal}'"
    raise RigError(f"{path}: no row of numbers is among its first {min(len(lines), HEAD_LINES)} lines, with {signs}")


def _numbers(path: Path, lines: list[str], form: Form, columns: int) -> Floats:
    """Return the values of each column, (columns, rows)."""
    if len(lines) < 2:
        raise RigError(f"{path}: has {len(lines)} rows below its header; a recording needs more")
    text = "\n".join(lines)
    if form.decimal == "," and form.delimiter != ",":
        text = text.replace(",", ".")
    try:  # this is fast, and reads neither empty cells nor times of day
        table = np.loadtxt(io.StringIO(text), delimiter=form.delimiter, ndmin=2, comments=None, usecols=range(columns))
        if len(table) == len(lines) and not np.isinf(table).any():
            for one in form.missing:
                if (number := _number(one, replace(form, missing=()))) is not None:
                    table[table == number] = np.nan
            return np.ascontiguousarray(table.T)
    except ValueError:
        pass
    out = np.empty((len(lines), columns))
    for n, cells in enumerate(csv.reader(lines, delimiter=form.delimiter)):
        place = f"{path}: line {form.data + n}"
        if not any(cells):
            raise RigError(f"{place} is empty; rows must follow each other")
        if len(cells) < columns:
            raise RigError(f"{place} has {len(cells)} fields where the header names {columns}")
        for i, cell in enumerate(cells[:columns]):
            number = _number(cell, form)
            if number is None or np.isinf(number):
                hint = f"; with '{form.delimiter}' between columns the decimal sign is '{form.decimal}'"
                raise RigError(f"{place} has '{cell.strip()[:40]}' where a number is expected{hint}")
            out[n, i] = number
    return np.ascontiguousarray(out.T)


def _table(path: Path) -> Foreign:
    pa, parquet = pyarrow()
    try:
        table = parquet.read_table(path)
    except (pa.ArrowException, ValueError) as error:
        raise RigError(f"{path}: cannot be read as Parquet ({str(error).splitlines()[0]})") from None
    channels = []
    for one, column in zip(table.schema, table.columns):
        if pa.types.is_timestamp(one.type):
            values = column.cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy().astype(float) * 1e-9
            channels.append(Channel(one.name, one.name, "s", values))
        elif pa.types.is_floating(one.type) or pa.types.is_integer(one.type) or pa.types.is_boolean(one.type):
            name, unit = split_head(one.name)
            stated = (one.metadata or {}).get(b"unit", b"").decode(errors="replace")
            values = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
            channels.append(Channel(one.name, one.name if stated else name, stated or unit, np.array(values, float)))
    if not channels or table.num_rows < 2:
        raise RigError(f"{path}: holds {len(channels)} columns of numbers with {table.num_rows} rows; a recording needs more")
    return Foreign(path, channels, provenance=read_provenance((table.schema.metadata or {}).get(KEY.encode())))


def named(channels: Sequence[Channel], head: str, where: str) -> Channel | None:
    """Return the channel with this head, this name or this last part of a path; RigError, with ``where``, when several have it."""
    found = [one for one in channels if one.head == head] or [one for one in channels if one.name == head]
    found = found or [one for one in channels if one.head.endswith((f".{head}", f"/{head}"))]
    if len(found) > 1:
        shown = ", ".join(f"'{one.head}'" for one in found[:4])
        raise RigError(
            f"{where}: '{head}' is there {len(found)} times, as {shown}{' and more' if len(found) > 4 else ''}; name one of these"
        )
    return found[0] if found else None
