# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller under faults: an upshift with each fault of the rig, in which what is faulty takes part.

``rig controller check --faults`` and the tests use it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple

from ..base import RigError, unknown
from ..controllers import Plug
from ..plant import MESSAGES
from ..plant import part as parts
from ..rig import (
    BAD_CONTROLLER,
    CONTROLLER,
    NO_COMMAND,
    FaultOfRig,
    RigConfig,
    Transmission,
    check_gearbox,
    faults_of,
    with_overrides,
)
from .session import ORDER, Session

IN_TIME, WELL, BADLY, HARM, FAILED = "tripped in time", "shifted well", "shifted badly", "did harm", "failed itself"
STATED = re.compile(r"controller .*, sample \d+: status (error|fatal): ")  # a controller that tells of a fault by its status
SPEED, LOAD, SUPPLIED = 100.0, "40 Nm", 1.7  # rad/s; torque of the load; pressure of the supply over the largest of a valve
STARTED, ONSET, SHIFTED = 2.6, 0.3, 2.0  # s: to the first gear's speed, from then to the order, and from the order to the end
STEP = 0.01  # s
NEAR = 0.03  # share of the input's speed to which a gear is reached
WORSE = 1.5  # times the healthy shift's time or peak torque, from which a shift is bad (assumed)


class Outcome(NamedTuple):
    """What became of a shift with a fault; ``text`` gives the numbers or the reason."""

    fault: str
    outcome: str
    text: str


@dataclass(frozen=True)
class Upshift:
    """What was seen of an upshift.

    Parameters
    ----------
    took : float or None
        Time from the order to the gear [s]; None when it was not reached.
    peak : float
        Highest torque of the input after the order [Nm].
    trip, reason : str
        Name of the trip and its sentence; empty when the rig did not trip.
    tripped : float
        Time from the order to the trip [s], below 0 for one before it.
    """

    took: float | None
    peak: float
    trip: str
    reason: str
    tripped: float


def check_under_faults(load: Callable[[RigConfig], Plug], config: RigConfig, only: str = "*") -> Iterator[Outcome]:
    """Yield the outcome of a shift with each fault that the rig can have with a controller outside.

    A trip of a limit of the machine, or of two gears clamped at once, is harm. A shift is bad when its time or torque is more than
    WORSE times that of the healthy one of the same controller. A trip came in time when what it trips for was there before a shift
    would have been bad. A controller that breaks down, falls silent or brings the plant to where it cannot be moved has failed
    itself; one that tells of the fault by its status has tripped the rig.

    Parameters
    ----------
    load : callable
        load(config) returns the controller anew; it is closed here.
    config : RigConfig
        The rig.
    only : str
        Names of faults with commas between them; * and ? stand for others.

    Yields
    ------
    Outcome
        Of the shift without a fault first, whose fault is empty.

    Raises
    ------
    RigError
        When the rig lacks two gears, motor, load or supply, no fault has such a name, or the controller does not shift without a
        fault.
    """
    check_gearbox(config, "controller check --faults")
    ways = _upshifts(config)
    if not ways:
        gears = " and ".join(gear.name for gear in config.structure.gears)
        raise RigError(f"controller check --faults shifts up from one gear to the next; '{config.name}' has {gears} alone")
    chosen, healthy = chosen_faults(config, only), dict[tuple[int, int], Upshift]()
    for one in (None, *chosen):
        way = ways[0] if one is None else _concerned(one.owner, ways, config.transmission)
        named = f"{config.transmission.way(*way)}: " if len(ways) > 1 else ""
        if way not in healthy:
            healthy[way] = found = _shift(load, config, "on", way)
            if found.trip or found.took is None:
                raise RigError(
                    f"the controller does not shift without a fault: {named}{found.reason or 'the gear was not reached'}"
                )
        if one is None:
            yield Outcome("", WELL, named + _numbers(healthy[way]))
            continue
        shift = _shift(load, config, one.name if one.fault.built_in else f"{one.name}, at={STARTED} s", way)
        text = f"{named}{_when(shift)}{shift.reason or _numbers(shift)}"
        yield Outcome(one.name, judged(one, shift, healthy[way], config), text)


def _upshifts(config: RigConfig) -> list[tuple[int, int]]:
    """Return the changes to the next gear in which the output turns faster the same way."""
    ratios = config.transmission.ratios
    return [(a, b) for a, b in config.transmission.ways().values() if ratios[a] / ratios[b] > 1.0]


def _concerned(owner: str, ways: list[tuple[int, int]], box: Transmission) -> tuple[int, int]:
    """Return the upshift in which something of a rig takes part most: its clutch changes, or is engaged, or it is no clutch's."""
    mine = {
        one.name
        for one in box.clutches
        if owner in (one.name, one.instance, one.valve, one.valve_name, one.pressure, one.current, one.setpoint)
    }

    def part_in(way: tuple[int, int]) -> int:
        old, new = ({one.name for one in box.engaged(gear)} for gear in way)
        return len(mine & (old ^ new)) * 2 + len(mine & old & new)

    return max(ways, key=part_in)


def judged(one: FaultOfRig, shift: Upshift, healthy: Upshift, config: RigConfig) -> str:
    """Return what a shift with a fault came to, one of the outcomes, by the healthy one of the same controller on a rig."""
    watched = {trip.name: trip for trip in config.trips}
    trip, latest = watched.get(shift.trip), WORSE * healthy.took
    if trip is not None and (trip.warning is not None or trip.name.startswith("tie_up")):
        return HARM
    told = shift.trip == BAD_CONTROLLER and STATED.match(shift.reason)
    unheard = shift.trip == NO_COMMAND and one.fault.part == MESSAGES
    if shift.trip and trip is None and not told and not unheard:
        return FAILED
    took = shift.took
    if shift.trip:
        took = shift.tripped - (trip.delay if trip is not None else 0.0)
    if took is None or took > latest or shift.peak > WORSE * healthy.peak:
        return BADLY
    return IN_TIME if shift.trip else WELL


def chosen_faults(config: RigConfig, only: str) -> list[FaultOfRig]:
    """Return the faults of a rig that names as for :func:`check_under_faults` stand for; RigError for a name without any."""
    known = [one for one in faults_of(config).values() if not one.lacking and one.fault.part != CONTROLLER]
    for name in only.split(","):
        if not any(fnmatchcase(one.name, name.strip()) for one in known):
            raise RigError(f"controller check --faults: {unknown('fault', name.strip(), [one.name for one in known])}")
    return [one for one in known if any(fnmatchcase(one.name, name.strip()) for name in only.split(","))]


def _when(shift: Upshift) -> str:
    return f"{abs(shift.tripped):.3f} s {'before' if shift.tripped < 0.0 else 'after'} the order: " if shift.trip else ""


def _numbers(shift: Upshift) -> str:
    took = "the gear was not reached" if shift.took is None else f"in gear after {1e3 * shift.took:.0f} ms"
    return f"{took}, input torque up to {shift.peak:.0f} Nm"


def _shift(load: Callable[[RigConfig], Plug], config: RigConfig, faults: str, way: tuple[int, int]) -> Upshift:
    ill, structure = with_overrides(config, {"faults": faults}), config.structure
    by_device = {setting.setpoint.device: key for key, setting in config.settings.steps.items()}
    keys = {
        role: [by_device[one.name] for one in structure.of_role(role) if one.name in by_device]
        for role in (parts.OIL, parts.SOURCE, parts.LOAD)
    }
    if not all(keys.values()):
        raise RigError(f"'{config.name}' has no motor, load or oil supply that takes setpoints, which a shift under faults needs")
    first, second = (config.transmission.names[gear] for gear in way)
    ratio = config.transmission.ratios[way[1]]
    took, peak = None, 0.0
    with Session(ill, 1, load(ill)) as session:
        for key in keys[parts.OIL]:
            session.set(key, SUPPLIED * max(config.values(valve.name).pressure_limit for valve in structure.valves))
        session.advance(0.2)
        session.set(ORDER, first)
        session.advance(0.6)
        session.set(keys[parts.SOURCE][0], SPEED)
        session.advance(1.4)
        session.set(keys[parts.LOAD][0], LOAD)
        session.advance(STARTED + ONSET - session.time)
        try:
            session.set(ORDER, second)
        except RigError as error:
            return Upshift(None, peak, session.rig.tripped_by, session.reason or str(error), _tripped(session))
        begun = session.time
        while session.time < begun + SHIFTED and not session.rig.safe:
            session.advance(STEP)
            peak = max(peak, abs(session.true(structure.input.torque)))
            slip = session.true(structure.input.speed) - ratio * session.true(structure.output.speed)
            near = abs(slip) < NEAR * SPEED
            took = (took if took is not None else session.time - begun) if near else None
        return Upshift(took, peak, session.rig.tripped_by, session.reason, _tripped(session))


def _tripped(session: Session) -> float:
    """Return how long after the order of the second gear the rig of a session tripped [s]; 0 when it did not."""
    return max((t - STARTED - ONSET for t, name, *_ in session.events if name == "rig_tripped"), default=0.0)
