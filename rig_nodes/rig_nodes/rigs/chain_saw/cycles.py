# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cycles of the chain saw: in the static view of the paper, and as turns of the crank in a recording; calculations.py uses it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import norm

from rig_nodes.base import RigError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rig_nodes.plant import CentrifugalConfig
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

SPEED = 950.0  # rad/s, p. 5
DELTA, SCATTER = 0.032, 0.013  # p. 4: mean and standard deviation of the irregularity
MEAN, SPREAD = 3.20, 0.51  # Nm, p. 5: M_o and s_p
TURN = np.linspace(0.0, 2.0 * np.pi, 721)


def engagement_speed(clutch: CentrifugalConfig) -> float:
    """Return the speed from which the clutch's shoes press, by their mass [rad/s]."""
    return clutch.engagement_speed * float(np.sqrt(clutch.engagement_mass / clutch.shoe_mass))


class Case(NamedTuple):
    """A clutch with a bar in the static view: M_s [Nm], J_b + m_p r_k^2 [kg m2], and the paper's delta with its deviation."""

    capacity: float
    inertia: float

    @property
    def per_delta(self) -> float:
        """Largest inertia torque for a delta of 1 [Nm]."""
        return self.inertia * SPEED**2

    def share(self, mean: float = DELTA, scatter: float = SCATTER) -> float:
        """Return the share of cycles whose largest torque, that of inertia at the upper dead centre, is above M_s."""
        return float(norm.sf((self.capacity / self.per_delta - mean) / scatter))

    def over(self, of: Callable[[float], float]) -> float:
        """Return the mean of a value over all cycles, by the normal law of delta."""
        return _mean(np.array([of(one) for one in _deltas()]))

    def excess(self, delta: float) -> float:
        """Return the excess of a cycle's largest torque over M_s [Nm]."""
        return max(0.0, self.per_delta * delta - self.capacity)

    def excess_over_turn(self, delta: float) -> float:
        """Return the mean over a turn of the excess of the torque (13) over M_s [Nm]."""
        asked = self.per_delta * delta * np.cos(TURN) + MEAN * (1.0 - np.cos(TURN))
        return float(np.trapezoid(np.maximum(0.0, np.abs(asked) - self.capacity), TURN) / (2.0 * np.pi))

    def slip_time(self, delta: float) -> float:
        """Return the share of a turn in which the torque of (13) is above M_s."""
        if self.excess(delta) == 0.0:
            return 0.0
        return float(np.arccos((self.capacity - MEAN) / (self.per_delta * delta - MEAN)) / np.pi)

    def slip_work(self) -> float:
        """Return the mean work of slip in a turn [J] for a drum that the clutch drives from an engine with a prescribed speed.

        Turns of all deltas are integrated together, from a third of a turn before the upper dead centre, where none slips.
        """
        delta = _deltas()
        step = (TURN[1] - TURN[0]) / SPEED
        drum, work = SPEED * (1.0 + delta * np.sin(TURN[480])), np.zeros(len(delta))
        for angle in np.concatenate([TURN[480:-1] - 2.0 * np.pi, TURN]):
            crank, ahead = (SPEED * (1.0 + delta * np.sin(one)) for one in (angle, angle + step * SPEED))
            load = MEAN * (1.0 - np.cos(angle))
            asked = self.per_delta * delta * np.cos(angle) + load
            slip = crank - drum
            locked = np.abs(slip) < 1e-9
            way = np.where(locked, np.sign(asked), np.sign(slip))
            after = drum + step * (way * self.capacity - load) / self.inertia
            holds = locked & (np.abs(asked) <= self.capacity)
            work += np.where(holds, 0.0, step * self.capacity * np.maximum(0.0, 0.5 * way * (slip + ahead - after)))
            drum = np.where(holds | (way * (ahead - after) <= 0.0), ahead, after)
        return _mean(work)


def _deltas() -> np.ndarray:
    return np.linspace(max(0.0, DELTA - 5.0 * SCATTER), DELTA + 6.0 * SCATTER, 401)


def _mean(values: np.ndarray) -> float:
    """Return the mean over all cycles of values at the irregularities of _deltas, by the normal law of delta."""
    return float(np.trapezoid(values * norm.pdf(_deltas(), DELTA, SCATTER), _deltas()))


class Cycles(NamedTuple):
    """Turns of the crank in a recording, from upper dead centre to upper dead centre.

    Parameters
    ----------
    begin, end : (n,) arrays of int
        First row of each turn, and first row of the next one.
    angle : (rows,) array
        Angle of the crank since the start [rad].
    """

    begin: np.ndarray
    end: np.ndarray
    angle: np.ndarray


def cycles_of(config: RigConfig, recording: Recorded) -> Cycles:
    """Return the whole turns in wood with the clutch's shoes firmly on the drum, or in the whole run when no wood is cut."""
    w, t = np.nan_to_num(recording["n_engine"]), recording.t
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))])
    turns = np.floor(angle / (2.0 * np.pi)).astype(int)
    starts = np.flatnonzero(np.diff(turns) > 0) + 1
    begin, end = starts[:-1], starts[1:]
    feed = np.nan_to_num(recording["F_feed"])
    engaged = 1.3 * engagement_speed(config.clutch)
    wanted = np.minimum.reduceat(w, begin) > engaged if len(begin) else np.zeros(0, bool)
    cutting = np.array([feed[b:e].min() for b, e in zip(begin, end)]) > 0.9 * config.chain.stated_feed
    # a cut begins with the feed; its first quarter of a second is a transient and is left out
    settled = np.array([feed[max(0, b - 2500) : b + 1].min() for b in begin]) > 0.9 * config.chain.stated_feed
    wanted = wanted & cutting & settled if (wanted & cutting & settled).any() else wanted
    if not wanted.any():
        raise RigError(f"no turn of the crank stays above {engaged:.0f} rad/s in this recording; take one of the sequence cut")
    return Cycles(begin[wanted], end[wanted], angle)


def each(values: np.ndarray, cycles: Cycles, of: Callable[[np.ndarray], float]) -> np.ndarray:
    """Return a value of each turn (turns,), made of the values (rows,) in it."""
    return np.array([of(values[b:e]) for b, e in zip(cycles.begin, cycles.end)])


def irregularity(w: np.ndarray, cycles: Cycles) -> np.ndarray:
    """Return delta of each turn by (8) and (9)."""
    high, low = each(w, cycles, np.max), each(w, cycles, np.min)
    return (high - low) / (high + low)


def slipping(config: RigConfig, recording: Recorded, cycles: Cycles) -> tuple[np.ndarray, np.ndarray]:
    """Return the turns in which a slip begins, and the turns with slip, as arrays of bool (turns,).

    Slip is a difference of the speeds of engine and drum by more than six times the noise of their meters and 1 rad/s. A slip
    around the upper dead centre lies in two turns but begins in one.
    """
    noise = config.instruments.speed_noise if config.effects.transducers else 0.0
    slip = np.abs(recording["n_engine"] - recording["n_drum"]) > 1.0 + 6.0 * np.sqrt(2.0) * noise
    onset = slip & ~np.concatenate([[True], slip[:-1]])
    return each(onset, cycles, np.any), each(slip, cycles, np.any)
