# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of a rig's record as whole numbers on a wire: 16 bits each, resolution from the signals' ranges.

Used by the CAN database and the Modbus register map, so that both carry the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..catalogue import Signal
from .record import ControllerRecord
from .seam import ControllerInfo, ControllerInputs

SIGNED, UNSIGNED = (-32767, 32767), (0, 65535)
NO_NUMBER = -32768  # raw value of a measurement that is none


@dataclass(frozen=True)
class Wire:
    """One number of 16 bits: shown = raw x step in ``unit``, SI = shown / scale. sign: where its sign is told."""

    name: str
    unit: str
    step: float
    scale: float
    raw: tuple[int, int]
    text: str

    def encode(self, value: float) -> int:
        """Raw number of an SI value, the nearest one that there is; NO_NUMBER for NaN."""
        if math.isnan(value):
            return NO_NUMBER
        low, high = self.raw
        return round(min(max(value * self.scale / self.step, low), high))

    def decode(self, raw: int) -> float:
        """SI value of a raw number; NaN for NO_NUMBER."""
        return math.nan if raw == NO_NUMBER else raw * self.step / self.scale

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value, in ``unit``."""
        return self.raw[0] * self.step, self.raw[1] * self.step


def step_for(high: float, steps: int) -> float:
    """The smallest of 1, 2, 5 times a power of ten with which ``steps`` of it reach ``high``."""
    power = 10.0 ** math.floor(math.log10(high / steps))
    return next(round(power * digit, 12) for digit in (1.0, 2.0, 5.0, 10.0) if power * digit * steps >= high)


def _measured(name: str, signal: Signal) -> Wire:
    return Wire(
        name,
        signal.display_unit,
        step_for(signal.shown(signal.high), SIGNED[1]),
        signal.scale,
        SIGNED,
        f"{signal.text.rstrip('.')}; {signal.sign}.",
    )


def currents(record: ControllerRecord) -> list[Wire]:
    """current_1 and on: the coil currents of the outputs."""
    out = []
    for k, output in enumerate(record.outputs, 1):
        wire = _measured(f"current_{k}", output.current)
        out.append(wire if output.valve else replace(wire, text=f"Coil current of output {k}, not connected."))
    return out


def measured(record: ControllerRecord) -> list[Wire]:
    """The transducers, by their names."""
    return [_measured(signal.name, signal) for signal in record.transducers]


def given(record: ControllerRecord) -> list[Wire]:
    """All that a controller is given as real numbers: currents, then transducers."""
    return [*currents(record), *measured(record)]


def commands(record: ControllerRecord, level: str) -> list[Wire]:
    """command_1 and on, at a level: current setpoints, or duties."""
    signal = record.like[level]
    step = step_for(signal.shown(signal.high), UNSIGNED[1])
    what = "Current setpoint" if level == "current" else "Duty"
    return [
        Wire(f"command_{k}", signal.display_unit, step, signal.scale, UNSIGNED, f"{what} of output {k}.")
        for k in range(1, len(record.outputs) + 1)
    ]


def values_of(inputs: ControllerInputs) -> tuple[float, ...]:
    """The values of :func:`given`, in its order."""
    return (*inputs.current, *inputs.measured)


def held_in(values: list[float], info: ControllerInfo, wires: list[Wire]) -> list[float]:
    """Commands, as these wires carry them, that a half step of resolution lifted above the largest one, set to it."""
    step = wires[0]
    slack = 0.5 * step.step / step.scale
    return [info.command_high if info.command_high < value <= info.command_high + slack else value for value in values]
