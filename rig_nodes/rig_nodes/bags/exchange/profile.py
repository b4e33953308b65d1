# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The profile of a logger: a YAML file with the form of its files and the signal of a rig for each column.

bags.exchange.imported reads files by it, bags.exchange.propose writes a first one. docs/how_to/import_export.md lists the keys.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...base import Map, RigError, brief, find_of_rigs, load_yaml, quantity, unknown, where_of
from .cells import GROUPS, MISSING
from .foreign import Form

BRIDGE = 2e-3  # s
KEYS = (
    "rig",
    "set",
    "encoding",
    "delimiter",
    "decimal",
    "thousands",
    "header",
    "units",
    "data",
    "missing",
    "sheet",
    "time",
    "columns",
    "gear",
    "orders",
    "bridge",
)
OPEN = "?"  # what a proposed profile leaves to its user
SIGNS = {"tab": "\t", "\\t": "\t"}


@dataclass(frozen=True)
class Mapped:
    """A column of a file as a signal: SI value = (value * factor + offset) in the unit.

    ``where`` names it in errors; ``time`` is its column of times when this is not the file's main one.
    """

    head: str
    signal: str
    where: str
    unit: str | None = None
    factor: float = 1.0
    offset: float = 0.0
    time: str | None = None


@dataclass(frozen=True)
class Profile:
    """The contents of a profile.

    Attributes
    ----------
    name : str
        Origin of the profile, as text for the user.
    rig : str or None
        Rig whose inertias, ratios and instrument errors are used.
    settings : dict of str to str
        Values that replace those of this rig.
    form : Form
        Form of a CSV file.
    time : str or None
        Column of the times.
    time_unit : str or None
        Unit of the times.
    date : str or None
        Column of the dates of times of day.
    period : float or None
        Time between rows [s], in place of a column of times.
    columns : tuple of Mapped
        Columns to take.
    gear : str or None
        Column of the ordered gear.
    gears : dict of str to str
        Names of gears by the numbers or texts in that column.
    orders : str or None
        Orders of gears, as for parse_orders.
    bridge : float
        Longest gap [s] that is bridged by a straight line.
    """

    name: str = "the heads of the file"
    rig: str | None = None
    settings: dict[str, str] = field(default_factory=dict)
    form: Form = field(default_factory=Form)
    time: str | None = None
    time_unit: str | None = None
    date: str | None = None
    period: float | None = None
    columns: tuple[Mapped, ...] = ()
    gear: str | None = None
    gears: dict[str, str] = field(default_factory=dict)
    orders: str | None = None
    bridge: float = BRIDGE


def time_above_0(text: object, where: str) -> float:
    """Return a time [s] that is above 0, from its text; ``where`` begins the error."""
    found = quantity(text, "time", where)
    if not found > 0.0:
        raise RigError(f"{where}: {brief(text)} is no time above 0")
    return found


def read_profile(name: str | Path) -> Profile:
    """Read a profile.

    Parameters
    ----------
    name : str or Path
        Its file, or the name of one in the folder of a rig.

    Returns
    -------
    Profile
        The profile.

    Raises
    ------
    RigError
        When there is no such file or it contains something unknown; the error has file and line.
    """
    path = Path(name)
    if not path.is_file() and not path.suffix:
        path = find_of_rigs("profiles", name)
    node = load_yaml(path)
    if not isinstance(node, Map):
        raise RigError(f"{path}: is no profile, expected a map with the keys {', '.join(KEYS)}")
    return _Reader(path).profile(node)


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path = path

    def profile(self, node: Map) -> Profile:
        self.only(node, KEYS, "profile")
        columns = self.map_at(node, "columns")
        if not columns:
            raise RigError(f"{self.path}: names no columns; write e.g. columns: {{'Moment': {{signal: NAME, unit: Nm}}}}")
        time, gear = node.get("time"), node.get("gear")
        time = time if isinstance(time, Map) else {"column": time} if isinstance(time, str) else self.map_at(node, "time")
        gear = gear if isinstance(gear, Map) else {"column": gear} if isinstance(gear, str) else self.map_at(node, "gear")
        self.only(time, ("column", "unit", "date", "period"), "time")
        self.only(gear, ("column", "values"), "gear")
        period = time.get("period")
        return Profile(
            self.path.name,
            self.text(node, "rig"),
            {str(key): str(value) for key, value in self.map_at(node, "set").items()},
            self.form(node),
            self.text(time, "column"),
            self.text(time, "unit"),
            self.text(time, "date"),
            None if period is None else self.positive(period, self.at(time, "period")),
            tuple(self.column(columns, head) for head in columns),
            self.text(gear, "column"),
            self.gears(gear),
            self.text(node, "orders"),
            self.positive(node["bridge"], self.at(node, "bridge")) if "bridge" in node else BRIDGE,
        )

    def at(self, node: Mapping, key: object) -> str:
        return where_of(self.path, node, key)

    def only(self, node: Mapping, known: Iterable[str], what: str) -> None:
        for key in node:
            if key not in known:
                raise RigError(f"{self.at(node, key)}: {unknown(f'key of a {what}', str(key), known)}")

    def map_at(self, node: Mapping, key: str) -> Mapping:
        found = node.get(key)
        if found is not None and not isinstance(found, Map):
            raise RigError(f"{self.at(node, key)}: {key} is {brief(found)}, expected a map")
        return found or {}

    def text(self, node: Mapping, key: str) -> str | None:
        found = node.get(key)
        if isinstance(found, (Mapping, list)):
            raise RigError(f"{self.at(node, key)}: {key} is {brief(found)}, expected one text")
        if found == OPEN:
            raise RigError(f"{self.at(node, key)}: {key} is still '{OPEN}'; the remark behind it says what is to be decided")
        return None if found is None else str(found)

    def number(self, node: Mapping, key: str, otherwise: float) -> float:
        found = node.get(key, otherwise)
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            raise RigError(f"{self.at(node, key)}: {key} is {brief(found)}, expected a number")
        return float(found)

    def positive(self, text: object, where: str) -> float:
        if text == OPEN:
            raise RigError(f"{where}: the period is still '{OPEN}'; write the time between rows, e.g. 0.1 ms")
        return time_above_0(text, where)

    def form(self, node: Map) -> Form:
        lines = {}
        for key in ("header", "units", "data"):
            found = node.get(key)
            if found is not None and (isinstance(found, bool) or not isinstance(found, int) or found < 1):
                raise RigError(f"{self.at(node, key)}: {key} is {brief(found)}, expected the number of a line from 1 on")
            lines[key] = found
        delimiter, decimal = self.text(node, "delimiter"), self.text(node, "decimal")
        delimiter = SIGNS.get(delimiter or "", delimiter)
        if delimiter is not None and len(delimiter) != 1:
            raise RigError(f"{self.at(node, 'delimiter')}: delimiter is {brief(delimiter)}, expected one sign such as ';', or tab")
        if decimal not in (None, ",", "."):
            raise RigError(f"{self.at(node, 'decimal')}: decimal is {brief(decimal)}, expected ',' or '.'")
        thousands = self.text(node, "thousands")
        if thousands is not None and (thousands not in GROUPS or thousands == decimal):
            raise RigError(
                f"{self.at(node, 'thousands')}: thousands is {brief(thousands)}, expected '.', ',', a blank or an apostrophe that "
                "is not the decimal sign"
            )
        missing = node.get("missing", [])
        return Form(
            self.text(node, "encoding"),
            delimiter,
            decimal,
            thousands,
            **lines,
            missing=(*MISSING, *map(str, missing if isinstance(missing, list) else [missing])),
            sheet=self.text(node, "sheet"),
        )

    def column(self, columns: Mapping, head: Any) -> Mapped:
        node, where = columns[head], self.at(columns, head)
        if isinstance(node, str):
            return Mapped(str(head), node, where)
        if not isinstance(node, Map):
            raise RigError(f"{where}: column {head!r} is {brief(node)}, expected e.g. {{signal: NAME, unit: Nm}}")
        self.only(node, ("signal", "unit", "factor", "offset", "time"), "column")
        if (signal := self.text(node, "signal")) is None:
            raise RigError(f"{where}: column {head!r} names no signal; write e.g. {{signal: NAME, unit: Nm}}")
        factor = self.number(node, "factor", 1.0)
        if not factor:
            raise RigError(f"{where}: the factor of column {head!r} is 0")
        offset, time = self.number(node, "offset", 0.0), self.text(node, "time")
        return Mapped(str(head), signal, where, self.text(node, "unit"), factor, offset, time)

    def gears(self, gear: Mapping) -> dict[str, str]:
        values = self.map_at(gear, "values").items()
        return {f"{key:g}" if isinstance(key, (int, float)) else str(key): str(name) for key, name in values}
