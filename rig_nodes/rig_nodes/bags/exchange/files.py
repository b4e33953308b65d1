# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writers of an exported run: CSV and Parquet as one table, MDF4 and MAT with a group for each clock.

`rig export` uses them. Each file appears whole or not at all.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import RigError, atomic_write, not_written, optional
from .groups import Column, Group, Rows, Signals, on_one_clock, on_own_clocks
from .provenance import CSV_DIGEST, KEY, csvw_path, digest_of, lines_of, provenance_of, text_of

if TYPE_CHECKING:
    from ...base import Floats
    from ..reader import Bag

# endings by what is exported of a run; runs/can_log.py writes the last three
FILE_KINDS = {
    "csv": (".csv",),
    "parquet": (".parquet",),
    "mf4": (".mf4",),
    "mat": (".mat",),
    "blf": (".blf",),
    "asc": (".asc",),
    "log": (".log",),
}
TIME = "t"
DATED = 3e7  # s; the times of a file that was imported and began later are dates, from 1970
MAT_LARGEST = 1 << 30  # bytes; a MAT file is made in memory as a whole
_NO_FIELD = re.compile(r"\W")


def pyarrow() -> tuple[Any, Any]:
    """Return pyarrow and pyarrow.parquet; RigError, with the remedy, when they cannot be loaded."""
    return optional("pyarrow"), optional("pyarrow.parquet")


@dataclass(frozen=True)
class Order:
    """What is to be written: signals, file, period of the table [ns] or None for the signals' own times, progress callback."""

    signals: Signals
    target: Path
    clock: int | None = None
    progress: Callable[[float, str], None] | None = None

    @property
    def columns(self) -> list[Column]:
        """All columns in the order of the table."""
        return [column for group in self.signals.groups for column in group.columns]

    def rows(self) -> Iterator[Rows]:
        """Yield the rows of the table."""
        parts = self.signals.parts(self.progress)
        groups = self.signals.groups
        return on_own_clocks(groups, parts) if self.clock is None else on_one_clock(groups, parts, self.clock)


def export(kind: str, order: Order) -> None:
    """Write the file.

    Parameters
    ----------
    kind : str
        Key of FILE_KINDS.
    order : Order
        What is to be written.

    Raises
    ------
    RigError
        When the run cannot be read, a package is missing or the file cannot be written.
    """
    {"csv": _csv, "parquet": _parquet, "mf4": _mf4, "mat": _mat}[kind](order)


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """Yield a temporary name to write to; the file is renamed when the block ends without an error, and deleted otherwise."""
    part = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        yield part
        os.replace(part, target)
    except OSError as error:
        raise not_written(f"{target}: it", error) from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _csv(order: Order) -> None:
    columns = order.columns
    with whole(order.target) as part:
        with open(part, "w", encoding="utf-8", newline="") as file:
            file.write(",".join([f"{TIME} [s]", *(f"{one.name} [{one.unit}]" for one in columns)]) + "\n")
            for rows in order.rows():
                cells = [[repr(t / 1e9) for t in rows.times.tolist()]]
                cells += [["" if x != x else repr(x) for x in column] for column in rows.values.T.tolist()]
                file.writelines(",".join(row) + "\n" for row in zip(*cells))
        about, described = csvw_path(order.target), {**_csvw(order), CSV_DIGEST: digest_of(part)}
        atomic_write(about, json.dumps(described, ensure_ascii=False, indent=1) + "\n")


def _csvw(order: Order) -> dict:
    """Return the description of the CSV file by the W3C's "Metadata Vocabulary for Tabular Data"."""
    provenance = provenance_of(order.signals.small)
    columns = [Column(TIME, "s", "Time of the run."), *order.columns]
    return {
        "@context": "http://www.w3.org/ns/csvw",
        "url": order.target.name,
        "tableSchema": {
            "columns": [
                {"titles": f"{one.name} [{one.unit}]", "name": _field(one.name), "datatype": "double", "dc:description": one.text}
                for one in columns
            ]
        },
        **{f"rig:{name}": value for name, value in lines_of(provenance)},
        KEY: provenance,
    }


def arrow_schema(signals: Signals) -> Any:
    """Return the columns of a pyarrow.Table of signals, with their units, and the run's provenance as its metadata."""
    pa, _ = pyarrow()
    provenance = provenance_of(signals.small)
    columns = [Column(TIME, "s", "Time of the run."), *(column for group in signals.groups for column in group.columns)]
    return pa.schema(
        [pa.field(one.name, pa.float64(), metadata={"unit": one.unit, "description": one.text}) for one in columns],
        metadata={KEY: text_of(provenance), **dict(lines_of(provenance))},
    )


def arrow_table(rows: Rows, schema: Any) -> Any:
    """Return rows as a pyarrow.Table; what has no value is null."""
    pa, _ = pyarrow()
    arrays = [pa.array(rows.times / 1e9), *(pa.array(column, from_pandas=True) for column in rows.values.T)]
    return pa.table(arrays, schema=schema)


def _parquet(order: Order) -> None:
    _, parquet = pyarrow()
    schema = arrow_schema(order.signals)
    with whole(order.target) as part, parquet.ParquetWriter(part, schema, compression="zstd") as writer:
        for rows in order.rows():
            writer.write_table(arrow_table(rows, schema))


def _mf4(order: Order) -> None:
    package = optional("asammdf", "mdf")
    groups, provenance = order.signals.groups, provenance_of(order.signals.small)
    place: dict[int, int] = {}
    with whole(order.target) as part, package.MDF(version="4.10") as file:
        file.header.start_time = started(order.signals.small, order.signals.length)
        file.header.comment = "; ".join(f"{name}: {value}" for name, value in lines_of(provenance))
        file.attach(text_of(provenance).encode(), file_name=f"{KEY}.json", mime="application/json", embedded=True)
        for rows in chain.from_iterable(order.signals.parts(order.progress)):
            times = rows.times / 1e9
            if rows.group not in place:
                group = groups[rows.group]
                made = [
                    package.Signal(np.ascontiguousarray(values), times, one.unit, one.name, comment=one.text)
                    for one, values in zip(group.columns, rows.values.T)
                ]
                place[rows.group] = file.append(made, acq_name=group.topic, comment=group.topic, common_timebase=True)
            else:
                file.extend(place[rows.group], [(times, None), *((np.ascontiguousarray(v), None) for v in rows.values.T)])
        made_at = part.with_suffix(".mf4")
        file.save(made_at, overwrite=True, compression=2)
        os.replace(made_at, part)


def started(small: Bag, length: int) -> datetime:
    """Return the date of a run.

    Parameters
    ----------
    small : Bag
        Description of the run.
    length : int
        Time from its first message to its last one [ns].

    Returns
    -------
    datetime
        The date of the measurement that was imported; otherwise when the bag was written, less its length.
    """
    about = small.run_info().get("imported")
    facts = [about.get(name) for name in ("start", "time_zero_s")] if isinstance(about, dict) else []
    start = next((float(one) for one in facts if isinstance(one, (int, float)) and DATED < one < 1e10), None)
    if start is None:
        files = [small.path] if small.path.is_file() else small.path.glob("*.mcap")
        start = max(one.stat().st_mtime for one in files) - length / 1e9
    return datetime.fromtimestamp(start, UTC)


def _mat(order: Order) -> None:
    from scipy.io import savemat

    groups, size = order.signals.groups, 8 * order.signals.rows()
    if size > MAT_LARGEST:
        raise RigError(
            f"{order.target}: would take some {size / 1e9:.1f} GB, and a MAT file is made in memory, at most "
            f"{MAT_LARGEST / 1e9:.1f} GB; choose fewer signals with --signals, cut the run with 'rig bag cut', or write mf4"
        )
    parts: list[list] = [[] for _ in groups]
    for rows in chain.from_iterable(order.signals.parts(order.progress)):
        parts[rows.group].append(rows)
    provenance = provenance_of(order.signals.small)
    found: dict[str, Any] = {KEY.replace(".", "_"): {**dict(lines_of(provenance)), "json": text_of(provenance)}}
    for group, held in zip(groups, parts):
        if held:
            table = np.concatenate([rows.values for rows in held])
            found[_field(group.topic.strip("/"))] = _struct(group, np.concatenate([rows.times for rows in held]) / 1e9, table)
    with whole(order.target) as part, open(part, "wb") as file:
        savemat(file, found, long_field_names=True, do_compression=True, oned_as="column")


def _struct(group: Group, times: np.ndarray, table: Floats) -> dict:
    fields = [_field(one.name) for one in group.columns]
    return {
        TIME: times,
        **{field: np.ascontiguousarray(column) for field, column in zip(fields, table.T)},
        "units": {TIME: "s", **{field: one.unit for field, one in zip(fields, group.columns)}},
        "names": {field: one.name for field, one in zip(fields, group.columns)},
        "topic": group.topic,
    }


def _field(name: str) -> str:
    """Return a name that is valid for a field or a variable in MATLAB."""
    text = _NO_FIELD.sub("_", name)
    return (text if text[:1].isalpha() else f"s_{text}")[:63]
