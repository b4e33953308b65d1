# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a type of device is to the engine: its configuration, the numbers it carries, and its compiled stages.

Every file of parts/ that is a type of device ends with ``PART = Part(...)``; engine.world finds it by its name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from ..config.schema import record_dtype
from ..errors import RigError

# What a key of a part's ``joined`` names in a rig: "body", "bodies" (driving, driven), "one_way" (the same, and one may be the
# ground), "torque" (a torque meter, or
# "clutches": all that the body gives clutches), "transducer", "output" (of the controller, from 1), "line" (name of the oil line
# that begins here), or a role of devices.
BODY, BODIES, ONE_WAY, TORQUE, TRANSDUCER, OUTPUT, LINE = ("body", "bodies", "one_way", "torque", "transducer", "output", "line")
# Roles of devices: what a rig asks its devices for. ``values`` are shared by others and no device.
SOURCE, LOAD, CLUTCH, FREEWHEEL, VALVE, LOSS, OIL, PRESS, METER, VALUES = (
    "source",
    "load",
    "clutch",
    "freewheel",
    "valve",
    "loss",
    "oil",
    "press",
    "meter",
    "values",
)

# Place of a wire that goes nowhere. Places are unsigned: compiled code need not look whether one counts from the end.
NOWHERE = 2**64 - 1

# Stages of the engine, in which a part may take part by a compiled function; k is the instance of this part:
# fill(world, k, h): what the step's length makes of its values, at the start of every call of the engine
# command(world, k, outputs, drive): the controller's newest answer, once a controller sample
# ordered(world, k, outputs, steps_per_sample, h): what the embedded law has just begun, once a controller sample
# before(world, k, h, t): from t over h, all but the driveline: torques and capacities that it gives the driveline
# bound(world, k): changes of speeds that are in no torque, right after the driveline
# after(world, k, h): with the driveline's new speeds, torques and heats
# pickup(world, k, h, index, shown): what it induces in the wires of transducers, at the end of the step before ``index``
STAGES = ("fill", "command", "ordered", "before", "bound", "after", "pickup")


@dataclass(frozen=True)
class Wire:
    """What a device is joined to by a key of its description: a kind or role as above; needed: it cannot be left out."""

    to: str
    needed: bool = True


@dataclass(frozen=True)
class Shown:
    """A signal that a device shows in its state's message.

    what: the end of its name; of: the quantity with its unit and range, see config.units; text, sign: sentences in which
    {called} is the device, {driving} and {driven} are the bodies that it joins.
    """

    what: str
    field: str
    of: str
    low: float
    high: float
    text: str
    sign: str
    states: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Command:
    """A setpoint that a device takes, with a switch.

    step: its key in a sequence; takes: key of the value there -> dimension; target, enabled: states that it sets;
    text: what is set, for people; of: quantity of the device's transducer whose unit and range the value has; node: end of the
    name of the node that takes it, where the device has more than one; only: switch of its configuration without which
    there is nobody who takes it; parameter: name of the value as a parameter of that node, by default the last of ``takes``.
    """

    step: str
    takes: dict[str, str]
    target: str
    enabled: str
    text: str
    of: str
    node: str = ""
    only: str = ""
    parameter: str = ""

    @property
    def value(self) -> str:
        """What the value is called, e.g. speed."""
        return list(self.takes)[-1]


@dataclass(frozen=True)
class Part:
    """A type of device.

    name: of its file; configs: dataclasses of its configuration, one after the other in its record; state: numbers that
    it carries from step to step, all finite at all times; derived: numbers made of its configuration before time passes;
    wires: places of what it is joined to (bodies, elements, oil lines, outputs of the controller, other instances);
    tables: derived arrays of numbers, name -> shape, where a shape may differ from rig to rig; order: place of its
    stages among those of the other parts, smaller ones first.

    To who describes a rig: role, one of those above; joined: key in the rig's description -> what it names; effects: name of
    what can be left out -> the values of its configuration without it; message: type of its state's message, says(rig, name):
    the fields of that message; shows, takes: its signals and commands.
    """

    name: str
    order: int
    configs: tuple[type, ...]
    state: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    wires: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    stages: dict[str, Callable] = field(default_factory=dict)
    role: str = ""
    joined: dict[str, Wire] = field(default_factory=dict)
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    message: str = ""
    says: Callable | None = None
    shows: tuple[Shown, ...] = ()
    takes: tuple[Command, ...] = ()

    def state_dtype(self) -> np.dtype:
        """One float64 per state."""
        return np.dtype([(name, "f8") for name in self.state])

    def values_dtype(self, shapes: dict[str, tuple[int, ...]]) -> np.dtype:
        """Configuration and derived numbers as float64, wires as uint64, tables of these shapes."""
        return np.dtype(
            [
                *record_dtype(*self.configs).descr,
                *((name, "f8") for name in self.derived),
                *((name, "u8") for name in self.wires),
                *((name, "f8", shapes[name]) for name in self.tables),
            ]
        )


def parts() -> list[str]:
    """Names of all types of devices that a rig's description may use."""
    return sorted(
        path.stem
        for path in Path(__file__).parent.glob("*.py")
        if "\nPART = " in path.read_text(encoding="utf-8") and part(path.stem).role
    )


@cache
def part(name: str) -> Part:
    """The type of device of this name; RigError when there is none."""
    try:
        found = import_module(f"{__package__}.{name}").PART
    except (ImportError, AttributeError):
        raise RigError(f"there is no part '{name}'") from None
    unknown = set(found.stages) - set(STAGES)
    if unknown:
        raise RigError(f"part '{name}' has the unknown stage '{sorted(unknown)[0]}'; known are {', '.join(STAGES)}")
    return found
