# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The range of each signal of a run: the results of a rig without gears and without a bench's evaluation.

analysis.run_report uses it for rigs without gears.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError, number_text

if TYPE_CHECKING:
    from ..bags import Bag, Logger

LOGGER = "/instruments/hmg4000"


class Ranges:
    """Lowest, mean, highest and last value of each signal that a bag holds, gathered from its pieces."""

    def __init__(self, bag: Bag) -> None:
        """Prepare for the signals of a bag's rig; ``bag`` may be any piece of it."""
        self._signals = bag.catalogue.signals
        self._logged: set[str] = set()  # signals of which the logger has rows
        self._found: dict[str, list] = {}  # lowest, sum, number, highest, last

    def add(self, piece: Bag, logger: Logger | None) -> None:
        """Take the values of a piece, or of the whole bag.

        Parameters
        ----------
        piece : Bag
            The piece.
        logger : Logger, optional
            Its rows of the logger; None when it has none that can be used.
        """
        logged = {} if logger is None else logger.channels
        self._logged |= logged.keys()
        for name, signal in self._signals.items():
            if signal.states or not (name in logged or (name not in self._logged and piece.counts.get(signal.topic))):
                continue
            try:
                values = logged[name] if name in logged else piece.series(signal)[1]
            except RigError:
                continue  # the bag is of another version of the message
            values = values[np.isfinite(values)]
            if not len(values):
                continue
            # a longer mantissa, so that the mean does not depend on the pieces
            lowest, total, count, highest, _ = self._found.get(name, (np.inf, np.longdouble(0.0), 0, -np.inf, 0.0))
            total += values.sum(dtype=np.longdouble)
            self._found[name] = [min(lowest, values.min()), total, count + len(values), max(highest, values.max()), values[-1]]

    def rows(self) -> list[dict]:
        """Return the ranges.

        Returns
        -------
        list of dict
            ``signal, quantity, unit, lowest, mean, highest, last`` for each signal in the order of the catalogue, in the unit in
            which the signal is displayed; signals that are states of a device have no row.
        """
        rows = []
        for name, signal in self._signals.items():
            if name in self._found:
                lowest, total, count, highest, last = self._found[name]
                shown = [float(signal.shown(one)) for one in (lowest, float(total / count), highest, last)]
                numbers = dict(zip(("lowest", "mean", "highest", "last"), shown))
                rows.append({"signal": name, "quantity": signal.quantity, "unit": signal.display_unit, **numbers})
        return rows


def signal_ranges(bag: Bag) -> list[dict]:
    """Return what :meth:`Ranges.rows` does, of a bag in memory."""
    try:
        logger = bag.logger(fill=True) if bag.counts.get(LOGGER) else None
    except RigError:
        logger = None
    ranges = Ranges(bag)
    ranges.add(bag, logger)
    return ranges.rows()


def range_cells(rows: Iterable[Mapping]) -> list[list[str]]:
    """Return the ranges as the rows of a table, its head first; none without a signal."""
    table = [["signal", "unit", "lowest", "mean", "highest"]]
    table += [[row["signal"], row["unit"], *(number_text(row[key] + 0.0) for key in ("lowest", "mean", "highest"))] for row in rows]
    return table if len(table) > 1 else []
