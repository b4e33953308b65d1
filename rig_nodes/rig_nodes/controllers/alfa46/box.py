# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 controller as an object: it takes orders and returns duties, with one call per controller sample.

Used by the alfa46 node (a process of its own); the embedded controller of the kernel runs the same law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError
from ...plant import alfa46_law as law
from ...rig import Alfa46Config, Transmission, beyond_alfa46

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...base import Floats


def refusal(gear: int, current_gear: int, shifting: bool, box: Transmission) -> str | None:
    """Return why an order cannot be accepted, or None when it can.

    Parameters
    ----------
    gear : int
        Number of the gear that is ordered.
    current_gear : int
        Number of the gear that was ordered last.
    shifting : bool
        True while a shift is running.
    box : Transmission
        The transmission with its gears.

    Returns
    -------
    str or None
        The reason.
    """
    if gear not in box.names:
        return f"there is no gear {gear}; order {box.spoken}"
    if gear and not box.outputs(gear):
        return f"gear {box.names[gear]} has no output of the controller, because none of its clutches has a valve"
    if shifting:
        return f"a shift to {box.names[current_gear]} is still running; wait for its end"
    if gear == current_gear:
        return f"gear {box.names[gear]} is already ordered"
    return None


class Alfa46:
    """The shift controller. The rig counts the samples; a time is a number of samples times the sample period.

    Parameters
    ----------
    config : Alfa46Config
        The settings.
    transmission : Transmission
        The transmission whose gears can be ordered; each gear drives the outputs of the valves of its clutches.

    Raises
    ------
    RigError
        When the transmission has a valve on an output that the Alfa46 lacks.
    """

    def __init__(self, config: Alfa46Config, transmission: Transmission) -> None:
        if why := beyond_alfa46(transmission):
            raise RigError(why)
        self.config, self.transmission = config, transmission
        self._config = config.law_config(transmission)
        self._profiles = np.ascontiguousarray(config.profiles)
        self._outputs = np.zeros(law.OUTPUTS, law.LAW_OUTPUT)
        self._state = np.zeros(1, law.LAW_STATE)
        # single numbers of them, which are read in a third of the time that the records take
        self._gear, self._shift_end, self._sample = (memoryview(self._state[name]) for name in ("gear", "shift_end", "sample"))
        self._phases = memoryview(self._outputs["phase"])
        self._currents = np.zeros(law.OUTPUTS)
        self._ordered: int | None = None

    @classmethod
    def load(cls, config: Alfa46Config, transmission: Transmission) -> None:
        """Load or compile everything that the controller will call, so that no sample has to wait for it.

        Parameters
        ----------
        config : Alfa46Config
            The settings.
        transmission : Transmission
            The transmission whose gears can be ordered.
        """
        box = cls(config, transmission)
        box.order(law.GEAR_I)
        box.step(0, np.zeros(law.OUTPUTS))

    def order(self, gear: int) -> None:
        """Order a gear; the order takes effect at the next sample.

        Parameters
        ----------
        gear : int
            Number of the gear.

        Raises
        ------
        RigError
            When the order is refused, with the reason.
        """
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
        """Take one controller sample.

        Parameters
        ----------
        sample : int
            Number of the sample.
        currents : (3,) sequence of float
            Measured coil currents [A].

        Returns
        -------
        duty : (3,) array of float
            Duty of each output, 0 to 1.
        setpoint : (3,) array of float
            Current setpoint of each output [A].
        """
        if self._ordered is not None:
            law.order_gear(self._ordered, sample, self._config[0], self._profiles, self._outputs, self._state[0])
            self._ordered = None
        self._currents[:] = currents
        law.law_step(sample, self._currents, self._config[0], self._profiles, self._outputs, self._state[0])
        return self._outputs["duty"], self._outputs["setpoint"]

    def force_neutral(self) -> None:
        """Go to neutral at once, without the falling halves of the profiles, because the rig has tripped and drives no coil."""
        self._outputs[:] = np.zeros(1, law.LAW_OUTPUT)
        self._state["gear"], self._state["shift_end"] = law.NEUTRAL, 0
        self._ordered = None

    def outputs_in_shift(self) -> np.ndarray:
        """Return which outputs (3,) the running shift changes; none between shifts."""
        moved = (self._outputs["pending"] != law.OFF) | (self._outputs["phase"] == law.FALLING)
        moved[list(self.transmission.outputs(self.gear))] = True
        return moved & self.shifting

    def change(self, config: Alfa46Config) -> None:
        """Use other settings from the next sample on; only the settings of outputs that no shift changes may differ.

        An output that has passed its last point stays there, whatever the new times are: only its hold current follows.

        Parameters
        ----------
        config : Alfa46Config
            The new settings.
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
        """Number of the gear that was ordered last."""
        return int(self._gear[0])

    @property
    def shifting(self) -> bool:
        """True until every running profile has passed its last point."""
        return self._sample[0] < self._shift_end[0]

    @property
    def active(self) -> list[bool]:
        """Which outputs (3,) are on: from switch-on to the end of the falling half of the profile."""
        return [phase != law.OFF for phase in self._phases.tolist()]
