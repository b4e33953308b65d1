# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of transducers and their wires: rows of the table that plant.instruments.transducers reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..instruments.transducers import GAIN, HIGH, LOW, NOISE, OFFSET, TURN
from .fault import (
    BAD,
    DRIFTED,
    ERRATIC,
    FIRST_SPN,
    GROWING,
    INTERMITTENT,
    LOST,
    RATE,
    TRANSDUCER,
    UNCALIBRATED,
    UPDATE,
    Fault,
    Size,
)

if TYPE_CHECKING:
    from .fault import Target

SPN = FIRST_SPN + 256


def offset(wire: Target, size: float) -> None:
    """Add a share of the full scale to the reading."""
    wire[OFFSET] += size * wire.span


def gain(wire: Target, size: float) -> None:
    """Let the sensitivity change by a share."""
    wire[GAIN] *= 1.0 + size


def noise(wire: Target, size: float) -> None:
    """Add noise, whose standard deviation is a share of the full scale; the two add as independent ones do."""
    wire[NOISE] = (wire[NOISE] ** 2 + (size * wire.span) ** 2) ** 0.5


def stuck(wire: Target, _size: float) -> None:
    """Show the value of the moment at which the fault began."""
    wire[LOW] = wire[HIGH] = wire.held()


def dropped(wire: Target, _size: float) -> None:
    """Show nothing: the wire is off."""
    wire[LOW] = wire[HIGH] = 0.0


def swapped(wire: Target, _size: float) -> None:
    """Exchange the wires of two transducers of one type."""
    wire.swap()


def delayed(wire: Target, size: float) -> None:
    """Show what was true a time [s] ago, or as the fault began, with the errors and the noise of now."""
    wire[OFFSET] += wire[GAIN] * wire.earlier(size)
    wire[GAIN] = 0.0


def losing_pulses(wire: Target, size: float) -> None:
    """Let an encoder's counter miss a share of the pulses."""
    wire[TURN] *= 1.0 - size


def lacks_counter(configs: tuple[Any, ...]) -> str:
    """Return what an analog transducer lacks for a loss of pulses."""
    return "" if configs[0] else "it counts no pulses"


def lacks_analog(configs: tuple[Any, ...]) -> str:
    """Return what an encoder lacks for analog noise or a late reading."""
    return "it counts pulses, and has no analog amplifier" if configs[0] else ""


def lacks_like(configs: tuple[Any, ...]) -> str:
    """Return what a transducer lacks for an exchange of wires."""
    return "" if configs[1] else "the rig has no other one of its type to be exchanged with"


FULL = "share of the full scale"
FAULTS = (
    Fault(
        *("offset", TRANSDUCER, "zero", "The zero has moved."),
        *("a reading that is not 0 at rest, and contradicts others", offset, SPN, UNCALIBRATED),
        Size("ratio", -1.0, 1.0, 0.05, FULL),
    ),
    Fault(
        *("drift", TRANSDUCER, "zero", "The zero drifts."),
        *("the reading moves away slowly", offset, SPN, DRIFTED),
        *(Size("ratio", -1.0, 1.0, 0.05, f"{FULL} at the end of the drift"), GROWING),
    ),
    Fault(
        *("gain", TRANSDUCER, "sensitivity", "The sensitivity is wrong."),
        *("the reading is too high or low in proportion", gain, SPN, UNCALIBRATED),
        Size("ratio", -1.0, 1.0, 0.1, "change of the sensitivity"),
    ),
    Fault(
        *("noise", TRANSDUCER, "amplifier", "The signal is noisy."),
        *("the reading scatters", noise, SPN, ERRATIC),
        *(Size("ratio", 0.0, 1.0, 0.02, f"standard deviation as a {FULL}"),),
        lacks=lacks_analog,
    ),
    Fault(
        *("stuck", TRANSDUCER, "amplifier", "The signal is frozen."), *("the reading does not even scatter", stuck, SPN, ERRATIC)
    ),
    Fault(*("dropped", TRANSDUCER, "wire", "The wire is off."), *("the reading is exactly 0", dropped, SPN, LOST)),
    Fault(
        *("loose", TRANSDUCER, "wire", "A contact of the wire is loose."),
        *("the reading drops to 0 now and then", dropped, SPN, ERRATIC),
        onset=INTERMITTENT,
    ),
    Fault(
        *("swapped", TRANSDUCER, "wire", "The wire is exchanged with that of the next transducer of its type."),
        *("two readings show each other's quantity", swapped, SPN, BAD),
        lacks=lacks_like,
        pairs=True,
    ),
    Fault(
        *("delayed", TRANSDUCER, "line", "The reading comes late."),
        *("the reading lags behind those that follow from it", delayed, SPN, UPDATE),
        *(Size("time", 0.0, 2.0, 0.1, "delay"),),
        lacks=lacks_analog,
        keeps=True,
    ),
    Fault(
        *("losing_pulses", TRANSDUCER, "disc", "The encoder loses pulses."),
        *("the speed is too low, and contradicts the ratio", losing_pulses, SPN, RATE),
        *(Size("ratio", 0.0, 1.0, 0.1, "share of the pulses"),),
        lacks=lacks_counter,
    ),
)
