# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The phase of a shift as far as the controller's wires tell: speeds of both shafts, pressure of the clutch.

Used by the alfa46 node for the feedback of its shift action; the law itself does not need it.
"""

from __future__ import annotations

from math import pi

from ..alfa46 import law
from ..plant.gearbox import RATIO_I, RATIO_II
from ..testbench.configuration import RigConfig

RATIOS = {law.GEAR_I: RATIO_I, law.GEAR_II: RATIO_II}
SYNCHRONOUS = 0.02  # share of the input speed below which slip drowns in the speed transducers' noise
STANDSTILL = 10.0 * pi / 30.0  # rad/s of the input shaft, below which no slip is told


def slip(gear: int, n_wej: float, n_wyj: float) -> float:
    """Slip of the clutch of a gear as a share of the input speed; 0 in neutral and at standstill.

    gear: 0, 1, 2; n_wej, n_wyj: speeds of w0 and wk [rad/s]. Ratios of thesis tab. 3.1.
    """
    if gear not in RATIOS or n_wej < STANDSTILL:
        return 0.0
    return 1.0 - RATIOS[gear] * n_wyj / n_wej


class ShiftPhase:
    """Names the phase of one shift from gear ``old`` to gear ``new``."""

    def __init__(self, config: RigConfig, old: int, new: int):
        self.old, self.new = old, new
        cylinder = {law.GEAR_I: config.clutch_s1, law.GEAR_II: config.clutch_s2}.get(new)
        self._kiss = kiss_pressure(cylinder) if cylinder else 0.0

    def name(self, n_wej: float, n_wyj: float, p1: float, p2: float) -> str:
        """fill, torque phase, inertia phase, locked or release. Speeds [rad/s], pressures [Pa, gauge]."""
        if self.new == law.NEUTRAL:
            return "release"
        if (p1 if self.new == law.GEAR_I else p2) < self._kiss:
            return "fill"
        if self.old != law.NEUTRAL and abs(slip(self.old, n_wej, n_wyj)) < SYNCHRONOUS and n_wej > STANDSTILL:
            return "torque phase"
        return "inertia phase" if abs(slip(self.new, n_wej, n_wyj)) > SYNCHRONOUS else "locked"


def kiss_pressure(cylinder) -> float:
    """Pressure [Pa] at which the piston reaches the plates: spring and seal forces at the end of the clearance."""
    spring = cylinder.spring_preload + cylinder.spring_rate * cylinder.clearance
    return (spring + cylinder.seal_friction) / (cylinder.piston_area * (1.0 - cylinder.seal_friction_share))
