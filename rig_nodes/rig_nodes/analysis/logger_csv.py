# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reader of a logger's CSV as a Recording, so that the same code analyses real measurements and the rig's.

`rig report FILE.csv` uses it. Column headers carry their unit, as "torque [Nm]"; names are those of the catalogue.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..catalogue import Signal, catalogue
from ..config.units import UNITS
from ..errors import RigError
from ..transmission import Transmission, transmission_of
from .metrics import Recording

TIME_NAMES = ("t", "time", "czas")
ORDER_NAMES = ("gear_ordered", "order")
# other spellings of units of config.units, by loggers and people
ALIASES = {
    "N.m": "Nm",
    "N m": "Nm",
    "N*m": "Nm",
    "N·m": "Nm",
    "1/min": "rpm",
    "min-1": "rpm",
    "r/min": "rpm",
    "obr/min": "rpm",
    "°C": "degC",
    "C": "degC",
    "µs": "us",
}
_HEADING = re.compile(r"\s*(.+?)\s*(?:\[\s*(.*?)\s*\]|\(\s*(.*?)\s*\))?\s*$")
_ORDER = re.compile(r"\s*([0-9]*\.?[0-9]+)\s*(?:s\s*)?:\s*(\w+)\s*-+>?\s*(\w+)\s*$")


def read_logger_csv(
    path: str | Path,
    period: float | None = None,
    orders: list[tuple[float, int, int]] | None = None,
    transmission: Transmission | None = None,
    signals: Mapping[str, Signal] | None = None,
) -> Recording:
    """Read a logger's CSV.

    The separator is ";", tab or ","; the decimal sign is a point, or with the first two separators also a comma. Lines that begin
    with # before the header are skipped. A column is named as in the rig's signals and has its unit in brackets (any unit of
    config.units of that quantity, rpm also as 1/min). The columns of the transmission must be present, with gauge pressures;
    columns that the catalogue does not contain are skipped. Times come from a column "t [s]" (time, czas), which must grow in
    equal steps, or from ``period``. Orders come from ``orders`` or else from a column gear_ordered [-] with numbers of gears, where
    each change is an order from the gear before.

    Parameters
    ----------
    path : str or Path
        The CSV file.
    period : float, optional
        Time between rows [s].
    orders : list of (float, int, int), optional
        Orders as Recording has them; they take precedence over the column.
    transmission : Transmission, optional
        That of the default rig by default.
    signals : mapping of str to Signal, optional
        The rig's signals; those of the default rig by default.

    Returns
    -------
    Recording
        The channels with the orders.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    path, box = Path(path), transmission or transmission_of()
    header, lines, number, separator = _lines(path)
    names, factors = _columns(path, header, catalogue().signals if signals is None else signals)
    table = _table(path, lines, number, separator, len(header))
    # a skipped heading has the name ""
    columns = {name: table[:, i] * factors[i] for i, name in enumerate(names) if name}
    missing = [name for name in box.channels if name not in columns]
    if missing:
        raise RigError(
            f"{path}: has no column {', '.join(missing)}; the analysis needs {', '.join(box.channels)}, each "
            f"with its unit, e.g. '{box.input.torque} [Nm]'"
        )
    t0, period = _time(path, columns.pop("t", None), period, number)
    ordered = columns.pop("gear_ordered", None)
    if orders is None:
        orders = [] if ordered is None else _orders(path, ordered, t0, period, number, box)
    return Recording(t0, period, columns, sorted(orders), box)


def parse_orders(text: str, transmission: Transmission | None = None) -> list[tuple[float, int, int]]:
    """Parse orders of the command line such as ``"3.845:I-II, 8.32:II-I"``.

    Parameters
    ----------
    text : str
        Time in the recording [s], gear before and gear ordered of each order.
    transmission : Transmission, optional
        Gives the names of the gears (Transmission.number), where 0 is neutral; the laboratory's by default.

    Returns
    -------
    list of (float, int, int)
        Time [s], gear before, gear ordered.

    Raises
    ------
    RigError
        When the text is not in this form; the error shows an example.
    """
    box, orders = transmission or transmission_of(), []
    first, second = list(box.ways())[:2]
    example = f"'3.845:{first}, 8.32:{second}'"
    for part in filter(str.strip, re.split(r"[,;]", text)):
        match = _ORDER.match(part)
        gears = [None] if match is None else [box.number(match[2]), box.number(match[3])]
        if None in gears:
            raise RigError(
                f"--orders: '{part.strip()}' is no order; write the time in s and the gears, e.g. {example} (0 is neutral)"
            )
        order = float(match[1]), gears[0], gears[1]
        if order[1] == order[2]:
            raise RigError(
                f"--orders: '{part.strip()}' orders the gear that is in; write another after the '-', e.g. '3.845:{first}'"
            )
        if any(order[0] == other[0] for other in orders):
            raise RigError(f"--orders: two orders at {order[0]:g} s; only one gear can be ordered at a time")
        orders.append(order)
    if not orders:
        raise RigError(f"--orders is empty; write e.g. {example}")
    return sorted(orders)


def _lines(path: Path) -> tuple[list[str], list[str], int, str]:
    """Return the fields of the header, the lines below it, the number of the first of these, and the separator."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RigError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1250", errors="replace")  # the encoding of Polish loggers' programs
    lines = text.splitlines()
    at = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if at is None:
        raise RigError(f"{path}: holds no header; the first line names the columns, with its unit, e.g. 't [s]; torque [Nm]'")
    separator = next((s for s in (";", "\t", ",") if s in lines[at]), None)
    if separator is None:
        raise RigError(f"{path}: line {at + 1} has no ';', tab or ',' between column names: '{lines[at][:60]}'")
    fields = [field.strip().strip('"').strip() for field in lines[at].split(separator)]
    while fields and not fields[-1]:
        fields.pop()  # a separator at the end of the line
    below = lines[at + 1 :]
    while below and not below[-1].strip():
        below.pop()
    if len(below) < 2:
        raise RigError(f"{path}: has {len(below)} rows below its header; a recording needs more")
    return fields, below, at + 2, separator


def _columns(path: Path, header: list[str], signals: Mapping[str, Signal]) -> tuple[list[str], list[float]]:
    """Return the catalogue name ("" for a skipped column) and the factor to SI of every column."""
    names, factors = [], []
    for heading in header:
        match = _HEADING.match(heading)
        name, unit = (match[1], match[2] or match[3]) if match else ("", None)
        if name.lower() in TIME_NAMES:
            name, dimension, own = "t", "time", "s"
        elif name in ORDER_NAMES:
            name, dimension, own, unit = "gear_ordered", "ratio", "-", unit or "-"
        elif name in signals:
            own = signals[name].display_unit
            dimension = UNITS[own][0]
        else:
            names.append("")
            factors.append(1.0)
            continue
        if not unit:
            raise RigError(f"{path}: column '{heading}' has no unit; write it in brackets, e.g. '{name} [{own}]'")
        unit = ALIASES.get(unit, unit)
        if unit not in UNITS or UNITS[unit][0] != dimension:
            known = ", ".join(u for u, (d, _) in UNITS.items() if d == dimension)
            raise RigError(f"{path}: column '{heading}' is in {unit}; a {dimension} is in {known}")
        if name in names:
            raise RigError(f"{path}: column {name} is there twice")
        names.append(name)
        factors.append(UNITS[unit][1])
    return names, factors


def _table(path: Path, lines: list[str], number: int, separator: str, columns: int) -> np.ndarray:
    """Return the numbers, (rows, columns)."""
    text = "\n".join(lines)
    if separator != ",":
        text = text.replace(",", ".")
    try:
        table = np.loadtxt(io.StringIO(text), delimiter=separator, ndmin=2, comments=None, usecols=range(columns))
    except ValueError:
        raise RigError(_first_fault(path, text.split("\n"), number, separator, columns)) from None
    if len(table) != len(lines):
        empty = next(i for i, line in enumerate(lines) if not line.strip())
        raise RigError(f"{path}: line {number + empty} is empty; rows must follow each other")
    return table


def _first_fault(path: Path, lines: list[str], number: int, separator: str, columns: int) -> str:
    """Return a sentence on the first line that is not a row of numbers."""
    for i, line in enumerate(lines):
        fields = line.split(separator)
        if len(fields) < columns:
            return f"{path}: line {number + i} has {len(fields)} fields where the header names {columns}"
        for field in fields[:columns]:
            try:
                float(field)
            except ValueError:
                comma = "; with ',' between columns numbers need a decimal point" if separator == "," else ""
                return f"{path}: line {number + i} has '{field.strip()}' where a number is expected{comma}"
    return f"{path}: holds no table of numbers"


def _time(path: Path, t: np.ndarray | None, period: float | None, number: int) -> tuple[float, float]:
    """Return the time of the first row and the period."""
    if t is None:
        if period is None:
            raise RigError(f"{path}: has no time column; add one, e.g. 't [s]', or give --period, e.g. '0.1 ms'")
        return 0.0, period
    if period is not None:
        return float(t[0]), period
    step = float(t[-1] - t[0]) / (len(t) - 1)
    steps = np.diff(t)
    # times with few digits repeat, and missing rows make a jump
    if not (step > 0.0 and np.all(steps > 0.0) and np.all(steps <= 1.5 * step)):
        at = int(np.argmax(~(steps > 0.0) | (steps > 1.5 * step)))
        raise RigError(
            f"{path}: the times must grow in equal steps, but go from {t[at]:g} s to {t[at + 1]:g} s at "
            f"line {number + at + 1}; rows are missing or the times have too few digits (leave the column "
            "out and give --period)"
        )
    return float(t[0]), step


def _orders(path: Path, gear: np.ndarray, t0: float, period: float, number: int, box: Transmission) -> list[tuple[float, int, int]]:
    """Return the orders from the changes of the ordered gear."""
    wrong = ~np.isin(gear, list(box.names))
    if wrong.any():
        at = int(np.argmax(wrong))
        raise RigError(f"{path}: line {number + at} orders the gear {gear[at]:g}; gears are {box.spoken}")
    changes = np.flatnonzero(np.diff(gear)) + 1
    return [(t0 + period * i, int(gear[i - 1]), int(gear[i])) for i in changes]
