# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam: what goes into a shift controller for a sample, what comes out, and its checks.

Used by every plug; user classes may import it too. How many outputs, which transducers and which gears there are is the
rig's own and stands in its record (record.py).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any

from ..alfa46.settings import OUTPUT_KEYS, POINTS, Alfa46Config
from ..config.names import unknown
from ..errors import RigError

LEVELS = ("duty", "current")


class Status(IntEnum):
    """How a step ended, after FMI; the effects stand in docs/how_to/controllers.md."""

    OK = 0
    DISCARD = 1  # no answer to this sample: the last command stays, for 100 ms at most
    ERROR = 2  # the rig trips; the controller is ended in order
    FATAL = 3  # the rig trips; the controller is not called again


class ControllerFailed(RigError):
    """A controller that cannot go on: its sentence is the reason with which the rig trips."""

    exit_code = 1

    def __init__(self, message: str, status: Status) -> None:
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class ControllerInfo:
    """What a controller learns before its first step."""

    period: float  # s between samples
    level: str  # "duty" or "current": what its command means
    command_high: float  # the largest command: 1 at level duty, the valves' current limit [A] at level current
    parameters: Mapping[str, float]  # flat names, SI
    outputs: tuple[str, ...]  # names of the controller's outputs, in the order of current and command
    transducers: Mapping[str, str]  # unit by name, in the order of measured
    gears: Mapping[int, str]  # name by number


@dataclass(frozen=True, slots=True)
class ControllerInputs:
    """One controller sample: what the wires carry, quantised and noisy.

    A rig's own type of it (ControllerRecord.inputs) has each transducer as an attribute of its name too.
    """

    sample: int  # index since time 0
    time: float  # sample x period [s]
    gear_request: int  # number of the gear ordered last; stays until the next order or a trip, then 0 (neutral)
    current: tuple[float, ...]  # measured coil currents of the outputs [A]
    measured: tuple[float, ...]  # the transducers of the rig's record, SI
    others: Mapping[str, float] = field(default_factory=dict)  # the transducers that the controller asked for, SI
    settings: Mapping[str, float] = field(default_factory=dict)  # the controller's own, as they are set now


@dataclass(slots=True)
class ControllerOutputs:
    """The answer to one sample; it acts from the next sample on."""

    command: Sequence[float] | None = None  # duty 0..1, or current setpoint [A], as the level says; None: 0 everywhere
    setpoint: Sequence[float] | None = None  # current asked for [A], for display; at level current the command
    gear: int = 0  # gear taken last
    shifting: bool = False  # a shift is still running
    flags: int = 0  # bit k: at level current, output k stays on at a setpoint of zero
    status: Status = Status.OK
    message: str = ""  # why the status is not OK
    signals: Mapping[str, float] | None = None  # values of the signals that the controller names as its own


def flat_parameters(config: Alfa46Config) -> dict[str, float]:
    """The alfa46 settings as flat names with SI values: "t12", "output_1.P1.time", "output_1.P1.current"."""
    out = {f.name: float(getattr(config.values, f.name)) for f in fields(config.values)}
    for key, points in zip(OUTPUT_KEYS, config.profiles, strict=True):
        for point, (time, current) in zip(POINTS, points, strict=True):
            out[f"{key}.{point}.time"], out[f"{key}.{point}.current"] = float(time), float(current)
    return out


def checked_wants(names: Any, name: str, known: Sequence[str]) -> tuple[str, ...]:
    """Transducers that a controller asks for beside those that all get; RigError unless the rig has each. known: its own."""
    if isinstance(names, str) or not isinstance(names, Collection) or not all(isinstance(item, str) for item in names):
        raise RigError(f"controller {name}: wants is {names!r}, expected names of transducers")
    for item in names:
        if item not in known:
            raise RigError(f"controller {name}: wants: {unknown('transducer', item, known)}")
    return tuple(names)


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
    """(command, setpoint, gear, shifting, flags) in plain types; RigError when one is not right."""
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
    if info.level == "current":
        setpoint = command
    else:
        setpoint = _numbers(setpoint, "setpoint", count)
        for k, value in enumerate(setpoint):
            if not math.isfinite(value):
                raise RigError(f"setpoint[{k}] is {value:g}, expected a finite current in A")
    if gear not in tuple(info.gears):
        told = " or ".join(f"{number} ({name})" for number, name in info.gears.items())
        raise RigError(f"gear is {gear!r}, expected {told}")
    try:
        bits = int(flags)
    except (TypeError, ValueError, OverflowError):
        bits = -1
    if not 0 <= bits < 1 << count:
        raise RigError(f"flags is {flags!r}, expected 0 to {(1 << count) - 1}: one bit for each output")
    return command, setpoint, int(gear), bool(shifting), bits
