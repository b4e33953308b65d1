# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trips by what the instruments say: a transducer that is dead, stuck or out of range, or contradicts others.

A healthy reading never rests, because it scatters by more than the converter's step; one that has no noise of its own can only be
judged by others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from ..base import SAMPLE
from ..plant import ERRATIC, LOST
from ..plant import part as parts
from .structure import Transducer
from .transducer_types import TRANSDUCER_TYPES, measures_both_signs
from .trip import ABOVE_RANGE, GEAR, MEASURED, SHIFTING, STAYED, Condition, Sum, Trip

if TYPE_CHECKING:
    from .configuration import RigConfig
    from .transmission import Clutch

BY_CHANCE = 1e-12  # that a healthy reading stays the same for so long
SHORTEST, LONGEST = 0.1, 10.0  # s, assumed: times after which a reading that stays the same is none; a longer one is no sign
AT_END = 0.998  # assumed: share of a range from which on a reading counts as its end


def engaged(number: int, name: str) -> tuple[Condition, Condition]:
    """Return the conditions that a gear is engaged by its number and name: it is reported, and no shift."""
    is_in = Condition(Sum("gear", ((GEAR, 1.0), (SHIFTING, -0.5))), True, number - 0.25, f"gear {name} is engaged")
    return is_in, Condition(Sum("gear", ((GEAR, 1.0),)), False, number + 0.25, is_in.text)


def reading(one: Transducer, magnitude: bool = False) -> Sum:
    """Return what a transducer shows, with its sign or as a magnitude."""
    return Sum(f"reading of {one.name}", ((f"{MEASURED}{one.name}", 1.0),), magnitude)


def _either_way(one: Transducer) -> Sum:
    """What a transducer shows, without the way in which it acts or turns, which a temperature below 0 has not."""
    return reading(one, measures_both_signs(one.type, one.low) and one.type != "temperature")


def fitted(config: RigConfig) -> list[Transducer]:
    """Return the transducers that are there."""
    return [one for one in config.structure.transducers if getattr(config.instruments, f"{one.like}_fitted", True)]


def trips_of_transducers(config: RigConfig) -> Iterator[Trip]:
    """Return the trips by what the instruments of a rig say; those from which a setting takes a reading are not there."""
    every, shown = ({one.name: one for one in those} for those in (config.structure.transducers, fitted(config)))
    for one in every.values():
        yield from _one_alone(config, one, one.name in shown)
    yield from _joined(config, shown)
    structure = config.structure
    if not structure.shifts or structure.input is None:
        return
    turns = Condition(_either_way(every[structure.input.speed]), True, 5.0, f"{structure.input.speed} shows that the input turns")
    for one in shown.values():
        if one.type == "temperature" and config.effects.transducers:
            source = "assumed: what an open wire shows; oil that warms passes it sooner"
            yield Trip(f"dead_{one.name}", reading(one, True), "temperature", 0.01, source, LOST, LONGEST, False, (turns,))
    if not config.prescribed:
        for clutch in config.transmission.clutches:
            if {clutch.pressure, clutch.current} <= every.keys():
                yield from _pressure(config, clutch, every, shown)
    ends = (structure.input.torque, structure.output.torque)
    if set(ends) <= every.keys() and len(structure.of_role(parts.SOURCE)) == 1:  # another source would drive past the gears
        yield from _torques(config, *(every[name] for name in ends), there=set(ends) <= shown.keys())


def _one_alone(config: RigConfig, one: Transducer, there: bool) -> Iterator[Trip]:
    """A transducer that shows the end of its range, nothing, or always the same; ``there``: it is fitted."""
    full, dimension = getattr(config.instruments, f"{one.like}_range"), TRANSDUCER_TYPES[one.type].dimension
    if one.type != "ratio":  # a lever or a throttle may stand at its end
        source = "assumed: the end of its full scale, which no healthy value reaches for so long"
        yield Trip(f"out_of_range_{one.name}", _either_way(one), dimension, AT_END * full, source, ABOVE_RANGE, 0.1, there=there)
    limit = _rests(config, one, full)
    there = there and limit <= LONGEST and config.effects.transducers
    rests = Sum(f"time for which the reading of {one.name} has been the same", ((f"{STAYED}{one.name}", SAMPLE),))
    nothing = 1e-6 * full
    source = f"its noise and the converter's step: by chance a healthy one rests so long once in {1.0 / BY_CHANCE:.0e} times"
    at_nothing = Condition(reading(one, True), False, nothing, "it shows 0")
    dead = there and not _counts(config, one)  # one that counts pulses shows 0 at rest, without noise
    yield Trip(f"dead_{one.name}", rests, "time", limit, source, LOST, 0.0, True, (at_nothing,), there=dead)
    neither = "it shows neither 0 nor its end"
    within = (Condition(reading(one, True), True, nothing, neither), Condition(reading(one, True), False, AT_END * full, neither))
    yield Trip(f"stuck_{one.name}", rests, "time", limit, source, ERRATIC, 0.0, True, within, there=there)


def _counts(config: RigConfig, one: Transducer) -> bool:
    return getattr(config.instruments, f"{one.like}_step", 0.0) > 0.0


def _joined(config: RigConfig, shown: Mapping[str, Transducer]) -> Iterator[Trip]:
    """Encoders of bodies that wheels and shafts always join: one shows nothing while another one shows that they turn."""
    joins = [one.bodies for one in (*config.structure.meshes, *config.structure.shafts)]
    turning = {one.shows.removesuffix(".speed"): one for one in shown.values() if one.type == "speed"}
    for body, one in turning.items():
        reached = {body}
        for _ in joins:
            reached.update(each for pair in joins if reached.intersection(pair) for each in pair)
        others = [each for there, each in turning.items() if there in reached and each is not one]
        if others and _counts(config, one):
            turns = Condition(_either_way(others[0]), True, 5.0, f"{others[0].name} shows that it turns")
            limit, source = 0.5 * getattr(config.instruments, f"{one.like}_step"), "half of the encoder's step: no pulse at all"
            yield Trip(f"dead_{one.name}", reading(one, True), "angular velocity", limit, source, LOST, 0.2, False, (turns,))


def _rests(config: RigConfig, one: Transducer, full: float) -> float:
    """Return the time [s] for which a healthy reading stays the same with a chance of BY_CHANCE."""
    values, signed = config.instruments, measures_both_signs(one.type, one.low)
    noise, step = getattr(values, f"{one.like}_noise", 0.0), getattr(values, f"{one.like}_step", 0.0)
    if noise <= 0.0:
        return math.inf
    if step == 0.0 and values.resolution_bits > 0.0:
        step = (2.0 if signed else 1.0) * full / 2.0**values.resolution_bits
    stays = math.erf(step / (2.0 * math.sqrt(2.0) * noise))  # in the middle of a step
    if stays >= 1.0:
        return math.inf
    return max(SHORTEST, SAMPLE * math.ceil(math.log(BY_CHANCE) / math.log(stays))) if stays > 0.0 else SHORTEST


def _pressure(
    config: RigConfig, clutch: Clutch, every: Mapping[str, Transducer], shown: Mapping[str, Transducer]
) -> Iterator[Trip]:
    """A pressure that the current of its valve does not explain, for longer than any filling and release takes."""
    valve, one, current = getattr(config, clutch.valve), every[clutch.pressure], every[clutch.current]
    there = {clutch.pressure, clutch.current} <= shown.keys() and clutch.valve not in config.cut_out
    structure, most = config.structure, valve.pressure_limit
    wrong = getattr(config.instruments, f"{one.like}_class", 0.0) * getattr(config.instruments, f"{one.like}_range")
    line = structure.line_of(structure.oil_of(structure.device(clutch.valve), "supply"))
    supplies = [each for each in shown.values() if each.shows == f"{line}.pressure"]
    # the current that gives three quarters of the highest pressure even as it rises, against the hysteresis
    enough = (0.75 * most / valve.pressure_gain + valve.cracking_current) / (1.0 - valve.hysteresis)
    orders = f"{current.name} orders three quarters of the highest pressure"
    ordered = (
        Condition(_either_way(current), True, enough, orders),
        *(Condition(_either_way(each), True, 0.75 * most, f"{each.name} has them") for each in supplies),
    )
    idle = (Condition(_either_way(current), False, valve.cracking_current, f"{current.name} orders none"),)
    share = f"of the highest pressure of {clutch.valve_name}"
    for what, limit, above, enabled, source in (
        ("low", 0.5 * most, False, ordered, f"assumed: half {share}"),
        ("high", 0.25 * most + wrong, True, idle, f"assumed: a quarter {share}, and the class of {one.name}"),
        ("most", 1.25 * most + wrong, True, (), f"assumed: a quarter more than all {share}, and the class of {one.name}"),
    ):
        name = f"contradicts_{one.name}_{what}"
        yield Trip(name, _either_way(one), "pressure", limit, source, ERRATIC, 1.0, above, enabled, there=there)


def _torques(config: RigConfig, into: Transducer, out: Transducer, there: bool) -> Iterator[Trip]:
    """Torques of input and output that ratio and losses of an engaged gear do not explain."""
    full = max(getattr(config.instruments, f"{one.like}_range") for one in (into, out))
    losses = (getattr(config, one.name) for one in config.structure.of_role(parts.LOSS))
    bent = sum(abs(getattr(one, "square", 0.0)) for one in losses) * full * full
    for number, gear in enumerate(config.structure.gears, 1):
        ratio = config.transmission.ratios.get(number)
        if ratio is not None:
            text = f"difference of {into.name} and {out.name} by the ratio of gear {gear.name}"
            apart = Sum(text, ((f"{MEASURED}{into.name}", ratio), (f"{MEASURED}{out.name}", -1.0)), True)
            limit = 0.15 * full * max(1.0, abs(ratio)) + bent
            source = "assumed: 15 % of the full scale on the input, more than losses and inertias take for so long"
            source += ", and the losses by the square of the torque at full scale" * (bent > 0.0)
            name = f"contradicts_{into.name}_{gear.name}"
            yield Trip(name, apart, "torque", limit, source, ERRATIC, 2.0, True, engaged(number, gear.name), there=there)
