# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A first-order lag that ends at zero; used by parts.proportional_valve, parts.oil_supply and parts.load_pump."""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def lagged(value: float, target: float, decay: float) -> float:
    """A value that is never negative on its way to ``target``, with the share ``decay`` of the way still to come.

    What fades for ever must not end in denormal numbers, which slow the processor down by a fifth: below 1e-200 it is 0.
    """
    after = target + (value - target) * decay
    return after if after > 1e-200 else 0.0
