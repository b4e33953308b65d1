# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definition of a type of fault: what it acts on, its size with unit and range, and what a person sees of it.

Every other file of this folder is a family and ends with ``FAULTS = (...)``. Another package adds a fault by an entry point of the
group ``rig_nodes.faults``, which names a Fault. rig.faults reads orders of faults, runs.faults has them act.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

from ...base import Group

FAMILIES = Group("faults", "fault", __package__, "FAULTS")
# What a fault acts on where that is no type of device: a transducer, or the messages in one direction between controller and rig,
# whose name in orders is also their name as an owner; that of an output of the Alfa46 is "alfa46".
TRANSDUCER = "transducer"
MESSAGES, MEASUREMENTS = LINES = ("messages", "measurements")
ABRUPT, GROWING, INTERMITTENT = ONSETS = ("abrupt", "growing", "intermittent")
# of suspect parameters that SAE J1939 leaves to a manufacturer, behind those of trips; FMIs are numbered in SAE J1939-73
FIRST_SPN = 522_240
ABOVE, BELOW, ERRATIC, LOST, OPEN, SHORT, STUCK, RATE, UPDATE, UNKNOWN, BAD, UNCALIBRATED = 15, 17, 2, 4, 5, 6, 7, 8, 9, 11, 12, 13
NETWORK, DRIFTED = 19, 20  # received network data in error, data drifted high
NEVER = 1e12  # times a time constant: of what is stuck


class Target(Protocol):
    """What a fault changes: values of a device by their names, rows of a transducer's table, or points of a controller's profile.

    What is written is taken back when the fault ends. Values are read as they are with the faults that act already.

    Attributes
    ----------
    configs : tuple of object
        The device's configuration, with those of its plates and of the cylinder that presses it where it has some.
    span : float
        Full scale of a transducer [SI].
    """

    configs: tuple[Any, ...]
    span: float

    def __getitem__(self, name: str | int | tuple[int, int]) -> float:
        """Return a value [SI]."""
        ...

    def __setitem__(self, name: str | int | tuple[int, int], value: float) -> None:
        """Write a value [SI]."""
        ...

    def shift(self, state: str, by: float) -> None:
        """Add to a state of the device [SI], in all so much; it is taken off again at the fault's end."""
        ...

    def held(self) -> float:
        """Return what a transducer read as the fault began [SI]."""
        ...

    def earlier(self, time: float) -> float:
        """Return the true value that a transducer with a fault that ``keeps`` had so long ago [s, SI], or as the fault began."""
        ...

    def swap(self) -> None:
        """Exchange the wires of a transducer and of the next one of its type."""
        ...


@dataclass(frozen=True)
class Size:
    """The parameter of a fault; 0 is a healthy device.

    Parameters
    ----------
    quantity : str
        Dimension, of base.units.
    low, high : float
        Range [SI], inclusive.
    usual : float
        Value of an order without a size [SI].
    text : str
        What it is.
    """

    quantity: str
    low: float
    high: float
    usual: float
    text: str


def nothing(_configs: tuple[Any, ...]) -> str:
    """Return what a device lacks for a fault that every one of its type can have; a lambda would not be pickled with an order."""
    return ""


@dataclass(frozen=True)
class Fault:
    """A type of fault.

    Parameters
    ----------
    name : str
        Its name, behind that of what it acts on.
    part : str
        Type of device, or TRANSDUCER or one of LINES, or "alfa46".
    sub : str
        What of it fails.
    text, sign : str
        What is wrong, and what a person sees of it.
    act : function
        act(target, size) changes a Target by the present size [SI].
    spn, fmi : int
        Suspect parameter number of what fails at the first device of the type, to which the place of a later one, up to 31, is
        added, and failure mode, of SAE J1939-73.
    size : Size or None
        Its parameter; None for a fault without one, which cannot grow.
    onset : str
        How it sets in where an order does not say: one of ONSETS.
    built_in : bool
        True for wear or wrong assembly, which is there before a run begins: campaigns begin with it.
    lacks : function
        lacks(configs) returns what a device of this configuration lacks for it, or an empty text.
    effect : str
        Name of the effect of a rig without which it changes nothing there; empty for none.
    pairs : bool
        True when it acts on a transducer and the next one of its type at once; a second one on the same two would undo it.
    keeps : bool
        True when it needs the true value of its transducer at each sample.
    """

    name: str
    part: str
    sub: str
    text: str
    sign: str
    act: Callable[[Target, float], None]
    spn: int
    fmi: int
    size: Size | None = None
    onset: str = ABRUPT
    built_in: bool = False
    lacks: Callable[[tuple[Any, ...]], str] = nothing
    effect: str = ""
    pairs: bool = False
    keeps: bool = False


@cache
def faults() -> dict[str, Fault]:
    """Return all types of faults by what they act on and their own name, e.g. "oil_supply.air".

    Raises
    ------
    RigError
        When a package adds something else, or a fault that is there already.
    """
    found = {f"{one.part}.{one.name}": one for family in FAMILIES.own for one in FAMILIES.own_module(family).FAULTS}
    for point in FAMILIES.added().values():
        one = FAMILIES.load(point, Fault)
        if f"{one.part}.{one.name}" in found:
            raise FAMILIES.refused(point, f"is named {one.part}.{one.name} as another one")
        found[f"{one.part}.{one.name}"] = one
    return found
