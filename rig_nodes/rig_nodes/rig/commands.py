# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The setpoints that a rig's devices take: their topics, their keys in a sequence, their units and ranges.

runs.rig, sequences, nodes, FMUs and the signal catalogue use them.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..base import RigError
from ..plant import part as parts
from .structure import Structure
from .transducer_types import TRANSDUCER_TYPES


@dataclass(frozen=True)
class Setpoint:
    """One setpoint of a device.

    Parameters
    ----------
    step : str
        Its key in sequences.
    device : str
        The device that takes it.
    node : str
        The node that receives it.
    command : Command
        The command of the device's part.
    like : str
        The transducer whose unit and range it has.
    """

    step: str
    device: str
    node: str
    command: parts.Command
    like: str

    @property
    def topic(self) -> str:
        """Topic on which it is received."""
        return f"/{self.node}/command"

    @property
    def name(self) -> str:
        """Its name in errors and variables, e.g. motor_speed."""
        return f"{self.step}_{self.command.value}"


def setpoints_of(structure: Structure) -> dict[str, Setpoint]:
    """Return all setpoints of a rig by their key in sequences.

    Where two devices have the same key, the device's name is put before it.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.

    Returns
    -------
    dict of str to Setpoint
        The setpoints.

    Raises
    ------
    RigError
        When nothing measures the quantity whose range a setpoint would have.
    """
    found, steps = [], [command.step for device in structure.devices for command in parts.part(device.part).takes]
    for device in structure.devices:
        for command in parts.part(device.part).takes:
            node = (
                structure.names.get(f"{device.name}_{command.node}", f"{device.name}_{command.node}")
                if command.node
                else device.name
            )
            at_device = (one for one in structure.transducers if one.at == device.name)
            like = next((one.name for one in at_device if TRANSDUCER_TYPES[one.type].quantity == command.of), None)
            if like is None and device.role == parts.OIL:
                continue  # it only gives the oil temperature and viscosity; its pressure cannot be set
            if like is None:
                fit = next(name for name, one in TRANSDUCER_TYPES.items() if one.quantity == command.of)
                raise RigError(
                    f"parts.{device.name}: nothing measures its {command.of}, whose range its setpoint would have; "
                    f"give transducers one with type: {fit}, at: {device.name}"
                )
            step = command.step if steps.count(command.step) == 1 else f"{device.name}_{command.step}"
            found.append(Setpoint(step, device.name, node, command, like))
    return {one.step: one for one in found}
