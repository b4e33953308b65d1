# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The settings of one shift as the tuner sees them: eleven whole numbers, in ms and mA as the box takes them.

Used by studies.tune.search; the result is an Alfa46Config within the hardware's currents, times and rates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base import RigError
from ...rig import Alfa46Config, Alfa46Values, Clutch, RigConfig, Transmission, check_profile

# name -> (lowest, highest); gaps are times between a point and the one before it. P1 to P3 belong to the engaging valve,
# P4 to P6 to the releasing one. The current of P3 is given; that of P6 is 0, because the coil is off after it.
BOUNDS = {
    "P1.time": (20, 400),
    "P1.current": (0, 800),
    "P2.gap": (5, 400),
    "P2.current": (100, 700),
    "P3.gap": (20, 800),
    "P4.time": (5, 400),
    "P4.current": (0, 500),
    "P5.gap": (5, 350),
    "P5.current": (0, 400),
    "P6.gap": (5, 150),
    "delay": (-500, 200),
}
LONGEST = 1500  # ms from the order to the last point of both profiles
MS, MA = 1e-3, 1e-3


def moved(transmission: Transmission, way: str) -> tuple[Clutch, Clutch]:
    """Return the clutches that a shift moves.

    Parameters
    ----------
    transmission : Transmission
        The gearbox.
    way : str
        Name of the shift, e.g. I-II.

    Returns
    -------
    engaging : Clutch
        The clutch that is engaged.
    releasing : Clutch
        The clutch that is released.

    Raises
    ------
    RigError
        When there are several of them or none.
    """
    shift = transmission.shift(*transmission.ways()[way])
    if len(shift.engaging) != 1 or len(shift.releasing) != 1:
        raise RigError(f"the shift {way} does not release one clutch for another, and only such a shift can be tuned")
    return shift.engaging[0], shift.releasing[0]


def delay_of(transmission: Transmission, way: str) -> str:
    """Return the name of the box's delay of a shift, e.g. t12 from the first gear to the second.

    Raises
    ------
    RigError
        When the box has no such delay.
    """
    name = "t{}{}".format(*transmission.ways()[way])
    if name not in Alfa46Values.__dataclass_fields__:
        raise RigError(f"the shift {way} has no delay of its own in the box, and only a shift that has one can be tuned")
    return name


@dataclass(frozen=True)
class Rates:
    """What a coil can follow between two currents: it rises with the supply and falls through its own resistance.

    Parameters
    ----------
    supply : float
        Supply voltage [V].
    resistance : float
        Resistance of the coil [ohm].
    inductance : float
        Inductance of the coil [H].
    """

    supply: float  # V
    resistance: float  # ohm
    inductance: float  # H

    @classmethod
    def of(cls, config: RigConfig, clutch: Clutch) -> Rates:
        """Return the rates of the coil of a clutch's valve."""
        coil = config.values(clutch.valve)
        supply = min(coil.coil_voltage, config.alfa46.values.supply_voltage)
        return cls(supply, coil.coil_resistance, coil.coil_inductance)

    def shortest(self, i0: float, i1: float) -> float:
        """Return the least time [s] for a straight line from i0 to i1 [A] whose slope the coil still follows at the worse end."""
        if i1 > i0:
            spare = self.supply - self.resistance * i1
            return np.inf if spare <= 0.0 else (i1 - i0) * self.inductance / spare
        # The current falls by itself through the coil's resistance; the line is followed down to a tenth of its height.
        return (i0 - i1) * self.inductance / (self.resistance * max(i1, 0.1 * i0)) if i0 > i1 else 0.0


def whole(values: dict[str, int]) -> tuple[int, ...]:
    """Return the settings as whole numbers in the order of BOUNDS."""
    return tuple(int(values[name]) for name in BOUNDS)


def values_of(config: Alfa46Config, way: str, transmission: Transmission) -> dict[str, int]:
    """Return the numbers of existing settings, rounded to whole ms and mA.

    Parameters
    ----------
    config : Alfa46Config
        The settings.
    way : str
        Name of the shift, e.g. I-II.
    transmission : Transmission
        The gearbox.

    Returns
    -------
    dict of str to int
        The numbers by the names of BOUNDS.
    """
    engaging, releasing = (config.profiles[clutch.output] for clutch in moved(transmission, way))
    t, i = engaging[:, 0] / MS, engaging[:, 1] / MA
    u, j = releasing[:, 0] / MS, releasing[:, 1] / MA
    found = (
        t[0],
        i[0],
        t[1] - t[0],
        i[1],
        t[2] - t[1],
        u[3],
        j[3],
        u[4] - u[3],
        j[4],
        u[5] - u[4],
        getattr(config.values, delay_of(transmission, way)) / MS,
    )
    return {name: int(round(float(value))) for name, value in zip(BOUNDS, found)}


def inside(values: dict[str, int]) -> dict[str, int]:
    """Return the settings with each that is outside its BOUNDS at the nearest value inside."""
    return {name: min(max(values[name], low), high) for name, (low, high) in BOUNDS.items()}


def settings(base: Alfa46Config, way: str, values: dict[str, int], transmission: Transmission) -> Alfa46Config:
    """Return a base with the numbers of one shift put in.

    Parameters
    ----------
    base : Alfa46Config
        Its current of P3 and its points of the other shift are kept.
    way : str
        Name of the shift, e.g. I-II.
    values : dict of str to int
        The numbers by the names of BOUNDS.
    transmission : Transmission
        The gearbox.

    Returns
    -------
    Alfa46Config
        The settings.
    """
    profiles = base.profiles.copy()
    engaging, releasing = (clutch.output for clutch in moved(transmission, way))
    v = values
    t1 = v["P1.time"]
    t2 = t1 + v["P2.gap"]
    profiles[engaging, :3, 0] = np.array([t1, t2, t2 + v["P3.gap"]]) * MS
    profiles[engaging, :2, 1] = np.array([v["P1.current"], v["P2.current"]]) * MA
    t4 = v["P4.time"]
    t5 = t4 + v["P5.gap"]
    profiles[releasing, 3:, 0] = np.array([t4, t5, t5 + v["P6.gap"]]) * MS
    profiles[releasing, 3:, 1] = np.array([v["P4.current"], v["P5.current"], 0]) * MA
    return Alfa46Config(replace(base.values, **{delay_of(transmission, way): v["delay"] * MS}), np.round(profiles, 9))


def refused(base: RigConfig, way: str, values: dict[str, int]) -> float:
    """Return by how much settings ask for more than the hardware gives.

    Parameters
    ----------
    base : RigConfig
        The rig; its controller has the settings that the values replace in part.
    way : str
        Name of the shift, e.g. I-II.
    values : dict of str to int
        The numbers by the names of BOUNDS.

    Returns
    -------
    float
        Excess of slopes and length together [s]; 0 when there is none.
    """
    box = base.transmission
    config = settings(base.alfa46, way, values, box)
    engaging, releasing = moved(box, way)
    too_much = 0.0
    up, hold = config.profiles[engaging.output], config.profiles[releasing.output]
    points = [
        (engaging, (0.0, 0.0), up[0]),
        (engaging, up[0], up[1]),
        (engaging, up[1], up[2]),
        (releasing, (0.0, hold[2, 1]), hold[3]),
        (releasing, hold[3], hold[4]),
    ]
    for clutch, a, b in points:
        too_much += max(0.0, Rates.of(base, clutch).shortest(a[1], b[1]) - (b[0] - a[0]))
    delay = getattr(config.values, delay_of(box, way))
    last = max(max(0.0, delay) + up[2, 0], max(0.0, -delay) + hold[5, 0])
    return too_much + max(0.0, last - LONGEST * MS)


def check(config: Alfa46Config) -> None:
    """Check that the box takes the settings, which are whole ms and mA.

    Raises
    ------
    RigError
        When the box would refuse them.
    """
    for number, profile in enumerate(config.profiles):
        check_profile(profile, f"output_{number + 1}", config.values.current_limit)
        if not np.allclose(np.round(profile / MS), profile / MS, atol=1e-6):
            raise RigError(f"output_{number + 1}: the box takes whole ms and mA")
