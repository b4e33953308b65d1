# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of the benchmark: an upshift and a downshift at a drawn speed, load and temperature, healthy or with one fault.

studies.faults.score uses it; what a detector gets is a Course.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError
from ...plant import LINES, uniform
from ...plant import part as parts
from ...rig import check_gearbox, faults_of, shown_unit, with_overrides
from ...runs import Session

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ...base import Floats
    from ...plant import Fault
    from ...rig import RigConfig

HEALTHY = ""
PERIOD = 0.01  # s: of the course that a detector gets
SIZES = (0.25, 0.5, 1.0, 2.0)  # of the usual size
SPEED, LOAD, TEMPERATURE = (60.0, 150.0), (15.0, 60.0), (30.0, 60.0)  # rad/s, Nm and degC between which a run lies
ONSET = (2.5, 3.3)  # s
SHIFTS, END = (3.6, 5.6), 7.4  # s: orders, and the end
SUPPLIED = 1.7  # pressure of the supply over the largest one of a valve
DRAWS = 1 << 35  # number of the first channel of the values that draw the runs


@dataclass(frozen=True)
class Case:
    """A run of the benchmark.

    Parameters
    ----------
    seed : int
        Seed of the transducers' errors and noise.
    speed, load, temperature : float
        Speed of the input [rad/s], torque of the load [Nm] and temperature of the oil [degC].
    fault : str
        Name of its fault; HEALTHY for none.
    size : float
        Size over the usual one.
    onset : float
        When it begins [s]; 0 for wear and wrong assembly.
    """

    seed: int
    speed: float
    load: float
    temperature: float
    fault: str = HEALTHY
    size: float = 1.0
    onset: float = 0.0


@dataclass(frozen=True)
class Course:
    """What a detector gets of a run: nothing that the wires of a real one do not carry.

    Parameters
    ----------
    t : (n,) array of float
        Times [s].
    signals : dict of str to (n,) array of float
        What the transducers show [SI], and of each output of the controller its setpoint_K [A] and duty_K, K from 1.
    gear : (n,) array of int
        Number of the gear that was ordered last.
    config : RigConfig
        The rig.
    """

    t: Floats
    signals: dict[str, Floats]
    gear: np.ndarray
    config: RigConfig = field(repr=False)


def cases_of(config: RigConfig, seed: int, healthy: int, repeats: int, sizes: Sequence[float] = SIZES) -> list[Case]:
    """Return runs drawn by a seed: the healthy ones, then each fault in each size.

    Parameters
    ----------
    config : RigConfig
        The rig.
    seed : int
        The seed; runs of different seeds have nothing in common.
    healthy : int
        Number of healthy runs.
    repeats : int
        Runs for each fault and size; a fault without a size has so many for all sizes.
    sizes : sequence of float
        Sizes over the usual one; in place of one beyond the fault's range is the end of the range.

    Returns
    -------
    list of Case
        The runs.

    Raises
    ------
    RigError
        When the rig has no gears.
    """
    check_gearbox(config, "the benchmark of fault detectors")
    wanted: list[tuple[str, float]] = [(HEALTHY, 1.0)] * healthy
    known = faults_of(config)
    for one in known.values():
        if not one.lacking and one.fault.part not in LINES:
            wanted += [(one.name, size) for size in _sizes(one.fault, sizes) for _ in range(repeats)]
    out = []
    for number, (fault, size) in enumerate(wanted):
        drawn = [uniform(seed, DRAWS + k, number) for k in range(5)]
        speed, load, temperature, onset = (
            low + (high - low) * x for (low, high), x in zip((SPEED, LOAD, TEMPERATURE, ONSET), drawn)
        )
        built_in = bool(fault) and known[fault].fault.built_in
        out.append(Case(int(drawn[4] * 2**31), speed, load, temperature, fault, size, 0.0 if built_in else round(onset, 3)))
    return out


def _sizes(fault: Fault, sizes: Sequence[float]) -> Iterable[float]:
    """Return the sizes over the usual one that a fault can have, each once; one without a size is always as bad as usual."""
    size = fault.size
    if size is None:
        return (1.0,)
    return dict.fromkeys(min(max(size.usual * one, size.low), size.high) / size.usual for one in sizes)


def course_of(config: RigConfig, case: Case) -> Course:
    """Run a case and return what a detector gets; no trip is watched, so that detectors are compared on the same times."""
    structure, steps = config.structure, config.settings.steps
    oil = structure.of_role(parts.OIL)
    ill = with_overrides(config, {"faults": _order(config, case) if case.fault else "on", "trips.watched": "off"})
    ill = ill.with_values({f"{one.name}.temperature": case.temperature for one in oil})
    by_device = {setting.setpoint.device: key for key, setting in steps.items()}
    roles = {
        role: [by_device[one.name] for one in structure.of_role(role) if one.name in by_device]
        for role in (parts.OIL, parts.SOURCE, parts.LOAD)
    }
    if not all(roles.values()):
        raise RigError(f"'{config.name}' has no motor, load or oil supply that takes setpoints, which the benchmark drives")
    gears = [gear.name for gear in structure.gears][:2]
    pressure = SUPPLIED * max(config.values(valve.name).pressure_limit for valve in structure.valves)
    orders = [
        (0.2, "shift", gears[0]),
        (0.3, roles[parts.SOURCE][0], case.speed),
        (1.0, roles[parts.LOAD][0], f"{case.load:.3f} Nm"),
    ]
    orders += [(at, "shift", gear) for at, gear in zip(SHIFTS, gears[::-1])]
    rows, gear = [], []
    with Session(ill, case.seed) as session:
        for key in roles[parts.OIL]:
            session.set(key, pressure)
        names, rig = session.transducers, session.rig
        for _ in range(round(END / PERIOD)):
            while orders and orders[0][0] <= session.time + 1e-9:
                _, key, value = orders.pop(0)
                session.set(key, value)
            session.advance(PERIOD)
            rows.append([*map(rig.measurement, names), *rig.setpoint, *rig.duty])
            gear.append(rig.gear)
    outputs = range(1, structure.outputs + 1)
    columns = (*names, *(f"setpoint_{k}" for k in outputs), *(f"duty_{k}" for k in outputs))
    signals = dict(zip(columns, np.array(rows).T))
    return Course(PERIOD * np.arange(1, len(rows) + 1), signals, np.array(gear), config)


def _order(config: RigConfig, case: Case) -> str:
    size = faults_of(config)[case.fault].fault.size
    text = f"{case.fault}, at={case.onset} s"
    if size is None:
        return text
    unit, factor = shown_unit(size.quantity)
    return f"{text}, size={size.usual * case.size / factor!r} {unit}"
