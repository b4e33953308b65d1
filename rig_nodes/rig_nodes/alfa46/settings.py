# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the Alfa46: profiles, delays, gains, read and checked from YAML.

Used by testbench.configuration; alfa46.law runs on the numbers that come out of here.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..clocks import SAMPLE
from ..config import load_yaml
from ..config.schema import build, check_keys, param, where_of
from ..config.units import quantity
from ..errors import RigError, brief
from . import law

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from ..transmission import Transmission

POINTS = ("P1", "P2", "P3", "P4", "P5", "P6")
CURRENT_LOOP = ("gain_p", "gain_i", "gain_d", "derivative_time")
OUTPUT_KEYS = tuple(f"output_{k + 1}" for k in range(law.OUTPUTS))


@dataclass(frozen=True)
class Alfa46Values:
    """Scalar settings; delays are those of the changes between two gears that follow each other."""

    sample_time: float = param("time", SAMPLE, SAMPLE, "Time between two samples of the controller")
    pwm_frequency: float = param("frequency", 10.0, 1e5, "Frequency of the PWM on the coils")
    supply_voltage: float = param("voltage", 1.0, 100.0, "Voltage that the power stage switches to the coils")
    gain_p: float = param("resistance", 0.0, 1e5, "Proportional gain of the current loop", live=True)
    gain_i: float = param("gain integral", 0.0, 1e7, "Integral gain of the current loop", live=True)
    gain_d: float = param("inductance", 0.0, 1e3, "Derivative gain of the current loop", live=True)
    derivative_time: float = param("time", 1e-3, 10.0, "Filter time of the derivative in the current loop", live=True)
    current_limit: float = param("current", 0.0, 0.8, "Largest current that a profile may ask for")
    t12: float = param(
        "time", -5.0, 5.0, "Delay from gear 1 to 2; negative: the engaging valve is switched on that much earlier", live=True
    )
    t21: float = param(
        "time", -5.0, 5.0, "Delay from gear 2 to 1; negative: the engaging valve is switched on that much earlier", live=True
    )
    t23: float = param(
        "time", -5.0, 5.0, "Delay from gear 2 to 3; negative: the engaging valve is switched on that much earlier", 0.0, live=True
    )
    t32: float = param(
        "time", -5.0, 5.0, "Delay from gear 3 to 2; negative: the engaging valve is switched on that much earlier", 0.0, live=True
    )


@dataclass(frozen=True)
class Alfa46Config:
    """Everything the box is set to. profiles: (outputs, 6, 2), time [s] and current [A]."""

    values: Alfa46Values
    profiles: np.ndarray

    def law_config(self, box: Transmission) -> np.ndarray:
        """One record for the compiled law. box: the transmission (rig_nodes.transmission) whose gears can be ordered."""
        record = np.zeros(1, law.LAW_CONFIG)
        record["period"] = self.values.sample_time
        for gear in box.gears:
            if gear.number <= law.GEARS:
                record["drives"][0, gear.number] = sum(1 << output for output in gear.outputs)
        for name in law.LAW_CONFIG.names:
            if name not in ("period", "drives"):
                record[name] = getattr(self.values, name)
        return record

    def as_dict(self) -> dict:
        """Plain SI values for the run's record."""
        out = {f.name: getattr(self.values, f.name) for f in fields(self.values)}
        out["profiles"] = {key: self.profiles[k].tolist() for k, key in enumerate(OUTPUT_KEYS)}
        return out


def read_profile(node: Any, path: str | Path, what: str, limit: float) -> np.ndarray:
    """(6, 2) times and currents of P1-P6; RigError when times do not increase or a current is out of bounds.

    P1-P3 must increase among themselves, and P4-P6 too: each half counts from its own switch signal.
    """
    check_keys(path, node, POINTS, POINTS, what)
    points = np.zeros((6, 2))
    for k, name in enumerate(POINTS):
        where = f"{where_of(path, node, name)}: {what}.{name}"
        entry = node[name]
        if not (isinstance(entry, list) and len(entry) == 2):
            raise RigError(f"{where} must be [time, current], e.g. [200 ms, 160 mA], found {brief(entry)}")
        points[k] = quantity(entry[0], "time", where), quantity(entry[1], "current", where)
        check_point(points, k, where, limit)
    return points


def check_point(points: np.ndarray, k: int, where: str, limit: float) -> None:
    """Point k of a profile (6, 2), those before it being right; RigError as :func:`read_profile`."""
    time, current = points[k]
    if not 0.0 <= current <= limit:
        raise RigError(f"{where} asks for {current * 1e3:g} mA; the valve takes 0 to {limit * 1e3:g} mA")
    first = k in (0, 3)
    before = 0.0 if first else points[k - 1, 0]
    earliest = 0.0 if first else before + SAMPLE  # points closer than a sample would coincide
    if not (earliest <= time <= 60.0 and time > 0.0):
        since = "the switch signal" if first else f"{POINTS[k - 1]} at {before * 1e3:g} ms"
        raise RigError(f"{where} is at {time * 1e3:g} ms; it must come after {since} (at most 60 s)")


def check_gains(level: str, names: Iterable[str]) -> None:
    """RigError where settings of these names are gains of a loop that the controller does not close at its level."""
    gain = next((name for name in names if name in CURRENT_LOOP), None)
    if gain is not None and level == "current":
        raise RigError(
            f"{gain} refused: at level current the rig's own power stage closes the loop, with the gains of "
            "the rig's configuration; set them with --set"
        )


def check_profile(points: np.ndarray, what: str, limit: float) -> None:
    """A whole profile (6, 2), times [s] and currents [A]; RigError as :func:`read_profile`."""
    for k, name in enumerate(POINTS):
        check_point(points, k, f"{what}.{name}", limit)


def read_alfa46(path: str | Path, node: Any = None) -> Alfa46Config:
    """The settings of a file (or of an already loaded map of it); RigError with file and line."""
    node = load_yaml(path) if node is None else node
    values = build(Alfa46Values, node, path, "alfa46", others=("profiles",))
    check_keys(path, node, node, ("profiles",), "alfa46")
    profiles = node["profiles"]
    check_keys(path, profiles, OUTPUT_KEYS, OUTPUT_KEYS, "alfa46.profiles")
    table = [read_profile(profiles[key], path, f"alfa46.profiles.{key}", values.current_limit) for key in OUTPUT_KEYS]
    return Alfa46Config(values, np.array(table))
