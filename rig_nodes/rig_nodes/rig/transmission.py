# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transmission of a rig as data: shafts, gears, clutches, and the signals and devices that belong to each.

Only :func:`transmission_of` makes it, from the rig's configuration. Analysis, views, controllers, sequences and the tuner take
gears, clutches, pressures and ratios from it and name none of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, TypeVar

from ..plant import kiss_pressure
from ..plant import part as parts
from .driveline import build_driveline, held_ratio, inertias_of
from .structure import Device, End, Shaft, Structure, key_of, structure_of
from .transducer_types import measured_range

if TYPE_CHECKING:
    from ..base import Floats
    from .configuration import RigConfig

    Numbers = TypeVar("Numbers", float, Floats)

NEUTRAL = 0  # number of the gear in which nothing is driven


@dataclass(frozen=True)
class Clutch:
    """A clutch or brake that engages gears.

    Parameters
    ----------
    name : str
        Its name for people.
    instance, valve : str
        Names of its device and of its valve's device.
    valve_name : str
        Name of the valve for people.
    output : int
        Output of the controller that drives the valve, counted from 0.
    pressure, current, setpoint : str
        Signals of its oil pressure, of its valve's coil current, and of the controller's current setpoint.
    kiss_pressure : float
        Pressure at which the clutch begins to carry torque [Pa, gauge].
    fall_rate : float
        Rate at which its pressure falls when it is released [Pa/s]; errors of times are estimated with it.
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
        """Beginning of the names of its signals and energies, e.g. ``s1``."""
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
        """Return its signal of torque, capacity, slip, mode, clamp or piston."""
        return f"{self.key}_{what}"

    @property
    def voltage(self) -> str:
        """Row of the voltage on its valve's coil, which is in recordings of the rig and is shown by no transducer."""
        return f"U_{key_of(self.valve_name)}"

    def valve_signal(self, what: str) -> str:
        """Return its valve's signal of duty or flow."""
        return f"{key_of(self.valve_name)}_{what}"


@dataclass(frozen=True)
class Gear:
    """A gear of the transmission.

    Parameters
    ----------
    number : int
        0 is neutral; the others count up from the slowest output.
    name : str
        Name of the gear.
    clutches : tuple of str
        Names of the engaged clutches.
    ratio : float or None
        Speed of the input divided by that of the output; None in neutral.
    outputs : tuple of int
        Outputs of the controller for these clutches, counted from 0, as in the rig's file. Swapped wires are swapped behind the
        controller.
    """

    number: int
    name: str
    clutches: tuple[str, ...] = ()
    ratio: float | None = None
    outputs: tuple[int, ...] = ()

    @property
    def short(self) -> str:
        """Name for tables; neutral is 0."""
        return self.name if self.number else "0"


@dataclass(frozen=True)
class Inertias:
    """Reduced inertias of the energy equation (6.108).

    The energy equation uses the whole inertias together with work that is measured at the torque meters. Motor and load pump lie
    outside the meters, so while the input speed has not recovered, its loss includes the kinetic energy of the motor itself. The
    heat alone is in the report's energy balance.

    Parameters
    ----------
    driving : float
        Inertia on the input shaft, with the motor, also where a compliant shaft joins it [kg m2].
    driven : float
        Inertia of the output side, with the load in the same way [kg m2].
    reduction : float
        Speed of the axis of ``driven`` divided by that of the output shaft.
    wheels : float
        The part of ``driving`` that lies between the input's torque meter and the clutches, which the meter's torque accelerates
        [kg m2].
    """

    driving: float
    driven: float
    reduction: float = 1.0
    wheels: float = 0.0

    @property
    def on_output(self) -> float:
        """The driven inertia on the output shaft [kg m2]."""
        return self.driven * self.reduction**2

    def kinetic(self, w_in: Numbers, w_out: Numbers) -> Numbers:
        """Return the kinetic energy [J] at these speeds of input and output shaft [rad/s], numbers or arrays."""
        return 0.5 * self.driving * w_in**2 + 0.5 * self.on_output * w_out**2


@dataclass(frozen=True)
class Shift:
    """A change of gear, with the clutches that it releases and engages, in the order of the transmission."""

    from_gear: int
    to_gear: int
    releasing: tuple[Clutch, ...]
    engaging: tuple[Clutch, ...]


@dataclass(frozen=True)
class Transmission:
    """Shafts, clutches and gears of a rig; the gears are in the order of their numbers, neutral first.

    ``drive_yields`` is why the input's speed is not held during a shift, for a sentence; empty where a drive holds it.
    ``ranges`` gives the lowest and the highest value [SI] that the transducer of a signal can show; a signal that is shown true has
    none.
    """

    input: End
    output: End
    clutches: tuple[Clutch, ...]
    gears: tuple[Gear, ...]
    inertias: Inertias
    drive_yields: str = ""
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict, hash=False)

    @cached_property
    def ratios(self) -> dict[int, float]:
        """Speed of the input divided by that of the output, by the number of each gear except neutral."""
        return {gear.number: gear.ratio for gear in self.gears if gear.ratio is not None}

    @cached_property
    def names(self) -> dict[int, str]:
        """Name of every gear by its number."""
        return {gear.number: gear.name for gear in self.gears}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Number of every gear by its name."""
        return {gear.name: gear.number for gear in self.gears}

    def outputs(self, number: int) -> tuple[int, ...]:
        """Return the controller's outputs of a gear, counted from 0; none in neutral and for an unknown gear."""
        return next((gear.outputs for gear in self.gears if gear.number == number), ())

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Signals of both shafts and of all clutches' pressures, from which shift metrics are computed."""
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
        """Return the name of a gear in tables; for an unknown gear its number."""
        return next((gear.short for gear in self.gears if gear.number == number), str(number))

    def way(self, from_gear: int, to_gear: int, arrow: str = " -> ") -> str:
        """Return the text of a change of gear in tables, e.g. ``I -> II``."""
        return self.short(from_gear) + arrow + self.short(to_gear)

    def number(self, text: str) -> int | None:
        """Return the number of the gear that a text names by name or number, in capitals or not.

        Parameters
        ----------
        text : str
            The text; N or 0 is neutral.

        Returns
        -------
        int or None
            The number; None when there is no such gear.
        """
        wanted = text.strip().lower()
        return next(
            (
                gear.number
                for gear in self.gears
                if wanted in (gear.name.lower(), str(gear.number)) or (gear.number == NEUTRAL and wanted == "n")
            ),
            None,
        )

    def engaged(self, gear: int) -> tuple[Clutch, ...]:
        """Return the clutches that are engaged in a gear; none in neutral and for an unknown gear."""
        held = next((one.clutches for one in self.gears if one.number == gear), ())
        return tuple(clutch for clutch in self.clutches if clutch.name in held)

    def shift(self, from_gear: int, to_gear: int) -> Shift:
        """Return what a change of gear does; a clutch of both gears stays engaged, so it is neither released nor engaged."""
        old, new = self.engaged(from_gear), self.engaged(to_gear)
        return Shift(
            from_gear,
            to_gear,
            tuple(clutch for clutch in old if clutch not in new),
            tuple(clutch for clutch in new if clutch not in old),
        )

    def changes(self, from_gear: int, to_gear: int) -> bool:
        """Return whether an order changes between two different gears, neither of which is neutral."""
        return from_gear != to_gear and from_gear in self.ratios and to_gear in self.ratios

    def turns_round(self, from_gear: int, to_gear: int) -> bool:
        """Return whether a change of gear turns the output's direction round, so that it passes standstill."""
        return self.changes(from_gear, to_gear) and self.ratios[from_gear] * self.ratios[to_gear] < 0.0

    def slower_ratio(self, one: int, other: int) -> float:
        """Return the ratio of that of two gears in which the output is slower, which (7.3) and (7.4) both use, without its sign."""
        return max(abs(self.ratios[one]), abs(self.ratios[other]))

    def ways(self) -> dict[str, tuple[int, int]]:
        """Return the changes to the next gear up and down by name, e.g. ``I-II`` -> (1, 2)."""
        driving = [gear for gear in self.gears if gear.ratio is not None]
        pairs = [pair for a, b in itertools.pairwise(driving) for pair in ((a, b), (b, a))]
        return {f"{a.name}-{b.name}": (a.number, b.number) for a, b in pairs}

    def slip(self, gear: int, w_in: Numbers, w_out: Numbers) -> Numbers:
        """Return the slip of a gear that drives as a share of the input speed, (6.85); speeds [rad/s], numbers or arrays."""
        return slip_of(self.ratios[gear], w_in, w_out)


def slip_of(ratio: float, w_in: Numbers, w_out: Numbers) -> Numbers:
    """Return the slip of a gear with this ratio as a share of the input speed, (6.85); speeds [rad/s], numbers or arrays."""
    return 1.0 - w_out * ratio / w_in


def transmission_of(config: RigConfig | Mapping) -> Transmission:
    """Return the transmission of a rig with gears.

    Parameters
    ----------
    config : RigConfig or mapping
        A configuration, or its record in a bag or a report (RigConfig.as_dict).

    Returns
    -------
    Transmission
        The transmission.

    Raises
    ------
    KeyError, TypeError, ValueError
        When a record is not that of a rig with gears.
    """
    if isinstance(config, Mapping):
        return made_of(config)
    return config.transmission


def made_of(record: Mapping) -> Transmission:
    """Return the transmission of a rig from its record; ValueError for a rig without gears."""
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
    driving, one = tied_to(structure, inertias, ends[0], structure.shafts)
    driven, reduction = tied_to(structure, inertias, ends[1], structure.shafts)
    both = Inertias(driving * one**2, driven, reduction, _wheels(structure, inertias, record))
    shown = ranges_of(structure, record)
    return Transmission(structure.input, structure.output, clutches, tuple(gears), both, _yields(structure), shown)


def _wheels(structure: Structure, inertias: Mapping[str, float], record: Mapping) -> float:
    """Return the inertia between the torque meter of the input and the clutches, reduced to the input [kg m2].

    Where the torque of a shaft is measured, it is all that toothed wheels tie to the input.
    """
    end = structure.input
    shown = next((one.shows for one in structure.transducers if one.name == end.torque), "")
    whole, speed = tied_to(structure, inertias, end.body)
    for meter in structure.of_role(parts.METER):
        if meter.name == shown:
            own = record[meter.name]
            return own["inertia"] if own["side"] == "within" else whole * speed**2 - own["inertia"]
    return whole * speed**2


def _yields(structure: Structure) -> str:
    """Return why no drive holds the speed of the input, for Transmission; empty where one does.

    A drive whose own body is joined to the input by a coupling or a shaft holds the mean of its speed; that is enough for the
    metrics that this decides, because the drive's inertia is then not counted with the input's.
    """
    joined, before = {structure.input.body} if structure.input else set(), 0
    rows = [*(one.bodies for one in (*structure.meshes, *structure.shafts)), *_joins(structure)]
    while len(joined) > before:
        before = len(joined)
        joined |= {body for bodies in rows if joined & set(bodies) for body in bodies}
    sources = structure.of_role(parts.SOURCE)
    drives = [one for one in sources if one.wires.get("body") in joined] or sources
    if not drives or any(parts.part(one.part).holds for one in drives):
        return ""
    names = " and ".join(f"{one.called} ({one.part.replace('_', ' ')})" for one in drives)
    return f"{names} {'yields' if len(drives) == 1 else 'yield'} to the load"


def _joins(structure: Structure) -> list[tuple[str, ...]]:
    """Return the bodies that each coupling joins."""
    return [tuple(one.wires["joins"]) for one in structure.of_role(parts.COUPLING) if "joins" in one.wires]


def ranges_of(structure: Structure, record: Mapping) -> dict[str, tuple[float, float]]:
    """Return the lowest and the highest value [SI] that each transducer of a rig can show; none where they show true values.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    record : mapping
        Its values, as a bag holds them.
    """
    if not record["effects"]["transducers"]:
        return {}
    fitted = record["instruments"]
    return {
        one.name: measured_range(one.type, one.low, fitted[f"{one.like}_range"], fitted.get(f"{one.like}_class", 0.0))
        for one in structure.transducers
        if fitted.get(f"{one.like}_range") and fitted.get(f"{one.like}_fitted", True)
    }


def _clutch(device: Device, structure: Structure, record: Mapping, wiring: Mapping[str, int]) -> Clutch:
    """A clutch with what belongs to it; the name of a signal that is not measured is empty."""
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


def tied_to(structure: Structure, inertias: Mapping[str, float], body: str, shafts: Iterable[Shaft] = ()) -> tuple[float, float]:
    """Return the inertia of all that toothed wheels tie to a body, and some shafts as if they were rigid.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    inertias : mapping of str to float
        Inertia of each body [kg m2].
    body : str
        Name of the body.
    shafts : iterable of Shaft
        Shafts that join what lies beyond them too.

    Returns
    -------
    inertia : float
        The inertia on its axis [kg m2].
    axis : float
        Speed of that axis divided by the speed of the body.
    """
    speeds, todo = {body: 1.0}, [body]
    joins = [*((mesh.bodies, mesh.ratio) for mesh in structure.meshes), *((shaft.bodies, 1.0) for shaft in shafts)]
    while todo:
        here = todo.pop()
        for bodies, ratio_of in joins:
            for (a, b), ratio in ((bodies, ratio_of), (bodies[::-1], 1.0 / ratio_of)):
                if a == here and b not in speeds:
                    speeds[b] = speeds[here] * ratio
                    todo.append(b)
    heavy = [name for name in speeds if inertias[name] > 0.0]
    if len(heavy) == 1:
        return inertias[heavy[0]], abs(speeds[heavy[0]])
    return sum(inertias[name] * speeds[name] ** 2 for name in heavy), 1.0
