# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Springs that slide and contacts with backlash: what a shaft with a characteristic has beside its table.

Used by driveline/lines.py and driveline/quick.py.
"""

from __future__ import annotations

from rig_nodes.base import INNER, njit
from rig_nodes.driveline.algebra import noinline


@njit(**INNER)
def spring_with_friction(stiffness: float, limit: float, torque: float, dx: float) -> tuple[float, float]:
    """Return (slope of the straight line from a torque with the spring's mean over a twist dx, torque after that twist)."""
    noinline()
    way = dx if dx >= 0.0 else -dx
    towards = torque if dx >= 0.0 else -torque
    room = max(0.0, (limit - towards) / stiffness)
    if way <= room or way < 1e-30:
        return stiffness, torque + stiffness * dx
    gained = room * 0.5 * (limit - towards) + (way - room) * (limit - towards)
    return 2.0 * gained / (way * way), limit if dx >= 0.0 else -limit


@njit(**INNER)
def sliding_heat(stiffness: float, limit: float, torque: float, dx: float) -> float:
    """Return the energy that such a spring loses over a twist dx [J]."""
    noinline()
    slope, after = spring_with_friction(stiffness, limit, torque, dx)
    return (torque + 0.5 * slope * dx) * dx - 0.5 * (after**2 - torque**2) / stiffness


@njit(**INNER)
def in_contact(gap: float, x: float, dx: float) -> float:
    """Return the share of the twist from x to x + dx that lies outside the backlash, which reaches from -gap to gap."""
    noinline()
    if gap == 0.0:
        return 1.0
    low, high = min(x, x + dx), max(x, x + dx)
    if low == high:
        return 1.0 if x >= gap or x <= -gap else 0.0
    return 1.0 - max(0.0, min(high, gap) - max(low, -gap)) / (high - low)


@njit(**INNER)
def contact_damping(damping: float, gap: float, x: float, dx: float, push: float, slope: float, rate: float) -> float:
    """Return the damping of a shaft over the twist from x to x + dx; a contact at an end of its backlash only pushes.

    While a contact opens, the torque is zero from the twist on at which the damping would exceed the torque of the spring, as in
    the Modelica Standard Library's ElastoBacklash2. The energy that the spring still has there is lost.

    Parameters
    ----------
    damping, gap : float
        Damping in contact [Nm s/rad] and half the backlash [rad].
    x, dx : float
        Twist at the start, and its change [rad].
    push, slope : float
        Torque of the characteristic at the start [Nm], and its mean slope over the change [Nm/rad].
    rate : float
        Mean rate of the twist [rad/s].

    Returns
    -------
    float
        The damping [Nm s/rad] whose mean torque over the change is that of the contact.
    """
    noinline()
    found = damping * in_contact(gap, x, dx)
    if gap == 0.0 or (x + 0.5 * dx) * rate >= 0.0:
        return found
    side = 1.0 if x + 0.5 * dx > 0.0 else -1.0
    first = side * (push + found * rate)
    last = first + side * slope * dx
    if first >= 0.0 and last >= 0.0:
        return found
    mean = 0.0
    if first > 0.0:
        mean = 0.5 * first * first / (first - last)
    elif last > 0.0:
        mean = 0.5 * last * last / (last - first)
    # where the contact opens within the change, the line is only the mean of the characteristic
    return min(found, max(0.0, (side * mean - push - 0.5 * slope * dx) / rate))
