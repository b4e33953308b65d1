# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The part of runs.rig.Rig that the ``shown_values`` of a part reads, for the messages of its devices.

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
        """Return the states of a device, in SI units."""

    def wire(self, name: str, key: str) -> str:
        """Return the name of what a device is joined to by a key of its description."""

    def speed_at(self, name: str) -> float:
        """Return the speed of the body that carries a device [rad/s]."""

    def slip(self, name: str) -> float:
        """Return the speed of a clutch's driving side less that of its driven side [rad/s]."""

    def holds(self, name: str) -> bool:
        """Return whether a clutch or free-wheel does not slip."""

    def clutch_mode(self, name: str) -> int:
        """Return 0 for a clutch that is open, 1 for one that slips, 2 for one that is locked."""

    def friction_torque(self, name: str) -> float:
        """Return the friction torque of a device [Nm]."""

    def capacity(self, name: str) -> float:
        """Return the friction torque that a device could hold while it slips [Nm]."""

    def heat_of(self, name: str) -> str:
        """Return the name of a clutch's heat among the energies."""

    def fed_pressure(self, valve: str) -> float:
        """Return the pressure of the port at which a valve feeds its clutch [Pa, gauge]."""

    def oil_drawn(self, name: str) -> float:
        """Return the flow that valves take from an oil supply [m3/s]."""
