# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of a rig's record as whole numbers on a wire: 16 bits each, with a resolution from the signals' ranges.

The CAN database and the Modbus register map use it, so that both carry the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..rig import Signal
from .record import ControllerRecord
from .seam import ControllerInfo, ControllerInputs

SIGNED, UNSIGNED = (-32767, 32767), (0, 65535)
NO_NUMBER = -32768  # raw value of a measurement without a number (NaN)


@dataclass(frozen=True)
class Wire:
    """One number of 16 bits: shown = raw x step in ``unit``, SI = shown / scale.

    Parameters
    ----------
    name : str
        Name of the number.
    unit : str
        Unit in which it is shown.
    step : float
        Value of one count, in ``unit``.
    scale : float
        Factor from SI to ``unit``.
    raw : (int, int)
        Smallest and largest raw number; the first is negative for a signed number.
    text : str
        What the number is, for people; it states the sign.
    """

    name: str
    unit: str
    step: float
    scale: float
    raw: tuple[int, int]
    text: str

    def encode(self, value: float) -> int:
        """Return the nearest possible raw number of an SI value; NO_NUMBER for NaN."""
        if math.isnan(value):
            return NO_NUMBER
        low, high = self.raw
        return round(min(max(value * self.scale / self.step, low), high))

    def decode(self, raw: int) -> float:
        """Return the SI value of a raw number; NaN for NO_NUMBER."""
        return math.nan if raw == NO_NUMBER else raw * self.step / self.scale

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value, in ``unit``."""
        return self.raw[0] * self.step, self.raw[1] * self.step


def step_for(signal: Signal, steps: int) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten of which ``steps`` steps reach both ends of a signal's shown range."""
    high = max(abs(signal.shown(signal.low)), abs(signal.shown(signal.high)))
    if high == 0.0:
        return 1.0  # nothing but 0 is expected
    power = 10.0 ** math.floor(math.log10(high / steps))
    return next(round(power * digit, 12) for digit in (1.0, 2.0, 5.0, 10.0) if power * digit * steps >= high)


def _measured(name: str, signal: Signal) -> Wire:
    return Wire(
        name, signal.display_unit, step_for(signal, SIGNED[1]), signal.scale, SIGNED, f"{signal.text.rstrip('.')}; {signal.sign}."
    )


def currents(record: ControllerRecord) -> list[Wire]:
    """Return the wires current_1 and on: the coil currents of the outputs."""
    out = []
    for k, output in enumerate(record.outputs, 1):
        wire = _measured(f"current_{k}", output.current)
        out.append(wire if output.valve else replace(wire, text=f"Coil current of output {k}, not connected."))
    return out


def measured(record: ControllerRecord) -> list[Wire]:
    """Return the wires of the transducers, with the transducers' names."""
    return [_measured(signal.name, signal) for signal in record.transducers]


def given(record: ControllerRecord) -> list[Wire]:
    """Return the wires of all real numbers that a controller receives: currents, then transducers."""
    return [*currents(record), *measured(record)]


def commands(record: ControllerRecord, level: str) -> list[Wire]:
    """Return the wires command_1 and on: current setpoints at level "current", duties at level "duty"."""
    signal = record.like[level]
    step = step_for(signal, UNSIGNED[1])
    what = "Current setpoint" if level == "current" else "Duty"
    return [
        Wire(f"command_{k}", signal.display_unit, step, signal.scale, UNSIGNED, f"{what} of output {k}.")
        for k in range(1, len(record.outputs) + 1)
    ]


def values_of(inputs: ControllerInputs) -> tuple[float, ...]:
    """Return the values of :func:`given`, in its order [SI]."""
    return (*inputs.current, *inputs.measured)


def held_in(values: list[float], info: ControllerInfo, wires: list[Wire]) -> list[float]:
    """Limit commands that rounding to the wire's resolution has raised above the largest command.

    Parameters
    ----------
    values : list of float
        Commands as the wires carry them: duty, or [A].
    info : ControllerInfo
        Its ``command_high`` is the limit.
    wires : list of Wire
        The wires of the commands.

    Returns
    -------
    list of float
        The commands; one above the limit by at most half a step is set to the limit.
    """
    step = wires[0]
    slack = 0.5 * step.step / step.scale
    return [info.command_high if info.command_high < value <= info.command_high + slack else value for value in values]
