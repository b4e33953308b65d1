# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of Parquet files; a column becomes numbers, texts or times when it is asked for."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import RigError
from ..cells import Cells, Signs, signs_of
from ..files import pyarrow
from ..foreign import Channel, Foreign, Form
from ..provenance import KEY, read_provenance
from ..units import split_head
from .format import Format
from .heads import apart

if TYPE_CHECKING:
    from collections.abc import Iterator


def read_parquet(path: Path, form: Form) -> Foreign:
    """Read a Parquet file.

    Parameters
    ----------
    path : Path
        The file.
    form : Form
        How the numbers in texts are written.

    Returns
    -------
    Foreign
        Its columns; fields of a struct are columns of their own, named ``struct.field``.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    pa, parquet = pyarrow()
    with parquet.ParquetFile(path) as file:  # read_table takes no heads that are there twice
        table = file.read()
    if not table.num_columns or table.num_rows < 2:
        raise RigError(f"{path}: holds {table.num_columns} columns with {table.num_rows} rows; a recording needs more")
    found, texts = [], [column for _, field, column in _flat(pa, table) if _is_text(pa, field.type)]
    for number, (name, field, column) in enumerate(_flat(pa, table), 1):
        plain, unit = split_head(name)
        stated = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
        cells = Cells(name, partial(_cells, pa, field.type, column), partial(_place, path), stated=_kind(pa, field.type))
        if _is_text(pa, field.type):
            own = _signs([column], form)
            cells.signs = own if own.sure else _signs(texts, form)  # the other columns may show what this one leaves open
        found.append(([f"column {number}"], Channel(name, name if stated else plain, stated or unit, cells)))
    return Foreign(path, apart(found), provenance=read_provenance((table.schema.metadata or {}).get(KEY.encode())))


def _place(path: Path, row: int) -> str:
    return f"{path}: row {row + 1}"


def _flat(pa: Any, table: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, field and column of each column, and of each field of those that are structs."""
    waiting = list(zip(table.column_names, table.schema, table.columns))
    while waiting:
        name, field, column = waiting.pop(0)
        if pa.types.is_struct(field.type):
            parts = column.combine_chunks().flatten() if column.num_chunks else []
            fields = [field.type.field(n) for n in range(field.type.num_fields)]
            waiting[:0] = [(f"{name}.{one.name}", one, part) for one, part in zip(fields, parts)]
        else:
            yield name, field, column


def _is_text(pa: Any, kind: Any) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind)


def _signs(columns: list, form: Form) -> Signs:
    texts = "\n".join(text for column in columns for text in map(str, column.unique().to_pylist()) if "\n" not in text)
    return signs_of(texts, "\n", Signs(thousands=form.thousands, missing=form.missing), form.decimal)


def _kind(pa: Any, kind: Any) -> str:
    """Return the type by its name, where it is none of those that need no word."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    if pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind) or pa.types.is_decimal(kind):
        return "numbers"
    if pa.types.is_temporal(kind) and not pa.types.is_interval(kind):
        return "dates and times in UTC" if pa.types.is_timestamp(kind) and kind.tz else "dates and times"
    return "no values" if pa.types.is_null(kind) else "" if _is_text(pa, kind) else str(kind)  # texts may be numbers


def _cells(pa: Any, kind: Any, column: Any) -> Any:
    """Return the cells of a column as Cells takes them."""
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = kind.value_type
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        if pa.types.is_integer(kind) and not column.null_count:
            return column.to_numpy()
        return np.array(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), float)
    if pa.types.is_decimal(kind):
        return np.array([np.nan if one is None else float(one) for one in column.to_pylist()])
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        ints = column.cast(pa.int64())
        empty = np.asarray(ints.is_null().to_numpy(zero_copy_only=False), bool)
        whole = ints.fill_null(0).to_numpy().astype(f"{'M' if pa.types.is_timestamp(kind) else 'm'}8[{kind.unit}]")
        whole[empty] = np.array("NaT", whole.dtype)
        return whole
    if pa.types.is_date(kind):
        days = column.cast(pa.date32()).cast(pa.int32())
        empty = np.asarray(days.is_null().to_numpy(zero_copy_only=False), bool)
        whole = days.fill_null(0).to_numpy().astype(np.int64).astype("M8[D]")
        whole[empty] = np.datetime64("NaT")
        return whole
    if pa.types.is_time(kind) or _is_text(pa, kind):
        return column.to_pylist()
    return None


FORMAT = Format("Parquet", lambda _path, head: head.startswith(b"PAR1"), read_parquet)
