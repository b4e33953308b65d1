# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plates of one type as a part of their own, whose values all clutches that name it share; no device and no step.

The law of the plates is in plant.parts.plates.
"""

from __future__ import annotations

from .part import VALUES, Part
from .plates import PlatePack

PART = Part(
    "plate_pack",
    0,
    (PlatePack,),
    role=VALUES,
    check=PlatePack.contradiction,
    effects={"plate_heat": {"friction_per_kelvin": 0.0}, "wear": {"wear_rate": 0.0}, "spline_hysteresis": {}},
)
