# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam's numbers as whole numbers on a wire: 16 bits each, resolution from the signal catalogue's ranges.

Used by the CAN database and the Modbus register map, so that both carry the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..catalogue import catalogue
from .seam import OUTPUTS, ControllerInputs, ControllerInfo

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


def _measured(name: str, signal_name: str) -> Wire:
    signal = catalogue().signals[signal_name]
    return Wire(name, signal.display_unit, step_for(signal.shown(signal.high), SIGNED[1]), signal.scale, SIGNED,
                f"{signal.text.rstrip('.')}; {signal.sign}.")


def measured() -> list[Wire]:
    """current_1 to current_3, n_wej, n_wyj, p1, p2: what a controller is given."""
    currents = [_measured(f"current_{k}", f"I_zr_p{k}") for k in (1, 2)]
    spare = Wire("current_3", currents[0].unit, currents[0].step, currents[0].scale, SIGNED,
                 "Coil current of the third output, not connected.")
    return [*currents, spare, *(_measured(name, name) for name in ("n_wej", "n_wyj", "p1", "p2"))]


def commands(level: str) -> list[Wire]:
    """command_1 to command_3 at a level: current setpoints, or duties."""
    signal = catalogue().signals["I_set_zr_p1" if level == "current" else "zr_p1_duty"]
    step = step_for(signal.shown(signal.high), UNSIGNED[1])
    what = "Current setpoint" if level == "current" else "Duty"
    return [Wire(f"command_{k}", signal.display_unit, step, signal.scale, UNSIGNED, f"{what} of output {k}.")
            for k in range(1, OUTPUTS + 1)]


def values_of(inputs: ControllerInputs) -> tuple[float, ...]:
    """The values of :func:`measured`, in its order."""
    return (*inputs.current, inputs.n_wej, inputs.n_wyj, inputs.p1, inputs.p2)


def held_in(values: list[float], info: ControllerInfo) -> list[float]:
    """Commands that a half step of resolution lifted above the largest one, set to it."""
    step = commands(info.level)[0]
    slack = 0.5 * step.step / step.scale
    return [info.command_high if info.command_high < value <= info.command_high + slack else value for value in values]
