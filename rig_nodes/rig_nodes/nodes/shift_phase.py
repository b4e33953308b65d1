# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The phase of a shift as far as the controller's inputs show it: speeds of both shafts, pressures of the clutches.

The alfa46 node uses it for the feedback of its shift action; the law itself does not need it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

from ..rig import NEUTRAL, Transmission

SYNCHRONOUS = 0.02  # share of the input speed; a smaller slip is lost in the noise of the speed transducers
STANDSTILL = 10.0 * pi / 30.0  # rad/s of the input shaft; below it no slip is reported


class ShiftPhase:
    """Names the phase of one shift from gear ``old`` to gear ``new``."""

    def __init__(self, transmission: Transmission, old: int, new: int) -> None:
        self.transmission, self.old, self.new = transmission, old, new
        engaging = transmission.shift(old, new).engaging
        self._kisses = [(transmission.clutches.index(clutch), clutch.kiss_pressure) for clutch in engaging]

    def slip(self, w_in: float, w_out: float) -> float:
        """Return the slip of the ordered gear as a share of the input speed; speeds [rad/s]; 0 in neutral and at standstill."""
        return self._slip(self.new, w_in, w_out)

    def _slip(self, gear: int, w_in: float, w_out: float) -> float:
        if gear not in self.transmission.ratios or w_in < STANDSTILL:
            return 0.0
        return self.transmission.slip(gear, w_in, w_out)

    def name(self, w_in: float, w_out: float, pressures: Sequence[float]) -> str:
        """Return the name of the phase: fill, torque phase, inertia phase, locked or release.

        Parameters
        ----------
        w_in, w_out : float
            Speeds of input and output shaft [rad/s].
        pressures : (clutches,) sequence of float
            Pressures of all clutches [Pa gauge].

        Returns
        -------
        str
            The name.
        """
        if self.new == NEUTRAL:
            return "release"
        if any(pressures[k] < kiss for k, kiss in self._kisses):
            return "fill"
        if self.old != NEUTRAL and abs(self._slip(self.old, w_in, w_out)) < SYNCHRONOUS and w_in > STANDSTILL:
            return "torque phase"
        return "inertia phase" if abs(self.slip(w_in, w_out)) > SYNCHRONOUS else "locked"
