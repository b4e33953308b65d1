# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a combustion engine, and of the centrifugal clutch behind that of a saw."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from .fault import BELOW, ERRATIC, FIRST_SPN, INTERMITTENT, NEVER, STUCK, UNCALIBRATED, UNKNOWN, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

ENGINE, CLUTCH, SPN, SHOES = "combustion_engine", "centrifugal_clutch", FIRST_SPN + 512, FIRST_SPN + 544


def misfiring(engine: Target, size: float) -> None:
    """Let a share of the firings fail, drawn by their numbers."""
    engine["misfires"] = max(engine["misfires"], size)


def cutting_out(engine: Target, _size: float) -> None:
    """Let no firing happen."""
    misfiring(engine, 1.0)


def weak(engine: Target, size: float) -> None:
    """Take a share of the torque curve, as a lack of compression or fuel does; the engine's own drag stays."""
    for point in ("torque_low", "torque_peak", "torque_high"):
        engine[point] *= 1.0 - size


def stuck(engine: Target, _size: float) -> None:
    """Hold throttle or rack where they are: their travel takes for ever."""
    engine["throttle_time"] *= NEVER


def oily(clutch: Target, size: float) -> None:
    """Take a share of the friction between shoes and drum."""
    clutch["friction"] *= 1.0 - size


def spring(clutch: Target, size: float) -> None:
    """Take a share of the springs' force, which grows with the square of the speed at which the shoes touch the drum."""
    clutch["engagement_speed"] *= sqrt(1.0 - size)


FAULTS = (
    Fault(
        *("misfiring", ENGINE, "ignition", "Firings fail."),
        *("the engine runs unevenly, and needs more throttle for the same torque", misfiring, SPN, ERRATIC),
        Size("ratio", 0.0, 1.0, 0.3, "share of the firings"),
    ),
    Fault(
        *("cutting_out", ENGINE, "ignition", "Ignition or fuel are cut."),
        *("torque is gone now and then", cutting_out, SPN, BELOW),
        onset=INTERMITTENT,
    ),
    Fault(
        *("weak", ENGINE, "cylinders", "The engine is weak."),
        *("more throttle for the same torque; speed falls under load", weak, SPN, BELOW),
        Size("ratio", 0.0, 1.0, 0.6, "share of the torque at full throttle that is lost"),
    ),
    Fault(
        *("stuck", ENGINE, "throttle", "The throttle, or the rack of the governor, stays where it is."),
        *("speed follows the load and no longer its setpoint", stuck, SPN, STUCK),
    ),
    Fault(
        *("oily", CLUTCH, "shoes", "There is oil on the shoes."),
        *("the clutch slips longer at the same speed", oily, SHOES, UNCALIBRATED),
        Size("ratio", 0.0, 1.0, 0.5, "share of the friction that is lost"),
    ),
    Fault(
        *("spring", CLUTCH, "springs", "The springs of the shoes are weak or broken."),
        *("the drum turns at idle", spring, SHOES, UNKNOWN),
        Size("ratio", 0.0, 1.0, 0.6, "share of their force that is lost"),
    ),
)
