# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks what a user's controller names as its own: settings, and signals with the blocks in which they are recorded.

It is used by plugs, by runs.outputs and by the alfa46 process, so that all of them make the same blocks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any

from ..base import RigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

ROWS = 5  # samples of a block: one graph tick
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
MOST = 64
BLOCK, CHANNELS = "/controller/signals", "/controller/channels"


def once_each(pairs: Iterable[tuple[str, Any]], what: str, name: str) -> dict[str, Any]:
    """Return what belongs to each name of a controller's own.

    Parameters
    ----------
    pairs : iterable of (str, object)
        Each name with what belongs to it.
    what : str
        "wants", "signals" or "settings".
    name : str
        The controller's name, for the error's sentence.

    Returns
    -------
    dict of str to object
        The same by name.

    Raises
    ------
    RigError
        When a name comes twice: the controller would see another number of values than it has names.
    """
    out = {}
    for key, value in pairs:
        if key in out:
            raise RigError(f"controller {name}: {what} has the name '{key}' twice, expected each name once")
        out[key] = value
    return out


def checked_signals(given: Any, name: str) -> dict[str, str]:
    """Check a controller's own signals.

    Parameters
    ----------
    given : Any
        A collection of names, or a dict of names and units.
    name : str
        The controller's name, for the error's sentence.

    Returns
    -------
    dict of str to str
        Unit by name; "-" where none was given.

    Raises
    ------
    RigError
        When ``given`` is neither, a name is no identifier or comes twice, or there are more than 64 names.
    """
    units = dict(given) if isinstance(given, dict) else given
    if isinstance(given, Collection) and not isinstance(given, (dict, str)) and all(isinstance(key, str) for key in given):
        units = once_each(((key, "-") for key in given), "signals", name)
    right = isinstance(units, dict) and all(
        isinstance(key, str) and NAME.fullmatch(key) and isinstance(unit, str) for key, unit in units.items()
    )
    if not right or len(units) > MOST:
        raise RigError(
            f"controller {name}: signals is {given!r}, expected up to {MOST} names of letters, digits and "
            "underscores, or a map of names and units"
        )
    return units


def checked_settings(given: Any, name: str) -> dict[str, float]:
    """Check a controller's own settings.

    Parameters
    ----------
    given : Any
        A dict of names and first values.
    name : str
        The controller's name, for the error's sentence.

    Returns
    -------
    dict of str to float
        First value by name.

    Raises
    ------
    RigError
        When ``given`` is no such dict, a value is not finite, or there are more than 64 names.
    """
    right = (
        isinstance(given, dict)
        and len(given) <= MOST
        and all(
            isinstance(key, str) and NAME.fullmatch(key) and isinstance(value, (int, float)) and math.isfinite(value)
            for key, value in given.items()
        )
    )
    if not right:
        raise RigError(f"controller {name}: settings is {given!r}, expected a map of names and first values")
    return {key: float(value) for key, value in given.items()}


class Blocks:
    """Collects a row for each answered sample; the rows of samples without an answer are NaN.

    Parameters
    ----------
    columns : int
        Number of signals.
    """

    def __init__(self, columns: int) -> None:
        self._columns, self._number = columns, -1
        self._data: np.ndarray | None = None

    def add(self, sample: int, values: Sequence[float]) -> list[tuple[int, np.ndarray]]:
        """Add the row of a sample and return the blocks that are complete with it.

        Parameters
        ----------
        sample : int
            Index of the sample since time 0.
        values : (columns,) sequence of float
            Values of the signals.

        Returns
        -------
        list of (int, (5, columns) array of float)
            Sample of the first row, and the rows, of each complete block.
        """
        import numpy as np  # here, because the process of a user's class does without it

        number, row = divmod(sample, ROWS)
        done = []
        if number != self._number:
            done += self._take()
            self._number, self._data = number, np.full((ROWS, self._columns), np.nan)
        self._data[row] = values
        if row == ROWS - 1:
            done += self._take()
        return done

    def _take(self) -> list[tuple[int, np.ndarray]]:
        data, self._data = self._data, None
        return [] if data is None else [(self._number * ROWS, data)]
