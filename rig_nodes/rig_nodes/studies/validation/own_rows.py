# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The validation rows of a rig's folder: validation.yaml, the value that each row takes, and their judgement.

A row takes its value from a run, or from a cell of one of the folder's calculations (runs.calculations).

Used by ``rig validate --rig`` for rigs that have rows of their own; rigs.hydmag.laboratory.programme handles those of the
laboratory.
"""

from __future__ import annotations

import ast
import fnmatch
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ...analysis import every_metric, shifts
from ...bags import Recording
from ...base import (
    SI,
    UNITS,
    RigError,
    beside,
    brief,
    check_keys,
    dimension_of,
    load_yaml,
    quantity,
    unknown,
    where_of,
    with_article,
)
from ...rig import DIMENSIONS, RigConfig, load_rig, with_overrides
from ...runs import Calculation, Run, Table, Workers, calculations_of, load_sequence, record, recorded_with
from .rows import CONTRADICTS, INSIDE, NOT_COMPARED, OUTSIDE, Row, Target

ROLES = ("calibrate", "predict", "contradiction")
STEADY = 0.3  # s before the next order over which a gear's values are averaged, unless the row says otherwise
_KEYS = (
    "id",
    "text",
    "source",
    "role",
    "sequence",
    "with",
    "settings",
    "value",
    "metric",
    "calculation",
    "where",
    "column",
    "gear",
    "over",
    "from",
    "to",
    "shift",
    "printed",
    "low",
    "high",
)
_OPERATORS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: dict[str, Callable] = {"mean": np.mean, "min": np.min, "max": np.max}


@dataclass(frozen=True)
class OwnRow:
    """A row: its target, the run that it needs, and the value that it takes from the run or from a calculation.

    Parameters
    ----------
    target : Target
        What is accepted.
    sequence : str
        Name or file of the run's sequence; empty for a calculation without a recording.
    parameters, settings : tuple of (str, str)
        Names and values of the sequence's parameters and of the rig's settings in the run.
    value : str
        An expression of signals; empty for other rows.
    metric : str
        Key of a shift in the report, which ends with its unit; empty for other rows.
    gear : int or None
        Gear whose steady end is averaged.
    over : float
        Time before the next order over which it is averaged [s].
    window : (float, float) or None
        Start and end of the averaged time [s], in place of a gear.
    shift : (int, int) or None
        Gears before and after the shift of a metric.
    calculation : Calculation or None
        The calculation of a row that takes a cell of its table.
    where : tuple of (str, object)
        Columns and their values, which select the cell's row.
    column : str
        The cell's column.
    """

    target: Target
    sequence: str
    parameters: tuple[tuple[str, str], ...]
    settings: tuple[tuple[str, str], ...]
    value: str = ""
    metric: str = ""
    gear: int | None = None
    over: float = STEADY
    window: tuple[float, float] | None = None
    shift: tuple[int, int] | None = None
    calculation: Calculation | None = None
    where: tuple[tuple[str, object], ...] = ()
    column: str = ""

    @property
    def run(self) -> tuple:
        """What all rows of one run have in common."""
        return self.sequence, self.parameters, self.settings


def load_rows(path: Path, rig: str | Path, config: RigConfig) -> list[OwnRow]:
    """Read the rows of a file.

    Parameters
    ----------
    path : Path
        The file.
    rig : str or Path
        Name or file of the rig.
    config : RigConfig
        Its configuration.

    Returns
    -------
    list of OwnRow
        The rows in the file's order.

    Raises
    ------
    RigError
        With file and line, for names that this rig does not have and for entries that are no row.
    """
    node = load_yaml(path)
    check_keys(path, node, ("rows",), ("rows",), "the validation")
    rows = node["rows"]
    if not isinstance(rows, list) or not rows:
        raise RigError(f"{where_of(path, node, 'rows')}: rows must be a list, found {brief(rows)}")
    out: dict[str, OwnRow] = {}
    for k, row in enumerate(rows):
        one = _Reader(path, row, where_of(path, rows, k), rig, config).row()
        if one.target.id in out:
            raise RigError(f"{where_of(path, row, 'id')}: there is a row '{one.target.id}' already; each id may be used once")
        out[one.target.id] = one
    return list(out.values())


def chosen_rows(rows: list[OwnRow], patterns: Iterable[str]) -> list[OwnRow]:
    """Return the rows whose id matches one of some patterns, or all rows when there are no patterns.

    Parameters
    ----------
    rows : list of OwnRow
        The rows.
    patterns : iterable of str
        Patterns with shell wildcards.

    Returns
    -------
    list of OwnRow
        The rows.

    Raises
    ------
    RigError
        For a pattern that matches nothing.
    """
    patterns = list(patterns)
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(row.target.id, pattern) for row in rows):
            raise RigError(f"{unknown('row', pattern, [row.target.id for row in rows])} (* matches any text)")
    return [row for row in rows if not patterns or any(fnmatch.fnmatchcase(row.target.id, one) for one in patterns)]


class _Reader:
    """Reads one row; every refusal names file and line."""

    def __init__(self, path: Path, node: Any, where: str, rig: str | Path, config: RigConfig) -> None:
        check_keys(path, node, _KEYS, ("id", "text", "source", "role", "low", "high"), "a row", where)
        self.path, self.node, self.rig, self.config = path, node, rig, config

    def refuse(self, key: str, reason: str) -> NoReturn:
        """Raise RigError about a key of the row, with file and line."""
        raise RigError(f"{where_of(self.path, self.node, key)}: {self.node['id']}.{key} {reason}")

    def row(self) -> OwnRow:
        """Return the row as its file has it; RigError with file and line when it is not right."""
        node = self.node
        for key in ("id", "text", "source"):
            if not isinstance(node[key], str) or not node[key].strip():
                self.refuse(key, f"is {brief(node[key])}, expected words")
        if node["role"] not in ROLES:
            self.refuse("role", f"is {brief(node['role'])}, expected {', '.join(ROLES[:-1])} or {ROLES[-1]}")
        parameters, settings = (self.texts(key) for key in ("with", "settings"))
        given = [key for key in ("value", "metric", "calculation") if key in node]
        if len(given) != 1:
            self.refuse(
                given[0] if given else "id",
                "needs one of value, an expression of signals, metric, a key of the report's shifts, and calculation, one of the "
                "folder's calculations",
            )
        dimension, numbers = self.numbers()
        where: dict = {}
        if "calculation" in node:
            where = self.of_calculation()
        elif "sequence" not in node:
            self.refuse(given[0], "needs the key sequence, whose run gives the value")
        name = beside(self.path, node["sequence"]) if "sequence" in node else ""
        try:
            config = with_overrides(self.config, dict(settings))
            if name:
                load_sequence(name, dict(parameters), self.rig).check_rig(config)
        except RigError as error:
            raise RigError(f"{where_of(self.path, node)}: {node['id']}: {error}") from None
        if "calculation" not in node:
            where = self.of_shift(dimension) if "metric" in node else self.of_window(dimension)
        target = Target(
            id=node["id"],
            text=node["text"],
            where=node["source"],
            kind="range",
            quantity=str(node.get("value", node.get("metric", node.get("column")))),
            dimension=dimension,
            procedure=str(node.get("sequence", node.get("calculation"))),
            role=node["role"],
            why=node["source"],
            line=node.line + 1,
            conditions={},
            **numbers,
        )
        return OwnRow(target, name, parameters, settings, **where)

    def texts(self, key: str) -> tuple[tuple[str, str], ...]:
        """Return names and values under a key as texts."""
        entries = self.node.get(key, {})
        if not isinstance(entries, dict):
            self.refuse(key, f"is {brief(entries)}, expected a map of names and values")
        return tuple((str(name), str(value)) for name, value in entries.items())

    def numbers(self) -> tuple[str, dict]:
        """Return the dimension of low, high and printed, and these numbers [SI]."""
        node, found = self.node, {}
        dimension = dimension_of(str(node["low"]))
        if dimension not in SI:
            self.refuse("low", f"is {brief(node['low'])}, expected a number with its unit, e.g. 2.8 - or 60 Nm")
        for key in ("low", "high", "printed"):
            if key in node:
                found[key] = quantity(node[key], dimension, f"{where_of(self.path, node, key)}: {node['id']}.{key}")
        if found["low"] > found["high"]:
            self.refuse("low", f"is {node['low']}, above high, which is {node['high']}")
        if found["low"] == found["high"] and node["role"] == "calibrate" and "calculation" not in node:
            self.refuse("low", f"is {node['low']} as high is; a row to calibrate by has a width, by which its miss is measured")
        if "printed" in found:
            found["printed"] = (found["printed"],)
        return dimension, {"unit": str(node["low"]).split(None, 1)[1].strip(), **found}

    def gear(self, key: str, name: object) -> int:
        """Return the number of the gear with this name."""
        numbers = self.config.transmission.numbers if self.config.structure.gears else {}
        if str(name) not in numbers:
            self.refuse(
                key, f"names the gear {brief(str(name))}; known are {', '.join(map(str, numbers)) or 'none: the rig has no gears'}"
            )
        return numbers[str(name)]

    def of_shift(self, dimension: str) -> dict:
        """Return metric and gears of a row on the first shift of a way."""
        node = self.node
        if more := next((key for key in ("gear", "over", "from", "to") if key in node), None):
            self.refuse(more, "goes with value; a metric is that of a shift")
        units = {metric.key: metric.unit for metric in every_metric()}
        if node["metric"] not in units:
            self.refuse("metric", f"is {brief(node['metric'])}; {unknown('metric', str(node['metric']), units)}")
        if UNITS[units[node["metric"]]][0] != dimension:
            self.refuse("low", f"is {brief(node['low'])}, but {node['metric']} is given in {units[node['metric']]}")
        old, dash, new = str(node.get("shift", "")).partition("-")
        if not dash:
            self.refuse("shift" if "shift" in node else "metric", "needs the key shift: two gears with a dash, e.g. 1-2")
        return {"metric": node["metric"], "shift": (self.gear("shift", old), self.gear("shift", new))}

    def of_calculation(self) -> dict:
        """Return the calculation of a row and its cell."""
        node = self.node
        if more := next((key for key in ("gear", "over", "from", "to", "shift") if key in node), None):
            self.refuse(more, "goes with value or metric; a calculation has where and column")
        known = calculations_of(self.rig)
        if (name := str(node["calculation"])) not in known:
            self.refuse("calculation", f"is {brief(name)}: {unknown('calculation', name, known)}")
        wanted = known[name]
        if wanted.of_recording != ("sequence" in node):
            self.refuse(
                "calculation",
                f"is {name}, which " + ("needs a recording: the key sequence" if wanted.of_recording else "takes no recording"),
            )
        if "with" in node and not wanted.of_recording:
            self.refuse("with", "goes with a sequence")
        if "column" not in node:
            self.refuse("calculation", "needs the key column, and where if the table has more rows than one")
        where = node.get("where", {})
        if not isinstance(where, dict):
            self.refuse("where", f"is {brief(where)}, expected a map of columns and values")
        return {"calculation": wanted, "where": tuple(where.items()), "column": str(node["column"])}

    def of_window(self, dimension: str) -> dict:
        """Return expression and time of a row on signals over a window."""
        node, signals = self.node, self.config.catalogue.signals
        names = names_in(str(node["value"]), f"{where_of(self.path, node, 'value')}: {node['id']}.value")
        for name in names:
            if name not in signals:
                self.refuse("value", f"names {brief(name)}: {unknown('signal', name, signals)}")
        if [str(node["value"])] == names and (own := signals[names[0]].quantity) is not None:
            if DIMENSIONS.get(own, own) != dimension:
                self.refuse("low", f"is {brief(node['low'])}, but {names[0]} is given in {signals[names[0]].display_unit}")
        if ("gear" in node) == ("from" in node or "to" in node):
            self.refuse("value", "needs the key gear, whose steady end is taken, or from and to, times of the run")
        if "gear" in node:
            over = self.time("over") if "over" in node else STEADY
            return {"value": str(node["value"]), "gear": self.gear("gear", node["gear"]), "over": over}
        if not ("from" in node and "to" in node):
            self.refuse("from" if "from" in node else "to", "is given without the other; from and to are needed")
        window = self.time("from"), self.time("to")
        if not window[0] < window[1]:
            self.refuse("from", f"is {node['from']}, not before to, which is {node['to']}")
        return {"value": str(node["value"]), "window": window}

    def time(self, key: str) -> float:
        """Return the seconds under a key, 0 or more."""
        value = quantity(self.node[key], "time", f"{where_of(self.path, self.node, key)}: {self.node['id']}.{key}")
        if value < 0.0:
            self.refuse(key, f"is {self.node[key]}, expected 0 s or more")
        return value


# ---- expressions


def names_in(text: str, where: str) -> list[str]:
    """Return the signals of an expression.

    Parameters
    ----------
    text : str
        Signals, numbers, +, -, *, /, brackets, and mean, min and max of one signal.
    where : str
        File, line and key, for the error.

    Returns
    -------
    list of str
        Names of the signals, each once.

    Raises
    ------
    RigError
        When the text is no such expression or names no signal.
    """
    try:
        tree = ast.parse(text, mode="eval").body
        names: list[str] = []
        _walk(tree, lambda name, _: names.append(name) or 1.0)
    except (SyntaxError, ValueError, RecursionError, MemoryError, OverflowError):
        raise RigError(
            f"{where} is {brief(text)}, expected signals, numbers and + - * / ( ), mean(...), min(...), max(...)"
        ) from None
    except ZeroDivisionError:
        pass  # every signal was 1 here; with other values the expression may be right
    if not names:
        raise RigError(f"{where} is {brief(text)}, which names no signal")
    return list(dict.fromkeys(names))


def _walk(node: ast.expr, value: Callable[[str, str], float]) -> float:
    """Return the number of an expression; value(name, function) returns the number that a signal stands for."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    if isinstance(node, ast.Name):
        return value(node.id, "mean")
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_walk(node.left, value), _walk(node.right, value))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_walk(node.operand, value)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS and not node.keywords:
        if len(node.args) == 1 and isinstance(node.args[0], ast.Name):
            return value(node.args[0].id, node.func.id)
    raise ValueError("no such expression")


# ---- running and judging


def measure_rows(config: RigConfig, rig: str | Path, rows: list[OwnRow]) -> list[tuple[float | None, str]]:
    """Run a rig once and return the values of rows that share this run.

    Parameters
    ----------
    config : RigConfig
        The rig, with the changes of ``--set``.
    rig : str or Path
        Name or file of the rig.
    rows : list of OwnRow
        Rows of the same run.

    Returns
    -------
    list of (float or None, str)
        Value of each row [SI], or None and the reason.
    """
    sequence, parameters, settings = rows[0].run
    changed = with_overrides(config, dict(settings))
    if not sequence:
        tables = {row.calculation.name: row.calculation.table(changed) for row in rows if row.calculation}
        return [_of_table(row, tables) for row in rows]
    logged = {one.name for one in changed.structure.transducers}
    states = {name for row in rows if row.value for name in names_in(row.value, row.target.id)} - logged
    run, tables = recorded_with(
        [row.calculation for row in rows if row.calculation],
        changed,
        lambda names: record(changed, load_sequence(sequence, dict(parameters), rig), plant_states=names),
        states,
    )
    if run.end["state"] != "ended":
        return [(None, run.end["reason"])] * len(rows)
    rows_of_shifts = shifts(run.recording) if isinstance(run.recording, Recording) else []
    return [
        _of_table(row, tables) if row.calculation else _of_metric(row, rows_of_shifts) if row.metric else _of_signals(row, run)
        for row in rows
    ]


def _of_table(row: OwnRow, tables: Mapping[str, Table]) -> tuple[float | None, str]:
    assert row.calculation is not None
    table = tables[row.calculation.name]
    where = f"{row.calculation.path.parent / 'validation.yaml'}:{row.target.line}: {row.target.id}: {row.calculation.name}"
    try:
        found = table.cell(dict(row.where), row.column)
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
    if (dimension := UNITS[table.columns[row.column]][0]) != row.target.dimension:
        raise RigError(f"{where}: {row.column} is {with_article(dimension)}, the row's low is {with_article(row.target.dimension)}")
    return (None, "the calculation gives no value") if found is None else (found, "")


def _of_metric(row: OwnRow, shifts_found: list[dict]) -> tuple[float | None, str]:
    found = next((one for one in shifts_found if (one["from_gear"], one["to_gear"]) == row.shift), None)
    if found is None:
        return None, "the run has no such shift"
    if found[row.metric] is None:
        return None, found["undefined"].get(row.metric, "; ".join(found["why"]) or "was not found")
    unit = next(metric.unit for metric in every_metric() if metric.key == row.metric)
    return found[row.metric] * UNITS[unit][1], ""


def _of_signals(row: OwnRow, run: Run) -> tuple[float | None, str]:
    logged = run.recording
    start, end = row.window or (0.0, 0.0)
    if row.window is None:
        orders = logged.orders
        at = next((k for k, order in enumerate(orders) if order[2] == row.gear), None)
        if at is None:
            return None, "the run does not order the gear"
        end = orders[at + 1][0] if at + 1 < len(orders) else logged.t0 + logged.period * logged.rows
        start = end - row.over
        if start < orders[at][0]:
            return None, "the gear is not in for so long"
    rows = slice(*(round((t - logged.t0) / logged.period) for t in (start, end)))

    def value(name: str, function: str) -> float:
        series = logged.channels[name] if name in logged.channels else run.plant_states[name]
        if not len(series[rows]):
            raise ValueError(f"the run ends before {start:g} s")
        return float(_FUNCTIONS[function](series[rows]))

    try:
        found = _walk(ast.parse(row.value, mode="eval").body, value)
    except ZeroDivisionError:
        return None, "divides by 0"
    except ValueError as reason:
        return None, str(reason)
    return (found, "") if math.isfinite(found) else (None, "is no finite number")


def judge(row: OwnRow, value: float | None, reason: str) -> Row:
    """Return the row with the rig's answer.

    Parameters
    ----------
    row : OwnRow
        The row.
    value : float or None
        The rig's value [SI]; None when there is none.
    reason : str
        Why there is none.

    Returns
    -------
    Row
        The target with the rig's answer.
    """
    target = row.target
    if value is None:
        return Row(target, NOT_COMPARED, low=target.low, high=target.high, reason=reason)
    inside = target.low <= value <= target.high
    met = CONTRADICTS if target.role == "contradiction" else INSIDE
    return Row(target, met if inside else OUTSIDE, value, target.low, target.high, count=1, inside=int(inside))


def check_settings(rows: list[OwnRow], settings: dict[str, str]) -> None:
    """Raise RigError when a row sets one of these values of the rig itself."""
    for row in rows:
        if both := sorted(set(settings) & {name for name, _ in row.settings}):
            raise RigError(f"setting {both[0]}: row '{row.target.id}' sets it itself; choose other --rows")


def _measured(rig: str, settings: dict[str, str], rows: list[OwnRow]) -> list[tuple[float | None, str]]:
    return measure_rows(load_rig(rig, settings), rig, rows)


def rows_by_run(rows: list[OwnRow]) -> list[list[OwnRow]]:
    """Return the rows of each run, run by run."""
    out: dict[tuple, list[OwnRow]] = {}
    for row in rows:
        out.setdefault(row.run, []).append(row)
    return list(out.values())


def validate_rows(
    rows: list[OwnRow], rig: str, settings: dict[str, str], workers: Workers, progress: Callable[[int, int], None] | None = None
) -> list[Row]:
    """Run what the rows need and judge them.

    Parameters
    ----------
    rows : list of OwnRow
        The rows.
    rig : str
        Name or file of the rig.
    settings : dict of str to str
        Changes of the rig.
    workers : Workers
        The worker processes.
    progress : callable or None
        Takes the number of finished runs and that of all.

    Returns
    -------
    list of Row
        The judged rows in their order.
    """
    groups = rows_by_run(rows)
    answers = {}
    for group, found in zip(groups, workers.map(partial(_measured, rig, settings), groups, progress)):
        answers |= {row.target.id: one for row, one in zip(group, found)}
    return [judge(row, *answers[row.target.id]) for row in rows]
