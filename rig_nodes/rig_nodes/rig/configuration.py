# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The configuration of a rig from its folder: its structure and every value, checked before anything starts.

Every command that needs a rig uses it. runs.rig takes the numbers; their record goes into the bag.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from ..base import (
    RIG_FILE,
    SAMPLE,
    Map,
    RigError,
    beside,
    brief,
    build,
    check_keys,
    entry,
    file_of,
    find_config,
    merged,
    quantity,
    stamped,
    unknown,
    where_of,
    with_bases,
)
from ..plant import NOT_DEVICES, cuttable, why_not
from ..plant import part as parts
from .alfa46 import OUTPUT_KEYS, POINTS, Alfa46Config, Alfa46Values, read_alfa46
from .cross_checks import cross_check
from .driveline import inertias_of
from .faults import FAULTS, orders_of
from .prescribed import Prescribed, read_prescribed
from .read import DEVICE_KEYS, KEYS, read_structure
from .read_elements import GROUPS
from .read_wheels import MESH_KEYS
from .sections import LOGGER_RATE, CutConfig, EffectsConfig, KernelConfig, instruments_of, section_classes, written
from .settings import COLUMNS, POINT, SOURCES, WIRING, Settings, effects_of, settings_of
from .signal_catalogue import Catalogue, catalogue_of
from .signals import unnamed
from .structure import RATE, Device, Structure
from .transducer_types import TRANSDUCER_TYPES
from .transmission import Transmission, made_of, tied_to
from .trip import Trip
from .trips import OWN_TRIPS, TRIP_SOURCES, TRIPS, WATCHED, OwnTrip, default_of, read_trips, trip_settings, trips_of
from .turning import check_driveline

_POINT_KEY = re.compile(rf"alfa46\.({'|'.join(OUTPUT_KEYS)})\.({'|'.join(POINTS)})(?:\.({'|'.join(COLUMNS)}))?")
_POINT = re.compile(r"\s*([-+\d.eE]+\s*[a-zA-Z]+)[\s,]+([-+\d.eE]+\s*[a-zA-Z]+)\s*")


@dataclass(frozen=True)
class RigConfig:
    """The configuration of a whole rig.

    Parameters
    ----------
    name : str
        Name of the rig.
    structure : Structure
        What the rig is made of.
    kernel : KernelConfig
        The plant's step.
    sections : mapping of str to object
        By name, the values of bodies, shafts and devices, of ``instruments`` and ``effects``; each is also an attribute.
    wiring : tuple of int
        Index of the controller's output that drives each valve.
    alfa46 : Alfa46Config or None
        The settings of the shift controller; None for a rig without gears.
    cut : CutConfig
        The tick of the cuts.
    cut_out : tuple of str
        Devices outside the plant, which are reached through topics (plant.engine.outside).
    prescribed : Prescribed or None
        Clutch pressures that are prescribed; None when valves make them.
    faults : tuple of str or None
        Orders of faults with which a run begins (rig.faults); None while faults are disabled.
    description : str
        One line of text about the rig.
    trip_values : mapping of str to float
        Limits [SI] and delays [s] of trips that differ from what follows from the devices, by "NAME.limit" and "NAME.delay".
    trips_watched : bool
        False when no trip is watched.
    trip_sources : mapping of str to str
        Source of these limits, by the name of the trip; none of one that was set for a run.
    own_trips : tuple of OwnTrip
        Trips that the rig's file describes.
    """

    name: str
    structure: Structure
    kernel: KernelConfig
    sections: Mapping[str, object]
    wiring: tuple[int, ...] = ()
    alfa46: Alfa46Config | None = None
    cut: CutConfig = CutConfig(SAMPLE)  # noqa: RUF009, it cannot be changed
    cut_out: tuple[str, ...] = ()
    prescribed: Prescribed | None = None
    faults: tuple[str, ...] | None = None
    description: str = ""
    trip_values: Mapping[str, float] = field(default_factory=dict)
    trips_watched: bool = True
    trip_sources: Mapping[str, str] = field(default_factory=dict, compare=False)
    own_trips: tuple[OwnTrip, ...] = ()

    def __getattr__(self, name: str) -> Any:
        sections = self.__dict__.get("sections", {})
        if name in sections:
            return sections[name]
        raise AttributeError(f"the rig has no part '{name}'")

    def replaced(self, **changes: Any) -> RigConfig:
        """Return the rig with other values of some sections or other fields, each given by its name."""
        own = {one.name for one in fields(self)}
        sections = {**self.sections, **{name: value for name, value in changes.items() if name not in own}}
        new = replace(self, sections=sections, **{name: value for name, value in changes.items() if name in own})
        if changes.keys() <= _OF_NO_DRIVE:  # what was computed of the drive stays: many rigs differ in the controller only
            new.__dict__.update({name: self.__dict__[name] for name in _OF_THE_DRIVE if name in self.__dict__})
        return new

    def values(self, name: str) -> Any:
        """Return the values under an owner's name in the settings.

        Parameters
        ----------
        name : str
            Name of a section, or "kernel", "cut" or "alfa46".

        Returns
        -------
        object or None
            The values; None when there are none of this name.
        """
        if name in ("kernel", "cut"):
            return getattr(self, name)
        if name == "alfa46":
            return self.alfa46.values if self.alfa46 else None
        return self.sections.get(name)

    @cached_property
    def cuttable(self) -> tuple[str, ...]:
        """The names of the devices that can stand outside the plant."""
        return tuple(device.name for device in self.structure.devices if cuttable(device))

    def felt_at(self, body: str) -> float:
        """Return the inertia that wheels tie to a body, including its own, on the body's axis [kg m2]."""
        inertia, axis = tied_to(self.structure, inertias_of(self.structure, self.sections), body)
        return inertia * axis**2

    @cached_property
    def transmission(self) -> Transmission:
        """The gears, clutches and shafts of the rig; ValueError for a rig without gears."""
        return made_of(self.as_dict())

    @cached_property
    def catalogue(self) -> Catalogue:
        """The topics and signals of the rig."""
        return catalogue_of(self.structure)

    @cached_property
    def settings(self) -> Settings:
        """All that can be changed, by name."""
        known = settings_of(self.structure, self.sections)
        known.update((one.name, one) for one in trip_settings(self))
        return known

    @cached_property
    def trips(self) -> tuple[Trip, ...]:
        """What is watched while the rig runs, whether it trips or not (``trips_watched``)."""
        return trips_of(self)

    def value(self, name: str) -> Any:
        """Return the present value of a setting [SI]; for a point of a profile its time [s] and its current [A]."""
        owner, _, key = name.partition(".")
        if found := _POINT_KEY.fullmatch(name):
            return self.alfa46.profiles[_place(*found.groups())]
        if owner == TRIPS:
            return default_of(self, key)
        if key == "source":
            return SOURCES[owner in self.cut_out]
        return getattr(self.values(owner), key)

    def with_values(self, changes: Mapping[str, object]) -> RigConfig:
        """Return the rig with other values of settings, which are not checked here.

        Parameters
        ----------
        changes : mapping of str to object
            New values [SI] by the names of the settings. A caller that has them from people checks each one first.

        Returns
        -------
        RigConfig
            The changed rig.
        """
        own: dict[str, dict] = {}
        profiles = self.alfa46.profiles.copy() if self.alfa46 else None
        for name, value in changes.items():
            owner, _, key = name.partition(".")
            if found := _POINT_KEY.fullmatch(name):
                profiles[_place(*found.groups())] = value
            else:
                own.setdefault(owner, {})[key] = value
        replaced: dict[str, Any] = {}
        if trips := own.pop(TRIPS, None):
            replaced["trips_watched"] = bool(trips.pop(WATCHED, self.trips_watched))
            replaced["trip_values"] = {**self.trip_values, **trips}
            replaced["trip_sources"] = {t: of for t, of in self.trip_sources.items() if not {f"{t}.limit", f"{t}.delay"} & {*trips}}
        replaced |= {owner: replace(self.values(owner), **those) for owner, those in own.items()}
        if self.alfa46:
            replaced["alfa46"] = Alfa46Config(replaced.get("alfa46", self.alfa46.values), profiles)
        return self.replaced(**replaced)

    def as_dict(self) -> dict:
        """Return plain SI values and the structure, for a run's record; without what is as usual."""
        out = {name: asdict(value) for name, value in (("kernel", self.kernel), *self.sections.items())}
        if out["instruments"]["logger_rate"] == LOGGER_RATE:
            del out["instruments"]["logger_rate"]
        if self.cut_out:
            out["cut"] = {**asdict(self.cut), "devices": list(self.cut_out)}
        if self.prescribed:
            out["prescribed"] = self.prescribed.as_dict()
        if self.trip_values or not self.trips_watched:
            out[TRIPS] = {**self.trip_values, **({} if self.trips_watched else {WATCHED: False})}
        out |= {TRIP_SOURCES: dict(self.trip_sources)} if self.trip_sources else {}
        if self.own_trips:
            out[OWN_TRIPS] = [asdict(one) for one in self.own_trips]
        if self.faults is not None:
            out[FAULTS] = list(self.faults)
        if self.alfa46:
            out |= {"wiring": list(self.wiring), "alfa46": self.alfa46.as_dict()}
        return {"name": self.name, "structure": self.structure.plain(), **out}


# Fields that do not concern the drive, and the cached properties that do not depend on these fields.
_OF_NO_DRIVE, _OF_THE_DRIVE = {"alfa46", "kernel"}, ("transmission", "catalogue", "settings", "cuttable")


def _place(output: str, point: str, column: str | None) -> tuple:
    """The indices of a profile's point, or of its time or current alone, among the profiles."""
    place = OUTPUT_KEYS.index(output), POINTS.index(point)
    return place if column is None else (*place, COLUMNS.index(column))


def _check_tick(cut: CutConfig, where: str) -> None:
    samples = cut.tick / SAMPLE
    if abs(samples - round(samples)) > 1e-9:
        raise RigError(
            f"{where}: a tick of {cut.tick * 1e3:g} ms is no whole number of samples of {SAMPLE * 1e3:g} ms; give e.g. 1 ms or 5 ms"
        )


def _with_source(structure: Structure, cut_out: tuple[str, ...], device: str, source: object, where: str) -> tuple[str, ...]:
    """Return cut_out with the source of one device set to "plant" or "topic"."""
    if source not in SOURCES:
        raise RigError(f"{where}: source is {brief(source)}, expected {' or '.join(SOURCES)}")
    if source == "topic" and (why := why_not(structure, device)):
        raise RigError(f"{where}: {why}")
    wanted = {*cut_out, device} if source == "topic" else {*cut_out} - {device}
    return tuple(one.name for one in structure.devices if one.name in wanted)


_TOP = (
    "description",
    "base",
    "controller",
    "controller_values",
    "step",
    "instruments",
    "effects",
    "cut",
    "prescribed",
    TRIPS,
    *KEYS,
)


def _read(node: Map, path: str | Path, name: str) -> RigConfig:
    """Read a rig from its merged file."""
    check_keys(path, node, _TOP, ("description", "step", "bodies", "parts", "transducers", "instruments"), "the rig")
    if not isinstance(text := node["description"], str) or not text.isprintable():
        raise RigError(f"{where_of(path, node, 'description')}: description is {brief(text)}, expected a line of text")
    kernel = build(KernelConfig, node, path, "the rig", others=_TOP)
    structure = read_structure(node, path)
    sections, cut_out = {}, ()
    own = {one: (group, node[group][one], where_of(path, node[group], one)) for group in GROUPS for one in node.get(group) or ()}
    own |= {mesh["name"]: ("meshes", mesh, where_of(path, mesh)) for mesh in node.get("meshes") or () if "name" in mesh}
    for owner, cls in section_classes(structure).items():
        group, entries, where = own[owner]
        sections[owner] = written(build(cls, entries, path, owner, GROUPS.get(group, MESH_KEYS), where))
    for device in structure.devices:
        sections[device.name], cut_out = _device(node["parts"], path, structure, device, cut_out)
    _check_errors_given(structure, node, path)
    sections["instruments"] = build(
        instruments_of(structure), node["instruments"], path, "instruments", where=where_of(path, node, "instruments")
    )
    _check_full_scales(structure, sections["instruments"], node, path)
    effects = node.get("effects", Map(node.line))
    check_keys(path, effects, effects_of(structure), (), "effects", where_of(path, node, "effects"))
    sections["effects"] = build(EffectsConfig, effects, path, "effects")
    cut = CutConfig(SAMPLE)
    if "cut" in node:
        cut = build(CutConfig, node["cut"], path, "cut", where=where_of(path, node, "cut"))
        _check_tick(cut, f"{where_of(path, node['cut'], 'tick')}: cut.tick")
    check_driveline(structure, sections, node, path)
    prescribed = None
    if "prescribed" in node:
        prescribed = read_prescribed(node["prescribed"], path, structure)
    config = RigConfig(
        name,
        structure,
        kernel,
        sections,
        tuple(valve.wires["output"] - 1 for valve in structure.valves),
        _controller(node, path, structure),
        cut,
        cut_out,
        prescribed,
        description=node["description"],
    )
    try:
        config.catalogue  # noqa: B018, made now, where a wrong signal has a line
    except RigError as error:
        device = re.match(r"parts\.(\w+)", str(error))
        raise RigError(f"{where_of(path, node['parts'], device[1]) if device else path}: {error}") from None
    if structure.names:
        lacking, known = unnamed(structure)
        for name in lacking:
            raise RigError(f"{where_of(path, node['names'], name)}: names.{name}: {unknown('signal', name, known)}")
    _check_view(config, node, path)
    if node.get(TRIPS) is None:
        return config
    return read_trips(node, path, config)


def _check_errors_given(structure: Structure, node: Map, path: str | Path) -> None:
    """Refuse a transducer whose required errors are not among the instruments, where the transducer stands."""
    given = node["instruments"]
    if not isinstance(given, Map):
        return  # which the reader of the instruments refuses
    for one in structure.transducers:
        required = [what for what, error in TRANSDUCER_TYPES[one.type].errors().items() if error.default is MISSING]
        lacking = [what for what in required if f"{one.like}_{what}" not in given]
        if not lacking:
            continue
        others = [other.like for other in structure.transducers if other.type == one.type]
        known = [like for like in dict.fromkeys(others) if all(f"{like}_{what}" in given for what in required)]
        raise RigError(
            f"{where_of(path, node['transducers'], one.name)}: transducers.{one.name}: instruments has no {one.like}_{lacking[0]} "
            f"for it; write it there with its value and source"
            f"{f', or share the errors of others by like: {known[0]}' if known else ''}"
        )


def _check_full_scales(structure: Structure, instruments: Any, node: Map, path: str | Path) -> None:
    """Refuse a transducer whose range is more than its instrument can show; one that is not fitted shows nothing anyway."""
    for one in structure.transducers:
        key = f"{one.like}_range"
        full = getattr(instruments, key)
        if max(one.high, -one.low) <= full or not getattr(instruments, f"{one.like}_fitted", True):
            continue
        entry_of, errors = node["transducers"][one.name], node["instruments"]
        end = entry_of["range"][1 if one.high > full else 0]
        places = [
            (f"transducers.{one.name}.range goes to {end}", entry_of, "range"),
            (f"instruments.{key} ends at {errors[key][0]}", errors, key),
        ]
        places.sort(key=lambda place: file_of(path, *place[1:]) != path)  # a variant's own line comes before that of its base
        (first, *at_first), (second, *at_second) = places
        raise RigError(
            f"{where_of(path, *at_first)}: {first}, and {second} ({where_of(path, *at_second)}); expected a range within what its "
            "instrument can show"
        )


def _check_view(config: RigConfig, node: Map, path: str | Path) -> None:
    """Raise RigError with file and line for a plot of unknown signals, or of signals that cannot share a plot."""
    known = config.catalogue.signals
    for page, plots in config.structure.view.items():
        for plot in plots:
            title, names = plot.title, plot.signals
            where = f"{where_of(path, node['view'][page], title)}: view.{page}.{title}"
            turn = [plot.over] if plot.over not in ("", RATE) else []
            for name in (*names, *turn):
                if name not in known:
                    raise RigError(f"{where}: {unknown('signal', name, known)}")
                if known[name].states:
                    raise RigError(
                        f"{where}: {name} is a state, which the view shows in lanes of its own; name signals with a unit"
                    )
            if len(units := {known[name].display_unit: name for name in names}) > 1:
                found = " and ".join(f"{name} in {unit}" for unit, name in units.items())
                raise RigError(f"{where}: a plot's signals share their unit, found {found}")
            if turn and known[plot.over].unit != "rad/s":
                raise RigError(f"{where}: turn must be a speed of rotation, found {plot.over} in {known[plot.over].display_unit}")


def _device(
    nodes: Map, path: str | Path, structure: Structure, device: Device, cut_out: tuple[str, ...]
) -> tuple[object, tuple[str, ...]]:
    """Return the values of a device, and ``cut_out`` with this device included when its source is a topic."""
    node, part = nodes[device.name], parts.part(device.part)
    others = (*DEVICE_KEYS, *part.joined)
    cls = part.configs[0] if part.configs else NoValues
    values = build(cls, node, path, device.name, others, where_of(path, nodes, device.name))
    if "source" in node and "source" not in part.joined:
        where = f"{where_of(path, node, 'source')}: {device.name}"
        cut_out = _with_source(structure, cut_out, device.name, node["source"], where)
    return values, cut_out


@dataclass(frozen=True)
class NoValues:
    """The values of a part that has none."""


def _controller(node: Map, path: str | Path, structure: Structure) -> Alfa46Config | None:
    """Read the settings that ``controller`` names, installed ones or a file beside the rig's, and apply the rig's own changes."""
    if not structure.shifts:
        if "controller" in node:
            raise RigError(f"{where_of(path, node, 'controller')}: controller: the rig has no gears and valves for one")
        return None
    if "controller" not in node:
        raise RigError(f"{where_of(path, node)}: the rig has gears and lacks the key 'controller', e.g. controller: alfa46")
    try:
        settings = read_alfa46(find_config("controllers", beside(file_of(path, node, "controller"), node["controller"])))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'controller')}: controller: {error}") from None
    if "controller_values" in node:
        own, known = node["controller_values"], Alfa46Values.__dataclass_fields__
        check_keys(path, own, known, (), "controller_values", where_of(path, node, "controller_values"))
        changes = {name: entry(known[name], own[name], f"{where_of(path, own, name)}: controller_values.{name}") for name in own}
        settings = Alfa46Config(replace(settings.values, **changes), settings.profiles)
    return settings


def _where_written(node: Map, path: str | Path, keys: tuple[str, ...]) -> str:
    """``file:line`` of the first of these keys that is written in the rig's own map."""
    for part, _, name in (key.partition(".") for key in keys):
        for own in (
            node.get("controller_values") if part == "alfa46" else node.get(part),
            *((node[group] or {}).get(part) for group in ("parts", *GROUPS) if isinstance(node.get(group), Map)),
        ):
            if isinstance(own, dict) and name in own:
                return f"{where_of(path, own, name)}: "
    return f"{path}: "


def load_rig(name: str | Path, overrides: dict[str, str] | None = None) -> RigConfig:
    """Read a rig by its name, folder or file, with its bases.

    Parameters
    ----------
    name : str or Path
        Name of an installed rig, a rig's folder, or its file.
    overrides : dict of str to str, optional
        Settings with other values, e.g. {"alfa46.t12": "200 ms", "wiring": "swapped", "alfa46.output_1.P1": "200 ms 160 mA"}.

    Returns
    -------
    RigConfig
        The checked configuration.

    Raises
    ------
    RigError
        With file and line, or the name of the setting, when something is not right.
    """
    node, path, bases = None, None, with_bases(name)
    for path, own in reversed(bases):
        check_keys(path, own, _TOP, ("description",), "the rig")
        own = stamped(own, path)
        node = own if node is None else merged(node, own)
    try:
        config = _read(node, path, rig_name(path))
    except RigError as error:
        if not any(str(error).startswith(f"{base}:") for base, _ in bases[1:]):
            raise
        raise RigError(
            f"{error}; this line is of the base: in {path}, leave it out with 'NAME: ~' or give it another value"
        ) from None
    cross_check(config, partial(_where_written, node, path))
    return with_overrides(config, overrides or {})


def rig_name(path: str | Path) -> str:
    """Return the name of the rig in a file: the name of its folder, or the file's own name."""
    path = Path(path)
    return path.absolute().parent.name if path.name == RIG_FILE else path.stem


def load_gearbox_rig(name: str | Path, overrides: dict[str, str] | None, what: str) -> RigConfig:
    """Read a rig as :func:`load_rig` does, and refuse one that has no shift controller.

    Parameters
    ----------
    name : str or Path
        Name of an installed rig, a rig's folder, or its file.
    overrides : dict of str to str or None
        Settings with other values.
    what : str
        What needs the gearbox, as the subject of the error.

    Returns
    -------
    RigConfig
        The checked configuration.

    Raises
    ------
    RigError
        When the rig has no gears and no shift controller.
    """
    config = load_rig(name, overrides)
    check_gearbox(config, what)
    return config


def check_gearbox(config: RigConfig, what: str) -> None:
    """Raise RigError for a rig without gears and shift controller; ``what`` needs them, as the subject of the error."""
    if not config.structure.shifts:
        raise RigError(f"{what} is for a rig with gears and a shift controller; '{config.name}' has none")


def with_overrides(config: RigConfig, overrides: dict[str, str], together: bool = True) -> RigConfig:
    """Return the rig with some values changed.

    Parameters
    ----------
    config : RigConfig
        The rig to change.
    overrides : dict of str to str
        Settings with their new values, as :func:`load_rig` takes them.
    together : bool
        True when these are all the changes, so that the values must also fit each other.

    Returns
    -------
    RigConfig
        The changed rig.

    Raises
    ------
    RigError
        When a value does not fit.
    """
    known, structure, changes = config.settings, config.structure, {}
    for key, text in overrides.items():
        where, (part, _, name) = f"setting {key}={text if len(text) < 200 else brief(text)}", key.partition(".")
        if key == WIRING:
            if text != "swapped" or len(config.wiring) != 2:
                raise RigError(f"{where}: the only other wiring is 'swapped', of a rig with two valves")
            config = replace(config, wiring=config.wiring[::-1])
        elif key == FAULTS:
            continue  # they are checked against what the rig has become
        elif name == "source" and part in {device.name for device in structure.devices} | set(NOT_DEVICES):
            config = replace(config, cut_out=_with_source(structure, config.cut_out, part, text, where))
        else:
            changes |= _override(known, key, text, where)
            if part == "cut":
                _check_tick(config.with_values(changes).cut, where)
    for key in changes:
        if (point := key.rpartition(".")[0]) in changes:
            raise RigError(f"{point} is set as a whole and in part; give one of them")
    config = config.with_values(changes)
    if (text := overrides.get(FAULTS)) is not None:
        config = replace(config, faults=orders_of(config, text, f"setting {FAULTS}"))
    if overrides and together:
        cross_check(
            config,
            lambda keys: next(
                (f"setting {k}={text}: " for k, text in overrides.items() if k in keys or k.rpartition(".")[0] in keys), ""
            ),
        )
    return config


def _override(known: Settings, key: str, text: str, where: str) -> dict[str, object]:
    """Read one setting by its name, and its value [SI] from a text."""
    try:
        setting = known.find(key)
        setting.check_kept()
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
    if setting.dimension != POINT:
        return {key: setting.value_of(text, f"{where}: the value")}
    found = _POINT.fullmatch(text) if len(text) < 80 else None
    if found is None:
        raise RigError(f'{where}: expected time and current, e.g. "200 ms 160 mA"')
    return {key: (quantity(found[1], "time", where), quantity(found[2], "current", where))}
