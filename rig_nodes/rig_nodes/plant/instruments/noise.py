# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Counter-based noise: the same (seed, channel, sample) gives the same number, whatever was drawn before.

Called by the engine and runs.gauges; because of it a run does not depend on how it is cut into pieces.
"""

from __future__ import annotations

import numpy as np

from ...base import njit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_CHANNEL = np.uint64(0xD1B54A32D192ED03)


@njit(cache=True, error_model="numpy", forceinline=True)
def _mix(z: np.uint64) -> np.uint64:
    # splitmix64 finaliser (Steele, Lea, Flood 2014): full avalanche of a 64-bit counter
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True, error_model="numpy", forceinline=True)
def channel_key(seed: int, channel: int) -> np.uint64:
    """Return the key (uint64) at which the numbers of a channel begin, for :func:`noise_at`."""
    return _mix(np.uint64(seed) * _GOLDEN + np.uint64(channel) * _CHANNEL)


@njit(cache=True, error_model="numpy", forceinline=True)
def noise_at(key: np.uint64, sample: int) -> float:
    """Return a number of zero mean and unit variance, the sum of four 16-bit uniforms, which is never beyond 3.5."""
    z = _mix(key + np.uint64(sample) * _GOLDEN)
    low = np.uint64(0xFFFF)
    total = float(z & low) + float((z >> np.uint64(16)) & low)
    total += float((z >> np.uint64(32)) & low) + float(z >> np.uint64(48))
    # four uniforms on 0..65535: mean 131070, variance 4 (65536^2 - 1) / 12
    return (total - 131070.0) * (1.0 / 37837.22722)


@njit(cache=True, error_model="numpy", forceinline=True)
def uniform(seed: int, channel: int, sample: int) -> float:
    """Return a number from 0 to below 1, uniformly distributed."""
    z = _mix(channel_key(seed, channel) + np.uint64(sample) * _GOLDEN)
    return float(z >> np.uint64(11)) / 9007199254740992.0  # 53 bits
