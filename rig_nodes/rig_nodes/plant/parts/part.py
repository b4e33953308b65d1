# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definition of a type of device for the engine: its configuration, the numbers in its record, and its compiled stages.

Every file of this folder that is a type of device ends with ``PART = Part(...)`` and is found by its name. Another package adds
one by an entry point.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import Group, RigError, record_dtype

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from .shown_rig import ShownRig

PARTS = Group("parts", "part", __package__, "PART")
# What a key of a part's ``joined`` names in a rig: "body", "bodies" (driving, driven), "one_way" (the same, and one of them may be
# the ground), "drives" (a source or a coupling), "torque" (a torque meter, or "clutches" for the sum of the torques from the body
# to clutches), "transducer", "output" (an output of the controller, from 1), "line" (the oil line that begins here), "input" (an
# input of the driveline that is a ratio), or a role of devices.
BODY, BODIES, ONE_WAY, TORQUE, TRANSDUCER, OUTPUT, LINE = ("body", "bodies", "one_way", "torque", "transducer", "output", "line")
INPUT = "input"
DRIVES = "drives"  # a device that drives a shaft from one end: a source or a coupling
# Roles of devices, by which a rig finds its devices. ``values`` are shared by devices and are not a device.
SOURCE, COUPLING, LOAD, CLUTCH, FREEWHEEL, VALVE, LOSS, OIL, PRESS, METER, MASS, LEVER, VALUES = (
    "source",
    "coupling",
    "load",
    "clutch",
    "freewheel",
    "valve",
    "loss",
    "oil",
    "press",
    "meter",
    "mass",
    "lever",
    "values",
)

# Place of a wire without a target. Places are unsigned, so that compiled code need not check whether one counts from the end.
NOWHERE = 2**64 - 1

# Stages of the engine. A part takes part in a stage by a compiled function; k is the instance of this part:
# fill(world, k, h): computes the values that depend on the step's length, at the start of every call of the engine
# command(world, k, outputs, drive): applies the controller's newest answer, once per controller sample
# ordered(world, k, outputs, steps_per_sample, h): reads the newest output of the embedded law, once per controller sample
# before(world, k, h, t): moves the device from t over h and sets its torques and capacities in the driveline, world.driveline:
#     middle[body] is the speed expected in the middle of the step; push[0, body] and push[1, body] take a torque on the body at the
#     step's start and end (add to them); cap[ROW, element] takes, at the start (0) and the end (1) of the step, the torque while
#     slipping KIN, the limits while sticking HI and LO, which is negative, and over the step the drag VISC [Nm s/rad]
# bound(world, k): changes speeds without a torque, right after the driveline
# after(world, k, h): uses the driveline's new speeds, torques and heats
# pickup(world, k, h, index, shown): sets the voltage that it induces in the wires of transducers in the step that ends at row
# ``index``
STAGES = ("fill", "command", "ordered", "before", "bound", "after", "pickup")


@dataclass(frozen=True)
class Wire:
    """A connection of a device, by a key of its description.

    Parameters
    ----------
    to : str
        One of the names above: what the key joins the device to.
    needed : bool
        False where it can be left out.
    """

    to: str
    needed: bool = True


@dataclass(frozen=True)
class Shown:
    """A signal in the message of a device's state.

    Parameters
    ----------
    what : str
        End of the signal's name.
    field : str
        Field of the message.
    of : str
        Quantity with its unit and range, see base.units.
    low, high : float
        Ends of its range.
    text, sign : str
        Sentences in which {called} is the device and {driving} and {driven} are the bodies that it joins.
    states : dict of int to str
        Names of the values of a state.
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
    """A setpoint of a device, with a switch.

    Parameters
    ----------
    step : str
        Its key in a sequence.
    takes : dict of str to str
        Dimension of the value of each key there.
    target, enabled : str
        States that it sets.
    text : str
        What is set, in words.
    of : str
        Quantity of the device's transducer, whose unit and range the value has.
    node : str
        End of the name of the node that accepts the setpoint, where the device has more than one.
    only : str
        Switch of the device's configuration without which no node accepts the setpoint.
    parameter : str
        Name of the value as a parameter of that node, by default the last key of ``takes``.
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
        """Name of the value, e.g. speed."""
        return list(self.takes)[-1]


def no_values(_rig: ShownRig, _name: str) -> tuple[()]:
    """Return the fields of no message."""
    return ()


def no_shaft(_values: object) -> tuple[float, float]:
    """Return stiffness and damping of the shaft of a part that owns none."""
    return 0.0, 0.0


def not_whole(values: object, *names: str) -> tuple[str, str] | None:
    """Return the first of some values that is no whole number, as ``Part.check`` does."""
    return next(
        ((name, f"is {value:g}, expected a whole number") for name in names if (value := getattr(values, name)) != int(value)), None
    )


def not_in_order(values: object, *names: str) -> tuple[str, str] | None:
    """Return the first of some values [SI] that is not above the one before it, as ``Part.check`` does."""
    for less, more in pairwise(names):
        low, high = getattr(values, less), getattr(values, more)
        if not low < high:
            return less, f"is {low:g}, expected less than the {high:g} of {more}, both in SI units"
    return None


@dataclass(frozen=True)
class Part:
    """A type of device.

    Parameters
    ----------
    name : str
        Name of its file.
    order : int
        Place of its stages among those of the other parts, smaller ones first.
    configs : tuple of type
        Dataclasses of its configuration, one after the other in its record.
    state : tuple of str
        State variables, which go from step to step and are finite at all times.
    derived : tuple of str
        Numbers that are computed from its configuration before time passes.
    wires : tuple of str
        Keys of its connections: bodies, elements, oil lines, outputs of the controller, other instances.
    tables : tuple of str
        Derived arrays of numbers, whose shapes may differ from rig to rig.
    stages : dict of str to function
        Compiled functions by the name of their stage.
    role : str
        One of the roles above, for the description of a rig.
    joined : dict of str to Wire
        By key of the rig's description, what the device is joined to.
    effects : dict of str to dict
        By the name of an effect that can be left out, the values of the configuration without it.
    message : str
        Type of its state's message.
    shown_values : function
        shown_values(rig, name) returns the fields of that message; a part without one needs none.
    shows : tuple of Shown
        Its signals.
    takes : tuple of Command
        Its commands.
    inertia : function or None
        inertia(values) returns what it adds to the inertia of its body [kg m2], by its configuration as a dataclass or a plain map.
    stores : tuple of str
        States with the work that it has done on its body and with the energy that it stores [J]; empty for a part that stores no
        energy outside the driveline.
    account : str
        State with the work [J] that it has taken since time 0 from bodies on which it acts by a torque, for a device that does so
        and is not the rig's drive. A load without such a state acts by friction alone.
    shaft : function
        shaft(values) returns the stiffness [Nm/rad] and the damping [Nm s/rad] of a compliant shaft between the two bodies that it
        joins, which the part owns by its wire "shaft". The kernel moves this shaft, and a stage ``before`` may give it another
        stiffness, damping and twist for its step. The part's state "stored" is the energy in it [J].
    holds : bool
        True for a source that holds the speed of its body, whatever the load up to its limits.
    check : function, optional
        check(values) returns the name of a value and the rest of a sentence where values contradict each other, otherwise None.
    source : str
        Key of the file of a part of another package. It is in the type of its record, because numba's cache would otherwise give
        an engine that was made of an earlier version of the file.
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
    shown_values: Callable[[ShownRig, str], tuple] = no_values
    shows: tuple[Shown, ...] = ()
    takes: tuple[Command, ...] = ()
    inertia: Callable[[Any], float] | None = None
    stores: tuple[str, ...] = ()
    account: str = ""
    shaft: Callable[[Any], tuple[float, float]] = no_shaft
    check: Callable[[Any], tuple[str, str] | None] | None = None
    holds: bool = False
    source: str = ""

    def state_dtype(self) -> np.dtype:
        """Return the type of its states: one float64 for each."""
        return np.dtype([(name, "f8") for name in self.state])

    def values_dtype(self, shapes: dict[str, tuple[int, ...]]) -> np.dtype:
        """Return the type of its values: configuration and derived numbers as float64, wires as uint64, and tables.

        Parameters
        ----------
        shapes : dict of str to tuple of int
            Shapes of the tables by their names.

        Returns
        -------
        numpy.dtype
            Type of the record.
        """
        return np.dtype(
            [
                *record_dtype(*self.configs).descr,
                *((name, "f8") for name in self.derived),
                *((name, "u8") for name in self.wires),
                *((name, "f8", shapes[name]) for name in self.tables),
                *([(f"source_{self.source}", "f8")] if self.source else []),
            ]
        )


def parts() -> list[str]:
    """Return the names of all types of devices that a rig's description may use, those of other packages too."""
    return [name for name in PARTS.names() if part(name).role]


def is_part(name: object) -> bool:
    """Return whether a rig's description may use a type of device of this name; this imports its own module only."""
    return isinstance(name, str) and (PARTS.has_own(name) or name in PARTS.added()) and bool(part(name).role)


def bodies_of(name: str, wires: Mapping[str, Any]) -> list[str]:
    """Return the bodies that single wires of a device name: those whose speed its part may need.

    Parameters
    ----------
    name : str
        Name of its part.
    wires : mapping of str to str, list of str or int
        What it is joined to.

    Returns
    -------
    list of str
        Names of the bodies.
    """
    kind = part(name)
    return [to for key, to in wires.items() if key == "body" or (key in kind.wires and kind.joined[key].to == BODY)]


@cache
def part(name: str) -> Part:
    """Return the type of device of a name.

    Parameters
    ----------
    name : str
        Name of its file.

    Returns
    -------
    Part
        The type of device.

    Raises
    ------
    RigError
        When there is no such part, it has an unknown stage, or the package that adds it is at fault.
    """
    if PARTS.has_own(name):
        found = PARTS.own_module(name).PART
    elif point := PARTS.added().get(name):
        found = _of_package(point)
    else:
        raise RigError(f"there is no part '{name}'")
    unknown = set(found.stages) - set(STAGES)
    if unknown:
        raise RigError(f"part '{name}' has the unknown stage '{sorted(unknown)[0]}'; known are {', '.join(STAGES)}")
    return found


def _of_package(point: EntryPoint) -> Part:
    """Return a type of device of another package, with the key of its source."""
    found = PARTS.load(point, Part)
    if found.name != point.name:
        raise PARTS.refused(point, f"is a part of the name '{found.name}', expected that of the entry point")
    source = Path(str(import_module(point.module).__file__)).read_bytes()
    return replace(found, source=hashlib.sha256(source).hexdigest()[:16])
