# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions that are nearly rigs: each is refused in one sentence, or is a rig, within seconds; a campaign tries 10 000 of them.

What makes a description a rig is said here once more, apart from the checks of the reader: its numbers, its sizes, its record, the
plan of its plant.
"""

import dataclasses
import math
import random
import re
import shutil
import threading
import time

import numpy as np
import pytest

from rig_nodes.base import SAMPLE, RigError, rig_folders
from rig_nodes.plant import World
from rig_nodes.plant import part as parts
from rig_nodes.rig import config_of_record, load_rig
from rig_nodes.runs import plan_of
from rig_nodes.runs.watch import Watched

HANGS = 5.0  # s
TOLD = 1000  # descriptions after which a campaign prints how far it is
VALUES = [
    "",
    "0",
    "-1",
    "1e30",
    ".nan",
    ".inf",
    "[]",
    "{}",
    "~",
    "on",
    "'",
    "1 rpm",
    "-5 degC",
    "3 MPa",
    "[1, 2]",
    "a b",
    "\u00e9",
    "*x",
]
NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
WORD = re.compile(r"[A-Za-z_]\w*")


def other_number(lines, draw):
    """Changes a number that is no part of a comment or a source, so that most descriptions stay rigs in form."""
    k = draw.choice([k for k, line in enumerate(lines) if NUMBER.search(line.partition("#")[0].partition('"')[0])])
    head, quote, source = lines[k].partition('"')
    one = draw.choice(list(NUMBER.finditer(head)))
    value = float(one[0])
    other = draw.choice((0.0, -value, 10.0 * value, 0.1 * value, 1e3 * value, 1e-3 * value, value + 1.0, 1.3 * value))
    text = str(int(other)) if other.is_integer() else f"{other:g}"
    lines[k] = head[: one.start()] + text + head[one.end() :] + quote + source


def changed(text, draw):
    """Returns a description with one to three random changes."""
    lines = text.splitlines()
    if draw.randrange(2):
        for _ in range(draw.randint(1, 2)):
            other_number(lines, draw)
        return "\n".join(lines) + "\n"
    for _ in range(draw.randint(1, 3)):
        k = draw.randrange(len(lines))
        how = draw.randrange(7)
        if how == 0:
            del lines[k]
        elif how == 1:
            lines.insert(draw.randrange(len(lines)), lines[k])
        elif how == 2:
            lines[k] = draw.choice(("  ", " ", "\t")) + lines[k]
        elif how == 3:
            head, sign, _ = lines[k].partition(":")
            lines[k] = f"{head}{sign} {draw.choice(VALUES)}"
        else:
            found = list((NUMBER if how == 4 else WORD).finditer(lines[k]))
            if found:
                one = draw.choice(found)
                other = draw.choice(VALUES) if how < 6 else draw.choice(WORD.findall(text))
                lines[k] = lines[k][: one.start()] + other + lines[k][one.end() :]
        lines = lines or [""]
    return "\n".join(lines) + "\n"


def numbers(value, where=""):
    """Yields place and value of every number within dataclasses, maps and lists."""
    if dataclasses.is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if hasattr(value, "items"):
        for key, one in value.items():
            yield from numbers(one, f"{where}.{key}")
    elif isinstance(value, (list, tuple, np.ndarray)):
        for one in value:
            yield from numbers(one, where)
    elif isinstance(value, (int, float)):
        yield where, float(value)


def sizes_of(part, values):
    """Yields what cannot be of a device by its type and values."""
    if part == "plate_pack":
        ring = (0.5 * values.inner_spline_diameter, values.inner_radius, values.outer_radius, 0.5 * values.outer_spline_diameter)
        if not (ring[0] < ring[1] + 1e-9 and ring[1] < ring[2] and ring[2] < ring[3] + 1e-9):
            yield f"radii {ring}"
        if values.surfaces not in range(1, 100):
            yield f"{values.surfaces} surfaces"
    if part == "combustion_engine":
        if not 0.0 <= values.speed_low < values.speed_peak < values.speed_high:
            yield "a curve whose speeds do not rise"
        if values.torque_peak < max(values.torque_low, values.torque_high):
            yield "a curve whose peak is none"
        if not values.stall_speed < values.firing_speed or not values.idle_speed < values.cut_speed:
            yield "an engine that cannot run"
    if part == "twisting_coupling" and not values.inner_diameter < values.outer_diameter:
        yield "a nut inside its screw"
    if (inertia := parts.part(part).inertia) and inertia(values) < 0.0:
        yield f"an inertia of {inertia(values)}"
    if part == "saw_chain" and inertia(values) <= 0.0:
        yield "a chain without mass"


def what_is_wrong(config):
    """Yields what no rig can be, of one that was taken."""
    structure = config.structure
    for place, value in numbers((dict(config.sections), config.kernel, config.alfa46, structure.plain())):
        if not math.isfinite(value):
            yield f"{place} is {value}"
    for name, setting in config.settings.items():
        value = config.value(name) if setting.kept and name != "wiring" else ""
        if not isinstance(value, (str, bool)):
            spans = zip(np.ravel(value), np.ravel(setting.low), np.ravel(setting.high))
            yield from (f"{name} is {one}" for one, low, high in spans if not low <= one <= high)
    for device in structure.devices:
        yield from (f"{device.name}: {text}" for text in sizes_of(device.part, config.values(device.name)))
    if round(SAMPLE / config.kernel.step) * config.kernel.step != pytest.approx(SAMPLE):
        yield f"a step of {config.kernel.step} s"
    names = [one.name for one in structure.transducers]
    if len(set(names)) != len(names) or not all(one.low < one.high for one in structure.transducers):
        yield "transducers"
    sets = [frozenset(gear.clutches) for gear in structure.gears]
    if len(set(sets)) != len(sets) or not set().union(*sets) <= {device.name for device in structure.devices}:
        yield "gears"
    if len(set(config.wiring)) != len(config.wiring) or not all(0 <= one < structure.outputs for one in config.wiring):
        yield f"outputs {config.wiring}"
    if structure.input and not all(1e-3 < abs(ratio) < 1e3 for ratio in config.transmission.ratios.values() if ratio is not None):
        yield "ratios"
    if not all(0.0 <= trip.limit < math.inf and 0.0 <= trip.delay <= 60.0 and trip.row() for trip in config.trips):
        yield "trips"
    if config_of_record(config.as_dict(), "here").as_dict() != config.as_dict():
        yield "a record that gives another rig"
    try:
        world = World(plan_of(config).plan)
    except RigError as error:
        yield f"no plan: {error}"
        return
    if not np.isfinite(world.numbers).all():
        yield "a plant whose numbers are not finite"
    Watched(config.trips, world, np.zeros(len(world.plan.channels)))


@pytest.mark.parametrize("rig", list(rig_folders()))
def test_nothing_is_wrong_with_an_installed_rig(rig):
    assert list(what_is_wrong(load_rig(rig))) == []


@pytest.mark.parametrize("count", [50, pytest.param(10_000, marks=pytest.mark.campaign)])
def test_a_description_that_is_nearly_a_rig_is_one_or_is_refused_in_a_sentence(tmp_path, count, soon_done, capsys):
    draw, refused, longest, wrong = random.Random(41), 0, 0.0, []
    folders = {}
    for name, folder in rig_folders().items():
        folders[name] = tmp_path / name
        shutil.copytree(folder, folders[name], ignore=shutil.ignore_patterns("*.py", "__pycache__", "validation.yaml"))
    texts = {name: (folder / "rig.yaml").read_text(encoding="utf-8") for name, folder in folders.items()}
    for number in range(count):
        name = draw.choice(sorted(folders))
        path = folders[name] / "rig.yaml"
        path.write_text(changed(texts[name], draw), encoding="utf-8")
        began = time.monotonic()
        try:
            with soon_done(HANGS):
                said = list(what_is_wrong(load_rig(folders[name])))
            if said:
                shutil.copy(path, kept := tmp_path.parent / f"rig_{number}.yaml")
                wrong.append(f"{kept} of {name} was taken: {'; '.join(said)}")
        except RigError as error:
            refused += 1
            if "\n" in str(error):
                wrong.append(f"{number}: more than a line: {error}")
        except Exception as error:
            kept = tmp_path.parent / f"rig_{number}.yaml"
            shutil.copy(path, kept)
            wrong.append(f"{kept} of {name}: {type(error).__name__}: {error}")
        path.write_text(texts[name], encoding="utf-8")
        longest = max(longest, time.monotonic() - began)
        if (number + 1) % TOLD == 0:
            with capsys.disabled():
                print(f"\n{number + 1} descriptions: {refused} refused, {len(wrong)} wrong; longest {longest:.2f} s", end="")
    assert not wrong, "\n".join(wrong[:20])


def test_a_description_that_hangs_would_be_found(soon_done):
    with pytest.raises(pytest.fail.Exception, match="it hangs"), soon_done(0.02):
        threading.Event().wait(60.0)
