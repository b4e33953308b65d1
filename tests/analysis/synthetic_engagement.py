# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One engagement of S1 made by hand, with all times known, for the tests of the analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from synthetic_shift import I1, PERIOD, RPM, noisy

from rig_nodes.bags.logged import Recording
from rig_nodes.rig.configuration import load_rig

ORDER = 0.5  # s


@dataclass
class Engagement:
    """Times in s after the order, pressures in Pa; the shape is that of p1 in chapter 9."""

    rpm: float = 500.0
    rise: float = 0.20  # time at which the pressure leaves its rest
    fill_slope: float = 1.622e6  # Pa/s
    fill: float = 0.0863  # s from this time to the jump
    plateau: float = 1.02e6
    plateau_for: float = 0.080  # with 0 the jump continues as the ramp
    ramp: float = 5.87e6  # Pa/s
    end: float = 2.3e6
    kiss: float = 0.17e6
    dip: float = 0.0  # Pa by which the pressure falls once within 60 ms after the plateau
    closed: float = 0.46  # time at which the slip reaches zero
    peak: float = 120.0
    length: float = 1.5

    def pressure(self, t: np.ndarray) -> np.ndarray:
        contact = self.rise + self.fill
        low = self.fill_slope * self.fill
        top = contact + 14e-3
        leave = top + self.plateau_for
        points = [(self.rise, 0.0), (contact, low), (top, self.plateau)]
        level = self.plateau
        if self.plateau_for:
            points.append((leave, self.plateau))
        if self.dip:
            points += [(leave + 20e-3, level + 0.4e6), (leave + 50e-3, level + 0.4e6 - self.dip)]
            leave, level = points[-1]
        points.append((leave + (self.end - level) / self.ramp, self.end))
        return np.interp(t, *zip(*points))

    def channels(self) -> dict[str, np.ndarray]:
        t = np.arange(int(round(self.length / PERIOD))) * PERIOD - ORDER
        p = self.pressure(t)
        w = np.full(t.size, self.rpm / RPM)
        start = self.closed - 0.12
        n_wyj = w / I1 * np.interp(t, [start, self.closed], [0.0, 1.0])
        carried = 50.0e-6 * np.maximum(p - self.kiss, 0.0)
        m_wyj = np.where(t < self.closed, np.minimum(carried, self.peak), 30.0)
        m_wej = np.where(t < self.closed, np.minimum(carried, self.peak) / I1 + 3.0, 28.0)
        return {"M_wej": m_wej, "n_wej": w, "M_wyj": m_wyj, "n_wyj": n_wyj, "p1": p, "p2": np.zeros(t.size)}

    def recording(self, noise_seed: int | None = None, hum: float = 0.0) -> Recording:
        channels = self.channels()
        if noise_seed is not None:
            channels = noisy(channels, noise_seed)
        channels["p1"] = channels["p1"] + hum * np.sin(2 * np.pi * 50.0 * np.arange(channels["p1"].size) * PERIOD)
        return Recording(0.0, PERIOD, channels, [(ORDER, 0, 1)], load_rig("hydmag").transmission)
