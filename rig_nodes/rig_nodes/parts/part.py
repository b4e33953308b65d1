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

import numpy as np

from ..config.schema import record_dtype
from ..errors import RigError

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
class Part:
    """A type of device.

    name: of its file; configs: dataclasses of its configuration, one after the other in its record; state: numbers that
    it carries from step to step, all finite at all times; derived: numbers made of its configuration before time passes;
    wires: places of what it is joined to (bodies, elements, oil lines, outputs of the controller, other instances);
    tables: derived arrays of numbers, name -> shape, where a shape may differ from rig to rig; order: place of its
    stages among those of the other parts, smaller ones first.
    """

    name: str
    order: int
    configs: tuple[type, ...]
    state: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    wires: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    stages: dict[str, Callable] = field(default_factory=dict)

    def state_dtype(self) -> np.dtype:
        """One float64 per state."""
        return np.dtype([(name, "f8") for name in self.state])

    def values_dtype(self, shapes: dict[str, tuple[int, ...]]) -> np.dtype:
        """Configuration and derived numbers as float64, wires as int64, tables of these shapes."""
        return np.dtype([*record_dtype(*self.configs).descr, *((name, "f8") for name in self.derived),
                         *((name, "i8") for name in self.wires),
                         *((name, "f8", shapes[name]) for name in self.tables)])


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
