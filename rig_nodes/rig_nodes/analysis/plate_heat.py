# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The temperature of a clutch's plates above the oil's, from the heat that its messages carry.

The view draws it, and analysis.state_at_order reads it at the orders.
"""

from __future__ import annotations

import numpy as np


def above_the_oil(
    t: np.ndarray, heat: np.ndarray, capacity: float, cooling: float, before: tuple[float, float, float] | None = None
) -> np.ndarray:
    """Return the exact solution for heat at a constant rate between two messages.

    Parameters
    ----------
    t, heat : (n,) array of float
        Times [s] and heat since time 0 [J].
    capacity, cooling : float
        Heat capacity [J/K], and heat flow to the oil per kelvin [W/K].
    before : tuple of float, optional
        Time [s], heat [J] and temperature above the oil [K] before the first message; by default there is none above it.

    Returns
    -------
    (n,) array of float
        Temperature above that of the oil [K].
    """
    if not len(t):
        return np.empty(0)
    start, stored, over = before or (float(t[0]), float(heat[0]), 0.0)
    spent = np.diff(t, prepend=start) * cooling / capacity
    left = np.exp(-spent)
    rise = np.divide(-np.expm1(-spent), spent, out=np.ones_like(spent), where=spent > 0.0) / capacity
    values = []
    for share, more in zip(left.tolist(), (np.diff(heat, prepend=stored) * rise).tolist()):
        over = over * share + more
        values.append(over)
    return np.array(values)
