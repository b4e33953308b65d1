# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a user's controller names as its own, checked: settings, and signals with the blocks in which they are recorded.

Used by plugs, by testbench.outputs and by the alfa46 process: the same blocks, whoever sends them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RigError

if TYPE_CHECKING:
    from collections.abc import Sequence

ROWS = 5  # samples of a block: one graph tick
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
MOST = 64
BLOCK, CHANNELS = "/controller/signals", "/controller/channels"


def checked_signals(given: Any, name: str) -> dict[str, str]:
    """Unit by name of a controller's own signals, from names or from a map of names and units; RigError when wrong."""
    units = dict(given) if isinstance(given, dict) else given
    if isinstance(given, Collection) and not isinstance(given, (dict, str)) and all(isinstance(key, str) for key in given):
        units = dict.fromkeys(given, "-")
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
    """A controller's own settings, first value by name; RigError when they are none."""
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
    """Collects a row for each answered sample; samples without one are NaN."""

    def __init__(self, columns: int) -> None:
        self._columns, self._number, self._data = columns, -1, None

    def add(self, sample: int, values: Sequence[float]) -> list[tuple[int, np.ndarray]]:
        """The blocks that are complete with these values (columns,): (sample of the first row, rows (5, columns))."""
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
