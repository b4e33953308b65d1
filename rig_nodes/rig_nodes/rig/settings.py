# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything of a rig that has a value: the name by which it is changed, its range, and whether it can change during a run.

It is the one table for `--set`, sweeps, tuner, calibration, sequences, ROS parameters and FMU variables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields
from functools import cached_property
from typing import Any

from ..base import SI, SWITCH, WORDS, RigError, number_text, shown_in, unknown_value, value_of
from ..plant import part as parts
from .alfa46 import OUTPUT_KEYS, POINTS, Alfa46Values
from .commands import Setpoint, setpoints_of
from .quantities import QUANTITIES
from .sections import CutConfig, EffectsConfig, KernelConfig, instruments_of, section_classes, with_written
from .structure import Structure
from .transducer_types import TRANSDUCER_TYPES

POINT, COLUMNS = "point", ("time", "current")  # of a profile
LATEST = 60.0  # s after its switch signal at which a point may stand
SOURCES, ON_OFF = ("plant", "topic"), ("on", "off")
OWN, MOST_OWN = "controller.", 1e15  # prefix of the settings that a user's controller has itself, and their largest number
CONTROLLER, INSTRUMENTS, WIRING = "alfa46", "instruments", "wiring"
CHANGED = "setting_changed"  # name of the event on a new value


@dataclass(frozen=True)
class Setting:
    """One value of a rig.

    Parameters
    ----------
    name : str
        ``owner.key``.
    text : str
        What the value is.
    dimension : str
        A dimension of base.units, or SWITCH, WORDS or POINT.
    low, high : float
        Range [SI], inclusive.
    choices : tuple of str
        The words that it takes.
    kept : bool
        True when it is in the configuration, so that it can be given before a run.
    live : bool
        True when it can change while the rig runs, as the parameter ``key`` of the node ``owner``.
    numbers : int
        How many numbers it has.
    setpoint : Setpoint or None
        The setpoint that it sets by its value or, for a switch, by turning the device on or off.
    state : str
        State of its device that has the value while the rig runs.
    lacking : str
        Switch of the rig that is off, so that the setpoint has no effect; empty when nothing is lacking.
    """

    name: str
    text: str
    dimension: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    kept: bool = True
    live: bool = False
    numbers: int = 1
    setpoint: Setpoint | None = field(default=None, compare=False)
    state: str = ""
    lacking: str = ""

    @property
    def owner(self) -> str:
        """What the value belongs to; for a value that can change while the rig runs, its node."""
        return self.name.partition(".")[0]

    @property
    def key(self) -> str:
        """Name of the value at its owner."""
        return self.name.partition(".")[2]

    @property
    def unit(self) -> str:
        """The SI unit as people write it; empty when there is none."""
        return SI.get(self.dimension, "").removeprefix("-")

    @property
    def is_number(self) -> bool:
        """True for one number with a dimension."""
        return self.dimension not in (SWITCH, WORDS, POINT) and self.numbers == 1

    @property
    def _words(self) -> tuple[str, ...]:
        return self.choices or (ON_OFF if self.dimension == SWITCH else ())

    def value_of(self, text: object, where: str) -> float | bool | str:
        """Return the value of what was written for it [SI].

        Parameters
        ----------
        text : object
            What was written, e.g. "1500 rpm".
        where : str
            Beginning of the error.

        Returns
        -------
        float, bool or str
            The value.

        Raises
        ------
        RigError
            When the setting does not take it.
        """
        return value_of(self.dimension, self.low, self.high, self._words, text, where)

    def written(self, value: Any) -> str:
        """Return a value [SI] as ``--set`` takes it."""
        if self.dimension == POINT:
            return f"{value[0]:.6g} s {value[1]:.6g} A"
        if not self.is_number:
            return ("on" if value else "off") if self.dimension == SWITCH else str(value)
        unit, factor = shown_in(self.dimension)
        return f"{value / factor:.6g} {unit}"

    def span(self) -> str:
        """Return the range with its unit, or the words."""
        if not self.is_number:
            return ", ".join(self._words)
        unit, factor = shown_in(self.dimension)
        return f"{self.low / factor:.6g} to {self.high / factor:.6g} {unit}"

    def sentence(self, value: bool | float | list[float]) -> str:
        """Return the text of an event on a new value [SI], e.g. ``motor.speed = 62.8 rad/s``."""
        if self.dimension == SWITCH:
            text = str(bool(value)).lower()
        else:
            numbers = value if isinstance(value, list) else [value]
            text = f"{' '.join(f'{number:.6g}' for number in numbers)} {self.unit}"
        return f"{self.name} = {text}".rstrip()

    def check(self, value: float) -> None:
        """Raise RigError for a number [SI] that is out of range or not finite."""
        if not (math.isfinite(value) and self.low <= value <= self.high):
            given, low, high = (number_text(one, 6, apart=" ") for one in (value, self.low, self.high))
            unit = f" {self.unit}".rstrip()
            raise RigError(f"{self.name} of {given}{unit} refused; expected {low} to {high}{unit}")

    def check_lives(self) -> None:
        """Raise RigError for a setting that cannot change while the rig runs."""
        if not self.live:
            raise RigError(f"{self.name} cannot be set while the rig runs; give --set {self.name}=... to the run")

    def check_kept(self) -> None:
        """Raise RigError for a setting that has no value before the rig runs."""
        if not self.kept:
            step = f" by a step '{self.setpoint.step}' of a sequence or" if self.setpoint else ""
            raise RigError(f"{self.name} is set while the rig runs,{step} by ./rig set; it has no value before")


class Settings(dict[str, Setting]):
    """All settings of a rig by their names."""

    def kept(self) -> list[Setting]:
        """Return the settings that have a value before the rig runs."""
        return [one for one in self.values() if one.kept]

    def find(self, name: str) -> Setting:
        """Return a setting by its name; RigError, with the names most like it, when there is none."""
        if name not in self:
            owners: dict[str, list[str]] = {}
            for one in self.values():
                if one.key:
                    owners.setdefault(one.owner, []).append(one.key)
            raise RigError(unknown_value(name, owners))
        return self[name]

    def at(self, node: str) -> list[Setting]:
        """Return the settings that a node takes while the rig runs."""
        return [one for one in self.values() if one.live and one.owner == node and not one.lacking]

    @cached_property
    def steps(self) -> dict[str, Setting]:
        """The setpoints by their key in sequences."""
        return {one.setpoint.step: one for one in self.values() if one.setpoint and one.dimension != SWITCH}


def own_setting(name: str) -> Setting:
    """Return a setting that a user's controller has named as its own: a number without unit or range."""
    return Setting(name, "Setting of the controller's own", "ratio", -MOST_OWN, MOST_OWN, kept=False, live=True)


def effects_of(structure: Structure) -> set[str]:
    """Return the effects that can be left out of a rig: those of its parts, and that of the transducers."""
    return {"transducers", *(name for device in structure.devices for name in parts.part(device.part).effects)}


def settings_of(structure: Structure, values: Mapping) -> Settings:
    """Return the settings of a rig.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    values : mapping
        Values of its sections by name, as dataclasses or as plain maps.

    Returns
    -------
    Settings
        The settings by name.
    """

    def chosen(owner: str, switch: str) -> bool:
        section = values[owner]
        return bool(section.get(switch, True) if isinstance(section, Mapping) else getattr(section, switch, True))

    def written(owner: str) -> tuple[str, ...]:
        section = values[owner]
        return tuple(section) if isinstance(section, Mapping) else tuple(one.name for one in fields(section))

    out, effects = Settings(), effects_of(structure)
    owners = {
        "kernel": KernelConfig,
        "cut": CutConfig,
        **{name: with_written(cls, written(name)) for name, cls in section_classes(structure).items()},
        **{device.name: configs[0] for device in structure.devices if (configs := parts.part(device.part).configs)},
        INSTRUMENTS: instruments_of(structure),
        "effects": EffectsConfig,
        **({CONTROLLER: Alfa46Values} if structure.shifts else {}),
    }
    every = [
        _of_field(f"{owner}.{one.name}", one)
        for owner, cls in owners.items()
        for one in fields(cls)
        if owner != "effects" or one.name in effects
    ]
    every += _of_devices(structure, chosen)
    for one in structure.transducers:
        if "noise" in TRANSDUCER_TYPES[one.type].errors() and chosen(INSTRUMENTS, f"{one.like}_fitted"):
            like = out_of(every, f"{INSTRUMENTS}.{one.like}_noise")
            every.append(
                Setting(
                    f"{INSTRUMENTS}.noise.{one.name}",
                    f"Noise of {one.name}, standard deviation",
                    like.dimension,
                    like.low,
                    like.high,
                    kept=False,
                    live=True,
                )
            )
    every.append(Setting(f"{INSTRUMENTS}.noise", "Whether the transducers have their noise", SWITCH, kept=False, live=True))
    if structure.shifts:
        every += _of_profiles()
        if len(structure.valves) == 2:
            every.append(
                Setting(
                    WIRING,
                    "Which output of the controller drives which valve, where not as the file has it",
                    WORDS,
                    choices=("swapped",),
                )
            )
    out.update((one.name, one) for one in every)
    return out


def out_of(settings: list[Setting], name: str) -> Setting:
    """Return the setting of a name from a list."""
    return next(one for one in settings if one.name == name)


def _of_field(name: str, one: Field) -> Setting:
    """A value of the configuration."""
    meta = one.metadata
    live = meta.get("live", False)
    return Setting(
        name,
        meta["text"],
        meta["dimension"],
        meta.get("low", -math.inf),
        meta.get("high", math.inf),
        meta.get("choices", ()),
        live=bool(live),
        state=live if isinstance(live, str) else "",
    )


def _of_devices(structure: Structure, chosen: Callable[[str, str], bool]) -> list[Setting]:
    """Setpoints with their switches, and the settings of where a device stands."""
    out = []
    for setpoint in setpoints_of(structure).values():
        command, like = setpoint.command, next(one for one in structure.transducers if one.name == setpoint.like)
        quantity = QUANTITIES[TRANSDUCER_TYPES[like.type].quantity]
        text = command.text[0].upper() + command.text[1:] + (", gauge" if quantity.gauge else "")
        lacking = f"{setpoint.device}.{command.only}" if command.only and not chosen(setpoint.device, command.only) else ""
        about = {"kept": False, "live": True, "setpoint": setpoint, "lacking": lacking}
        out += [
            Setting(
                f"{setpoint.node}.{command.parameter or command.value}",
                text,
                command.takes[command.value],
                like.low,
                like.high,
                **about,
            ),
            Setting(f"{setpoint.node}.enabled", "Whether the device is switched on", SWITCH, **about),
        ]
    from ..plant import cuttable  # here, because it imports compiled code that many readers do not need

    return out + [
        Setting(
            f"{device.name}.source", "Where the device stands: in the plant, or outside it behind a topic", WORDS, choices=SOURCES
        )
        for device in structure.devices
        if cuttable(device)
    ]


def _of_profiles() -> list[Setting]:
    """The points of the controller's profiles, and for changes during a run the times and currents of each profile."""
    out, most = [], Alfa46Values.__dataclass_fields__["current_limit"].metadata["high"]
    for output in OUTPUT_KEYS:
        for point in POINTS:
            name = f"{CONTROLLER}.{output}.{point}"
            out += [
                Setting(name, f"Time and current of {point} in the profile of {output}", POINT),
                Setting(f"{name}.time", f"Time of {point} in the profile of {output}", "time", 0.0, LATEST),
                Setting(f"{name}.current", f"Current of {point} in the profile of {output}", "current", 0.0, most),
            ]
    return out + [
        Setting(
            f"{CONTROLLER}.{output}.{column}",
            f"{column.capitalize()} of the points in the profile of {output}",
            dimension,
            kept=False,
            live=True,
            numbers=len(POINTS),
        )
        for output in OUTPUT_KEYS
        for column, dimension in (("times", "time"), ("currents", "current"))
    ]
