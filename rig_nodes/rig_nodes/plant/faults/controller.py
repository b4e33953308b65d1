# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the Alfa46 inside the rig: what is wrong in the current profile of one of its outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base import SAMPLE
from .fault import FIRST_SPN, UNCALIBRATED, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

CONTROLLER = "alfa46"  # as the owner of its settings is called
P1, P2, P3 = ((point, 0) for point in range(3))  # times of the points, by their places in a profile


def fill_time(profile: Target, size: float) -> None:
    """Shift the end of the filling phase by a time [s], and with it the rise of the current; it does not end before it begins."""
    by = max(size, profile[P1] + SAMPLE - profile[P2])
    profile[P2] += by
    profile[P3] += by


FAULTS = (
    Fault(
        *("fill_time", CONTROLLER, "profile", "The controller fills the clutch for a wrong time."),
        *("the clutch's pressure rises too early or too late", fill_time, FIRST_SPN + 288, UNCALIBRATED),
        Size("time", -1.0, 1.0, 0.2, "difference to the time that is set, below 0 for too short a filling"),
    ),
)
