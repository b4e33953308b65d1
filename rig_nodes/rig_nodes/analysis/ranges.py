# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The range of each signal of a run: the results of a rig without gears and without a bench's evaluation.

analysis.report uses it for rigs without gears.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..errors import RigError

if TYPE_CHECKING:
    from ..bags.reader import Bag

LOGGER = "/instruments/hmg4000"


def signal_ranges(bag: Bag) -> list[dict]:
    """Return lowest, mean, highest and last value of each signal that a bag holds.

    Parameters
    ----------
    bag : Bag
        The recording.

    Returns
    -------
    list of dict
        ``signal, quantity, unit, lowest, mean, highest, last`` for each signal in the order of the catalogue, in the unit in which
        the signal is displayed; signals that are states of a device have no row.
    """
    try:
        logged = bag.logger(fill=True).channels if bag.counts.get(LOGGER) else {}
    except RigError:
        logged = {}
    rows = []
    for name, signal in bag.catalogue.signals.items():
        if signal.states or not (name in logged or bag.counts.get(signal.topic)):
            continue
        try:
            values = logged[name] if name in logged else bag.series(signal)[1]
        except RigError:
            continue  # the bag is of another version of the message
        values = values[np.isfinite(values)]
        if not len(values):
            continue
        shown = [float(signal.shown(one)) for one in (values.min(), values.mean(), values.max(), values[-1])]
        numbers = dict(zip(("lowest", "mean", "highest", "last"), shown))
        rows.append({"signal": name, "quantity": signal.quantity, "unit": signal.display_unit, **numbers})
    return rows


def range_lines(rows: Iterable[Mapping]) -> list[str]:
    """Return the ranges as a table for the terminal."""
    table = [["signal", "unit", "lowest", "mean", "highest"]]
    table += [[row["signal"], row["unit"], *(f"{row[key]:z.4g}" for key in ("lowest", "mean", "highest"))] for row in rows]
    if len(table) == 1:
        return []
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    return [
        "  ".join(cell.ljust(width) if i < 2 else cell.rjust(width) for i, (cell, width) in enumerate(zip(line, widths)))
        for line in table
    ]
