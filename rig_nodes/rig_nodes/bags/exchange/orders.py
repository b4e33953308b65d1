# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orders of gears in the form in which they are written on the command line or in a profile."""

from __future__ import annotations

import re

from ...base import RigError
from ...rig import Transmission

_ORDER = re.compile(r"\s*([0-9]*\.?[0-9]+)\s*(?:s\s*)?:\s*(\w+)\s*-+>?\s*(\w+)\s*$")


def example_of_orders(box: Transmission) -> str:
    """Return an example of what :func:`parse_orders` takes, with the changes of a transmission."""
    return ", ".join(f"{time:g}:{way}" for time, way in zip((3.845, 8.32), box.ways())) or "3.845:FROM-TO"


def parse_orders(text: str, box: Transmission, where: str = "--orders") -> list[tuple[float, int, int]]:
    """Parse orders such as ``"3.845:I-II, 8.32:II-I"``.

    Parameters
    ----------
    text : str
        Time in the recording [s], gear before and gear ordered of each order.
    box : Transmission
        Transmission with the names of the gears (Transmission.number), where 0 is neutral.
    where : str
        Beginning of the error.

    Returns
    -------
    list of (float, int, int)
        Time [s], gear before, gear ordered.

    Raises
    ------
    RigError
        When the text is not in this form; the error shows an example.
    """
    orders: list[tuple[float, int, int]] = []
    example = f"'{example_of_orders(box)}'"
    for part in filter(str.strip, re.split(r"[,;]", text)):
        match = _ORDER.match(part)
        gears = [None] if match is None else [box.number(match[2]), box.number(match[3])]
        if None in gears:
            raise RigError(
                f"{where}: '{part.strip()}' is no order; write the time in s and the gears, e.g. {example} (0 is neutral)"
            )
        order = float(match[1]), gears[0], gears[1]
        if order[1] == order[2]:
            raise RigError(f"{where}: '{part.strip()}' orders the gear that is in; write another after the '-', e.g. {example}")
        if any(order[0] == other[0] for other in orders):
            raise RigError(f"{where}: two orders at {order[0]:g} s; only one gear can be ordered at a time")
        orders.append(order)
    if not orders:
        raise RigError(f"{where} is empty; write e.g. {example}")
    return sorted(orders)
