# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's record of a rig: its outputs, the transducers that the controller sees, and the gears it may be asked for.

Everything that carries samples and answers is made from it: types, structs, frames, messages, FMU variables, CAN, Modbus.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from operator import itemgetter
from types import MappingProxyType
from typing import TYPE_CHECKING

from ..base import RigError
from ..rig import OUTPUT_KEYS, POINTS, Alfa46Config, Signal, slip_of
from .seam import ControllerInfo, ControllerInputs, inputs_type

if TYPE_CHECKING:
    from ..rig import RigConfig

STANDSTILL = 10.0 * math.pi / 30.0  # rad/s of the input shaft, below which the slip is given as 0


@dataclass(frozen=True)
class Output:
    """One output of the controller.

    Parameters
    ----------
    name : str
        The output's name.
    valve : str
        The device that it drives; empty where no valve is connected.
    current : Signal
        The signal of its coil current; where no valve is connected, that of another output.
    pressure : str
        The signal of the clutch that its valve presses.
    """

    name: str
    valve: str
    current: Signal
    pressure: str = ""


@dataclass(frozen=True)
class Gear:
    """One gear that can be ordered.

    Parameters
    ----------
    number : int
        The gear's number.
    name : str
        The gear's name.
    ratio : float or None
        Input speed over output speed; None where no clutch holds.
    presses : tuple of (str, float)
        For each clutch that holds the gear: its pressure transducer, and the reading at which its plates touch [Pa, gauge].
    outputs : tuple of int
        Outputs of the valves of these clutches, counted from 0.
    """

    number: int
    name: str
    ratio: float | None = None
    presses: tuple[tuple[str, float], ...] = ()
    outputs: tuple[int, ...] = ()


@dataclass(frozen=True)
class ControllerRecord:
    """What goes between one rig and its shift controller, in this order.

    Parameters
    ----------
    rig : str
        The rig's name, for people.
    outputs : tuple of Output
        The controller's outputs.
    transducers : tuple of Signal
        Entries of the signal catalogue.
    gears : tuple of Gear
        The gears that can be ordered.
    like : mapping of str to Signal
        By level, the signal whose unit and range a command has.
    input_speed, output_speed : str
        Transducers of the two shafts that ``Gear.ratio`` relates.
    all_transducers : tuple of str
        Transducers of the whole rig; a controller may want some of them in addition.

    Raises
    ------
    RigError
        When a transducer's name is no identifier or is the name of another part of a sample.
    """

    rig: str
    outputs: tuple[Output, ...]
    transducers: tuple[Signal, ...]
    gears: tuple[Gear, ...]
    like: Mapping[str, Signal]
    input_speed: str
    output_speed: str
    all_transducers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.names:
            if not name.isidentifier() or name in ControllerInputs.__slots__:
                raise RigError(
                    f"transducer '{name}' cannot be one of the controller's: its name is no identifier or is "
                    "that of another part of a sample"
                )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the transducers."""
        return tuple(signal.name for signal in self.transducers)

    @cached_property
    def id(self) -> str:
        """16 hexadecimal digits, equal for records with equal names, units and order; the positions of the valves do not count."""
        parts = (
            [output.name for output in self.outputs],
            [(signal.name, signal.unit) for signal in self.transducers],
            [(gear.number, gear.name) for gear in self.gears],
        )
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]

    @property
    def number(self) -> int:
        """The first 28 bits of the id, for carriers that take no text."""
        return int(self.id[:7], 16)

    @cached_property
    def gear_names(self) -> dict[int, str]:
        """Gear name by number."""
        return {gear.number: gear.name for gear in self.gears}

    @cached_property
    def gears_text(self) -> str:
        """The gears for people: "0 (neutral), 1 (I), 2 (II)"."""
        return ", ".join(f"{number} ({name})" for number, name in self.gear_names.items())

    @cached_property
    def inputs(self) -> type[ControllerInputs]:
        """The type of this rig's samples: ControllerInputs with an attribute for each transducer, by its name."""
        return inputs_type({signal.name: f"{signal.text} [{signal.unit}]" for signal in self.transducers})

    def made_for_another(self, record: str) -> str:
        """Return a piece of a sentence: something was made for the record with this id, and what the user can do."""
        return (
            f"made for the record {record} of another rig, this one's is {self.id}; write rig_record.h anew with "
            f"./rig export record --rig {self.rig} -o rig_record.h"
        )

    def reader(self, name: str) -> Callable[[Sequence[float]], float]:
        """Return a function that takes a transducer's value out of ``measured``."""
        return itemgetter(self.names.index(name))

    @cached_property
    def _speeds(self) -> tuple[Callable[[Sequence[float]], float], Callable[[Sequence[float]], float]]:
        return self.reader(self.input_speed), self.reader(self.output_speed)

    def speeds(self, measured: Sequence[float]) -> tuple[float, float]:
        """Return the speeds of the input and of the output shaft [rad/s]."""
        first, second = self._speeds
        return first(measured), second(measured)

    def slip(self, number: int, measured: Sequence[float]) -> float:
        """Return the slip of a gear's clutch as a share of the input speed.

        Parameters
        ----------
        number : int
            The gear's number.
        measured : sequence of float
            Values of the transducers in the record's order [SI].

        Returns
        -------
        float
            The slip [-]: 0 without a clutch and at standstill, NaN where a speed is no finite number.
        """
        n_in, n_out = self.speeds(measured)
        if not (math.isfinite(n_in) and math.isfinite(n_out)):
            return math.nan
        ratio = next((gear.ratio for gear in self.gears if gear.number == number), None)
        if ratio is None or n_in < STANDSTILL:
            return 0.0
        return slip_of(ratio, n_in, n_out)


def flat_parameters(config: Alfa46Config) -> dict[str, float]:
    """Return the alfa46 settings as flat names with SI values: "t12", "output_1.P1.time", "output_1.P1.current".

    Parameters
    ----------
    config : Alfa46Config
        The alfa46 settings of a rig.

    Returns
    -------
    dict of str to float
        SI value by flat name.
    """
    out = {f.name: float(getattr(config.values, f.name)) for f in fields(config.values)}
    for key, points in zip(OUTPUT_KEYS, config.profiles, strict=True):
        for point, (time, current) in zip(POINTS, points, strict=True):
            out[f"{key}.{point}.time"], out[f"{key}.{point}.current"] = float(time), float(current)
    return out


def controller_info(record: ControllerRecord, config: Alfa46Config, level: str) -> ControllerInfo:
    """Return what a controller receives at a level before its first sample.

    Parameters
    ----------
    record : ControllerRecord
        The rig's record.
    config : Alfa46Config
        The rig's alfa46 settings.
    level : str
        "duty" or "current".

    Returns
    -------
    ControllerInfo
        The period, the level, the largest command, the settings and the record's names.
    """
    values = config.values
    high = values.current_limit if level == "current" else 1.0
    return ControllerInfo(
        values.sample_time,
        level,
        high,
        flat_parameters(config),
        tuple(output.name for output in record.outputs),
        {signal.name: signal.unit for signal in record.transducers},
        record.gear_names,
    )


def record_of(config: RigConfig) -> ControllerRecord:
    """Return the record of a rig of rig.configuration, the only function that depends on where its parts are described."""
    signals, box = config.catalogue.signals, config.transmission
    first = box.clutches[0]
    by_output, outputs = {clutch.output: clutch for clutch in box.clutches}, []
    for k in range(config.structure.outputs):
        name, clutch = f"output_{k + 1}", by_output.get(k)
        outputs.append(
            Output(name, clutch.valve, signals[clutch.current], clutch.pressure)
            if clutch
            else Output(name, "", signals[first.current])
        )
    gears = tuple(
        Gear(
            gear.number,
            gear.name,
            gear.ratio,
            tuple((clutch.pressure, clutch.kiss_pressure) for clutch in box.engaged(gear.number)),
            gear.outputs,
        )
        for gear in box.gears
    )
    seen = box.input.speed, box.output.speed, *(clutch.pressure for clutch in box.clutches)
    like = {"duty": signals[first.valve_signal("duty")], "current": signals[first.setpoint]}
    return ControllerRecord(
        config.name,
        tuple(outputs),
        tuple(signals[name] for name in seen),
        gears,
        MappingProxyType(like),
        *seen[:2],
        tuple(config.catalogue.measured().values()),
    )
