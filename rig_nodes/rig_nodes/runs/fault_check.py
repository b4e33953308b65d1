# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller under faults: an upshift with each type of fault, and what became of it.

``rig controller check --faults`` and the tests use it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from ..base import RigError
from ..controllers import Plug
from ..plant import TRANSDUCER
from ..plant import part as parts
from ..rig import FaultOfRig, RigConfig, check_gearbox, faults_of, with_overrides
from .session import ORDER, Session

IN_TIME, WELL, BADLY, HARM = "tripped in time", "shifted well", "shifted badly", "did harm"
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
class _Shift:
    """An upshift: time from the order to the gear [s], None when it was not reached; highest torque [Nm]; trip and its reason."""

    took: float | None
    peak: float
    trip: str
    reason: str


def check_under_faults(load: Callable[[RigConfig], Plug], config: RigConfig) -> Iterator[Outcome]:
    """Yield the outcome of a shift with each type of fault.

    A trip of a limit of the machine, or of two gears clamped at once, is harm; any other trip came in time. A shift is judged by
    the healthy one of the same controller. A transducer's fault is that of the coil current of the last valve, where it can have
    it, because every controller sees it.

    Parameters
    ----------
    load : callable
        load(config) returns the controller anew; it is closed here.
    config : RigConfig
        The rig.

    Yields
    ------
    Outcome
        Of the shift without a fault first, whose fault is empty.

    Raises
    ------
    RigError
        When the rig lacks two gears, motor, load or supply, or the controller does not shift without a fault.
    """
    check_gearbox(config, "controller check --faults")
    if len(config.structure.gears) < 2:
        only = config.structure.gears[0].name
        raise RigError(f"controller check --faults shifts from one gear to the next; '{config.name}' has gear {only} alone")
    healthy = _shift(load, config, "on")
    if healthy.trip or healthy.took is None:
        raise RigError(f"the controller does not shift without a fault: {healthy.reason or 'the gear was not reached'}")
    yield Outcome("", WELL, _numbers(healthy))
    harmful = {trip.name for trip in config.trips if trip.warning is not None or trip.name.startswith("tie_up")}
    for one in _each(config):
        shift = _shift(load, config, one.name if one.fault.built_in else f"{one.name}, at={STARTED} s")
        if shift.trip:
            yield Outcome(one.name, HARM if shift.trip in harmful else IN_TIME, shift.reason)
        elif shift.took is None or shift.took > WORSE * healthy.took or shift.peak > WORSE * healthy.peak:
            yield Outcome(one.name, BADLY, _numbers(shift))
        else:
            yield Outcome(one.name, WELL, _numbers(shift))


def _each(config: RigConfig) -> list[FaultOfRig]:
    """Return the faults of all devices, and each of transducers and messages once."""
    known = [one for one in faults_of(config).values() if not one.lacking]
    shown = f"{config.structure.valves[-1].name}.current"
    current = next((one.name for one in config.structure.transducers if one.shows == shown), "")
    kept: dict[tuple, FaultOfRig] = {}
    for one in known:
        key = (one.fault.part, one.fault.name, "" if one.fault.part == TRANSDUCER else one.owner)
        if key not in kept or one.owner == current:
            kept[key] = one
    return list(kept.values())


def _numbers(shift: _Shift) -> str:
    took = "the gear was not reached" if shift.took is None else f"in gear after {1e3 * shift.took:.0f} ms"
    return f"{took}, input torque up to {shift.peak:.0f} Nm"


def _shift(load: Callable[[RigConfig], Plug], config: RigConfig, faults: str) -> _Shift:
    ill, structure = with_overrides(config, {"faults": faults}), config.structure
    by_device = {setting.setpoint.device: key for key, setting in config.settings.steps.items()}
    keys = {
        role: [by_device[one.name] for one in structure.of_role(role) if one.name in by_device]
        for role in (parts.OIL, parts.SOURCE, parts.LOAD)
    }
    if not all(keys.values()):
        raise RigError(f"'{config.name}' has no motor, load or oil supply that takes setpoints, which a shift under faults needs")
    first, second = (gear.name for gear in structure.gears[:2])
    ratio = config.transmission.ratios[config.transmission.numbers[second]]
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
            return _Shift(None, peak, "" if not session.rig.safe else session.rig.tripped_by, session.reason or str(error))
        begun = session.time
        while session.time < begun + SHIFTED and not session.rig.safe:
            session.advance(STEP)
            peak = max(peak, abs(session.true(structure.input.torque)))
            slip = session.true(structure.input.speed) - ratio * session.true(structure.output.speed)
            near = abs(slip) < NEAR * SPEED
            took = (took if took is not None else session.time - begun) if near else None
        return _Shift(took, peak, session.rig.tripped_by, session.reason)
