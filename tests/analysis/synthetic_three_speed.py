# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A planetary transmission of three clutches and three gears, and shifts of it made by hand, with all times known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from synthetic_shift import PERIOD, RPM

from rig_nodes.bags.logged import Recording
from rig_nodes.rig.structure import End
from rig_nodes.rig.transmission import Clutch, Gear, Inertias, Transmission

KISS = {"C1": 0.2e6, "C2": 0.3e6, "B1": 0.25e6}
GEARS = {1: ("C1", "B1"), 2: ("C1", "C2"), 3: ("C2", "B1")}
RATIOS = {1: 3.0, 2: 1.8, 3: 1.0}
CLUTCHES = tuple(
    Clutch(
        name,
        f"clutch_{name.lower()}",
        f"valve_{name.lower()}",
        f"V-{name}",
        k,
        f"p_{name.lower()}",
        f"I_{name.lower()}",
        f"I_set_{name.lower()}",
        kiss,
        13e6,
    )
    for k, (name, kiss) in enumerate(KISS.items())
)
BOX = Transmission(
    End("in", "n_in", "M_in"),
    End("out", "n_out", "M_out"),
    CLUTCHES,
    (Gear(0, "N"), *(Gear(number, f"{number}.", held, RATIOS[number]) for number, held in GEARS.items())),
    Inertias(0.5, 0.2),
)


@dataclass
class ThreeSpeedShift:
    """Times in s after the order, which comes at 1 s."""

    old: int
    new: int
    fall: float = 0.30  # the first releasing pressure starts to fall from 2 MPa, at 13 MPa/s
    later: float = 0.05  # between the falls of two releasing clutches
    rise: float = 0.25  # all engaging pressures rise from here, at 4 MPa/s
    depart: float = 0.40  # the output leaves its old speed
    end: float = 0.55  # it reaches its new one
    rpm: float = 1500.0

    def channels(self) -> dict[str, np.ndarray]:
        t = np.arange(30_000) * PERIOD - 1.0
        w = np.full(t.size, self.rpm / RPM)
        old, new = (0.0 if gear == 0 else 1.0 / RATIOS[gear] for gear in (self.old, self.new))
        moved, pressures = BOX.shift(self.old, self.new), {}
        for clutch in CLUTCHES:
            if clutch in moved.releasing:
                start = self.fall + self.later * moved.releasing.index(clutch)
                p = np.clip(2e6 - 13e6 * (t - start), 0.0, 2e6)
            elif clutch in moved.engaging:
                p = np.clip(4e6 * (t - self.rise), 0.0, 2e6)
            else:
                p = np.full(t.size, 2e6 if clutch in BOX.engaged(self.old) else 0.0)
            pressures[clutch.pressure] = p
        return {
            "M_in": np.interp(t, [self.depart, self.end - 1e-2, self.end, self.end + 0.1], [60.0, 200.0, 190.0, 80.0]),
            "n_in": w,
            "M_out": np.full(t.size, 100.0),
            "n_out": w * np.interp(t, [self.depart, self.end], [old, new]),
            **pressures,
        }

    def recording(self, **changed) -> Recording:
        return Recording(0.0, PERIOD, self.channels() | changed, [(1.0, self.old, self.new)], BOX)

    def both(self, releasing: float, engaging: float) -> float:
        """Returns the time in which the first releasing and the last engaging clutch are above these kiss pressures [s]."""
        return self.fall + (2e6 - releasing) / 13e6 - (self.rise + engaging / 4e6)
