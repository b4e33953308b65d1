# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Converts a logger's file into a measurement of a rig (signals in SI on one clock, orders of gears) and writes this as a bag.

`rig import` writes runs with it; `rig compare` compares files with runs and writes no bag.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ... import __version__
from ...base import UNITS, RigError, unknown, with_article
from ...rig import CONTROLLER_EVENTS, GEAR_WAS, SHIFT_ORDERED, Signal, Transmission, catalogue, transmission_of
from ..cdr import encoder
from ..logged import Recording, orders_in
from ..rig_in_bag import rig_record
from ..writer import BagWriter
from .cells import CellError
from .clock import Clock
from .foreign import Channel, Foreign, column, read_foreign
from .orders import parse_orders
from .profile import Mapped, Profile
from .time_columns import Axis, axis_of, found_times, stamps_of
from .units import unit_of

if TYPE_CHECKING:
    from ...base import Floats

ORDER_NAMES = ("gear_ordered", "order")
BLOCK, CHANNELS, RUN_INFO = "/instruments/hmg4000", "/instruments/channels", "/rig/run_info"
ROWS = 50  # largest number of rows in a block
LATEST = 24 * 3600.0  # s; the times of a file that begins later are taken as dates, and its run begins at 0
NO_RIG = (
    "its rig is not given, and the results depend on this rig's inertias, ratios and instrument errors; name it by --rig NAME, "
    "in Python by rig=NAME, or in a profile"
)
MOST_BLOCKS_IN = 5e-3  # s; largest span of the rows in a block


@dataclass(frozen=True)
class Measurement:
    """A file's signals on one clock.

    Attributes
    ----------
    t0, period : float
        Time of row 0 and between rows [s].
    channels : dict of str to (n,) array of float
        Values by signal [SI]; NaN where there are none.
    events : list of (float, str, str, str, float)
        Orders of gears and other events, in the form of Bag.events.
    record : mapping
        Record of the rig.
    about : dict
        The run's record of its import.
    run : dict
        The record of the run that was exported, or empty.
    notes : list of str
        Notes for its user, as sentences.
    """

    t0: float
    period: float
    channels: dict[str, Floats]
    events: list[tuple[float, str, str, str, float]]
    record: Mapping
    about: dict
    run: dict = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def recording(self, box: Transmission) -> Recording:
        """Return the measurement for the shift metrics; RigError when it lacks a signal that they need."""
        return Recording(self.t0, self.period, self.channels, orders_in(self.events), box)


def own_profile(foreign: Foreign, record: Mapping) -> Profile | None:
    """Return a profile for a file whose heads are the rig's own names, or for an exported run; None when heads must be guessed.

    Parameters
    ----------
    foreign : Foreign
        The file.
    record : mapping
        Record of the rig whose names the heads may be.

    Returns
    -------
    Profile or None
        The profile.
    """
    exported = foreign.provenance is not None
    signals = catalogue(record).signals
    measured = {one["name"] for one in record["structure"]["transducers"]}
    times = found_times(foreign.channels)
    mapped = [
        Mapped(
            one.head,
            one.name,
            f"{foreign.path}: column '{one.head}'",
            time=times.own[one.head].head if one.head in times.own else None,
        )
        for one in foreign.channels
        if one.name in signals and (not exported or one.name in measured) and one.name not in ORDER_NAMES
    ]
    gear = None if exported else next((one.head for one in foreign.channels if one.name in ORDER_NAMES), None)
    if not exported and not all(name in [one.signal for one in mapped] for name in transmission_of(record).channels):
        return None
    main, date = (one.head if one else None for one in (times.main, times.date))
    return Profile(time=main, date=date, columns=tuple(mapped), gear=gear) if mapped else None


def why_none(path: str | Path, record: Mapping) -> str:
    """Return why :func:`read_measurement` has returned None for a file, as words behind its name."""
    heads = {one.name for one in read_foreign(path).channels}
    needed = transmission_of(record).channels
    lacking = [name for name in needed if name not in heads]
    if len(lacking) == len(needed):
        return f"its heads are not signals of rig '{record.get('name')}'"
    return f"it has no head {', '.join(lacking)}, which a file without a profile needs for rig '{record.get('name')}'"


def measure(foreign: Foreign, profile: Profile, record: Mapping, named_by: str, orders: str | None = None) -> Measurement:
    """Make a measurement of a file.

    Parameters
    ----------
    foreign : Foreign
        The file.
    profile : Profile
        The profile by which the file is read.
    record : mapping
        Record of the rig (RigConfig.as_dict).
    named_by : str
        Where the rig was named, e.g. ``--rig``; it is kept in the record of the import.
    orders : str, optional
        Orders of gears from the command line.

    Returns
    -------
    Measurement
        The measurement.

    Raises
    ------
    RigError
        When the file does not fit profile or rig.
    """
    signals, path = catalogue(record).signals, foreign.path
    found = {}
    for one in profile.columns:
        channel = column(foreign, one.head, one.where)
        if one.signal not in signals:
            raise RigError(f"{one.where}: {unknown('signal', one.signal, signals)}")
        if one.signal in found:
            raise RigError(
                f"{one.where}: signal {one.signal} is there twice, as '{found[one.signal][1].head}' and '{channel.head}'; "
                "name the one to take under 'columns' in a profile"
            )
        found[one.signal] = one, channel, _in_si(one, channel, signals[one.signal])
        if channel.over and profile.time is None and profile.period is None:
            raise RigError(
                f"{one.where}: '{channel.head}' is recorded over {channel.over} and not over time; name a column of times "
                "in a profile, e.g. time: {column: NAME, unit: s}, or give the time between its rows by --period, in Python "
                "by period="
            )
    if not found:
        raise RigError(f"{path}: no column is taken from it")
    axis = axis_of(foreign, profile, [channel for _, channel, _ in found.values()])
    clocks = found_times(foreign.channels).own if axis.head is not None else {}
    for name, (one, channel, values) in found.items():
        time = one.time or (clocks[channel.head].head if channel.head in clocks else None)
        if time is not None and time != axis.head:
            found[name] = replace(one, time=time), _with_times(foreign, one.where, time, channel, axis), values
    main = {name: values for name, (_, channel, values) in found.items() if _on(channel, axis)}
    clock = Clock(foreign, axis.stamps, profile.bridge, list(main.values()))
    channels, counts = {}, {"missing": 0, "bridged": 0}
    for name, (_, channel, values) in found.items():
        if name in main:
            channels[name] = clock.placed(values, counts)
        elif channel.times is None or len(channel.times) != len(values):
            raise RigError(
                f"{path}: column '{channel.head}' has {len(values)} values, and its times '{axis.head}' have "
                f"{len(axis.stamps.seconds)}; name the column of its own times, e.g. {{signal: NAME, time: COLUMN}}"
            )
        else:
            channels[name] = clock.carried(channel, values, bool(signals[name].states), counts)
    events = _events(foreign, profile, orders, record, axis, clock)
    return _measurement(_Read(foreign, profile, axis, clock, found, counts), channels, events, record, named_by)


class _Read(NamedTuple):
    """A file as a profile reads it, and what was found in it by the names of signals."""

    foreign: Foreign
    profile: Profile
    axis: Axis
    clock: Clock
    found: dict[str, tuple[Mapped, Channel, Floats]]
    counts: dict[str, int]  # of values that are missing and of those that were bridged


def _measurement(read: _Read, channels: dict[str, Floats], events: list, record: Mapping, named_by: str) -> Measurement:
    foreign, profile, axis, clock, found, counts = read
    notes, shift = [*foreign.notes, *axis.notes], 0.0
    if axis.stamps.dated or not 0.0 <= clock.t0 < LATEST:
        shift = clock.t0
        notes.append(f"time 0 of the run is {axis.stamps.first or f'{shift:.6f} s'} of the file")
    notes += clock.notes
    notes += _words(found)
    if slower := [name for name, (one, channel, _) in found.items() if one.time is not None and channel.times is not None]:
        notes.append(f"{', '.join(slower)} have the times of '{found[slower[0]][0].time}'")
    if counts["missing"]:
        left = counts["missing"] - counts["bridged"]
        notes.append(
            f"{counts['missing']} of {clock.rows * len(channels)} values are missing: {counts['bridged']} were bridged by straight "
            f"lines{f', {left} in gaps over {profile.bridge * 1e3:g} ms stay empty' if left else ''}"
        )
    taken = {channel.head for _, channel, _ in found.values()} | {one.time for one, _, _ in found.values()}
    taken |= {profile.date, profile.gear, axis.head, axis.date}
    left_out = [one for one in foreign.channels if one.head not in taken and one.name not in taken]
    if left_out:
        shown = ", ".join(f"'{one.head}'{'' if one.kind == 'numbers' else f' ({one.kind})'}" for one in left_out[:5])
        were = "column was" if len(left_out) == 1 else "columns were"
        notes.append(f"{len(left_out)} {were} left out: {shown}{' and more' if len(left_out) > 5 else ''}")
    about = {
        "file": foreign.path.name,
        "sha256": foreign.digest(),
        "by": f"rig_nodes {__version__}",
        "profile": profile.name,
        "rig_named_by": named_by,
        "columns": {
            name: {"head": channel.head, "unit": one.unit or channel.unit, "factor": one.factor, "offset": one.offset}
            for name, (one, channel, _) in found.items()
        },
        "rows": clock.rows,
        **counts,
        "time_zero_s": axis.stamps.zero + shift,
        **({} if foreign.start is None else {"start": foreign.start + shift}),
    }
    run = {key: value for key, value in foreign.provenance["run"].items() if key != "configuration"} if foreign.provenance else {}
    events = [(t - shift, *rest) for t, *rest in events]
    return Measurement(clock.t0 - shift, clock.period, channels, events, record, about, run, notes)


def _words(found: Mapping[str, tuple[Mapped, Channel, Floats]]) -> list[str]:
    """Return notes on texts that were taken for missing values and that nobody declared."""
    counts: dict[str, int] = {}
    for _, channel, _ in found.values():
        for word, number in channel.words().items():
            counts[word] = counts.get(word, 0) + number
    if not counts:
        return []
    shown = ", ".join(f"'{word}' {number} times" if number > 1 else f"'{word}' once" for word, number in list(counts.items())[:5])
    return [f"cells that hold no number count as missing: {shown}{' and more' if len(counts) > 5 else ''}"]


def _with_times(foreign: Foreign, where: str, time: str, channel: Channel, axis: Axis) -> Channel:
    """Return a column with the times of a time column of its own."""
    own = stamps_of(foreign, column(foreign, time, where))
    if own.dated != axis.stamps.dated:
        raise RigError(f"{where}: '{time}' and '{axis.head}' are times of different kinds, which have no common beginning")
    return Channel(channel.head, channel.name, channel.unit, channel.content, own.seconds + (own.zero - axis.stamps.zero))


def _in_si(one: Mapped, channel: Channel, signal: Signal) -> Floats:
    """Return the values of a column in SI."""
    own, dimension = signal.display_unit, UNITS[signal.display_unit][0]
    if not (stated := one.unit or channel.unit):
        if dimension != "ratio":
            raise CellError(
                f"{one.where} has no unit; write it in brackets behind the name, e.g. '{channel.name} [{own}]', or in a profile"
            )
        stated = "-"
    unit = unit_of(stated)
    if unit is None or UNITS[unit][0] != dimension:
        known = ", ".join(u for u, (d, _) in UNITS.items() if d == dimension)
        raise (RigError if unit else CellError)(
            f"{one.where} is in {stated}; {with_article(dimension)} such as {one.signal} is in {known}"
        )
    values = channel.values
    if one.factor != 1.0 or one.offset:
        values = values * one.factor + one.offset
    factor = UNITS[unit][1]
    return values if factor == 1.0 else values * factor


def _on(channel: Channel, axis: Axis) -> bool:
    """Return True when a channel has a value at each row of the clock."""
    own, times = channel.times, axis.stamps.seconds
    return len(channel.values) == len(times) and (own is None or own is times or np.array_equal(own, times))


def _events(
    foreign: Foreign, profile: Profile, orders: str | None, record: Mapping, axis: Axis, clock: Clock
) -> list[tuple[float, str, str, str, float]]:
    """Return the events of an exported run, or the orders that were given or are in a column."""
    if not (record["structure"]["gears"]):
        return _stated_events(foreign)
    box = transmission_of(record)
    if orders is not None or profile.orders is not None:
        text, where = (orders, "--orders") if orders is not None else (profile.orders or "", f"{profile.name}: orders")
        begin = clock.t0 if axis.stamps.dated else 0.0  # dates and times of day have orders by the run's own time
        given = [(t + begin, *gears) for t, *gears in parse_orders(text, box, where)]
        for t, before, after in given:
            if not clock.first <= t <= clock.last:
                what = f"{t - begin:g} s, {box.names[before]} to {box.names[after]},"
                raise RigError(
                    f"{where}: the order at {what} is outside {foreign.path}, whose times go from {clock.first - begin:.10g} to "
                    f"{clock.last - begin:.10g} s"
                )
        return _as_events(given, box)
    if profile.gear is None:
        return _stated_events(foreign)
    channel = column(foreign, profile.gear, f"{foreign.path}: gear")
    return _as_events(_from_column(foreign, channel, profile, box, clock), box)


def _stated_events(foreign: Foreign) -> list[tuple[float, str, str, str, float]]:
    events = foreign.provenance["events"] if foreign.provenance else []
    try:
        return [(float(t), str(topic), str(name), str(text), float(value)) for t, topic, name, text, value in events]
    except (TypeError, ValueError) as error:
        raise RigError(f"{foreign.path}: the events of the exported run in it cannot be used ({error})") from None


def _as_events(orders: Sequence[tuple[float, int, int]], box: Transmission) -> list[tuple[float, str, str, str, float]]:
    out, gear = [], 0
    for t, before, after in orders:
        if before != gear:  # the gear was ordered before the file begins
            out.append((t, CONTROLLER_EVENTS, GEAR_WAS, f"{box.names[before]} was in", float(before)))
        out.append((t, CONTROLLER_EVENTS, SHIFT_ORDERED, f"shift to {box.names[after]} ordered", float(after)))
        gear = after
    return out


def _from_column(
    foreign: Foreign, channel: Channel, profile: Profile, box: Transmission, clock: Clock
) -> list[tuple[float, int, int]]:
    """Return the orders from the changes of the ordered gear, which the column has as numbers or as names."""
    texts = np.array(channel.texts())
    at_rows = clock.times_of(channel, len(texts))
    known = np.flatnonzero((texts != "") & np.isfinite(at_rows))
    values = texts[known]
    numbers = {
        text: box.number(profile.gears.get(text) or profile.gears.get(_plain(text)) or _plain(text))
        for text in dict.fromkeys(values.tolist())
    }
    for text, number in numbers.items():
        if number is None:
            at = known[int(np.argmax(values == text))]
            example = f'gear: {{column: {channel.head}, values: {{"{text}": {box.names[1]}}}}}'
            raise RigError(
                f"{foreign.path}: {foreign.row(int(at))} orders the gear {text}; gears are {box.spoken}, and a profile names "
                f"others, e.g. {example}"
            )
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    times = at_rows[known]
    found = [(float(times[i]), int(numbers[values[i - 1]] or 0), int(numbers[values[i]] or 0)) for i in changes]
    return [(t, before, after) for t, before, after in found if before != after]


def _plain(text: str) -> str:
    """Return ``1`` for a number that is written as 1.0 or 1,0, and any other text as it is."""
    try:
        return f"{float(text.replace(',', '.')):g}"
    except ValueError:
        return text


def sequence_name(path: Path) -> str:
    """Return the name of the run of a file, for the names of its folder and bag."""
    return re.sub(r"[^\w.-]+", "_", path.stem).strip("._") or "imported"


def write_bag(measurement: Measurement, folder: Path, name: str) -> Path:
    """Write a measurement as a bag.

    Parameters
    ----------
    measurement : Measurement
        The measurement.
    folder : Path
        Folder of the bag.
    name : str
        First part of the bag's file name.

    Returns
    -------
    Path
        The bag's file.

    Raises
    ------
    RigError
        When it cannot be written.
    """
    about = measurement.about
    record = {
        "sequence": name,
        "description": f"imported from {about['file']}",
        "seed": None,
        "versions": {"rig_nodes": __version__},
        **measurement.run,
        "configuration": dict(measurement.record),
        "imported": about,
    }
    known = catalogue(measurement.record)
    types = {topic: one.ros_type for topic, one in known.all_topics.items()}
    first = round(measurement.t0 * 1e9)
    names = list(measurement.channels)
    messages: list[tuple[int, str, tuple]] = [
        (first, RUN_INFO, (json.dumps(record, sort_keys=True),)),
        (first, CHANNELS, (names, [known.signal(one).unit for one in names], measurement.period)),
    ]
    events = [event for event in measurement.events if event[1] in types and event[0] >= 0.0]
    messages += [(round(t * 1e9), topic, (what, text, value)) for t, topic, what, text, value in events]
    messages += _blocks(measurement)
    messages.sort(key=itemgetter(0))  # the sort is stable, so that the description of the run stays before its rows
    encoders = {topic: encoder(types[topic]).encode for _, topic, _ in messages}
    counts = dict.fromkeys(encoders, 0)
    with BagWriter(folder, name, topics=known.all_topics) as bag:
        for stamp, topic, fields in messages:
            bag.write(topic, types[topic], encoders[topic](stamp, counts[topic], *fields), stamp)
            counts[topic] += 1
    return bag.path


def _blocks(measurement: Measurement) -> list[tuple[int, str, tuple]]:
    """Return the rows as the logger's blocks; the stamp of a block is the exact time of its first row."""
    table = np.column_stack(list(measurement.channels.values()))
    begin = math.floor(measurement.t0 / measurement.period + 1e-6)
    # a bag in which no time passes holds no run, so that the last row of a short recording is a block of its own
    rows = max(1, min(ROWS, round(MOST_BLOCKS_IN / measurement.period), len(table) - 1))
    out = []
    for at in range(0, len(table), rows):
        part = table[at : at + rows]
        stamp = round((measurement.t0 + measurement.period * at) * 1e9)
        out.append((stamp, BLOCK, (begin + at, measurement.period, *part.shape, part.ravel())))
    return out


def read_measurement(
    path: str | Path, profile: Profile | None, record: Mapping | None, named_by: str, orders: str | None = None
) -> Measurement | None:
    """Read a file by a profile, or by its heads when these are the rig's own names.

    Parameters
    ----------
    path : str or Path
        The file.
    profile : Profile, optional
        The profile by which the file is read.
    record : mapping or None
        Record of the rig; None where only the exported run in the file can give it.
    named_by : str
        Where the rig was named. When it is empty, the rig is that of the exported run in the file, and for a file without one the
        record only gives the names that its heads may be.
    orders : str, optional
        Orders of gears.

    Returns
    -------
    Measurement or None
        None when a profile is needed and there is none.

    Raises
    ------
    RigError
        When the file cannot be used, or its rig is not given.
    """
    foreign = read_foreign(path, profile.form if profile else None)
    if foreign.provenance and not named_by:
        record, named_by = rig_record(foreign.provenance["run"]["configuration"]), "the exported run"
    if record is None:
        raise RigError(f"{path}: {NO_RIG}")
    if profile is None or not profile.columns:
        found = own_profile(foreign, record)
        if found is None:
            return None
        profile = found if profile is None else replace(found, period=profile.period, time=None if profile.period else found.time)
    if not named_by:
        raise RigError(f"{path}: {NO_RIG}")
    return measure(foreign, profile, record, named_by, orders)
