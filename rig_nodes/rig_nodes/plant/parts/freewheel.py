# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Free-wheel, a one-way clutch: its first body cannot turn faster than its second one, and runs behind it without torque.

The driveline holds and releases it (driveline.builder), so it has no step of its own. Its message is that of a clutch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .part import FREEWHEEL, Part, Shown, Wire

if TYPE_CHECKING:
    from .shown_rig import ShownRig


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ClutchState; nothing presses it, and it has no drag."""
    return (2 * rig.holds(name), rig.friction_torque(name), 0.0, 0.0, 0.0, rig.slip(name), 0.0, 0.0, 0.0, 0.0)


PART = Part(
    "freewheel",
    0,
    (),
    wires=("element",),
    role=FREEWHEEL,
    joined={"joins": Wire("one_way")},
    message="ClutchState",
    shown_values=shown_values,
    shows=(
        Shown("mode", "mode", "state", 0.0, 2.0, "Free-wheel {called}: overruns or holds.", "none", {0: "overruns", 2: "holds"}),
        Shown("torque", "torque", "torque", 0.0, 2000.0, "Torque that free-wheel {called} holds.", "positive drives {driven}"),
        Shown("slip", "slip", "speed", -650.0, 0.0, "Slip of free-wheel {called}.", "{driving} minus {driven}"),
    ),
)
