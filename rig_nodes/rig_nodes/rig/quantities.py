# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The quantities of signals, with the SI unit of the messages and the unit that people read.

rig.signals and the parts use them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi


@dataclass(frozen=True)
class Quantity:
    """One quantity.

    Parameters
    ----------
    name : str
        Its name in the catalogue.
    unit : str
        SI unit of the messages; degC for temperatures.
    display : str
        Unit that people read.
    scale : float
        Factor from ``unit`` to ``display``.
    sign : str
        Meaning of the sign, unless a signal states another.
    gauge : bool
        True for a pressure above ambient.
    """

    name: str
    unit: str
    display: str
    scale: float
    sign: str = "positive"
    gauge: bool = False


# name of a quantity -> name of its dimension in base.units, where they differ
DIMENSIONS = {"volume flow": "volume flow", "electric current": "current"}

QUANTITIES = {
    "torque": Quantity("torque", "N.m", "Nm", 1.0, "positive when it drives"),
    "speed": Quantity("angular velocity", "rad/s", "rpm", 30.0 / pi, "positive in the driving direction"),
    "pressure": Quantity("pressure", "Pa", "MPa", 1e-6, "gauge, positive above ambient", True),
    "current": Quantity("electric current", "A", "mA", 1e3, "positive when it flows from its supply"),
    "temperature": Quantity("temperature", "degC", "degC", 1.0, "Celsius"),
    "force": Quantity("force", "N", "N", 1.0, "positive when pressed"),
    "length": Quantity("length", "m", "mm", 1e3),
    "flow": Quantity("volume flow", "m3/s", "l/min", 60000.0),
    "ratio": Quantity("ratio", "-", "%", 100.0),
    "velocity": Quantity("velocity", "m/s", "km/h", 3.6, "positive forwards"),
    "energy": Quantity("energy", "J", "kJ", 1e-3),
    "state": Quantity("state", "-", "-", 1.0, "none"),
}
