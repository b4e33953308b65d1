# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The setpoints that a rig's devices take: by which topic, by which key of a sequence, and with whose unit and range.

Used by testbench.rig, sequences, nodes, FMUs and the signal catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import RigError
from ..parts import part as parts
from .quantities import TRANSDUCERS
from .structure import Structure


@dataclass(frozen=True)
class Setpoint:
    """One setpoint: step: its key in sequences; node: who takes it; like: the transducer whose unit and range it has."""

    step: str
    device: str
    node: str
    command: parts.Command
    like: str

    @property
    def topic(self) -> str:
        """Where it comes in."""
        return f"/{self.node}/command"

    @property
    def name(self) -> str:
        """As refusals and variables have it, e.g. motor_speed."""
        return f"{self.step}_{self.command.value}"


def setpoints_of(structure: Structure) -> dict[str, Setpoint]:
    """All setpoints of a rig by their key in sequences; where two devices have the same, their names come before it."""
    found, steps = [], [command.step for device in structure.devices for command in parts.part(device.part).takes]
    for device in structure.devices:
        for command in parts.part(device.part).takes:
            node = (
                structure.names.get(f"{device.name}_{command.node}", f"{device.name}_{command.node}")
                if command.node
                else device.name
            )
            like = next(
                (one.name for one in structure.transducers if one.at == device.name and TRANSDUCERS[one.type][0] == command.of),
                None,
            )
            if like is None and device.role == parts.OIL:
                continue  # it gives oil its temperature and viscosity, and nobody sets its pressure
            if like is None:
                kinds = [kind for kind, (quantity, _) in TRANSDUCERS.items() if quantity == command.of]
                raise RigError(
                    f"parts.{device.name}: nothing measures its {command.of}, whose range its setpoint would have; "
                    f"give transducers one with type: {kinds[0]}, at: {device.name}"
                )
            step = command.step if steps.count(command.step) == 1 else f"{device.name}_{command.step}"
            found.append(Setpoint(step, device.name, node, command, like))
    return {one.step: one for one in found}
