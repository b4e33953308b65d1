# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the Alfa46, which are profiles, delays and gains, read from YAML and checked.

Used by rig.configuration; plant.alfa46_law runs on the numbers that this module returns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import SAMPLE, RigError, brief, build, check_keys, load_yaml, param, quantity, where_of
from ..plant import alfa46_law as law

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from .transmission import Transmission

POINTS = ("P1", "P2", "P3", "P4", "P5", "P6")
CURRENT_LOOP = ("gain_p", "gain_i", "gain_d", "derivative_time")
OUTPUT_KEYS = tuple(f"output_{k + 1}" for k in range(law.OUTPUTS))


@dataclass(frozen=True)
class Alfa46Values:
    """Scalar settings; each delay is that of the change between two gears that follow each other."""

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
    """All settings of the controller.

    Parameters
    ----------
    values : Alfa46Values
        Scalar settings.
    profiles : (outputs, 6, 2) array of float
        Time [s] and current [A] of each point of the profiles.
    """

    values: Alfa46Values
    profiles: np.ndarray

    def law_config(self, box: Transmission) -> np.ndarray:
        """Return the settings as a record for the compiled law.

        Parameters
        ----------
        box : Transmission
            The transmission (rig_nodes.rig.transmission) whose gears can be ordered.

        Returns
        -------
        (1,) record array
            Record of law.LAW_CONFIG.
        """
        record = np.zeros(1, law.LAW_CONFIG)
        record["period"] = self.values.sample_time
        for gear in box.gears:
            if gear.number <= law.GEARS:
                record["drives"][0, gear.number] = sum(1 << output for output in gear.outputs)
        for name in law.LAW_CONFIG.names or ():
            if name not in ("period", "drives"):
                record[name] = getattr(self.values, name)
        return record

    def as_dict(self) -> dict:
        """Return plain SI values for the record of a run."""
        out = {f.name: getattr(self.values, f.name) for f in fields(self.values)}
        out["profiles"] = {key: self.profiles[k].tolist() for k, key in enumerate(OUTPUT_KEYS)}
        return out


def beyond_alfa46(box: Transmission) -> str:
    """Return why the Alfa46 cannot drive a transmission, as one sentence; empty where it can."""
    last = max(box.clutches, key=lambda clutch: clutch.output)
    if last.output >= law.OUTPUTS:
        return (
            f"the Alfa46 has {law.OUTPUTS} outputs, and {last.valve_name} is on output {last.output + 1}; run this rig with a "
            "controller of your own (--controller)"
        )
    if len(box.gears) - 1 > law.GEARS:
        return f"the Alfa46 has {law.GEARS} gears; run a rig with {len(box.gears) - 1} with a controller of your own (--controller)"
    return ""


def read_profile(node: Any, path: str | Path, what: str, limit: float) -> np.ndarray:
    """Read the times and currents of P1-P6.

    P1-P3 must increase among themselves, and so must P4-P6: each half counts from its own switch signal.

    Parameters
    ----------
    node : Any
        The loaded map of the profile.
    path : str or Path
        The file, for messages.
    what : str
        Name of the profile in messages.
    limit : float
        Largest current [A].

    Returns
    -------
    (6, 2) array of float
        Times [s] and currents [A].

    Raises
    ------
    RigError
        When times do not increase or a current is out of bounds.
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
    """Check point k of a profile whose earlier points are right.

    Parameters
    ----------
    points : (6, 2) array of float
        Times [s] and currents [A].
    k : int
        Number of the point, from 0.
    where : str
        Name of the point in messages.
    limit : float
        Largest current [A].

    Raises
    ------
    RigError
        As for :func:`read_profile`.
    """
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
    """Check that no gain is set of a loop that the controller does not close at its level.

    Parameters
    ----------
    level : str
        Level of the controller.
    names : iterable of str
        Names of the settings.

    Raises
    ------
    RigError
        When one of the settings is a gain of the current loop and the level is "current".
    """
    gain = next((name for name in names if name in CURRENT_LOOP), None)
    if gain is not None and level == "current":
        raise RigError(
            f"{gain} refused: at level current the rig's own power stage closes the loop, with the gains of "
            "the rig's configuration; set them with --set"
        )


def check_profile(points: np.ndarray, what: str, limit: float) -> None:
    """Check a whole profile.

    Parameters
    ----------
    points : (6, 2) array of float
        Times [s] and currents [A].
    what : str
        Name of the profile in messages.
    limit : float
        Largest current [A].

    Raises
    ------
    RigError
        As for :func:`read_profile`.
    """
    for k, name in enumerate(POINTS):
        check_point(points, k, f"{what}.{name}", limit)


def read_alfa46(path: str | Path, node: Any = None) -> Alfa46Config:
    """Read the settings from a file, or from a map of it that is loaded already.

    Parameters
    ----------
    path : str or Path
        The file.
    node : Any, optional
        The loaded map.

    Returns
    -------
    Alfa46Config
        The settings.

    Raises
    ------
    RigError
        With file and line, when a setting is not valid.
    """
    node = load_yaml(path) if node is None else node
    values = build(Alfa46Values, node, path, "alfa46", others=("profiles",))
    check_keys(path, node, node, ("profiles",), "alfa46")
    profiles = node["profiles"]
    more = (
        [key for key in profiles if str(key).startswith("output_") and key not in OUTPUT_KEYS] if isinstance(profiles, dict) else []
    )
    if more:
        raise RigError(f"{where_of(path, profiles, more[0])}: alfa46.profiles has {more[0]}; the Alfa46 has {law.OUTPUTS} outputs")
    check_keys(path, profiles, OUTPUT_KEYS, OUTPUT_KEYS, "alfa46.profiles")
    table = [read_profile(profiles[key], path, f"alfa46.profiles.{key}", values.current_limit) for key in OUTPUT_KEYS]
    return Alfa46Config(values, np.array(table))
