# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What plant.engine.outside reads of a rig's configuration (rig.configuration.RigConfig) and of its structure.

Used in annotations only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


class Device(Protocol):
    """A device of a rig's description."""

    @property
    def name(self) -> str:
        """Its name in the rig."""

    @property
    def part(self) -> str:
        """Name of its part."""

    @property
    def role(self) -> str:
        """Role of its part."""

    @property
    def wires(self) -> Mapping[str, Any]:
        """What it is joined to, by key of the part's ``joined``."""


class Devices(Protocol):
    """The structure of a rig as a list of its devices."""

    @property
    def devices(self) -> Sequence[Device]:
        """All devices, in the order of the description."""


class Structure(Devices, Protocol):
    """The structure of a rig in which devices are looked up."""

    def device(self, name: str) -> Device:
        """Return the device of this name."""

    def oil_of(self, device: Any, key: str = "oil") -> str:
        """Return the name of the oil supply of one of its own devices."""


class Cut(Protocol):
    """Settings of the connection to a device outside the plant."""

    @property
    def tick(self) -> float:
        """Time for which each side holds the values of the other one [s]."""


class Kernel(Protocol):
    """Settings of the plant's steps."""

    @property
    def step(self) -> float:
        """Length of a step [s]."""


class CutRig(Protocol):
    """A rig's configuration, with the values of each device as an attribute of its name."""

    @property
    def structure(self) -> Structure:
        """The structure of the rig."""

    @property
    def cut(self) -> Cut:
        """Settings of the connection to its devices outside the plant."""

    @property
    def kernel(self) -> Kernel:
        """Settings of its plant's steps."""

    def felt_at(self, body: str) -> float:
        """Return the inertia that wheels tie to a body, its own included [kg m2]."""
