# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a device's message asks of the rig that runs it: testbench.rig.Rig as a part's ``says`` sees it.

Used in annotations only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np


class ShownRig(Protocol):
    """A rig with its devices by their names."""

    @property
    def config(self) -> object:
        """The rig's configuration, with the values of each device as an attribute of its name."""

    @property
    def energies(self) -> Mapping[str, float]:
        """Work and heat since time 0 by their names [J]."""

    @property
    def safe(self) -> bool:
        """True in the safe state."""

    @property
    def command_age(self) -> float:
        """Time since the sample that the newest command answers [s]."""

    def device(self, name: str) -> np.void:
        """The states of a device [SI]."""

    def wire(self, name: str, key: str) -> str:
        """What a device is joined to by a key of its description."""

    def speed_at(self, name: str) -> float:
        """Speed of the body that a device sits on [rad/s]."""

    def slip(self, name: str) -> float:
        """Driving minus driven side of a clutch [rad/s]."""

    def holds(self, name: str) -> bool:
        """True while a clutch or free-wheel does not slip."""

    def clutch_mode(self, name: str) -> int:
        """Whether a clutch is open, slips or is locked: 0, 1, 2."""

    def friction_torque(self, name: str) -> float:
        """Friction torque of a device [Nm]."""

    def capacity(self, name: str) -> float:
        """Friction torque that a device could hold while it slips [Nm]."""

    def heat_of(self, name: str) -> str:
        """Name of a clutch's heat among the energies."""

    def fed_pressure(self, valve: str) -> float:
        """Pressure between a valve and its clutch [Pa, gauge]."""

    def oil_drawn(self, name: str) -> float:
        """What valves take from an oil supply [m3/s]."""
