# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig check RIG``: the content of a rig's folder, its errors with their place, and its driveline as a picture."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import RIG_FILE, find_config, where_of, with_bases
from .output_files import KINDS, OutputFile, may_write

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from ..rig import RigConfig

PICTURE = "picture.svg"  # which rig list rigs names, too
PART_S = 5e-6  # s of processor time for a part of a step of two bodies, measured
HELP = "check the folder of a rig and draw its driveline"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("rig", metavar="RIG", help="folder of a rig, its file, or the name of an installed one")
    parser.add_argument(
        "--picture",
        type=OutputFile("svg"),
        metavar="FILE.svg",
        help="where the picture goes, an .svg file (default: picture.svg in the rig's folder)",
    )


def main(args: argparse.Namespace) -> int:
    """Check a rig and return 0 when a run can begin; an error is one sentence with file and line."""
    from ..base import atomic_write, not_written
    from ..rig import beyond_alfa46, driveline_svg, load_rig
    from ..runs import load_sequence, plan_of
    from ..studies import read_beginnings

    config = load_rig(args.rig)
    plan_of(config)  # checks joined devices, which only the engine can check
    print("\n".join([*_summary(config), *_fastest(config), *_slow_shafts(config), *_short_ranges(config)]))
    if config.structure.shifts and (why := beyond_alfa46(config.transmission)):
        print(f"warning: {_last_output(args.rig, config)}: {why}")
    for path in _sequences(args.rig):
        sequence = load_sequence(path, None, args.rig)
        sequence.check_rig(config)
        print(f"sequence {path.stem}: {len(sequence.steps)} steps")
    for line in _held_against(args.rig, config):
        print(line)
    if config.structure.shifts and (ways := read_beginnings(args.rig, config.transmission)):
        print(f"settings at which tune begins: {', '.join(ways)}")
    picture, drawn = args.picture or _beside(args.rig), driveline_svg(config).encode()
    may_write("--picture", picture, KINDS["svg"], args)
    try:
        same = picture.is_file() and picture.read_bytes() == drawn
        if not same:  # an installed rig has its picture, and its folder may belong to another user
            atomic_write(picture, drawn)
    except OSError as error:
        raise not_written(picture, error) from None
    print(f"picture of the driveline: {picture}{'' if same else ' (written)'}")
    return 0


def _beside(rig: str) -> Path:
    """Return where the picture of a rig lies: in its folder, by the name of its file where that is not the folder's only one."""
    path = find_config("rigs", rig)
    return path.with_name(PICTURE) if path.name == RIG_FILE else path.with_suffix(".svg")


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
    from ..studies import CALIBRATION_FILE, ROWS_FILE, programme_of

    folder = find_config("rigs", rig).parent
    rows = folder / ROWS_FILE
    if not rows.is_file() or programme_of(rows):
        return
    from ..studies import calibration_of, load_rows

    yield f"validation rows: {', '.join(row.target.id for row in load_rows(rows, rig, config))}"
    if (folder / CALIBRATION_FILE).is_file():
        yield f"calibration: {', '.join(calibration_of(rig, config).parameters)}"


def _fastest(config: RigConfig) -> Iterator[str]:
    """Yield the highest natural frequency of all states of the clutches, with a warning where a run does not resolve it."""
    from ..analysis import found_in, states_of, system_of
    from ..driveline import highest_resolved

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
    from ..analysis import system_of
    from ..driveline import parts_of_steps

    step = config.kernel.step
    for name, parts in parts_of_steps(system_of(config), step).items():
        if parts * PART_S > step:
            took = f"up to {parts} parts to resolve its table, which takes some {parts * PART_S * 1e3:.2g} ms"
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
