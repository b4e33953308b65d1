# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A first-order lag that ends at exactly zero; used by plant.parts.proportional_valve, plant.parts.oil_supply and
plant.parts.load_pump.
"""

from __future__ import annotations

from ...base import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def lagged(value: float, target: float, decay: float) -> float:
    """Return a value, never negative, after a time in which its difference to ``target`` falls to the share ``decay``.

    A value below 1e-200 becomes 0: an endless decay would reach denormal numbers, which slow the processor down by a fifth.
    """
    after = target + (value - target) * decay
    return after if after > 1e-200 else 0.0
