# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load pump (the laboratory's PO, type PWK) with relief valve in its pressure line: a passive load on a shaft.

It is a part of the engine. It gives a torque capacity that the driveline applies as friction, so it can hold but never drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sin
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import HI0, HI1, KIN0, KIN1, LO0, LO1
from .lag import lagged
from .part import LOAD, Command, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

PER_RPM = 30.0 / pi
CHATTER = 40.0 * 2.0 * pi  # rad/s: of the poppet of a relief valve that chatters (assumed; a loaded spring of some grams has more)


@dataclass(frozen=True)
class LoadConfig:
    """Values of the pump and its relief valve."""

    displacement: float = param("displacement", 1e-8, 1e-3, "Displacement of the pump")
    mechanical_loss: float = param("torque", 0.0, 100.0, "The pump's own friction on its body, whatever the pressure")
    pressure_time: float = param(
        "time", 1e-4, 1.0, "Time constant with which the pressure in the pump's pressure line follows the relief valve"
    )
    pressure_limit: float = param(
        "pressure", 1e5, 1e8, "Largest pressure in the pump's pressure line, whatever the setting of the relief valve"
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def relief_factor(speed: float) -> float:
    """Return pressure over setting of the relief valve at a speed [rad/s]: f(n) of Annex D, n in rpm."""
    n = abs(speed) * PER_RPM
    return 3.84e-7 * n * n - 6.36e-4 * n + 1.32


@njit(cache=True, error_model="numpy", forceinline=True)
def line_pressure(pressure: float, setting: float, enabled: bool, speed: float, h: float, load: Record) -> float:
    """Return the pressure of the pump's pressure line after a step; with an open relief valve it falls to zero.

    Parameters
    ----------
    pressure : float
        Pressure before the step [Pa].
    setting : float
        Setting of the relief valve [Pa].
    enabled : bool
        False when the relief valve is opened.
    speed : float
        Speed of the pump [rad/s].
    h : float
        Length of the step [s].
    load : Record
        Values of the pump.

    Returns
    -------
    float
        Pressure [Pa].
    """
    return pressure_after(pressure, setting, enabled, speed, exp(-h / load.pressure_time), load)


@njit(cache=True, error_model="numpy", forceinline=True)
def pressure_after(pressure: float, setting: float, enabled: bool, speed: float, decay: float, load: Record) -> float:
    """Return :func:`line_pressure` after a time in which the share ``decay`` of a change is still to come."""
    target = 0.0
    if enabled:
        target = min(setting * relief_factor(speed), load.pressure_limit)
    return lagged(pressure, target, decay)


@njit(cache=True, error_model="numpy", forceinline=True)
def torque_capacity(pressure: float, load: Record) -> float:
    """Return the torque [Nm] with which the pump resists rotation: V/(2 pi) p plus its own friction."""
    return load.displacement * pressure + load.mechanical_loss


def most_torque(load: LoadConfig) -> float:
    """Return the torque [Nm] that the pump holds at its pressure limit: :func:`torque_capacity` without the kernel's record."""
    return load.displacement * load.pressure_limit + load.mechanical_loss


def relief_setting_for(torque: float, speed: float, load: LoadConfig) -> float:
    """Return the relief setting for a load torque.

    Parameters
    ----------
    torque : float
        Load torque [Nm].
    speed : float
        Output speed [rad/s].
    load : LoadConfig
        Values of the pump.

    Returns
    -------
    float
        Setting of the relief valve [Pa].
    """
    factor = relief_factor.py_func(speed)  # for a single call it would take 3 ms to load the compiled function
    return max(0.0, torque - load.mechanical_loss) / (load.displacement * factor)


def load_torque(setting: float, speed: float, load: LoadConfig) -> float:
    """Return the torque [Nm] that a relief setting [Pa] makes at a speed [rad/s]; :func:`relief_setting_for` is its inverse."""
    return load.displacement * min(setting * relief_factor.py_func(speed), load.pressure_limit) + load.mechanical_loss


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of pressure that is still to come after a step."""
    world.values.load_pump[k].decay = exp(-h / world.values.load_pump[k].pressure_time)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set pressure and capacity by the speed in the middle of the step."""
    me, my, line = world.parts.load_pump[k], world.values.load_pump[k], world.driveline
    cap, f = line.cap, my.element
    capacity = cap[KIN1, f]
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = capacity, capacity, -capacity
    if me.held > 0.0:
        me.pressure = me.held_pressure
        capacity = max(0.0, me.held_capacity)
    else:
        setting = me.setting
        if my.chatter > 0.0:
            setting *= 1.0 + my.chatter * sin(CHATTER * t)
        me.pressure = pressure_after(
            me.pressure, setting, me.enabled > 0.0 and world.safe == 0.0, line.middle[my.body], my.decay, my
        )
        capacity = torque_capacity(me.pressure, my)
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = capacity, capacity, -capacity


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its LoadState."""
    me = rig.device(name)
    return (rig.friction_torque(name), rig.capacity(name), me["pressure"], me["setting"], rig.energies["load"])


# setting, enabled: setting and switch of the relief valve; held*: answer of a load outside the plant, for a tick
# (plant.engine.outside); chatter: amplitude of a chattering relief valve as a share of its setting
PART = Part(
    "load_pump",
    40,
    (LoadConfig,),
    state=("setting", "enabled", "pressure", "held", "held_capacity", "held_pressure"),
    derived=("decay", "chatter"),
    wires=("body", "element"),
    stages={"fill": fill, "before": before},
    role=LOAD,
    joined={"body": Wire("body")},
    message="LoadState",
    shown_values=shown_values,
    shows=(
        Shown("torque", "torque", "torque", 0.0, 500.0, "Torque of the load pump.", "positive brakes {body}"),
        Shown("work", "work", "energy", 0.0, 1e9, "Work taken by the load pump since time 0.", "positive taken from the shaft"),
        Shown("relief_setting", "relief_setting", "pressure", 0.0, 4e7, "Setting of the load's relief valve.", "gauge"),
    ),
    takes=(
        Command(
            "load",
            {"torque": "torque", "pressure": "pressure"},
            "setting",
            "enabled",
            "relief pressure of the load",
            "pressure",
            parameter="relief_pressure",
        ),
    ),
)
