# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calculations of a rig's folder: Python functions that give tables, with the rig's values and, where asked, a recording.

``rig calculate`` prints them and the rows of validation.yaml take numbers from them. What a source computes without a
simulation is such a calculation. The file is only run when one of its calculations is wanted: its names are read without it.
"""

from __future__ import annotations

import ast
import importlib.util
import math
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from ..base import UNITS, RigError, brief, meant, quantity, unknown, with_bases

if TYPE_CHECKING:
    from ..bags import Bag
    from ..rig import RigConfig
    from .recorded import Run

FILE, TABLE = "calculations.py", "CALCULATIONS"


class NotRecorded(Exception):
    """A calculation needs a signal that this recording does not hold; the run can be made again with it."""


@dataclass(frozen=True)
class Table:
    """What a calculation gives.

    Parameters
    ----------
    text : str
        One sentence on what the table shows, with its source.
    columns : dict of str to str
        Name and unit of each column; a column without a unit ("") holds words.
    rows : sequence of tuple
        Cells: numbers [SI], words, or None where there is no value.

    Raises
    ------
    RigError
        For an unknown unit, a row of another length, or a cell of another kind.
    """

    text: str
    columns: Mapping[str, str]
    rows: Sequence[tuple]

    def __post_init__(self) -> None:
        for name, unit in self.columns.items():
            if unit and unit not in UNITS:
                raise RigError(f"column {name} has the unknown unit {brief(unit)}; known are {', '.join(UNITS)}")
        for k, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise RigError(f"row {k} has {len(row)} cells, expected {len(self.columns)}: {', '.join(self.columns)}")
            for (name, unit), cell in zip(self.columns.items(), row):
                if cell is not None and not isinstance(cell, Real if unit else str):
                    raise RigError(f"row {k}: {name} is {brief(cell)}, expected {f'a number [SI of {unit}]' if unit else 'words'}")

    def in_units(self) -> list[list[float | str | None]]:
        """Return the rows with each number in its column's unit."""
        factors = [UNITS[unit][1] if unit else 1.0 for unit in self.columns.values()]
        return [[float(cell) / f if isinstance(cell, Real) else cell for cell, f in zip(row, factors)] for row in self.rows]

    def cell(self, where: Mapping[str, object], column: str) -> float | None:
        """Return the number in one cell.

        Parameters
        ----------
        where : mapping of str to object
            Values of columns that select the row: words, numbers in the column's unit, or numbers with a unit.
        column : str
            The cell's column.

        Returns
        -------
        float or None
            The number [SI]; None when the table has no value there.

        Raises
        ------
        RigError
            For an unknown column, a column of words, or when not exactly one row is selected.
        """
        names = list(self.columns)
        for name in (*where, column):
            if name not in self.columns:
                raise RigError(unknown("column", name, names))
        if not self.columns[column]:
            raise RigError(f"the column {column} holds words, expected one with numbers")
        wanted = {names.index(name): self._cell_of(name, value) for name, value in where.items()}
        rows = [row for row in self.rows if all(_same(row[k], value) for k, value in wanted.items())]
        if len(rows) != 1:
            raise RigError(f"{len(rows)} rows have {dict(where) or 'any value'}, expected exactly one")
        found = rows[0][names.index(column)]
        return None if found is None else float(found)

    def _cell_of(self, name: str, value: object) -> float | str:
        unit = self.columns[name]
        if not unit:
            return str(value)
        if isinstance(value, Real) and not isinstance(value, bool):
            return float(value) * UNITS[unit][1]
        return quantity(value, UNITS[unit][0], name)


def _same(cell: object, wanted: float | str) -> bool:
    if isinstance(cell, Real) and isinstance(wanted, float):
        return math.isclose(float(cell), wanted, rel_tol=1e-9, abs_tol=1e-12)
    return cell == wanted


class Recorded:
    """A recording as calculations see it: all signals on the rows of the logger.

    ``recording["name"]`` is a signal's array (rows,) [SI]. A signal that is not logged is taken from its topic; it keeps its
    last value until the next message.

    Parameters
    ----------
    t : (rows,) array of float
        Times of the rows [s].
    events : list of (float, str, str, float)
        Time [s], name, text and value of each event of sequencer and controller.
    channels : mapping of str to (rows,) array
        Signals that are there already.
    more : callable
        Returns the array of another signal by its name.
    """

    def __init__(self, t: np.ndarray, events: list, channels: Mapping[str, np.ndarray], more: Callable[[str], np.ndarray]) -> None:
        self.t, self.events, self._channels, self._more = t, events, dict(channels), more

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._channels:
            self._channels[name] = self._more(name)
        return self._channels[name]


def of_run(run: Run, config: RigConfig) -> Recorded:
    """Return a run in memory as calculations see it; a signal that was not kept raises NotRecorded, an unknown one RigError."""

    def more(name: str) -> np.ndarray:
        if name not in config.catalogue.signals:
            raise RigError(unknown("signal", name, config.catalogue.signals))
        raise NotRecorded(name)

    logged = run.recording
    t = logged.t0 + logged.period * np.arange(logged.rows)
    return Recorded(t, run.events, {**logged.channels, **run.plant_states}, more)


def of_bag(bag: Bag) -> Recorded:
    """Return a bag as calculations see it; rows that were lost are NaN."""
    logger = bag.logger(fill=True)
    t = logger.t0 + logger.period * np.arange(len(next(iter(logger.channels.values()))))

    def more(name: str) -> np.ndarray:
        times, values = bag.series(name)
        if not len(times):
            raise RigError(f"{bag.path}: holds no message with the signal {name}")
        return values[np.maximum(np.searchsorted(times, t + 1e-9, side="right") - 1, 0)]

    return Recorded(t, [(at, name, text, value) for at, _, name, text, value in bag.events()], logger.channels, more)


@dataclass(frozen=True)
class Calculation:
    """A calculation of a rig's folder, known by name before its file is run.

    Parameters
    ----------
    name : str
        Its name.
    path : Path
        Its file.
    text : str
        First line of its function's docstring.
    of_recording : bool
        Whether it needs a recording.
    """

    name: str
    path: Path
    text: str
    of_recording: bool

    def table(self, config: RigConfig, recording: Recorded | None = None) -> Table:
        """Return the calculation's table.

        Parameters
        ----------
        config : RigConfig
            The rig, which gives the values.
        recording : Recorded, optional
            The recording, for a calculation that needs one.

        Returns
        -------
        Table
            The table.

        Raises
        ------
        RigError
            With file and line, when the calculation fails or gives no table.
        NotRecorded
            When a run in memory does not hold a signal that is asked for.
        """
        function = getattr(module_of(self.path), TABLE)[self.name]
        try:
            found = function(config, recording) if self.of_recording else function(config)
        except NotRecorded:
            raise
        except Exception as error:
            raise RigError(f"{_place(self.path, error)}: calculation {self.name}: {_reason(error)}") from None
        if not isinstance(found, Table):
            raise RigError(f"{self.path}: calculation {self.name} returns {brief(found)}, expected a Table")
        return found


def calculations_of(rig: str | Path) -> dict[str, Calculation]:
    """Return the calculations of a rig, or of its nearest base that has some, by name; the file is read but not run.

    Parameters
    ----------
    rig : str or Path
        Name, folder or file of the rig.

    Returns
    -------
    dict of str to Calculation
        The calculations; empty when neither the rig nor a base has any.

    Raises
    ------
    RigError
        With file and line, when the file is not Python or does not list its calculations.
    """
    path = next((path.parent / FILE for path, _ in with_bases(rig) if (path.parent / FILE).is_file()), None)
    if path is None:
        return {}
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except SyntaxError as error:
        raise RigError(f"{path}:{error.lineno}: is not Python ({error.msg})") from None
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        raise RigError(f"{path}: cannot be read ({error})") from None
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    listed = next(
        (
            node.value
            for node in tree.body
            if isinstance(node, (ast.Assign, ast.AnnAssign))
            and [getattr(one, "id", "") for one in (node.targets if isinstance(node, ast.Assign) else [node.target])] == [TABLE]
        ),
        None,
    )
    if not isinstance(listed, ast.Dict):
        raise RigError(f'{path}: has no {TABLE}; list the functions in it, {TABLE} = {{"name": function, ...}}')
    found = {}
    for key, value in zip(listed.keys, listed.values):
        where = f"{path}:{value.lineno}"
        if not (isinstance(key, ast.Constant) and isinstance(key.value, str) and isinstance(value, ast.Name)):
            raise RigError(f"{where}: an entry of {TABLE} is a name in quotes and a function of this file")
        function = functions.get(value.id)
        if function is None:
            raise RigError(f"{where}: {value.id} is no function of this file; {meant(value.id, functions)}")
        count = len(function.args.args)
        if count not in (1, 2):
            raise RigError(f"{path}:{function.lineno}: {value.id} has {count} parameters, expected config, or config and recording")
        text = (ast.get_docstring(function) or "").partition("\n")[0]
        found[key.value] = Calculation(key.value, path, text, count == 2)
    return found


def on_recording(rig: str | Path, name: str) -> Calculation:
    """Return a calculation of a rig by its name; RigError when there is none, or when it takes no recording."""
    known = calculations_of(rig)
    if name not in known:
        raise RigError(unknown("calculation", name, known))
    if not known[name].of_recording:
        raise RigError(f"the calculation {name} takes no recording, so no run changes it")
    return known[name]


def recorded_with(
    wanted: Iterable[Calculation], config: RigConfig, make: Callable[[tuple[str, ...]], Run], states: Iterable[str] = ()
) -> tuple[Run, dict[str, Table]]:
    """Make a run with the signals that calculations read, and return both.

    Parameters
    ----------
    wanted : iterable of Calculation
        The calculations.
    config : RigConfig
        The rig.
    make : callable
        Makes the run and keeps the states of these names; it is called again when a calculation asks for others, because a
        lockstep run is the same every time.
    states : iterable of str
        Names of states that are kept in any case.

    Returns
    -------
    tuple of (Run, dict of str to Table)
        The run and the calculations' tables by their names; no table when the run did not come to its end.
    """
    wanted, kept = list(wanted), set(states)
    while True:
        run = make(tuple(sorted(kept)))
        if run.end["state"] != "ended":
            return run, {}
        recording = of_run(run, config)
        try:
            return run, {one.name: one.table(config, recording) for one in wanted}
        except NotRecorded as signal:
            kept.add(str(signal))


@lru_cache(maxsize=16)
def module_of(path: Path) -> ModuleType:
    """Return the module of a calculations.py, run once in a process; RigError with file and line when it fails."""
    spec = importlib.util.spec_from_file_location(f"calculations_of_{path.parent.name}", path)
    if spec is None or spec.loader is None:
        raise RigError(f"{path}: cannot be loaded")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise RigError(f"{_place(path, error)}: {_reason(error)}") from None
    return module


def _place(path: Path, error: Exception) -> str:
    """``file:line`` of the last line of the file that an error has passed."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return f"{path}:{lines[-1]}" if lines else str(path)


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, RigError) else f"{type(error).__name__}: {brief(str(error))}"
