# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signals of a run with their times and their unit; ``run.signals`` is a Signals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from ..bags import Bag, Logger
from ..bags import Signals as Groups
from ..base import UNITS, RigError, brief, unknown


class Signal(NDArrayOperatorsMixin):
    """Values (n,) of a signal with their times.

    It is used as an array: numpy takes it, it has an array's operators and methods, and what is computed of it is a plain array. A
    slice or a selection of it keeps its times.

    Parameters
    ----------
    values : (n,) array of float
        The values.
    time : (n,) array of float
        Time of each value [s].
    name : str
        Name of the signal.
    unit : str
        Unit of the values; that of SI unless :meth:`to` made the signal.
    text : str
        One sentence about the signal; empty for a signal of a controller's own.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> p1 = run.signals["p1"]
    >>> p1.unit, p1.to("MPa").unit, bool(p1.max() == p1.values.max())
    ('Pa', 'MPa', True)
    >>> bool((p1[p1.time > 5.0].time > 5.0).all())
    True
    """

    def __init__(self, values: np.ndarray, time: np.ndarray, name: str, unit: str, text: str = "") -> None:
        self.values, self.time, self.name, self.unit, self.text = np.asarray(values, float), time, name, unit, text

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [one.values if isinstance(one, Signal) else one for one in inputs]
        if "out" in options:
            options["out"] = tuple(one.values if isinstance(one, Signal) else one for one in options["out"])
        return getattr(ufunc, method)(*plain, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "values":  # of a copy that has no values yet
            raise AttributeError(name)
        return getattr(self.values, name)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[float]:
        return iter(self.values)

    def __getitem__(self, key: Any) -> Any:
        key = key.values if isinstance(key, Signal) else key
        values = self.values[key]
        if values.ndim != 1 or isinstance(key, tuple):
            return values
        return Signal(values, self.time[key], self.name, self.unit, self.text)

    def to(self, unit: str) -> Signal:
        """Return the signal in another unit.

        Parameters
        ----------
        unit : str
            A unit of the same dimension, e.g. ``"MPa"`` for a pressure.

        Returns
        -------
        Signal
            The converted values, with the same times.

        Raises
        ------
        RigError
            When there is no such unit, or it is one of another dimension.
        """
        dimension, factor = UNITS.get(self.unit, ("", 1.0))
        if unit not in UNITS or UNITS[unit][0] != dimension:
            known = ", ".join(one for one, (of, _) in UNITS.items() if of == dimension)
            raise RigError(
                f"{self.name} is in {self.unit} and not to be had in {brief(unit)}; expected one of {known or self.unit}"
            )
        return Signal(self.values * (factor / UNITS[unit][1]), self.time, self.name, unit, self.text)

    def __repr__(self) -> str:
        if not len(self):
            return f"{self.name} [{self.unit}], no values"
        low, high = (f"{value:.4g}" for value in (np.nanmin(self.values), np.nanmax(self.values)))
        ends = f"{self.time[0]:.4g} to {self.time[-1]:.4g} s"
        return f"{self.name} [{self.unit}], {len(self)} values, {low} to {high}, {ends}"


class Signals(Mapping[str, Signal]):
    """The signals of a run by their names, in SI; each is decoded when it is asked for.

    Parameters
    ----------
    path : Path
        Folder of the run, or its bag.
    owner : object, optional
        What keeps a temporary folder; it stays as long as these signals.

    Attributes
    ----------
    about : Bag
        Events and description of the run, without its other messages.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> "M_wyj" in run.signals, run.signals["M_wyj"].unit
    (True, 'Nm')
    >>> run.signals["M_wjy"]
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: there is no signal 'M_wjy' in the run; did you mean 'M_wyj' or 'M_wej'?
    """

    def __init__(self, path: Path, owner: object = None) -> None:
        self._path, self._owner = path, owner
        chosen = Groups(path)
        self._groups, self.about = chosen.groups, chosen.small
        self._places = {column.name: (group, column) for group in self._groups for column in group.columns}
        self._loggers: dict[str, Logger] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def get(self, name: str, default: Any = None) -> Any:
        """Return a signal, or the default when the run has none of this name, as a dict does."""
        if name not in self:
            return default
        return self[name]

    def __getitem__(self, name: str) -> Signal:
        self.check(name)
        group, column = self._places[name]
        if group.logger or column.signal is None:
            rows = self._rows(group.topic)
            return Signal(rows.channels[name].copy(), rows.time(), name, column.unit, column.text)
        times, values = self._held.series(column.signal)
        return Signal(values, times, name, column.unit, column.text)

    def check(self, name: str) -> None:
        """Raise RigError, with the names most like it, for a signal that the run does not hold."""
        if name not in self._places:
            raise RigError(unknown("signal", name, self._places).replace(";", " in the run;", 1))

    @property
    def span(self) -> tuple[float, float]:
        """Times of the run at which the recording begins and ends [s]."""
        return self._held.recorded_from, self._held.recorded_to / 1e9

    @property
    def period(self) -> float | None:
        """Time between the rows of the fastest logger [s]; None for a run without one."""
        return min((self._rows(group.topic).period for group in self._groups if group.logger), default=None)

    @cached_property
    def _held(self) -> Bag:
        return Bag(self._path)

    def _rows(self, topic: str) -> Logger:
        """Return all rows of a logger; NaN where some are missing."""
        if topic not in self._loggers:
            self._loggers[topic] = self._held.logger(topic, fill=True)
        return self._loggers[topic]

    def __repr__(self) -> str:
        lines = [f"{len(self)} signals"]
        for group in self._groups:
            names = ", ".join(f"{column.name} [{column.unit}]" for column in group.columns)
            lines.append(f"{group.topic}: {names}")
        return "\n".join(lines)
