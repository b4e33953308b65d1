# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torque meter in a shaft, between the drive or load at the shaft's end and all else on it; rigid, without a step of its own.

Its torque follows from that of the driveline, see runs.plan; a compliant meter is a shaft of the driveline.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...base import choice, param
from .part import METER, Part, Wire


@dataclass(frozen=True)
class TorqueMeterConfig:
    """Inertia on one side of the meter, and which side this is."""

    inertia: float = param("inertia", 0.0, 100.0, "Inertia on one side of the meter; the body's own inertia includes it")
    side: str = choice(
        "Side of the meter with this inertia: beyond the meter, with the motor or load, or within, with the gears",
        "beyond",
        "within",
    )


PART = Part(
    "torque_meter",
    0,
    (TorqueMeterConfig,),
    role=METER,
    joined={"body": Wire("body"), "source": Wire("drives", needed=False), "load": Wire("load", needed=False)},
)
