# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random scatter from cycle to cycle that depends on the cycle's number alone; for plant.parts.combustion_engine and
plant.parts.saw_chain.
"""

from __future__ import annotations

from math import cos, log, pi, sqrt

from ...base import njit
from ..instruments.noise import uniform

TURN = 2.0 * pi


@njit(cache=True, error_model="numpy")
def uniform_of(seed: float, channel: int, cycle: float) -> float:
    """Return a number from 0 to below 1, uniformly distributed; its arguments are those of :func:`normal_of`."""
    return uniform(int(seed), 2 * channel, int(cycle))


@njit(cache=True, error_model="numpy")
def normal_of(seed: float, channel: int, cycle: float) -> float:
    """Return a normally distributed number of zero mean and unit variance (Box and Muller 1958, from two uniform numbers).

    Parameters
    ----------
    seed, cycle : float
        Whole numbers.
    channel : int
        Number of the scattered quantity; the numbers of different channels are independent.

    Returns
    -------
    float
        The same number for the same arguments.
    """
    u = 1.0 - uniform_of(seed, channel, cycle)
    return sqrt(-2.0 * log(u)) * cos(TURN * uniform(int(seed), 2 * channel + 1, int(cycle)))
