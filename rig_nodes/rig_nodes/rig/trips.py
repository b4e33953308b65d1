# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips of a rig: what is watched while it runs, and from which value on the rig goes into its safe state.

rig.configuration makes them from what a rig says of its devices; plant.engine.watch evaluates them after every controller sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

from ..base import SWITCH, Map, RigError, brief, check_keys, unknown, where_of
from ..plant import ERRATIC, OPEN, SHORT, STUCK
from ..plant import part as parts
from .bench_trips import RULES
from .driveline import bodies_shown
from .settings import Setting
from .structure import Device, Transducer
from .transducer_types import TRANSDUCER_TYPES, measured_range
from .trip import FIRST_SPN, GEAR, MEASURED, SHIFTING, TOO_HIGH, TOO_LOW, Condition, Sum, Trip
from .trips_of_transducers import engaged, fitted, reading, trips_of_transducers

if TYPE_CHECKING:
    from pathlib import Path

    from .configuration import RigConfig

TRIPS, WATCHED = "trips", "watched"  # owner of the settings of trips, and that which turns all of them off
OWN_TRIPS, TRIP_SOURCES = "own_trips", "trip_sources"  # keys of a record: the trips that a rig's file describes, sources of others
OWN_SPN = FIRST_SPN + 1024  # of the first trip that a file describes: whatever devices a rig has, it keeps its number
MOST_DELAY = 60.0  # s
MOST_TIMES = 1e3  # by which a limit can be more than the one that follows from the rig


@dataclass(frozen=True)
class OwnTrip:
    """A trip that a rig's file describes: what a transducer shows above a limit [SI], or below it, for a delay [s]."""

    name: str
    signal: str
    above: bool
    limit: float
    delay: float
    source: str


def trips_of(config: RigConfig) -> tuple[Trip, ...]:
    """Return the trips of a rig with its own limits.

    Parameters
    ----------
    config : RigConfig
        The rig; its ``trip_values`` and ``trip_sources`` replace what follows from its devices.

    Returns
    -------
    tuple of Trip
        The trips in their order, numbered from FIRST_SPN, and from OWN_SPN on those that the rig's file describes.
    """
    out = []
    for trip in _there(config):
        own = {
            key: config.trip_values[f"{trip.name}.{key}"]
            for key in ("limit", "delay")
            if f"{trip.name}.{key}" in config.trip_values
        }
        source = config.trip_sources.get(trip.name, "set for this run") if own else trip.source
        out.append(replace(trip, **own, source=source))
    return tuple(out)


def trip_settings(config: RigConfig) -> list[Setting]:
    """Return the settings of a rig's trips: limit and delay of each, and whether they are watched at all."""
    out = [Setting(f"{TRIPS}.{WATCHED}", "Whether the trips are watched; off: the rig goes on until it breaks", SWITCH)]
    known = {one.name: one for one in fitted(config)}
    own = {one.name: _span(config, known[one.signal]) for one in config.own_trips if one.signal in known}
    for trip in _there(config):
        name = f"{TRIPS}.{trip.name}"
        low, high = own.get(trip.name, (0.0, MOST_TIMES * trip.limit))
        out += [
            Setting(f"{name}.limit", f"Limit of the {trip.quantity.text}", trip.dimension, low, high),
            Setting(f"{name}.delay", f"Time for which {trip.name} must be past its limit", "time", 0.0, MOST_DELAY),
        ]
    return out


def read_trips(rig: Map, path: str | Path, config: RigConfig) -> RigConfig:
    """Return a rig with the trips that its file describes, and the limits and delays that it gives the others.

    Parameters
    ----------
    rig : Map
        The rig's description, with ``trips``: by name a map with ``limit`` or ``delay``, each [value with unit, "its source"]; for
        a trip of its own with ``signal``, a transducer, ``above`` or ``below``, and ``delay`` where it has one.
    path : str or Path
        The file.
    config : RigConfig
        The rig without them.

    Returns
    -------
    RigConfig
        The rig with them.

    Raises
    ------
    RigError
        With file and line, when something is not right.
    """
    known, values, sources, node = {trip.name: trip for trip in config.trips}, {}, {}, rig[TRIPS]
    here = where_of(path, rig, TRIPS)
    own = [
        name
        for name in (node if isinstance(node, Map) else ())
        if name not in known and isinstance(node[name], Mapping) and "signal" in node[name]
    ]
    check_keys(path, node, (*known, *own), (), TRIPS, here)
    for name in (name for name in node if name in known):
        check_keys(path, node[name], ("limit", "delay"), (), f"{TRIPS}.{name}", where_of(path, node, name))
        for key, entry in node[name].items():
            where, setting = f"{where_of(path, node[name], key)}: {TRIPS}.{name}.{key}", config.settings[f"{TRIPS}.{name}.{key}"]
            values[f"{name}.{key}"], sources[name] = _sourced(entry, setting, where)
    trips = tuple(_own_trip(node, path, name, config) for name in own)
    return config.replaced(trip_values=values, trip_sources=sources, own_trips=trips)


def _sourced(entry: object, setting: Setting, where: str) -> tuple[float, str]:
    """Return value [SI] and source of an entry."""
    if not (isinstance(entry, list) and len(entry) == 2 and isinstance(entry[1], str) and entry[1].strip()):
        raise RigError(f'{where} must be [value with unit, "its source"], found {brief(entry)}')
    return float(setting.value_of(entry[0], where)), entry[1]


def _span(config: RigConfig, one: Transducer) -> tuple[float, float]:
    """Return what a transducer can show [SI]: a trip of its own beyond that could never fire."""
    errors, full = config.instruments, f"{one.like}_range"
    low, high = measured_range(one.type, one.low, getattr(errors, full), getattr(errors, f"{one.like}_class", 0.0))
    return low + 0.0, high  # people read no -0


def _own_trip(node: Map, path: str | Path, name: str, config: RigConfig) -> OwnTrip:
    """Return a trip that a rig's file describes."""
    one, line, what = node[name], where_of(path, node, name), f"{TRIPS}.{name}"
    if name in RULES:
        raise RigError(f"{line}: {what}: that is the name of a rule of the bench (rig list trips); name it otherwise")
    if name == WATCHED:
        raise RigError(f"{line}: {what}: that is the name of the switch that turns all trips off; name it otherwise")
    if not str(name).isidentifier():
        raise RigError(f"{line}: {what}: the name of a trip has letters, digits and _ only, found {brief(name)}")
    check_keys(path, one, ("signal", "above", "below", "delay"), ("signal",), what, line)
    known = {each.name: each for each in fitted(config)}
    if str(one["signal"]) not in known:
        raise RigError(f"{where_of(path, one, 'signal')}: {what}: {unknown('transducer', one['signal'], known)}")
    side = "above" if "above" in one else "below"
    if ("above" in one) == ("below" in one):
        raise RigError(f"{line}: {what} needs one of above and below, with its limit")
    signal = known[one["signal"]]
    limits = Setting("limit", "", TRANSDUCER_TYPES[signal.type].dimension, *_span(config, signal))
    limit, source = _sourced(one[side], limits, f"{where_of(path, one, side)}: {what}.{side}")
    delay = 0.0
    if "delay" in one:
        delay, _ = _sourced(
            one["delay"], Setting("delay", "", "time", 0.0, MOST_DELAY), f"{where_of(path, one, 'delay')}: {what}.delay"
        )
    return OwnTrip(name, signal.name, side == "above", limit, delay, source)


def default_of(config: RigConfig, key: str) -> float | bool:
    """Return the present value of the setting of a trip [SI], by its name without the owner, e.g. "overspeed_w0.limit"."""
    if key == WATCHED:
        return config.trips_watched
    name, _, what = key.rpartition(".")
    for trip in config.trips:
        if trip.name == name:
            return getattr(trip, what)
    raise RigError(unknown("trip", name, [trip.name for trip in config.trips]))


# ---- what follows from the devices


def _there(config: RigConfig) -> Iterator[Trip]:
    """The trips whose quantity is there, numbered by all that the devices have: what is switched off moves no number."""
    numbers: dict[str, int] = {}
    for trip in _derived(config):
        number = numbers.setdefault(trip.name, FIRST_SPN + len(numbers))
        if trip.there:
            yield replace(trip, spn=number)
    fit = {one.name for one in fitted(config)}
    shown = {one.name: one for one in config.structure.transducers}
    for number, own in enumerate(config.own_trips, OWN_SPN):
        if own.signal in fit:
            one, way = shown[own.signal], TOO_HIGH if own.above else TOO_LOW
            dimension = TRANSDUCER_TYPES[one.type].dimension
            yield Trip(own.name, reading(one), dimension, own.limit, own.source, way, own.delay, own.above, spn=number)


def _derived(config: RigConfig) -> Iterator[Trip]:
    structure = config.structure
    yield from _speeds(config)
    yield from _torques(config)
    for oil in structure.of_role(parts.OIL):
        yield from _oil(config, oil)
    for valve in structure.valves:
        yield from _valve(config, valve)
    packs = [clutch for clutch in structure.clutches if "plates" in clutch.wires]
    for clutch in packs:
        yield from _plates(config, clutch)
    if structure.shifts and structure.input:
        yield from _gears(config, {clutch.name: clutch for clutch in packs})
    yield from trips_of_transducers(config)
    if structure.shifts and structure.input:
        shifts = Sum("part of a shift that the controller still reports", ((SHIFTING, 1.0),))
        source = "assumed: several times the longest shift; no trip of a gear is watched while one lasts"
        yield Trip("shift_too_long", shifts, "ratio", 0.5, source, STUCK, 10.0, True, (_turning(config),))


def _speeds(config: RigConfig) -> Iterator[Trip]:
    """A speed too high of each body that has a speed of its own in the plant."""
    structure = config.structure
    measured = {one.shows.removesuffix(".speed"): one for one in structure.transducers if one.type == "speed"}
    fastest = max((one.high for one in measured.values()), default=0.0)
    limiters = [getattr(getattr(config, one.name), "cut_speed", 0.0) for one in structure.of_role(parts.SOURCE)]
    limiter = max(limiters, default=0.0)
    for body in bodies_shown(structure) if measured else ():
        high = measured[body].high if body in measured else fastest
        whose = f"the range of {measured[body].name}" if body in measured else "the largest range of a speed"
        quantity_ = Sum(f"speed of {body}", ((f"{body}.speed", 1.0),), True)
        source = f"assumed: four fifths of {whose}, so that it is still measured when it trips"
        if limiter:
            source = "assumed: 15 % above the cut_speed of the engine"
        limit = 1.15 * limiter or 0.8 * high
        yield Trip(f"overspeed_{body}", quantity_, "angular velocity", limit, source, TOO_HIGH, 0.01)


def _torques(config: RigConfig) -> Iterator[Trip]:
    """A torque too high of each drive with a limit of its own, and of each meter and shaft whose torque is measured."""
    for device in config.structure.of_role(parts.SOURCE):
        limit = getattr(getattr(config, device.name), "torque_limit", None)
        if limit is not None:
            watched = Sum(f"torque of {device.called}", ((f"{device.name}.torque", 1.0),), True)
            source = "assumed: a tenth above its torque_limit, which its converter keeps to"
            yield Trip(f"overtorque_{device.name}", watched, "torque", 1.1 * limit, source, TOO_HIGH, 0.02)
    for one in config.structure.transducers:
        if one.type == "torque":
            full = getattr(config.instruments, f"{one.like}_range")
            source = f"assumed: {one.name} bears a fifth more than its full scale"
            watched = Sum(f"torque at {one.name}", ((one.shows, 1.0),), True)
            yield Trip(f"overtorque_{one.name}", watched, "torque", 1.2 * full, source, TOO_HIGH, 0.02)


def _turning(config: RigConfig) -> Condition:
    """The input turns: a rig that stands does not suffer."""
    turns = Sum("speed", ((f"{config.structure.input.body}.speed", 1.0),), True)
    return Condition(turns, True, 5.0, "the input turns")


def _oil(config: RigConfig, oil: Device) -> Iterator[Trip]:
    """Oil that is too hot, and a supply that is lost while it feeds the clutches of a gear."""
    hot = Sum(f"temperature of the oil of {oil.called}", ((f"{oil.name}.oil_temperature", 1.0),))
    yield Trip(f"hot_{oil.name}", hot, "temperature", 110.0, "assumed: mineral oil ages quickly above it", TOO_HIGH, 0.1)
    fed = [valve for valve in config.structure.valves if config.structure.oil_of(valve, "supply") == oil.name]
    if not fed or not config.structure.shifts or config.structure.input is None or config.prescribed:
        return
    most = max(getattr(config, valve.name).pressure_limit for valve in fed)
    watched = Sum(f"pressure of {oil.called}", ((f"{config.structure.line_of(oil.name)}.pressure", 1.0),))
    in_gear = Condition(Sum("gear", ((GEAR, 1.0),)), True, 0.5, "a gear is ordered")
    source = "assumed: a fifth of the highest pressure of its valves"
    yield Trip(f"lost_{oil.name}", watched, "pressure", 0.2 * most, source, TOO_LOW, 0.5, False, (in_gear, _turning(config)))


def _valve(config: RigConfig, valve: Device) -> Iterator[Trip]:
    """A clutch's pressure that is too high, and a coil whose current does not follow its voltage."""
    values, clutch = getattr(config, valve.name), valve.wires["feeds"]
    watched = Sum(f"pressure of {config.structure.device(clutch).called}", ((f"{config.structure.line_of(clutch)}.pressure", 1.0),))
    source = f"assumed: a quarter above the highest pressure of {valve.called}, for longer than a spool in oil of 0 degC overshoots"
    yield Trip(f"overpressure_{clutch}", watched, "pressure", 1.25 * values.pressure_limit, source, TOO_HIGH, 0.2)
    there = valve.name not in config.cut_out and config.effects.current_loop
    current = next(one.name for one in config.structure.transducers if one.shows == f"{valve.name}.current")
    # at rest the current of a coil is the mean voltage over its resistance
    expected, shown = (f"{valve.name}.duty", values.coil_voltage / values.coil_resistance), (f"{MEASURED}{current}", 1.0)
    for what, fmi, sign, text in (
        ("open", OPEN, 1.0, "less than its voltage drives"),
        ("short", SHORT, -1.0, "more than its voltage drives"),
    ):
        watched = Sum(
            f"current of {valve.called} {text}",
            tuple((name, way * weight) for name, weight, way in ((*expected, sign), (*shown, -sign))),
        )
        source = "assumed: a quarter of the range of such coils; a hot coil has a third less current"
        limit = 0.25 * values.coil_voltage / values.coil_resistance
        yield Trip(f"coil_{what}_{valve.name}", watched, "current", limit, source, fmi, 0.2, there=there)


HOT, NEW = 200.0, 40.0  # degC, assumed: mean temperature that wet linings bear, and that of plates before a shift
PRESSED, CLAMPED = 4e6, 0.2e6  # Pa, assumed: what sintered wet linings bear, and from which on plates count as clamped


def _pressure(config: RigConfig, clutch: Device) -> Sum:
    """The pressure between the plates of a pack: its clamp force over the area of one surface."""
    pack = getattr(config, clutch.wires["plates"])
    area = math.pi * (pack.outer_radius**2 - pack.inner_radius**2)
    return Sum(f"surface pressure of {clutch.called}", ((f"{clutch.name}.clamp", 1.0 / area),))


def _slip(clutch: Device) -> Sum:
    return Sum(f"slip of {clutch.called}", ((f"{clutch.name}.slip", 1.0),), True)


def _plates(config: RigConfig, clutch: Device) -> Iterator[Trip]:
    """Plates that are pressed too much, too hot, or heated too much by one slip."""
    pressure, pack = _pressure(config, clutch), getattr(config, clutch.wires["plates"])
    source = "assumed: what wet linings bear"
    yield Trip(f"surface_pressure_{clutch.name}", pressure, "pressure", PRESSED, source, TOO_HIGH, 0.2)
    hot = Sum(f"temperature of the plates of {clutch.called}", ((f"{clutch.name}.temperature", 1.0),))
    yield Trip(f"hot_plates_{clutch.name}", hot, "temperature", HOT, f"{source}, as a mean of the pack", TOO_HIGH, 0.05)
    heat = Sum(f"heat of one slip of {clutch.called}", ((f"{clutch.name}.heat", 1.0),))
    slips = Condition(_slip(clutch), True, 1.0, f"{clutch.called} slips")
    presses = Condition(Sum("torque", ((f"{clutch.name}.static", 1.0),)), True, 1.0, "its plates touch")
    limit, source = pack.heat_capacity * (HOT - NEW), f"heat_capacity by {HOT - NEW:g} K: what heats them to {HOT:g} degC"
    yield Trip(f"slip_energy_{clutch.name}", heat, "energy", limit, source, TOO_HIGH, 0.0, True, (presses, slips), True)


def _gears(config: RigConfig, packs: Mapping[str, Device]) -> Iterator[Trip]:
    """Clutches of two gears clamped at a time, a clutch that slips or is open in its gear, and speeds against a gear's ratio."""
    structure = config.structure
    into, out = structure.input, structure.output
    together = {frozenset(pair) for gear in structure.gears for pair in combinations(gear.clutches, 2)}
    turns = _turning(config)
    for a, b in combinations([name for name in packs if any(name in gear.clutches for gear in structure.gears)], 2):
        if frozenset((a, b)) in together:
            continue
        clamped = Condition(_pressure(config, packs[a]), True, CLAMPED, f"{packs[a].called} is clamped")
        watched = Sum(f"surface pressure of {packs[b].called} beside {packs[a].called}", _pressure(config, packs[b]).terms)
        source = "assumed: a twentieth of what linings bear, and longer than any overlap of a shift"
        yield Trip(f"tie_up_{a}_{b}", watched, "pressure", CLAMPED, source, STUCK, 1.0, True, (clamped, turns))
    for number, gear in enumerate(structure.gears, 1):
        held = tuple(packs[name] for name in gear.clutches if name in packs)
        is_in = engaged(number, gear.name)
        for clutch in held:
            name, source = f"{gear.name}_{clutch.name}", "assumed: a tenth of a usual speed, for longer than a shift"
            yield Trip(f"slip_in_gear_{name}", _slip(clutch), "angular velocity", 10.0, source, STUCK, 1.0, True, is_in)
            source = "assumed: half of that from which on plates count as clamped"
            yield Trip(
                f"not_reached_{name}",
                _pressure(config, clutch),
                "pressure",
                0.5 * CLAMPED,
                source,
                STUCK,
                1.0,
                False,
                (*is_in, turns),
            )
        ratio = config.transmission.ratios.get(number)
        if ratio is None or len(held) < len(gear.held):
            continue
        speeds = Sum(
            f"difference of {into.speed} and {out.speed} by the ratio of gear {gear.name}",
            ((f"{MEASURED}{into.speed}", 1.0), (f"{MEASURED}{out.speed}", -ratio)),
            True,
        )
        holds = tuple(Condition(_slip(one), False, 1.0, f"{one.called} holds") for one in held)
        source = "assumed: ten times the resolution of such encoders, and more than a shaft's twist gives"
        yield Trip(
            f"contradicts_{into.speed}_{gear.name}", speeds, "angular velocity", 10.0, source, ERRATIC, 0.2, True, (*is_in, *holds)
        )
