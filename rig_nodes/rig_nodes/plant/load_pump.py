# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load pump PO (type PWK) with relief valve in its pressure line: a passive load on the output shaft wk.

Called by plant.kernel as a torque capacity that the driveline applies as friction, so it can hold, never drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi

from numba import njit

from ..config.schema import param
from .lag import lagged

RPM = pi / 30.0


@dataclass(frozen=True)
class LoadConfig:
    """Pump and relief valve."""

    displacement: float = param("displacement", 1e-8, 1e-3)
    mechanical_loss: float = param("torque", 0.0, 100.0)
    pressure_time: float = param("time", 1e-4, 1.0)
    pressure_limit: float = param("pressure", 1e5, 1e8)


@njit(cache=True, error_model="numpy", forceinline=True)
def relief_factor(speed):
    """Pressure over setting of the relief valve against speed [rad/s]: f(n) of Annex D, n in rpm."""
    n = abs(speed) / RPM
    return 3.84e-7 * n * n - 6.36e-4 * n + 1.32


@njit(cache=True, error_model="numpy", forceinline=True)
def line_pressure(pressure, setting, enabled, speed, h, load):
    """Pressure [Pa] of the pump's pressure line after h; an opened relief valve leaves none."""
    return pressure_after(pressure, setting, enabled, speed, exp(-h / load.pressure_time), load)


@njit(cache=True, error_model="numpy", forceinline=True)
def pressure_after(pressure, setting, enabled, speed, decay, load):
    """:func:`line_pressure` over a time in which the share ``decay`` of a change is still to come."""
    target = 0.0
    if enabled:
        target = min(setting * relief_factor(speed), load.pressure_limit)
    return lagged(pressure, target, decay)


@njit(cache=True, error_model="numpy", forceinline=True)
def torque_capacity(pressure, load):
    """Torque [Nm] with which the pump resists turning: V/(2 pi) p plus its own friction."""
    return load.displacement * pressure + load.mechanical_loss


def most_torque(load: LoadConfig) -> float:
    """Torque [Nm] that the pump holds at its pressure limit: :func:`torque_capacity` without the kernel's record."""
    return load.displacement * load.pressure_limit + load.mechanical_loss


def relief_setting_for(torque: float, speed: float, load: LoadConfig) -> float:
    """Relief setting [Pa] that gives this load torque [Nm] at this output speed [rad/s]."""
    return max(0.0, torque - load.mechanical_loss) / (load.displacement * relief_factor(speed))
