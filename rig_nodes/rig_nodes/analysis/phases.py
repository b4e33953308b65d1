# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""When the phases of a shift begin and end, and between which moments its times t_c, t_d, t_p and t_o are counted.

The page of `rig report --html` and the view mark them in their plots. Everything follows from the metrics of the shift.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

FILL, TORQUE, INTERRUPTED, INERTIA = "fill", "torque phase", "interrupted", "inertia phase"


@dataclass(frozen=True)
class Part:
    """A stretch of a shift: its name, when it begins and ends [s], and for a time its length as the metrics have it [s]."""

    name: str
    start: float
    end: float
    length: float = 0.0


def moments_of(row: Mapping) -> dict[str, float]:
    """Return the times [s] of order, kiss point, departure of the output and lock-up of a shift, as far as they were found."""
    found = {"order": 0.0, "kiss point": row.get("kiss_s"), "departure": row.get("departure_s"), "lock-up": row["t_c_s"]}
    return {name: row["t_order_s"] + since for name, since in found.items() if since is not None}


def phases_of(row: Mapping) -> list[Part]:
    """Return the phases of a shift, as far as they were found.

    Fill lasts from the order until all engaging clutches have their kiss pressure. In the torque phase the new clutch takes over
    torque while the output still turns at its old speed, until it departs from that. When it departs before the kiss point, no
    clutch carries it: the drive is interrupted to the kiss point, or as long as the shift was searched for one, and fill and
    interruption overlap. The inertia phase follows and ends with lock-up.
    """
    moments = moments_of(row)
    order, kiss, locked = (moments.get(name) for name in ("order", "kiss point", "lock-up"))
    parts = [] if order is None or kiss is None else [Part(FILL, order, kiss)]
    if row.get("departure_s") is None:
        return parts
    departure, interrupted = order + row["departure_s"], row.get("interrupted_s") or 0.0
    if interrupted > 0.0:
        parts.append(Part(INTERRUPTED, departure, departure + interrupted))
    elif kiss is not None and departure > kiss:
        parts.append(Part(TORQUE, kiss, departure))
    start = departure + interrupted
    return parts if locked is None or locked <= start else [*parts, Part(INERTIA, start, locked)]


def times_of(row: Mapping) -> list[Part]:
    """Return the stretches of t_c, t_d, t_p and t_o, as far as they were found."""
    if row["t_c_s"] is None:
        return []
    locked = row["t_order_s"] + row["t_c_s"]
    ends = {"t_c": (row["t_c_s"], 0.0), "t_d": (row["t_dt_s"], 0.0), "t_p": (row["t_p_s"], 0.0), "t_o": (0.0, row["t_o_s"])}
    return [
        Part(name, locked - before, locked + after, before or after)
        for name, (before, after) in ends.items()
        if before is not None and after is not None
    ]
