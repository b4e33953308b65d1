# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the motor with its converter, and of the load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .fault import BELOW, ERRATIC, FIRST_SPN, INTERMITTENT, STUCK, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

MOTOR, LOAD, SPN = "dc_motor", "load_pump", FIRST_SPN + 160


def weak(motor: Target, size: float) -> None:
    """Take a share of the torque and of the power."""
    for limit in ("torque_limit", "braking_limit", "power_limit"):
        motor[limit] *= 1.0 - size


def tripping(motor: Target, _size: float) -> None:
    """Block the converter: no torque either way."""
    weak(motor, 1.0)


def chattering(load: Target, size: float) -> None:
    """Let the poppet of the relief valve swing by a share of the pressure that it is set to."""
    load["chatter"] += size


FAULTS = (
    Fault(
        *("weak", MOTOR, "armature", "The motor is weak."),
        *("speed falls under load", weak, SPN, BELOW),
        Size("ratio", 0.0, 1.0, 0.6, "share of torque and power that is lost"),
        effect="motor_speed",
    ),
    Fault(
        *("tripping", MOTOR, "converter", "The converter trips and starts again."),
        *("torque is gone now and then", tripping, SPN, STUCK),
        onset=INTERMITTENT,
        effect="motor_speed",
    ),
    Fault(
        *("chattering", LOAD, "relief valve", "The relief valve chatters."),
        *("load pressure and output torque swing", chattering, SPN + 32, ERRATIC),
        Size("ratio", 0.0, 1.0, 0.3, "amplitude as a share of the setting"),
    ),
)
