# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transmission of a rig as data: shafts, gears, clutches, and the signals and devices that belong to each.

Made from the rig's configuration by :func:`transmission_of`, and nowhere else; analysis, views, controllers, sequences
and the tuner take gears, clutches, pressures and ratios from it and know none by name.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, TypeVar

from .description.driveline import build_driveline, held_ratio, inertias_of
from .description.structure import Device, End, Structure, key_of, structure_of
from .plant.kiss_point import kiss_pressure

if TYPE_CHECKING:
    from .arrays import Floats
    from .testbench.configuration import RigConfig

    Numbers = TypeVar("Numbers", float, Floats)

NEUTRAL = 0  # number of the gear in which nothing is driven


@dataclass(frozen=True)
class Clutch:
    """A clutch or brake that gears are engaged with.

    instance, valve: devices of the rig, as their parts and nodes are named; valve_name: what people call the valve;
    output: of the controller, counted from 0, that drives the valve; pressure, current, setpoint: signals of its oil, of
    its valve's coil and of what the controller asks for there. kiss_pressure [Pa, gauge]: where the clutch begins to
    carry; fall_rate [Pa/s]: how fast its pressure falls when it is let go, which errors of times are estimated with.
    """

    name: str
    instance: str
    valve: str
    valve_name: str
    output: int
    pressure: str
    current: str
    setpoint: str
    kiss_pressure: float
    fall_rate: float

    @property
    def key(self) -> str:
        """How the names of its signals and energies begin, e.g. ``s1``."""
        return key_of(self.name)

    @property
    def heat(self) -> str:
        """Name of its heat among the energies."""
        return f"heat_{self.key}"

    @property
    def state(self) -> str:
        """Topic of its state."""
        return f"/{self.instance}/state"

    def signal(self, what: str) -> str:
        """Its signal of torque, capacity, slip, mode, clamp or piston."""
        return f"{self.key}_{what}"

    @property
    def voltage(self) -> str:
        """Row of the voltage on its valve's coil, which recordings of the rig have and no transducer shows."""
        return f"U_{key_of(self.valve_name)}"

    def valve_signal(self, what: str) -> str:
        """Its valve's signal of duty or flow."""
        return f"{key_of(self.valve_name)}_{what}"


@dataclass(frozen=True)
class Gear:
    """A gear: number 0 is neutral, the others count up from the slowest output; clutches: names of those engaged.

    ratio: input over output speed; None in neutral. outputs: of the controller, counted from 0, for these clutches, as the
    rig's file has them: whoever crosses the wires crosses them behind the controller.
    """

    number: int
    name: str
    clutches: tuple[str, ...] = ()
    ratio: float | None = None
    outputs: tuple[int, ...] = ()

    @property
    def short(self) -> str:
        """For tables: neutral is 0."""
        return self.name if self.number else "0"


@dataclass(frozen=True)
class Inertias:
    """Reduced inertias of the energy equation (6.108).

    driving: on the input shaft, motor included [kg m2]; driven: of the output side, load included [kg m2], on an axis
    that turns ``reduction`` times as fast as the output shaft. The energy equation uses the whole inertias beside work
    that is measured at the torque meters: motor and load pump lie outside them, so while the input speed has not
    recovered its loss counts the motor's own kinetic energy too. The heat itself stands in the report's energy balance.
    """

    driving: float
    driven: float
    reduction: float = 1.0

    @property
    def on_output(self) -> float:
        """The driven inertia on the output shaft [kg m2]."""
        return self.driven * self.reduction**2

    def kinetic(self, w_in: Numbers, w_out: Numbers) -> Numbers:
        """Kinetic energy [J] at these speeds of input and output shaft [rad/s]."""
        return 0.5 * self.driving * w_in**2 + 0.5 * self.on_output * w_out**2


@dataclass(frozen=True)
class Shift:
    """A change of gear: which clutches it lets go, which it engages, in the order of the transmission."""

    from_gear: int
    to_gear: int
    releasing: tuple[Clutch, ...]
    engaging: tuple[Clutch, ...]


@dataclass(frozen=True)
class Transmission:
    """Shafts, clutches and gears of a rig; gears in order of their numbers, neutral first."""

    input: End
    output: End
    clutches: tuple[Clutch, ...]
    gears: tuple[Gear, ...]
    inertias: Inertias

    @cached_property
    def ratios(self) -> dict[int, float]:
        """Number of each gear that drives -> input over output speed."""
        return {gear.number: gear.ratio for gear in self.gears if gear.ratio is not None}

    @cached_property
    def names(self) -> dict[int, str]:
        """Number -> name of every gear."""
        return {gear.number: gear.name for gear in self.gears}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Name -> number of every gear."""
        return {gear.name: gear.number for gear in self.gears}

    def outputs(self, number: int) -> tuple[int, ...]:
        """The controller's outputs of a gear, counted from 0; none in neutral and in a gear that there is not."""
        return next((gear.outputs for gear in self.gears if gear.number == number), ())

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Signals of both shafts and all clutches' pressures, which shift metrics are computed from."""
        return (
            self.input.torque,
            self.input.speed,
            self.output.torque,
            self.output.speed,
            *(clutch.pressure for clutch in self.clutches),
        )

    @property
    def spoken(self) -> str:
        """The gears for a sentence on what may be ordered, e.g. ``0 (neutral), 1 (I) or 2 (II)``."""
        *first, last = (f"{gear.number} ({gear.name})" for gear in self.gears)
        return f"{', '.join(first)} or {last}"

    def short(self, number: int) -> str:
        """Name of a gear in tables; of one that there is not its number."""
        return next((gear.short for gear in self.gears if gear.number == number), str(number))

    def way(self, from_gear: int, to_gear: int, arrow: str = " -> ") -> str:
        """A change of gear in tables, e.g. ``I -> II``."""
        return self.short(from_gear) + arrow + self.short(to_gear)

    def number(self, text: str) -> int | None:
        """The gear that somebody means by its name or number, in either case; N or 0 is neutral; None: there is none."""
        said = text.strip().lower()
        return next(
            (
                gear.number
                for gear in self.gears
                if said in (gear.name.lower(), str(gear.number)) or (gear.number == NEUTRAL and said == "n")
            ),
            None,
        )

    def engaged(self, gear: int) -> tuple[Clutch, ...]:
        """The clutches that are engaged in a gear; none in neutral and in a gear that there is not."""
        held = next((one.clutches for one in self.gears if one.number == gear), ())
        return tuple(clutch for clutch in self.clutches if clutch.name in held)

    def shift(self, from_gear: int, to_gear: int) -> Shift:
        """What a change from one gear to another does; a clutch of both gears stays engaged and is neither."""
        old, new = self.engaged(from_gear), self.engaged(to_gear)
        return Shift(
            from_gear,
            to_gear,
            tuple(clutch for clutch in old if clutch not in new),
            tuple(clutch for clutch in new if clutch not in old),
        )

    def changes(self, from_gear: int, to_gear: int) -> bool:
        """An order changes from one gear that drives to another: no engagement from neutral, no way back to it."""
        return from_gear != to_gear and from_gear in self.ratios and to_gear in self.ratios

    def slower_ratio(self, one: int, other: int) -> float:
        """Ratio of that of two gears that drive in which the output is slower, which (7.3) and (7.4) both use."""
        return max(self.ratios[one], self.ratios[other])

    def ways(self) -> dict[str, tuple[int, int]]:
        """The changes to the next gear up and down by name, e.g. ``I-II`` -> (1, 2)."""
        driving = [gear for gear in self.gears if gear.ratio is not None]
        pairs = [pair for a, b in itertools.pairwise(driving) for pair in ((a, b), (b, a))]
        return {f"{a.name}-{b.name}": (a.number, b.number) for a, b in pairs}

    def slip(self, gear: int, w_in: Numbers, w_out: Numbers) -> Numbers:
        """Slip of a gear that drives as a share of the input speed, (6.85); speeds [rad/s], numbers or arrays."""
        return slip_of(self.ratios[gear], w_in, w_out)


def slip_of(ratio: float, w_in: Numbers, w_out: Numbers) -> Numbers:
    """Slip as a share of the input speed, (6.85), of a gear with this ratio."""
    return 1.0 - w_out * ratio / w_in


def transmission_of(config: RigConfig | Mapping | None = None) -> Transmission:
    """The transmission of a rig with gears.

    config: a RigConfig, or its record as a bag and a report hold it (RigConfig.as_dict); by default the installed rig that
    is taken where none is named. Raises KeyError, TypeError or ValueError for a record that is none.
    """
    if config is None:
        return _default()
    if isinstance(config, Mapping):
        return made_of(config)
    return config.transmission


@lru_cache(maxsize=1)
def _default() -> Transmission:
    from .testbench.configuration import load_rig  # here, as all that reads a rig stands above this module

    return load_rig().transmission


def made_of(record: Mapping) -> Transmission:
    """The transmission of a rig by its record; ValueError for a rig without gears."""
    structure = structure_of(record["structure"])
    if not structure.gears or structure.input is None or structure.output is None:
        raise ValueError(f"the rig '{record.get('name', '')}' has no gears")
    inertias = inertias_of(structure, record)
    system, names = build_driveline(structure, inertias, record, lossless=True), {one.name: one for one in structure.clutches}
    ends = structure.input.body, structure.output.body
    gears = [Gear(NEUTRAL, "neutral")]
    for number, gear in enumerate(structure.gears, 1):
        try:
            ratio = held_ratio(system, gear.held, *ends)
        except ValueError as error:
            raise ValueError(f"gear {gear.name} of the rig '{record.get('name', '')}': {error}") from None
        valves = [valve for one in gear.clutches if (valve := structure.valve_of(one))]
        gears.append(
            Gear(
                number,
                gear.name,
                tuple(names[one].called for one in gear.clutches),
                ratio,
                tuple(valve.wires["output"] - 1 for valve in valves),
            )
        )
    wiring = dict(zip((valve.name for valve in structure.valves), record.get("wiring", ())))
    clutches = tuple(_clutch(one, structure, record, wiring) for one in structure.clutches)
    driving, one = tied_to(structure, inertias, ends[0])
    driven, reduction = tied_to(structure, inertias, ends[1])
    return Transmission(structure.input, structure.output, clutches, tuple(gears), Inertias(driving * one**2, driven, reduction))


def _clutch(device: Device, structure: Structure, record: Mapping, wiring: Mapping[str, int]) -> Clutch:
    """A clutch with what belongs to it; of a signal that nobody measures the name is empty."""
    valve, values = structure.valve_of(device.name), record[device.name]

    def shown(what: str) -> str:
        return next((one.name for one in structure.transducers if one.shows == what), "")

    kiss = kiss_pressure(SimpleNamespace(**values)) if "piston_area" in values else 0.0
    line = structure.line_of(device.name)
    if valve is None:
        return Clutch(device.called, device.name, "", "", -1, shown(f"{line}.pressure"), "", "", kiss, device.release_rate)
    return Clutch(
        device.called,
        device.name,
        valve.name,
        valve.called,
        int(wiring[valve.name]),
        shown(f"{line}.pressure"),
        shown(f"{valve.name}.current"),
        f"I_set_{valve.key}",
        kiss,
        device.release_rate,
    )


def tied_to(structure: Structure, inertias: Mapping[str, float], body: str) -> tuple[float, float]:
    """(inertia of all that toothed wheels tie to a body [kg m2], speed of the axis that it is on by that of the body)."""
    speeds, todo = {body: 1.0}, [body]
    while todo:
        here = todo.pop()
        for mesh in structure.meshes:
            for (a, b), ratio in ((mesh.bodies, mesh.ratio), (mesh.bodies[::-1], 1.0 / mesh.ratio)):
                if a == here and b not in speeds:
                    speeds[b] = speeds[here] * ratio
                    todo.append(b)
    heavy = [name for name in speeds if inertias[name] > 0.0]
    if len(heavy) == 1:
        return inertias[heavy[0]], abs(speeds[heavy[0]])
    return sum(inertias[name] * speeds[name] ** 2 for name in heavy), 1.0
