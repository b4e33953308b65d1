# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bare problem of two inertias and a clutch that closes: its exact lock-up time, our driveline for it, and longer chains.

``rig bench peers`` and ``rig bench scaling`` use it. Inertias, capacity and times are as in the laboratory's gearbox:
0.7 and 0.127 kg m2, 0 to 264 Nm in 45 ms, 2 s. The capacity rises as a quarter of a sine wave, so that no tool is exact by
chance with straight lines. A torque acts on both sides, so that the common speed goes on changing after the lock-up.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...base import njit
from ...driveline import HI0, HI1, KIN0, KIN1, LO0, LO1, LOCK, N_EVENTS, Driveline, State, System, quiet_step
from ...plant import Addresses, Sizes, addresses, driveline_dtype, general_step

if TYPE_CHECKING:
    from ...base import Record

J1, J2 = 0.7, 0.127  # kg m2
CAPACITY, RISE, STICK = 264.0, 0.045, 1.1  # Nm, s, break-away over kinetic torque
DRIVE, LOAD = 60.0, -40.0  # Nm on the first and the last body
W1 = 1500.0 * math.pi / 30.0  # rad/s; initial speed of the first body; the second is at rest
END = 2.0  # s


def capacity(t: float) -> float:
    """Return the friction torque of the slipping clutch [Nm] at a time [s]."""
    return CAPACITY if t >= RISE else CAPACITY * math.sin(0.5 * math.pi * t / RISE)


def lock_up() -> float:
    """Return the exact time of the lock-up [s], from the momentum of the slip; after the rise all torques are constant."""
    per_torque = 1.0 / J1 + 1.0 / J2
    apart = DRIVE / J1 - LOAD / J2
    left = W1 + apart * RISE - per_torque * CAPACITY * RISE * 2.0 / math.pi
    return RISE + left / (per_torque * CAPACITY - apart)


def end_speed() -> float:
    """Return the exact common speed at the end [rad/s], from the total angular momentum."""
    return (J1 * W1 + (DRIVE + LOAD) * END) / (J1 + J2)


def chain(clutches: int = 1) -> System:
    """Return bodies in a row with clutches between them: the bare problem, or a longer row of its second body."""
    line = Driveline()
    line.inertia("0", J1, W1)
    for k in range(clutches):
        line.inertia(str(k + 1), J2, 0.0)
        line.clutch(f"c{k}", str(k), str(k + 1), stick=STICK)
    return line.build()


class Ours:
    """The driveline of this project on a chain of clutches that close at once.

    Parameters
    ----------
    clutches : int
        Number of clutches.
    """

    def __init__(self, clutches: int = 1) -> None:
        self.system = s = chain(clutches)
        self._addresses = addresses()
        self._line = np.zeros(1, driveline_dtype(Sizes(speeds=clutches + 1, elements=clutches)))
        line = self._line[0]
        for name in ("minv", "w", "sh", "kc"):
            line[name] = getattr(s, name)
        line["q"][:, 0], line["q"][:, -1] = DRIVE, LOAD
        line["cap"] = s.limits()
        self.state = State(*(line[name] for name in State._fields))
        self._advance = _advance.made  # numba's own function, because a call may be one short step

    def start(self) -> None:
        """Set the state of time 0."""
        x = self.state
        x.v[:] = self.system.v_start
        x.mode[:] = x.el[:] = x.e_in[:] = x.count[:] = x.work[:] = 0
        self.t = 0.0

    def advance(self, step: float, steps: int) -> None:
        """Make ``steps`` steps of the length ``step`` [s]."""
        self._advance(self.t, steps, step, self._line, self._addresses)
        self.t += step * steps

    def run(self, step: float, parts: int = 1) -> float:
        """Run until END in steps of one length and return the time of the first lock-up.

        Parameters
        ----------
        step : float
            Length of a step [s].
        parts : int
            Number of calls in which the steps are made.

        Returns
        -------
        float
            Time of the first lock-up [s].
        """
        self.start()
        steps = math.ceil(END / step - 1e-9)
        for part in range(parts):
            self.advance(step, steps * (part + 1) // parts - steps * part // parts)
        return self.lock()

    def run_straight(self, steps: int) -> float:
        """Compute the rise in some steps and the rest in one step, which is exact for torques that are straight lines over time.

        Parameters
        ----------
        steps : int
            Number of steps of the rise.

        Returns
        -------
        float
            Time of the first lock-up [s].
        """
        self.start()
        self.advance(RISE / steps, steps)
        self.advance(END - RISE, 1)
        return self.lock()

    def lock(self) -> float:
        """Return the time of the first lock-up so far [s]; inf when there is none."""
        for t, _, kind in self.state.events[: self.state.count[N_EVENTS]]:
            if kind == LOCK:
                return float(t)
        return math.inf


_capacity = njit(cache=True, error_model="numpy", nogil=True)(capacity)


@njit(cache=True, error_model="numpy", nogil=True)
def _advance(begin: float, steps: int, h: float, lines: Record, addresses: Addresses) -> None:
    line = lines[0]
    # the straight line through the capacity at the step's two Gauss points has the mean of the capacity to the fourth order
    at = 0.5 - 0.5 / math.sqrt(3.0)
    for i in range(steps):
        t = begin + i * h
        if t >= RISE:
            before = after = CAPACITY
        else:
            low, high = _capacity(t + at * h), _capacity(t + (1.0 - at) * h)
            slope = (high - low) / (1.0 - 2.0 * at)
            before, after = max(0.0, low - at * slope), high + at * slope
        for f in range(line.w.shape[0]):
            line.cap[KIN0, f], line.cap[KIN1, f] = before, after
            line.cap[HI0, f], line.cap[HI1, f] = STICK * before, STICK * after
            line.cap[LO0, f], line.cap[LO1, f] = -STICK * before, -STICK * after
        if not quiet_step(h, line):
            general_step(addresses, h, t, line)
