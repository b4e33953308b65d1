# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small table whose columns have units: shifts, events and sweeps from Python are such tables.

It needs no other package; ``to_pandas`` gives a DataFrame where pandas is installed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ..analysis import every_metric, unit_of
from ..base import RigError, brief, optional, unknown
from .given import chosen

if TYPE_CHECKING:
    import pandas
    import pyarrow
    from matplotlib.figure import Figure

    from ..view import Description

GEARS = ("from_gear", "to_gear")  # columns whose cells are names in Python, numbers in files
MOST_ROWS = 40  # that a repr shows


class Table:
    """Rows of numbers and words under named columns.

    ``table["name"]`` is a column as an array (rows,): numbers in the column's unit, NaN where there is none, or words.
    ``table[0]`` is a row as a dict, ``table[:3]`` a table, and iteration gives one row after the other; ``name in table`` asks for
    a column.

    Parameters
    ----------
    units : mapping of str to str
        The unit of each column by its name; "" for words and numbers without a unit.
    rows : sequence of mapping
        The cells of each row by column; what is missing or None has no value.
    shown : sequence of str, optional
        The columns that printing shows; all by default.
    figures : function, optional
        figures(places) describes what :meth:`plot` draws of the rows at these places (range); without it there is no figure.

    Examples
    --------
    >>> table = Table({"gear": "", "t_c_s": "s"}, [{"gear": "II", "t_c_s": 0.67}, {"gear": "I"}])
    >>> table
    gear  t_c_s
    II     0.67
    I         -
    >>> table["t_c_s"]
    array([0.67,  nan])
    >>> table[0]["gear"], len(table), table.units["t_c_s"]
    ('II', 2, 's')
    """

    def __init__(
        self,
        units: Mapping[str, str],
        rows: Sequence[Mapping[str, Any]],
        shown: Sequence[str] | None = None,
        figures: Callable[[range], list[Description]] | None = None,
    ) -> None:
        self.units, self._figures = dict(units), figures
        self._shown = [name for name in units if shown is None or name in shown]
        self._rows = [{name: row.get(name) for name in self.units} for row in rows]
        self._places = range(len(self._rows))  # among the rows that figures knows

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self.units)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter([dict(row) for row in self._rows])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.units

    @overload
    def __getitem__(self, key: int) -> dict[str, Any]: ...
    @overload
    def __getitem__(self, key: str) -> np.ndarray: ...
    @overload
    def __getitem__(self, key: slice) -> Table: ...
    def __getitem__(self, key: int | str | slice) -> dict[str, Any] | np.ndarray | Table:
        if isinstance(key, slice):
            part = Table(self.units, self._rows[key], self._shown, self._figures)
            part._places = self._places[key]
            return part
        if not isinstance(key, str):
            if not isinstance(key, int | np.integer) or not -len(self) <= key < len(self):
                raise RigError(f"there is no row {brief(key)}; the table has {len(self)} rows, the first is 0")
            return dict(self._rows[key])
        if key not in self.units:
            raise RigError(unknown("column", key, self.units))
        cells = [row[key] for row in self._rows]
        if all(cell is None or (isinstance(cell, (int, float)) and not isinstance(cell, bool)) for cell in cells):
            whole = cells and all(isinstance(cell, int) for cell in cells)
            return np.array(cells, dtype=int if whole else float)
        return np.array(cells, dtype=bool if all(isinstance(cell, bool) for cell in cells) else object)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a DataFrame; the units are in its ``attrs["units"]``.

        Raises
        ------
        RigError
            When pandas is not installed.
        """
        frame = optional("pandas").DataFrame({name: self[name] for name in self.units})
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_arrow(self) -> pyarrow.Table:
        """Return the table as one of Arrow; a column's unit is in the metadata of its field.

        Raises
        ------
        RigError
            When pyarrow is not installed.

        Examples
        --------
        >>> table = Table({"gear": "", "t_c_s": "s"}, [{"gear": "II", "t_c_s": 0.67}, {"gear": "I"}]).to_arrow()
        >>> table["t_c_s"].to_pylist(), table.field("t_c_s").metadata
        ([0.67, None], {b'unit': b's'})
        """
        pa, fields, columns = optional("pyarrow"), [], []
        for name, unit in self.units.items():
            cells = [row[name] for row in self._rows]
            known = any(cell is not None for cell in cells)
            columns.append(pa.array(cells, None if known or not unit else pa.float64()))
            fields.append(pa.field(name, columns[-1].type, metadata={"unit": unit} if unit else None))
        return pa.Table.from_arrays(columns, schema=pa.schema(fields))

    def plot(self, number: int = 1, dark: bool = False) -> Figure:
        """Draw the metrics of a sweep's shifts over what was varied, with a line for each further condition and the spread.

        Parameters
        ----------
        number : int
            The change of gears, from 1 on, in the order of the rows.
        dark : bool
            True for a dark ground.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, of which a notebook shows the picture.

        Raises
        ------
        RigError
            When the table is not that of a sweep, there is no such change of gears, or matplotlib is not installed.
        """
        if self._figures is None:
            raise RigError("this table has no figure; that of rig_nodes.sweep has one, and a run and a comparison have plot() too")
        optional("matplotlib")
        from ..view import draw_figure

        drawn = self._figures(self._places)
        number = chosen("figure", number, len(drawn), "the sweep") + 1
        return draw_figure(drawn[number - 1], dark)

    def _cells(self) -> list[list[str]]:
        """Return the head and the rows as text, the first and the last ones of many."""
        rows = [[_text(row[name]) for name in self._shown] for row in self._rows]
        if len(rows) > MOST_ROWS:
            rows = [*rows[: MOST_ROWS // 2], ["..."] * len(self._shown), *rows[-MOST_ROWS // 2 :]]
        return [[self._title(name) for name in self._shown], *rows]

    def _title(self, name: str) -> str:
        """Return the name of a column with its unit, where the name does not end with it."""
        unit = self.units[name]
        return f"{name} [{unit}]" if unit and not name.endswith(f"_{unit.lower()}") else name

    @property
    def _more(self) -> str:
        """A line on what is not shown."""
        left = len(self.units) - len(self._shown)
        return f"{len(self)} rows; {left} more columns are in .columns" if left else ""

    def __repr__(self) -> str:
        if not self._rows:
            return f"no rows of {', '.join(self.units)}"
        head, *rows = self._cells()
        words = [any(isinstance(row[name], str) for row in self._rows) for name in self._shown]
        widths = [max(map(len, column)) for column in zip(head, *rows)]
        lines = [[cell.ljust(w) if left else cell.rjust(w) for cell, w, left in zip(row, widths, words)] for row in (head, *rows)]
        return "\n".join(["  ".join(line).rstrip() for line in lines] + [self._more] * bool(self._more))

    def _repr_html_(self) -> str:
        head, *rows = ([escape(cell) for cell in row] for row in self._cells())
        body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
        heads = "".join(f"<th>{cell}</th>" for cell in head)
        return f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>{f'<p>{self._more}</p>' * bool(self._more)}"


def column_unit(name: str) -> str:
    """Return the unit of a column of a table of shifts: a metric, the time of the order or a state at it; "" where it has none."""
    metrics = {one.key: one.unit.strip("-") for one in every_metric()} | {"t_order_s": "s"}
    return metrics[name] if name in metrics else unit_of(name) or ""


def _text(cell: object) -> str:
    if cell is None or cell != cell:
        return "-"
    return f"{cell:.4g}" if isinstance(cell, float) else "yes" if cell is True else "no" if cell is False else str(cell)
