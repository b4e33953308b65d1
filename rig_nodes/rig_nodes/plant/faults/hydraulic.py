# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of hydraulic motors: one behind a flow regulator, and the two machines of a hydrostatic drive with their valves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .fault import BELOW, FIRST_SPN, NEVER, STUCK, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

MOTOR, DRIVE, SPN = "hydraulic_motor", "hydrostatic_branch", FIRST_SPN + 416
HYDROSTATIC, VALVES = FIRST_SPN + 448, FIRST_SPN + 480


def leaking(motor: Target, size: float) -> None:
    """Open a gap [m2] of worn pistons and valve plate, through which oil passes the motor."""
    motor["leak_area"] += size


def weak(motor: Target, size: float) -> None:
    """Take a share of the displacement: pistons that do not take part any more."""
    motor["lost"] = 1.0 - (1.0 - motor["lost"]) * (1.0 - size)


def dragging(motor: Target, size: float) -> None:
    """Add a friction torque [Nm]: bearings that seize."""
    motor["friction"] += size


def leaking_branch(branch: Target, size: float) -> None:
    """Let the worn gaps of both machines pass so many times more oil, between the lines and into the housings."""
    branch["leak_across"] /= 1.0 + size
    branch["leak_out"] /= 1.0 + size


def weak_pump(branch: Target, size: float) -> None:
    """Take a share of the pump's displacement: pistons that do not take part any more."""
    branch["pump_displacement"] *= 1.0 - size


def weak_motor(branch: Target, size: float) -> None:
    """Take a share of the motor's displacement."""
    branch["motor_displacement"] *= 1.0 - size


def stuck(branch: Target, _size: float) -> None:
    """Hold the pump's swash plate where it is: its travel takes for ever."""
    branch["pump_time"] *= NEVER


def relief(branch: Target, size: float) -> None:
    """Take a share of the force of the relief valves' springs."""
    branch["relief_pressure"] *= 1.0 - size


def boost(branch: Target, size: float) -> None:
    """Take a share of the pressure that the boost pump gives."""
    branch["boost_pressure"] *= 1.0 - size


def lacks_boost(configs: tuple[Any, ...]) -> str:
    """Return what a drive lacks for the loss of its boost pressure."""
    return "" if configs[0].boost_pressure > 0.0 else "it has no boost supply"


FAULTS = (
    Fault(
        *("leaking", MOTOR, "pistons", "The motor's pistons and valve plate are worn and leak."),
        *("it turns slower than its regulator is set for", leaking, SPN, BELOW),
        Size("area", 0.0, 10e-6, 0.5e-6, "area of the gaps"),
    ),
    Fault(
        *("weak", MOTOR, "pistons", "Pistons of the motor have failed."),
        *("it turns faster than its regulator is set for, with less torque for the pressure", weak, SPN, BELOW),
        Size("ratio", 0.0, 0.9, 0.2, "share of the displacement that is lost"),
    ),
    Fault(
        *("dragging", MOTOR, "bearings", "The motor's bearings seize."),
        *("more pressure for the same torque", dragging, SPN, STUCK),
        Size("torque", 0.0, 100.0, 20.0, "further friction"),
    ),
    Fault(
        *("leaking", DRIVE, "pistons", "The pistons and valve plates of pump and motor are worn and leak."),
        *("the output turns slower, the more so under load", leaking_branch, HYDROSTATIC, BELOW),
        Size("ratio", 0.0, 50.0, 4.0, "further flow of the leaks as a multiple of that of new machines"),
    ),
    Fault(
        *("weak_pump", DRIVE, "pump", "Pistons of the pump have failed."),
        *("the output turns slower at the same swivel", weak_pump, HYDROSTATIC, BELOW),
        Size("ratio", 0.0, 1.0, 0.25, "share of the displacement that is lost"),
    ),
    Fault(
        *("weak_motor", DRIVE, "motor", "Pistons of the motor have failed."),
        *("the output turns faster at the same swivel, with more pressure for the same torque", weak_motor, HYDROSTATIC, BELOW),
        Size("ratio", 0.0, 0.9, 0.25, "share of the displacement that is lost"),
    ),
    Fault(
        *("stuck", DRIVE, "swash plate", "The pump's swash plate stays where it is."),
        *("the swivel no longer follows its setpoint", stuck, HYDROSTATIC, STUCK),
    ),
    Fault(
        *("relief", DRIVE, "relief valves", "The springs of the relief valves are broken."),
        *("pressure is limited too low, the output does not turn its load", relief, VALVES, BELOW),
        Size("ratio", 0.0, 1.0, 0.9, "share of the opening pressure that is lost"),
    ),
    Fault(
        *("boost", DRIVE, "boost pump", "The boost pump is worn."),
        *("the pressure of the returning line falls", boost, VALVES, BELOW),
        Size("ratio", 0.0, 1.0, 0.6, "share of the boost pressure that is lost"),
        lacks=lacks_boost,
    ),
)
