# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What engine.outside asks of a rig's configuration (testbench.configuration.RigConfig) and its structure.

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
        """That of its part."""

    @property
    def wires(self) -> Mapping[str, Any]:
        """What it is joined to, by key of the part's ``joined``."""


class Devices(Protocol):
    """The structure of a rig, as far as it is a list of devices."""

    @property
    def devices(self) -> Sequence[Device]:
        """All of them, in the order of the description."""


class Structure(Devices, Protocol):
    """The structure of a rig whose devices are looked up."""

    def device(self, name: str) -> Device:
        """The device of this name."""

    def oil_of(self, device: Any, key: str = "oil") -> str:
        """Name of the oil supply of one of its own devices."""


class Cut(Protocol):
    """How a device outside is reached."""

    @property
    def tick(self) -> float:
        """Time that each side holds what the other one gave [s]."""


class Kernel(Protocol):
    """How time passes in the plant."""

    @property
    def step(self) -> float:
        """Length of a step [s]."""


class CutRig(Protocol):
    """A rig's configuration, with the values of each device as an attribute of its name."""

    @property
    def structure(self) -> Structure:
        """What the rig is made of."""

    @property
    def cut(self) -> Cut:
        """How its devices outside are reached."""

    @property
    def kernel(self) -> Kernel:
        """How time passes in its plant."""

    def felt_at(self, body: str) -> float:
        """Inertia that wheels tie to a body, its own counted [kg m2]."""
