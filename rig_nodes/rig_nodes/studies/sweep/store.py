# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a sweep: its manifest, a journal of finished members, and the results as Parquet.

studies.sweep.run and the verb ``sweep`` use it, and studies.tune.folder uses the journal too. A member counts as finished when its
line in the journal is whole, which its checksum shows. A line that a killed process left half written is cut off, and its
member runs again.
"""

from __future__ import annotations

import fcntl
import json
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ...analysis import every_metric, flat, loop_columns, metric_keys, unit_of
from ...base import RigError, atomic_write, optional
from .plan import Plan, Varied

if TYPE_CHECKING:
    from types import ModuleType

    import pyarrow

SWEEP, SWEEP_JOURNAL, RESULTS, BAGS = "sweep.json", "members.jsonl", "results.parquet", "bags"
KINDS = {
    "valid": "bool_",
    "why": "string",
    "undefined": "string",
    "from_gear": "int8",
    "to_gear": "int8",
}  # types of what a row has beside its metrics
METADATA = b"rig_nodes.sweep"


class Store:
    """An open folder of a sweep, a context manager that locks the folder; ``done`` holds the numbers of finished members.

    Parameters
    ----------
    folder : Path
        The folder.
    manifest : dict
        What :func:`manifest_of` of studies.sweep.run returned.

    Raises
    ------
    RigError
        When the folder holds something else, or another process works in it.
    """

    def __init__(self, folder: Path, manifest: dict) -> None:
        """Open the folder, or make it."""
        self.folder, self.manifest = Path(folder), manifest
        self._journal = open_journal(self.folder, SWEEP, SWEEP_JOURNAL, manifest, "sweep")
        self.done: set[int] = {entry["member"] for entry in self._journal.entries()}

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_error: object) -> None:
        self._journal.close()

    def add(self, entry: dict) -> None:
        """Record a finished member; the entry survives a kill of this process once this returns."""
        if entry["member"] in self.done:
            raise ValueError(f"member {entry['member']} is there already")
        self._journal.add(entry)
        self.done.add(entry["member"])

    def entries(self) -> Iterator[dict]:
        """Return what is recorded of each finished member, in the order in which the members finished."""
        return self._journal.entries()

    def write_results(self, plan: Plan) -> Path:
        """Write ``results.parquet`` of all finished members in the order of their numbers, and return its path.

        The old file stays until the new one is complete.
        """
        entries = sorted(self.entries(), key=lambda entry: entry["member"])
        table = next((one["table"]["columns"] for one in entries if "table" in one), {})
        states = dict.fromkeys(name for one in entries for row in one["shifts"] for name in flat(row))
        loops = {name: cell for one in entries for row in one["shifts"] for name, cell in loop_columns(row).items()}
        schema = schema_of(plan, self.manifest, table, sorted(states), loops)
        rows = [dict.fromkeys(schema.names) | row for entry in entries for row in rows_of(plan, entry)]
        columns = {name: [row[name] for row in rows] for name in schema.names}
        return write_table(self.folder / RESULTS, columns, schema)


class Journal:
    """A file that only grows, with a checksum for each entry; one process at a time has it open.

    Opening it cuts off what follows the last whole entry, which is what a kill during writing leaves.
    """

    def __init__(self, path: Path) -> None:
        """Open the file; RigError when another process has it open."""
        self.path, self._file = path, open(path, "a+b")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise RigError(f"{path.parent}: another process is working there; wait for it or end it") from None
        good = self._file.seek(0)
        for line in self._file:
            if decode(line) is None:
                break
            good += len(line)
        self._file.truncate(good)

    def add(self, entry: dict) -> None:
        """Record an entry; it survives a kill of this process once this returns."""
        self._file.write(encode(entry))
        self._file.flush()

    def entries(self) -> Iterator[dict]:
        """Return all entries, in the order in which they were added."""
        with open(self.path, "rb") as file:
            for line in file:
                entry = decode(line)
                if entry is None:
                    raise RigError(
                        f"{self.path}: an entry was damaged since the file was opened; start again, it goes on from the one before"
                    )
                yield entry

    def close(self) -> None:
        """Release the file for other processes."""
        self._file.close()


def open_journal(folder: Path, name: str, journal: str, manifest: dict, what: str) -> Journal:
    """Open the journal of a new piece of work, or of the same that was begun before.

    Parameters
    ----------
    folder : Path
        Its folder; it is made when it does not exist.
    name, journal : str
        Names of the files with the manifest and with the journal.
    manifest : dict
        What decides the work.
    what : str
        What the work is, for errors: sweep or tuning.

    Raises
    ------
    RigError
        When the folder holds something else, cannot be read, or another process works in it.
    """
    if not begun(folder, name, manifest, what):
        folder.mkdir(parents=True, exist_ok=True)
        atomic_write(folder / name, json.dumps(manifest, indent=1, ensure_ascii=False) + "\n")
    return Journal(folder / journal)


def begun(folder: Path, name: str, manifest: dict, what: str, apart: Iterable[str] = ()) -> bool:
    """Return whether a piece of work was begun in a folder; the arguments are as for :func:`open_journal`.

    ``apart`` holds keys of the manifest that are not compared. RigError when the folder holds something else or cannot be read.
    """
    path = folder / name
    if not path.exists():
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RigError(f"{folder}: it exists and holds no {what}; choose a new name")
        return False
    before = _read_json(path, what)
    if (why := differs(before, manifest | {key: before.get(key) for key in apart})) is not None:
        raise RigError(f"{folder} holds another {what} ({why} is not the same); choose a new one")
    return True


def _read_json(path: Path, what: str) -> dict:
    """Return the manifest in a file; RigError when it cannot be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict):
            raise ValueError("it is no map")
    except (OSError, ValueError) as error:
        raise RigError(f"{path}: cannot be read ({error}); start the {what} in a new folder") from None
    return found


def encode(entry: dict) -> bytes:
    """Return an entry as a line of the journal: checksum, content."""
    text = json.dumps(entry, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def decode(line: bytes) -> dict | None:
    """Return the content of a line; None when the line is not whole."""
    if not line.endswith(b"\n") or line[8:9] != b" ":
        return None
    text = line[9:-1]
    if line[:8] != b"%08x" % zlib.crc32(text):
        return None
    return json.loads(text)


def read_manifest(folder: str | Path) -> dict:
    """Return the manifest of a sweep's folder; RigError when the folder holds none."""
    path = Path(folder) / SWEEP
    if not path.is_file():
        raise RigError(f"{folder}: holds no sweep (no {SWEEP} in it)")
    manifest = _read_json(path, "sweep")
    if "plan" not in manifest:
        raise RigError(f"{path}: cannot be read (no plan in it); start the sweep in a new folder")
    return manifest


def differs(one: dict, other: dict) -> str | None:
    """Return the first key in which two manifests differ, e.g. "plan.seed"; None when they are equal."""
    for key in dict.fromkeys([*one, *other]):
        a, b = one.get(key), other.get(key)
        if a != b:
            inside = differs(a, b) if isinstance(a, dict) and isinstance(b, dict) else None
            return f"{key}.{inside}" if inside else str(key)
    return None


def parquet() -> tuple[ModuleType, ModuleType]:
    """Return (pyarrow, pyarrow.parquet); RigError when they cannot be loaded."""
    return optional("pyarrow"), optional("pyarrow.parquet")


def write_table(path: Path, columns: Mapping[str, list], schema: pyarrow.Schema) -> Path:
    """Write columns as a Parquet file and return its path; an old file stays until the new one is complete."""
    pa, pq = parquet()
    temporary = path.with_suffix(".part")
    pq.write_table(pa.table(dict(columns), schema=schema), temporary, compression="zstd")
    os.replace(temporary, path)
    return path


# ---- the table


def rows_of(plan: Plan, entry: dict) -> list[dict]:
    """Return the rows of a member: one for each of its shifts, or of its calculation's table; one without results otherwise."""
    shared = {
        "member": entry["member"],
        "seed": entry["seed"],
        **{one.name: entry["values"][one.name] for one in plan.varied if one.of != "seed"},
        "end": entry["end"]["state"],
        "reason": entry["end"]["reason"],
    }
    if plan.calculation:
        table = entry.get("table", {"columns": {}, "rows": [[]]})
        return [{**shared, **dict(zip(map(column_of, table["columns"]), row))} for row in table["rows"]]
    out = []
    for number, found in enumerate(entry["shifts"] or [None], 1):
        row = {**shared, "shift": None if found is None else number}
        for key in metric_keys():
            value = None if found is None else found.get(key)
            row[key] = _text_of(value) if KINDS.get(key) == "string" else value
        loops = {name: value for name, (value, _) in loop_columns(found or {}).items()}
        out.append(loops | row | flat(found or {}))
    return out


def _text_of(value: list[str] | Mapping[str, str] | None) -> str | None:
    """Return reasons as one text; those of a map have its keys in front."""
    if value is None:
        return None
    return "; ".join(f"{key}: {text}" for key, text in value.items()) if isinstance(value, Mapping) else "; ".join(value)


def column_of(name: str) -> str:
    """Return the name of a calculation's column in the results, where it must not hide one of the sweep's own."""
    return f"table.{name}"


def schema_of(
    plan: Plan, manifest: dict, table: Mapping[str, str], states: Iterable[str], loops: Mapping[str, tuple[float | str, str]]
) -> pyarrow.Schema:
    """Return the columns with their units, also of the calculation's table, states and loops, and the manifest as metadata."""
    pa, _ = parquet()

    def column(name: str, kind: pyarrow.DataType, unit: str | None = None, about: str | None = None) -> pyarrow.Field:
        metadata = {key: value for key, value in (("unit", unit), ("about", about)) if value}
        return pa.field(name, kind, metadata=metadata or None)

    columns = [
        column("member", pa.int64(), about="number of the run"),
        column("seed", pa.int64(), about="of the run's noise"),
        *(column(one.name, _kind(pa, one), one.unit, f"parameter of the {one.of}") for one in plan.varied if one.of != "seed"),
    ]
    if not plan.calculation:
        columns.append(column("shift", pa.int32(), about="number of the shift in its run, from 1; empty where there was none"))
        taken = {one.name for one in plan.varied}
        for name, (value, unit) in loops.items():
            if name not in taken:
                kind = pa.string() if isinstance(value, str) else pa.float64()
                columns.append(column(name, kind, unit, "of a loop of the sequence"))
    for name, unit in table.items():
        columns.append(
            column(column_of(name), pa.float64() if unit else pa.string(), unit, f"of the calculation {plan.calculation}")
        )
    if not plan.calculation:
        units = {"t_order_s": "s", **{metric.key: metric.unit for metric in every_metric() if metric.unit != "-"}}
        columns += [column(key, getattr(pa, KINDS.get(key, "float64"))(), units.get(key)) for key in metric_keys()]
    columns += [column(name, pa.float64(), unit_of(name), "of the rig when the shift was ordered") for name in states]
    columns += [column("end", pa.string(), about="how the run ended"), column("reason", pa.string())]
    return pa.schema(columns, metadata={METADATA: json.dumps(manifest, ensure_ascii=False).encode()})


def _kind(pa: ModuleType, one: Varied) -> pyarrow.DataType:
    return pa.string() if one.unit is None else pa.int64() if one.unit == "" else pa.float64()
