# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measuring procedures of the laboratory: YAML files of a sequence, the series for which it is run, and the number of repeats.

``rig procedure`` and the validation use them; runs.campaign runs many series on all cores.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base import (
    SI,
    RigError,
    beside,
    brief,
    check_keys,
    dimension_of_text,
    find_of_rigs,
    load_yaml,
    quantity,
    rig_of,
    rig_with,
    unknown,
    where_of,
)
from ..rig import RigConfig, load_rig, with_overrides
from .filled import filled
from .recorded import Run, record
from .sequence import Sequence, load_sequence

if TYPE_CHECKING:
    from ..base import Map

MOST_REPEATS = 100
MOST_SERIES = 2000  # of a procedure
BLOCK_KEYS = ("table", "grid", "label", "conditions", "parameters", "settings")


class Condition(NamedTuple):
    """What a series is run under: a number [SI] with its SI unit, a whole number, or a word."""

    value: float | int | str
    unit: str = ""


@dataclass(frozen=True)
class Series:
    """One setting under which a procedure is run.

    Parameters
    ----------
    procedure : str
        Name of the procedure.
    label : str
        Short name, unique in its procedure.
    conditions : dict
        Values by the names of rig.conditions [SI].
    sequence, rig : str
        Name of the sequence, or its file, and the rig for which it is written.
    parameters : dict of str to str
        Parameters of the sequence.
    overrides : dict of str to str
        Settings of the rig.
    repeats : int
        Number of runs.
    period : float or None
        Time from row to row [s]; None for that of the rig's logger.
    first_seed : int
        Seed of the first repeat; those of the others follow, and no two runs of a procedure have the same seed.
    """

    procedure: str
    label: str
    conditions: dict[str, float | int | str]
    units: dict[str, str]
    sequence: str
    rig: str
    parameters: dict[str, str]
    overrides: dict[str, str]
    repeats: int
    period: float | None
    first_seed: int

    @property
    def about(self) -> dict[str, Any]:
        """What `procedure.json` says of it."""
        return {"label": self.label, "conditions": self.conditions, "units": self.units}


@dataclass(frozen=True)
class Procedure:
    """A checked procedure; ``source`` names the description of the laboratory's procedure."""

    name: str
    description: str
    source: str
    sequence: str
    repeats: int
    all_series: tuple[Series, ...]

    @property
    def about(self) -> dict[str, str]:
        """What `procedure.json` says of it."""
        return {"procedure": self.name, "description": self.description, "source": self.source}

    def series(self, chosen: list[str] | None = None) -> list[Series]:
        """Return the series of the procedure, in its order.

        Parameters
        ----------
        chosen : list of str, optional
            Labels or numbers of series; all series when it is not given.

        Returns
        -------
        list of Series
            The chosen series.

        Raises
        ------
        RigError
            When there is no series of a name.
        """
        if chosen is None:
            return list(self.all_series)
        out = set()
        for name in chosen:
            found = [
                k
                for k, series in enumerate(self.all_series)
                if name == series.label or name == str(series.conditions.get("series"))
            ]
            if not found:
                labels = (series.label for series in self.all_series)
                raise RigError(f"procedure '{self.name}': {unknown('series', name, labels)}")
            out.update(found)
        return [self.all_series[k] for k in sorted(out)]


def load_procedure(name: str | Path, default: str | None = None) -> Procedure:
    """Return an installed procedure by its name, or one from a file; RigError with file and line when something is not right.

    ``default`` is the rig of a sequence that names none, as for :func:`base.names.rig_of`.
    """
    path = find_of_rigs("procedures", name, default)
    node = load_yaml(path)
    needed = ("description", "source", "sequence", "repeats", "series")
    check_keys(path, node, (*needed, "period", "settings"), needed, "the procedure")
    repeats = node["repeats"]
    if not isinstance(repeats, int) or isinstance(repeats, bool) or not 1 <= repeats <= MOST_REPEATS:
        raise RigError(
            f"{where_of(path, node, 'repeats')}: repeats is {brief(repeats)}, expected a whole number from 1 to {MOST_REPEATS}"
        )
    period = None
    if "period" in node:
        period = quantity(node["period"], "time", f"{where_of(path, node, 'period')}: period")
    blocks = node["series"]
    if not isinstance(blocks, list) or not blocks:
        raise RigError(f"{where_of(path, node, 'series')}: series must be a list with at least one block")
    sequence = _sequence(node, path, default)
    rig = rig_of(sequence, default)
    names = _names(rig)
    settings = _texts(node, "settings", {}, path)
    name, all_series, labels = Path(path).stem, [], set()
    for k, block in enumerate(blocks):
        check_keys(path, block, BLOCK_KEYS, ("label", "conditions"), "a block of series", where_of(path, blocks, k))
        where = where_of(path, block)
        for row in _rows(block, path, where):
            label = "".join(filled(str(block["label"]), row, where, "name").split())  # it names a folder too
            if label in labels:
                raise RigError(f"{where}: the label {brief(label)} is there twice")
            labels.add(label)
            conditions = _conditions(block, row, path, names)
            if len(labels) > MOST_SERIES:
                raise RigError(f"{where}: the procedure has more than {MOST_SERIES} series")
            all_series.append(
                Series(
                    name,
                    label,
                    {name: one.value for name, one in conditions.items()},
                    {name: one.unit for name, one in conditions.items() if one.unit},
                    sequence,
                    rig,
                    _texts(block, "parameters", row, path),
                    {**settings, **_texts(block, "settings", row, path)},
                    repeats,
                    period,
                    1 + len(all_series) * repeats,
                )
            )
    return Procedure(name, str(node["description"]), str(node["source"]), sequence, repeats, tuple(all_series))


def _sequence(node: Map, path: str | Path, default: str | None) -> str:
    """The name of the sequence, or its file, which is found from the folder of the procedure's file."""
    name = beside(path, node["sequence"])
    try:
        name = str(find_of_rigs("sequences", name, rig_with(path), default))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'sequence')}: sequence: {error}") from None
    return name


def _rows(block: Map, path: str | Path, where: str) -> list[dict[str, str]]:
    """The values of the ${names} of a block, once for each of its series."""
    if "table" in block and "grid" in block:
        raise RigError(f"{where}: a block of series has a table or a grid, not both")
    if "table" in block:
        return read_table(Path(path).parent / str(block["table"]), f"{where_of(path, block, 'table')}: table")
    grid, most = block.get("grid") or {}, 1
    if not isinstance(grid, dict):
        raise RigError(f"{where_of(path, block, 'grid')}: grid must be a map of names and their values, found {brief(grid)}")
    for name, values in grid.items():
        if not isinstance(values, list) or not values:
            raise RigError(f"{where_of(path, grid, name)}: grid.{name} must be a list of values, found {brief(values)}")
        most *= len(values)
        if most > MOST_SERIES:
            raise RigError(f"{where_of(path, grid, name)}: the grid makes more than {MOST_SERIES} series")
    return [dict(zip(grid, map(str, values))) for values in product(*grid.values())]


def read_table(path: Path, where: str) -> list[dict[str, str]]:
    """Read the rows of a CSV file with a heading; lines that begin with # are comments.

    Parameters
    ----------
    path : Path
        The file.
    where : str
        Place at which the file is named, for the errors.

    Returns
    -------
    list of dict of str to str
        Each row, by the names of the heading.

    Raises
    ------
    RigError
        When the file cannot be read, or a row does not have as many values as the heading.
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{where}: {path} cannot be read ({error})") from None
    heading, *rows = csv.reader(lines) if lines else [[]]
    if not rows or any(len(row) != len(heading) for row in rows):
        raise RigError(f"{where}: {path.name} needs a heading and rows of as many values as it has columns")
    return [dict(zip(heading, row)) for row in rows]


def _texts(node: Map, key: str, row: dict[str, str], path: str | Path) -> dict[str, str]:
    """A map of names and texts, with the ${names} replaced."""
    entries = node.get(key) or {}
    if not isinstance(entries, dict):
        raise RigError(f"{where_of(path, node, key)}: {key} must be a map of names and values, found {brief(entries)}")
    return {str(name): filled(str(value), row, where_of(path, entries, name), "name") for name, value in entries.items()}


def _conditions(block: Map, row: dict[str, str], path: str | Path, names: Mapping[str, tuple[str, ...]]) -> dict[str, Condition]:
    out: dict[str, Condition] = {}
    for name, text in _texts(block, "conditions", row, path).items():
        where = f"{where_of(path, block['conditions'], name)}: {name}"
        if name in names:
            if text not in names[name]:
                raise RigError(f"{where} is '{text}', expected {', '.join(names[name]) or 'none, as the rig has none'}")
            out[name] = Condition(text)
        elif text.isdigit():
            out[name] = Condition(int(text))
        elif dimension := dimension_of_text(text):
            out[name] = Condition(quantity(text, dimension, where), SI[dimension])
        else:
            out[name] = Condition(text)
    return out


def _names(rig: str) -> dict[str, tuple[str, ...]]:
    """Return the words that a condition which names a thing of the rig may have: shift, clutch and valve."""
    config = _base(rig)
    if not config.structure.gears:
        return {}
    box = config.transmission
    return {
        "shift": tuple(box.ways()),
        "clutch": tuple(clutch.name for clutch in box.clutches),
        "valve": tuple(clutch.valve_name for clutch in box.clutches),
    }


# ---- running


@lru_cache(maxsize=4)
def _base(rig: str) -> RigConfig:
    return load_rig(rig)


def prepare(series: Series, rig: str | None = None, settings: dict[str, str] | None = None) -> tuple[RigConfig, Sequence]:
    """Return the rig and the sequence of a series.

    Parameters
    ----------
    series : Series
        The series.
    rig : str, optional
        The rig; by default the one for which the sequence is written.
    settings : dict of str to str, optional
        Settings of the rig in addition to those of the series.

    Returns
    -------
    RigConfig
        The rig's configuration.
    Sequence
        The sequence with the parameters of the series.

    Raises
    ------
    RigError
        When the settings and the series set the same value, or the sequence is for another kind of rig.
    """
    both = sorted(set(settings or {}) & set(series.overrides))
    if both:
        raise RigError(f"setting {both[0]}: series '{series.label}' of '{series.procedure}' sets it itself")
    sequence = load_sequence(series.sequence, series.parameters, default=series.rig)
    config = with_overrides(_base(rig or sequence.rig), {**(settings or {}), **series.overrides})
    sequence.check_rig(config)
    return config, sequence


def run_repeat(series: Series, repeat: int, rig: str | None = None, settings: dict[str, str] | None = None) -> Run:
    """Run one repeat of a series, counted from 0, with the rig and settings of :func:`prepare`."""
    config, sequence = prepare(series, rig, settings)
    return record(config, sequence, series.first_seed + repeat, period=series.period)
