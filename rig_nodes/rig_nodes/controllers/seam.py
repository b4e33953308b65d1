# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam: what a shift controller receives for a sample, what it returns, and the checks of both.

Every plug uses it; user classes may import it too. The number of outputs, the transducers and the gears belong to the
rig and stand in its record (record.py).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

from ..base import RigError, unknown
from .own_signals import once_each

LEVELS = ("duty", "current")
MOST_TEXT = 1000  # characters of a controller's text that go into a sentence, and with it into bag and terminal


class Status(IntEnum):
    """How a step ended, as in FMI; docs/how_to/controllers.md describes the effects."""

    OK = 0
    DISCARD = 1  # no answer to this sample: the last command stays, for 100 ms at most
    ERROR = 2  # the rig trips; the controller is ended in order
    FATAL = 3  # the rig trips; the controller is not called again


STATUSES = tuple(Status)


class ControllerFailed(RigError):
    """A failure after which the controller cannot go on; its sentence is the reason with which the rig trips.

    Parameters
    ----------
    message : str
        The reason, as one sentence.
    status : Status
        ERROR or FATAL.
    """

    exit_code = 1

    def __init__(self, message: str, status: Status) -> None:
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class ControllerInfo:
    """What a controller receives before its first step."""

    period: float  # s between samples
    level: str  # "duty" or "current": the meaning of the command
    command_high: float  # largest command: 1 at level duty, the valves' current limit [A] at level current
    parameters: Mapping[str, float]  # flat names, SI
    outputs: tuple[str, ...]  # names of the controller's outputs, in the order of current and command
    transducers: Mapping[str, str]  # unit by name, in the order of measured
    gears: Mapping[int, str]  # name by number


@dataclass(frozen=True, slots=True)
class ControllerInputs:
    """One controller sample: the quantised and noisy values that the wires carry.

    The rig's own type of it (ControllerRecord.inputs) also has each transducer as an attribute with the transducer's name.
    """

    sample: int  # index since time 0
    time: float  # sample x period [s]
    gear_request: int  # number of the gear ordered last; it stays until the next order; a trip sets it to 0 (neutral)
    current: tuple[float, ...]  # measured coil currents of the outputs [A]
    measured: tuple[float, ...]  # values of the transducers in the rig's record, SI
    others: Mapping[str, float] = field(default_factory=dict)  # values of the transducers that the controller asked for, SI
    settings: Mapping[str, float] = field(default_factory=dict)  # present values of the controller's own settings


@dataclass(slots=True)
class ControllerOutputs:
    """The answer to one sample; it takes effect from the next sample on."""

    command: Sequence[float] | None = None  # duty 0..1 or current setpoint [A], depending on the level; None: all 0
    setpoint: Sequence[float] | None = None  # current that the controller wants [A], for display; at level current the command
    gear: int = 0  # number of the gear that the controller took last
    shifting: bool = False  # a shift is still running
    flags: int = 0  # bit k: at level current, output k stays on at a setpoint of zero
    status: Status = Status.OK
    message: str = ""  # why the status is not OK
    signals: Mapping[str, float] | None = None  # values of the controller's own signals, by name


def shortened(text: str) -> str:
    """Return a controller's text as UTF-8 can hold it, cut where it is longer than MOST_TEXT."""
    text = text.encode("utf-8", "replace").decode()
    return text if len(text) <= MOST_TEXT else f"{text[:MOST_TEXT]}... ({len(text)} characters)"


def error_text(error: BaseException) -> str:
    """Return an exception as one piece of a sentence, without its traceback."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # the exception is a user's, and its __str__ too
        text = ""
    return shortened(f"{type(error).__name__}: {text}".rstrip(": "))


def inputs_type(readings: Mapping[str, str]) -> type[ControllerInputs]:
    """Return the type of a rig's samples: ControllerInputs with an attribute for each transducer of its record.

    Parameters
    ----------
    readings : mapping of str to str
        Description by name, in the order of ``measured``.

    Returns
    -------
    type of ControllerInputs
        The type.
    """
    own = {
        name: property(lambda given, place=place: given.measured[place], doc=text)
        for place, (name, text) in enumerate(readings.items())
    }
    return type("ControllerInputs", (ControllerInputs,), {"__slots__": (), **own})


def checked_wants(names: Any, name: str, known: Sequence[str]) -> tuple[str, ...]:
    """Check the transducers that a controller asks for in addition to those that every controller receives.

    Parameters
    ----------
    names : Any
        What the controller names, expected to be a collection of strings.
    name : str
        The controller's name, for the error's sentence.
    known : sequence of str
        Names of the rig's transducers.

    Returns
    -------
    tuple of str
        The names, as they were given.

    Raises
    ------
    RigError
        When ``names`` is no collection of strings, the rig lacks one of the transducers, or one comes twice.
    """
    if isinstance(names, str) or not isinstance(names, Collection) or not all(isinstance(item, str) for item in names):
        raise RigError(f"controller {name}: wants is {names!r}, expected names of transducers")
    for item in names:
        if item not in known:
            raise RigError(f"controller {name}: wants: {unknown('transducer', item, known)}")
    return tuple(once_each(((item, item) for item in names), "wants", name))


def _numbers(values: Any, name: str, count: int) -> tuple[float, ...]:
    if values is None:
        return (0.0,) * count
    try:
        out = tuple(map(float, values))
    except (TypeError, ValueError):
        raise RigError(f"{name} is {values!r}, expected {count} numbers") from None
    if len(out) != count:
        raise RigError(f"{name} has {len(out)} numbers, expected {count}")
    return out


def checked(outputs: ControllerOutputs, info: ControllerInfo) -> tuple[tuple, tuple, int, bool, int]:
    """Check an answer and return its parts in plain types.

    Parameters
    ----------
    outputs : ControllerOutputs
        The controller's answer.
    info : ControllerInfo
        What the controller received before its first step.

    Returns
    -------
    tuple
        (command, setpoint, gear, shifting, flags): command (outputs,) as duty or [A], setpoint (outputs,) [A], then the
        gear's number, whether a shift is running, and one bit for each output.

    Raises
    ------
    RigError
        When an attribute is missing or a value is not permitted.
    """
    try:
        command, setpoint = outputs.command, outputs.setpoint
        gear, shifting, flags = outputs.gear, outputs.shifting, outputs.flags
    except AttributeError as error:
        raise RigError(f"step returned {type(outputs).__name__} without '{error.name}', expected ControllerOutputs") from None
    count = len(info.outputs)
    command = _numbers(command, "command", count)
    for k, value in enumerate(command):
        if not 0.0 <= value <= info.command_high:
            unit = " A" if info.level == "current" else ""
            raise RigError(f"command[{k}] is {value:g}, expected 0 to {info.command_high:g}{unit}")
    setpoint = _numbers(setpoint, "setpoint", count)
    for k, value in enumerate(setpoint):
        if not math.isfinite(value):
            raise RigError(f"setpoint[{k}] is {value:g}, expected a finite current in A")
    if info.level == "current":
        setpoint = command
    if gear not in tuple(info.gears):
        choices = " or ".join(f"{number} ({name})" for number, name in info.gears.items())
        raise RigError(f"gear is {gear!r}, expected {choices}")
    if shifting not in (False, True):
        raise RigError(f"shifting is {shifting!r}, expected True or False (1 or 0)")
    try:
        bits = int(flags)
    except (TypeError, ValueError, OverflowError):
        bits = -1
    if bits != flags or not 0 <= bits < 1 << count:
        raise RigError(f"flags is {flags!r}, expected 0 to {(1 << count) - 1}: one bit for each output")
    return command, setpoint, int(gear), bool(shifting), bits


def own_values(given: Any, signals: Collection[str]) -> tuple[float, ...]:
    """Return the values of a controller's own signals.

    Parameters
    ----------
    given : Any
        What the controller returned for them, expected to be a map of names and numbers.
    signals : collection of str
        The names that it has declared.

    Returns
    -------
    tuple of float
        Their values; one may be NaN or infinite.

    Raises
    ------
    RigError
        When one is missing, is no number, or was not declared.
    """
    if not signals and not given:
        return ()
    declared = ", ".join(signals) or "none"
    try:
        values = tuple(float(given[name]) for name in signals)
        surplus = [name for name in given if name not in signals]
    except (TypeError, KeyError, ValueError):
        raise RigError(f"signals is {given!r}, expected a number for each of {declared}") from None
    if surplus:
        raise RigError(f"signals has '{surplus[0]}', which is none of the signals that it has declared: {declared}")
    return values


class Taken(NamedTuple):
    """An answer that was checked, in plain types; for a status other than OK only ``text`` counts: the controller's reason."""

    status: Status
    text: str = ""
    command: tuple[float, ...] = ()  # duty or [A]
    setpoint: tuple[float, ...] = ()  # [A]
    gear: int = 0
    shifting: bool = False
    flags: int = 0
    own: tuple[float, ...] = ()  # values of the controller's own signals


def taken(outputs: Any, info: ControllerInfo, signals: Collection[str]) -> Taken:
    """Check everything that a controller returned for a sample.

    Parameters
    ----------
    outputs : Any
        What it returned, expected to be a ControllerOutputs.
    info : ControllerInfo
        What the controller received before its first step.
    signals : collection of str
        Names of its own signals.

    Returns
    -------
    Taken
        The answer.

    Raises
    ------
    RigError
        When a part of the answer is not permitted.
    """
    status = getattr(outputs, "status", Status.OK)
    if status not in STATUSES:
        raise RigError(f"status is {status!r}, expected 0 (ok), 1 (discard), 2 (error) or 3 (fatal)")
    status = Status(status)
    if status != Status.OK:
        text = " ".join(str(getattr(outputs, "message", "")).split()) or "it gave no reason"
        return Taken(status, shortened(text))
    answer = checked(outputs, info)
    return Taken(status, "", *answer, own_values(getattr(outputs, "signals", None), signals))
