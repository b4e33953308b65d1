# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a rig's folder holds, whether a run can begin, and where its results would lack: ``Rig.check`` and `rig check`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..analysis import found_in, states_of, system_of
from ..base import find_config, where_of, with_bases
from ..driveline import highest_resolved, parts_of_steps
from ..rig import beyond_alfa46
from ..runs import load_sequence, plan_of
from ..studies import CALIBRATION_FILE, ROWS_FILE, calibration_of, load_rows, programme_of, read_beginnings

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ..rig import RigConfig


def checked(rig: str, config: RigConfig) -> Iterator[str]:
    """Check a rig and the files in its folder, and yield a line for each thing that it has; a warning begins with that word.

    Parameters
    ----------
    rig : str
        Name, folder or file of the rig.
    config : RigConfig
        Its configuration.

    Raises
    ------
    RigError
        At the first thing that is not right, with its file and line.
    """
    plan_of(config)  # checks joined devices, which only the engine can check
    yield from (*_summary(config), *_fastest(config), *_slow_shafts(config), *_short_ranges(config))
    if config.structure.shifts and (why := beyond_alfa46(config.transmission)):
        yield f"warning: {_last_output(rig, config)}: {why}"
    for path in _sequences(rig):
        sequence = load_sequence(path, None, rig)
        sequence.check_rig(config)
        yield f"sequence {path.stem}: {len(sequence.steps)} steps"
    yield from _held_against(rig, config)
    if config.structure.shifts and (ways := read_beginnings(rig, config.transmission)):
        yield f"settings at which tune begins: {', '.join(ways)}"


def _last_output(rig: str, config: RigConfig) -> str:
    """Return ``file:line`` of the highest output of the rig's valves, in its own file or in that of a base."""
    last = max(config.structure.valves, key=lambda valve: valve.wires["output"]).name
    places = ((path, (own.get("parts") or {}).get(last) or {}) for path, own in with_bases(rig))
    return next(where_of(path, node, "output") for path, node in places if "output" in node)


def _sequences(rig: str) -> list[Path]:
    """Return the sequences in the rig's own folder."""
    return sorted((find_config("rigs", rig).parent / "sequences").glob("*.yaml"))


def _held_against(rig: str, config: RigConfig) -> Iterator[str]:
    """Yield one line for each of the validation rows and the calibration in the rig's own folder."""
    folder = find_config("rigs", rig).parent
    rows = folder / ROWS_FILE
    if not rows.is_file() or programme_of(rows):
        return
    yield f"validation rows: {', '.join(row.target.id for row in load_rows(rows, rig, config))}"
    if (folder / CALIBRATION_FILE).is_file():
        yield f"calibration: {', '.join(calibration_of(rig, config).parameters)}"


def _fastest(config: RigConfig) -> Iterator[str]:
    """Yield the highest natural frequency of all states of the clutches, with a warning where a run does not resolve it."""
    system, step = system_of(config), config.kernel.step
    every = ((max(found_in(system, one).modes.frequencies, default=0.0), one.name) for one in states_of(config))
    highest, state = max(every, key=lambda one: one[0])
    if not system.shafts or highest <= 0.0:
        return
    yield f"highest frequency: {highest:.5g} Hz ({state}), {highest * step:.2g} periods a step of {step * 1e6:g} us"
    if highest > highest_resolved(step):
        most = highest_resolved(step)
        yield (
            f"warning: a step of {step * 1e6:g} us resolves oscillations up to {most:.3g} Hz, and a run shows this one shifted or "
            f"damped; a step of at most {step * most / highest * 1e6:.2g} us resolves it"
        )


def _slow_shafts(config: RigConfig) -> Iterator[str]:
    """Yield a warning for each shaft whose table or backlash divides a step so often that a run falls behind real time."""
    step = config.kernel.step
    for name, (parts, seconds) in parts_of_steps(system_of(config), step).items():
        if seconds > step:
            took = f"up to {parts} parts to resolve its table, which takes some {seconds * 1e3:.2g} ms"
            yield (
                f"warning: shaft {name} divides a step of {step * 1e6:g} us into {took}: "
                "a run is slower than real time where it is so stiff"
            )


def _short_ranges(config: RigConfig) -> Iterator[str]:
    """Yield a warning when the output can turn faster than its transducer shows, in the gear in which it turns fastest."""
    if not config.structure.gears:
        return
    box = config.transmission
    into, out = (next(one for one in config.structure.transducers if one.name == end.speed) for end in (box.input, box.output))
    fastest = min(box.gears[1:], key=lambda gear: abs(gear.ratio or 0.0))
    speed, end = into.high / abs(box.ratios[fastest.number]), box.ranges.get(out.name, (0.0, float("inf")))[1]
    if speed > end:
        rpm = 30.0 / math.pi
        yield (
            f"warning: gear {fastest.name} turns the output at {speed * rpm:.0f} rpm when {into.name} is at {into.high * rpm:.0f}"
            f" rpm, and {out.name} shows at most {end * rpm:.0f} rpm: raise instruments.{out.like}_range, because shifts beyond "
            "it have no results"
        )


def _summary(config: RigConfig) -> Iterator[str]:
    """Yield the lines of the description's summary."""
    structure, n = config.structure, len(config.catalogue.signals)
    yield f"{config.name}: {config.description}"
    yield f"bodies: {', '.join(structure.bodies)}"
    if structure.elements:
        kinds = ((one.name, one.kind.replace("_", " ")) for one in structure.elements)
        yield f"elements: {', '.join(f'{name} ({kind})' for name, kind in kinds)}"
    if structure.gears:
        box = config.transmission
        for gear in box.gears[1:]:
            by = structure.gears[gear.number - 1]
            held = (*gear.clutches, *(structure.device(one).called for one in by.freewheels), *by.elements)
            yield f"gear {gear.name}: {', '.join(held)}, ratio {gear.ratio:.5g}"
        for clutch in box.clutches:
            by = f"{clutch.valve_name} on output {clutch.output + 1}" if clutch.valve else "no valve"
            yield f"{clutch.name}: {by}, kiss point at {clutch.kiss_pressure * 1e-6:.3f} MPa"
        yield f"inertia: {box.inertias.driving:.4g} kg m2 at the input, {box.inertias.on_output:.4g} kg m2 at the output"
    steps = ", ".join(config.settings.steps)
    yield f"setpoints of sequences: {steps}"
    logged, rate = len(config.catalogue.logger_channels()), config.instruments.logger_rate
    yield f"signals: {n}, of which {logged} are logged at {rate * 1e-3:g} kHz"
