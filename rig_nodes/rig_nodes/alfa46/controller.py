# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 box as an object: orders in, duty out, one call per controller sample.

Used by the alfa46 node (a process of its own); the embedded controller of the kernel runs the same law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import RigError
from ..transmission import Transmission
from . import law
from .settings import Alfa46Config

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..arrays import Floats


def refusal(gear: int, current_gear: int, shifting: bool, box: Transmission) -> str | None:
    """Why an order cannot be taken, or None. box: whose gears there are."""
    if gear not in box.names:
        return f"there is no gear {gear}; order {box.spoken}"
    if gear and (gear > law.GEARS or not box.outputs(gear)):
        return f"gear {box.names[gear]} has no output of the controller; the valves of its clutches have one of {law.OUTPUTS} each"
    if shifting:
        return f"a shift to {box.names[current_gear]} is still running; wait for its end"
    if gear == current_gear:
        return f"gear {box.names[gear]} is already ordered"
    return None


class Alfa46:
    """The shift controller. Samples are counted by the rig; times are samples times the sample period.

    transmission: whose gears can be ordered; each moves the outputs of its clutches' valves.
    """

    def __init__(self, config: Alfa46Config, transmission: Transmission) -> None:
        self.config, self.transmission = config, transmission
        self._config = config.law_config(transmission)
        self._profiles = np.ascontiguousarray(config.profiles)
        self._outputs = np.zeros(law.OUTPUTS, law.LAW_OUTPUT)
        self._state = np.zeros(1, law.LAW_STATE)
        self._currents = np.zeros(law.OUTPUTS)
        self._ordered: int | None = None

    @classmethod
    def load(cls, config: Alfa46Config, transmission: Transmission) -> None:
        """Load (or compile) everything the box will call, so that no sample waits for it."""
        box = cls(config, transmission)
        box.order(law.GEAR_I)
        box.step(0, np.zeros(law.OUTPUTS))

    def order(self, gear: int) -> None:
        """Order a gear; it takes effect at the next sample. RigError with the reason when refused."""
        why = refusal(
            gear,
            self.gear if self._ordered is None else self._ordered,
            self.shifting or self._ordered is not None,
            self.transmission,
        )
        if why:
            raise RigError(f"shift refused: {why}")
        self._ordered = gear

    def step(self, sample: int, currents: Sequence[float] | Floats) -> tuple[np.ndarray, np.ndarray]:
        """One controller sample: measured coil currents (3,) [A] in, duty (3,) and setpoints (3,) [A] out."""
        if self._ordered is not None:
            law.order_gear(self._ordered, sample, self._config[0], self._profiles, self._outputs, self._state[0])
            self._ordered = None
        self._currents[:] = currents
        law.law_step(sample, self._currents, self._config[0], self._profiles, self._outputs, self._state[0])
        return self._outputs["duty"], self._outputs["setpoint"]

    def force_neutral(self) -> None:
        """Neutral at once, without the falling halves of the profiles: the rig has tripped and drives no coil."""
        self._outputs[:] = np.zeros(1, law.LAW_OUTPUT)
        self._state["gear"], self._state["shift_end"] = law.NEUTRAL, 0
        self._ordered = None

    def outputs_in_shift(self) -> np.ndarray:
        """Which outputs the running shift moves (3,); none between shifts."""
        moved = (self._outputs["pending"] != law.OFF) | (self._outputs["phase"] == law.FALLING)
        moved[list(self.transmission.outputs(self.gear))] = True
        return moved & self.shifting

    def change(self, config: Alfa46Config) -> None:
        """Go on with other settings from the next sample on; for outputs that no shift moves.

        An output past its last point stays there, whatever the new times are: only its hold current follows.
        """
        now, period = self._state["sample"][0], config.values.sample_time
        for k, out in enumerate(self._outputs):
            last = 2 if out["phase"] == law.ON else 5
            if out["phase"] != law.OFF and (now - out["start"]) * period >= self._profiles[k, last, 0]:
                out["start"] = min(out["start"], now - round(config.profiles[k, last, 0] / period) - 1)
        self.config = config
        self._config[:] = config.law_config(self.transmission)
        self._profiles[:] = config.profiles

    @property
    def gear(self) -> int:
        """Gear ordered last."""
        return int(self._state["gear"][0])

    @property
    def shifting(self) -> bool:
        """True until the last point of every running profile has passed."""
        return bool(self._state["sample"][0] < self._state["shift_end"][0])

    @property
    def active(self) -> np.ndarray:
        """Which outputs are on (3,): from switch-on to the end of the profile's falling half."""
        return self._outputs["phase"] != law.OFF
