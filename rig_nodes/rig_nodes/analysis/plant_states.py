# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shift metrics from the plant's own states in a simulated bag, for comparison with those of the transducers.

`rig report --truth` uses it. The states come at 200 Hz without noise; the rate limits the accuracy of each metric.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..rig import Transmission
from .definitions import RPM, reasons_in

if TYPE_CHECKING:
    from ..bags import Bag
    from .gathered import Gathered

# the message fields that are read
GEARBOX, SHAFTS = "/gearbox/state", ("torque_in", "speed_in", "speed_out")
CLUTCH = ("mode", "heat", "torque")
LOCKED = 2
BEFORE = 0.2  # s before the order whose mean is the speed the shift starts from
WHY_NOT = (
    "t_d, t_p and overlap (their starts lie between two states), t_o and E_loss (defined by the torque meters; "
    "the plant's own account is the energy balance)"
)

States = dict[str, dict[str, np.ndarray]]


def states_of(bag: Bag | Gathered, box: Transmission) -> States | None:
    """Return the state topics of a bag as topic -> {t [s], fields}; None when it has no plant states (a real recording)."""
    found: States = {}
    for topic, names in {GEARBOX: SHAFTS, **{clutch.state: CLUTCH for clutch in box.clutches}}.items():
        t, columns = bag.fields(topic, list(names))
        if not len(t):
            return None
        found[topic] = {"t": t, **dict(zip(names, columns))}
    return found


def metrics_of_states(states: States, row: dict, box: Transmission, next_order_time: float | None = None) -> dict | None:
    """Return the metrics of one shift by the plant's states.

    Parameters
    ----------
    states : States
        Result of :func:`states_of`.
    row : dict
        The shift's row of shift.shift_metrics.
    box : Transmission
        That of the rig.
    next_order_time : float, optional
        Time of the next order [s].

    Returns
    -------
    dict or None
        None when the states do not cover the shift or the clutches never locked. t_lock_s: from the order to the first state in
        which all engaging clutches have locked (up to 5 ms late; the laboratory's slip threshold may be reached before or
        after it). input_torque_max_nm, output_speed_min_rpm, k: peak torque in the input shaft, lowest output speed and k in
        the window of the measured t_dt that ends there, or from the order without a t_dt, and in a downshift until the output
        stops falling. They are extremes at 200 Hz, so a peak of a few ms may be higher. heat_<clutch>_j and
        torque_<clutch>_max_nm: of every clutch, from the order to the settled torque or, without it, to the lock-up; the heats
        are integrals, exact except for 5 ms at the ends.
    """
    order = row["t_order_s"]
    until = np.inf if next_order_time is None else next_order_time
    gearbox = states[GEARBOX]
    engaging = box.shift(row["from_gear"], row["to_gear"]).engaging
    locks = [lock for clutch in engaging if (lock := _lock(states[clutch.state], order, until)) is not None]
    before = (gearbox["t"] >= order - BEFORE) & (gearbox["t"] < order)
    if not locks or len(locks) < len(engaging) or not before.any():
        return None
    end = max(locks)
    start = order if row["t_dt_s"] is None else max(order, end - row["t_dt_s"])
    inside = (gearbox["t"] >= start) & (gearbox["t"] <= end + (row["fall_s"] or 0.0) + 1e-9)
    turns_round = box.turns_round(row["from_gear"], row["to_gear"])  # past standstill, where a lowest speed has no meaning
    way = 1.0 if box.ratios[row["to_gear"]] > 0.0 else -1.0
    lowest = way * float((way * gearbox["speed_out"][inside]).min())  # in the direction of the ordered gear
    found: dict[str, float | None] = {
        "t_lock_s": end - order,
        "input_torque_max_nm": float(gearbox["torque_in"][inside].max()),
        "output_speed_min_rpm": None if turns_round else lowest * RPM,
        "k": None,
    }
    if row["from_gear"] in box.ratios and not turns_round and "k" not in reasons_in(row):
        ratio = box.slower_ratio(row["from_gear"], row["to_gear"])
        found["k"] = way * lowest / float(np.mean(gearbox["speed_in"][before])) * ratio
    last = end
    if row["t_c_s"] is not None and row["t_o_s"] is not None:
        last = max(end, order + row["t_c_s"] + row["t_o_s"])
    for clutch in box.clutches:
        state = states[clutch.state]
        t, heat = state["t"], state["heat"]
        found[f"{clutch.heat}_j"] = float(np.interp(last, t, heat) - np.interp(order, t, heat))
        part = state["torque"][(t >= order) & (t <= last)]
        found[f"torque_{clutch.key}_max_nm"] = float(np.max(np.abs(part))) if part.size else None
    return found


def _lock(clutch: dict[str, np.ndarray], order: float, until: float) -> float | None:
    """Return when an engaging clutch was first locked after an order; one that was still locked at the order must open first."""
    opened = np.flatnonzero((clutch["mode"] != LOCKED) & (clutch["t"] >= order))
    locked = (clutch["mode"] == LOCKED) & (clutch["t"] >= order) & (clutch["t"] < until)
    hits = np.flatnonzero(locked[opened[0] :]) if opened.size else np.array([], dtype=int)
    return float(clutch["t"][opened[0] + hits[0]]) if hits.size else None
