# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shift metrics from what the plant itself knows, beside those of the transducers: state topics of a simulated bag.

Used by `rig report --truth`. The states come at 200 Hz without noise, so each metric is marked by what that allows.
"""

from __future__ import annotations

import numpy as np

from .metrics import RATIO, RPM

# the field of each topic's message that is read
FIELDS = {"/gearbox/state": ("m_wej", "w_wej", "w_wyj"), "/clutch_s1/state": ("mode", "heat", "torque"),
          "/clutch_s2/state": ("mode", "heat", "torque")}
LOCKED = 2
CLUTCH = {1: "/clutch_s1/state", 2: "/clutch_s2/state"}
BEFORE = 0.2  # s before the order whose mean is the speed the shift starts from
KEYS = ("t_lock_s", "m_wej_max_nm", "n_wyj_min_rpm", "k", "heat_s1_j", "heat_s2_j", "torque_s1_max_nm",
        "torque_s2_max_nm")
WHY_NOT = ("t_d, t_p and overlap (their starts lie between two states), t_o and E_loss (defined by the torque meters; "
           "the plant's own account is the energy balance)")

States = dict[str, dict[str, np.ndarray]]


def states_of(bag) -> States | None:
    """Topic -> {t [s], fields} of a bag's state topics; None where it holds no plant's states (a real recording)."""
    found: States = {}
    for topic, names in FIELDS.items():
        rows = [(stamp * 1e-9, *(float(getattr(message, name)) for name in names))
                for stamp, message in bag.messages(topic)]
        if not rows:
            return None
        found[topic] = dict(zip(("t", *names), np.asarray(rows).T))
    return found


def truth_of(states: States, row: dict, next_order_time: float | None = None) -> dict | None:
    """What the plant says of one shift, under :data:`KEYS`; None where it does not cover the shift or it never locked.

    row: of metrics.shift_metrics. t_lock_s: from the order to the first state in which the engaging clutch is locked
    (up to 5 ms late; the laboratory's slip threshold may come before it or after). Peak torque in the input shaft,
    lowest output speed and k in the window of the measured t_dt that ends there, from the order without one; extremes
    of 200 Hz, so that a peak of a few ms may be higher. Heat of both clutches and their highest torques from the order
    to the settled torque or, without one, to the lock-up; these are integrals, exact but for 5 ms at the ends.
    """
    order, new = row["t_order_s"], CLUTCH[row["to_gear"]]
    until = np.inf if next_order_time is None else next_order_time
    clutch, gearbox = states[new], states["/gearbox/state"]
    locked = (clutch["mode"] == LOCKED) & (clutch["t"] >= order) & (clutch["t"] < until)
    # a clutch that was still locked when the order came has not engaged by it
    opened = np.flatnonzero((clutch["mode"] != LOCKED) & (clutch["t"] >= order))
    hits = np.flatnonzero(locked[opened[0]:]) if opened.size else np.array([], dtype=int)
    before = (gearbox["t"] >= order - BEFORE) & (gearbox["t"] < order)
    if hits.size == 0 or not before.any():
        return None
    end = float(clutch["t"][opened[0] + hits[0]])
    start = order if row["t_dt_s"] is None else max(order, end - row["t_dt_s"])
    inside = (gearbox["t"] >= start) & (gearbox["t"] <= end + 1e-9)
    lowest = float(gearbox["w_wyj"][inside].min())
    found = {"t_lock_s": end - order, "m_wej_max_nm": float(gearbox["m_wej"][inside].max()),
             "n_wyj_min_rpm": lowest * RPM, "k": None}
    if row["from_gear"] in RATIO:
        found["k"] = lowest / float(np.mean(gearbox["w_wej"][before])) * RATIO[1]
    last = end
    if row["t_c_s"] is not None and row["t_o_s"] is not None:
        last = max(end, order + row["t_c_s"] + row["t_o_s"])
    for name, topic in (("s1", CLUTCH[1]), ("s2", CLUTCH[2])):
        t, heat = states[topic]["t"], states[topic]["heat"]
        found[f"heat_{name}_j"] = float(np.interp(last, t, heat) - np.interp(order, t, heat))
        part = states[topic]["torque"][(t >= order) & (t <= last)]
        found[f"torque_{name}_max_nm"] = float(np.max(np.abs(part))) if part.size else None
    return found
