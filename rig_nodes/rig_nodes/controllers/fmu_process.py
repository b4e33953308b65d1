# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The process in which a controller FMU runs: samples of the plug (fmu.py) in, answers out, until its link closes."""

from __future__ import annotations

import contextlib
import ctypes as ct
import json
import os
import signal
import socket
import struct
import sys

from ..catalogue import catalogue
from ..errors import RigError
from ..fmu.importer import Fmu, FmuFailed
from .fmu import ANSWER, SAMPLE
from .own_signals import MOST, NAME
from .seam import OUTPUTS, Status

FRAME = 1 << 20  # longest message
PR_SET_PDEATHSIG = 1
NUMBERS = range(1, OUTPUTS + 1)
COMMANDS, SETPOINTS = [f"command_{k}" for k in NUMBERS], [f"setpoint_{k}" for k in NUMBERS]
INPUTS = ["gear_request", *(f"current_{k}" for k in NUMBERS), "n_wej", "n_wyj", "p1", "p2"]
OUTPUT_NAMES = [*COMMANDS, *SETPOINTS, "gear", "shifting", "flags", "status"]
LEVELS = ("duty", "current")
UNITS = {"A": ("current", 1.0), "mA": ("current", 1e-3), "1": ("duty", 1.0), "-": ("duty", 1.0), "%": ("duty", 0.01)}
NUMBER_TYPES = ("Real", "Float64", "Float32", "Integer", "Int32", "Enumeration", "Boolean")
STATUS = {"discard": Status.DISCARD, "error": Status.ERROR, "fatal": Status.FATAL}


def check_variables(fmu: Fmu) -> list[str]:
    """The seam's inputs that the FMU has; RigError when a variable lacks or has the wrong causality."""
    there = fmu.variables
    for name in ("gear_request", "command_1", "command_2", "gear", "shifting"):
        if name not in there:
            raise RigError(f"the FMU has no variable {name}; it has {', '.join(there)}")
    for wanted, names in (("input", INPUTS), ("output", OUTPUT_NAMES)):
        for name in names:
            if name in there and there[name].causality != wanted:
                raise RigError(f"the FMU's variable {name} has causality {there[name].causality}, expected {wanted}")
    return [name for name in INPUTS if name in there]


def wants_of(fmu: Fmu) -> list[str]:
    """Further transducers: the FMU's other inputs that are named like one."""
    known = {signal.name for signal in catalogue().signals.values() if signal.field == "value"}
    return [name for name, v in fmu.variables.items() if v.causality == "input" and name in known - set(INPUTS)]


def signals_of(fmu: Fmu) -> dict[str, str]:
    """Its own signals, to be recorded: unit by name of its other outputs that are numbers, the first ones."""
    names = [name for name, v in fmu.variables.items() if v.causality == "output" and name not in OUTPUT_NAMES
             and v.type in NUMBER_TYPES and NAME.fullmatch(name)]
    return {name: fmu.variables[name].unit or "-" for name in names[:MOST]}


def settings_of(fmu: Fmu) -> dict[str, float]:
    """Its own settings: start value by name of its tunable parameters that are numbers, the first ones."""
    names = [name for name, v in fmu.variables.items() if v.causality == "parameter" and v.variability == "tunable"
             and v.type in ("Real", "Float64", "Float32") and v.start is not None and NAME.fullmatch(name)]
    return {name: float(fmu.variables[name].start) for name in names[:MOST]}


def meaning_of(fmu: Fmu, name: str) -> tuple[str, float]:
    """What the unit of an output says: the level, empty where there is no unit, and the factor to A or to 1."""
    variable = fmu.variables[name]
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    if not unit:
        return "", 1.0
    if unit in UNITS:
        return UNITS[unit]
    base = next((known.baseUnit for known in fmu.description.unitDefinitions if known.name == unit), None)
    if base is not None:
        exponents = {key: int(getattr(base, key)) for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        used = {key: power for key, power in exponents.items() if power}
        if used in ({}, {"A": 1}) and float(base.offset) == 0.0:
            return "current" if used else "duty", float(base.factor)
    raise RigError(f"the FMU's output {name} is in {unit}; expected A (level current), or 1 or % (level duty)")


def levels_of(fmu: Fmu) -> tuple[list[str], str]:
    """The levels that the FMU knows, the likelier one first, and what of it says so: its parameter level, else the unit of
    its commands; empty where nothing does.
    """
    commands = [name for name in COMMANDS if name in fmu.variables]
    said = {name: meaning_of(fmu, name)[0] for name in commands}
    if len(set(said.values())) > 1:
        found = ", ".join(f"{name} {f'at level {level}' if level else 'without one'}" for name, level in said.items())
        raise RigError(f"the units of the FMU's commands do not agree: {found}")
    level = fmu.variables.get("level")
    if level is None:
        (by_unit,) = set(said.values())
        if not by_unit:
            return list(LEVELS), ""
        return [by_unit], "the unit of its commands"
    try:
        low, high, preferred = (default if text is None else int(float(text))
                                for text, default in ((level.min, 0), (level.max, 1), (level.start, 0)))
    except ValueError:
        raise RigError("the min, max and start of the FMU's parameter level are not all numbers") from None
    known = [name for k, name in enumerate(LEVELS) if low <= k <= high]
    if not known:
        raise RigError(f"the FMU's parameter level goes from {low} to {high}; expected 0 (duty), 1 (current) or both")
    return sorted(known, key=lambda name: LEVELS.index(name) != preferred), "its parameter level"


def start_values(fmu: Fmu, level: str, parameters: dict[str, float]) -> dict[str, float]:
    """The rig's settings and the level, of those that the FMU has as parameters."""
    given = {**parameters, "level": LEVELS.index(level)}
    return {name: value for name, value in given.items()
            if name in fmu.variables and fmu.variables[name].causality == "parameter"}


def answer_samples(link: socket.socket, fmu: Fmu, period: float, settings: list[str]) -> None:
    """One communication step for each sample, until the link closes. settings: names of those that come with it."""
    inputs = check_variables(fmu)
    write, places = fmu.writer(inputs), [INPUTS.index(name) for name in inputs]
    told = [name for name in OUTPUT_NAMES if name in fmu.variables]
    read, first, done = fmu.reader(told), None, 0
    wants, signals = wants_of(fmu), list(signals_of(fmu))
    write_others, read_own, write_settings = fmu.writer(wants), fmu.reader(signals), fmu.writer(settings)
    others, own, tuned = (struct.Struct(f"<{len(names)}d") for names in (wants, signals, settings))
    newest = tuple(settings_of(fmu)[name] for name in settings)  # as the FMU has them
    factors = {name: meaning_of(fmu, name)[1] for name in (*COMMANDS, *SETPOINTS) if name in told}
    while data := link.recv(FRAME):
        sample, request, *values = SAMPLE.unpack_from(data)
        given = [request, *values]
        first = sample if first is None else first
        fmu.forget()
        try:
            write([given[k] for k in places])
            write_others(others.unpack_from(data, SAMPLE.size))
            now = tuned.unpack_from(data, SAMPLE.size + others.size)
            if now != newest:
                write_settings(now)
                newest = now
            while done <= sample - first:  # samples that did not come are stepped over with what is known now
                fmu.step(done * period, period)
                done += 1
            found = dict(zip(told, read(), strict=True))
            own_values = own.pack(*read_own())
        except FmuFailed as failure:
            status = STATUS.get(failure.status, Status.ERROR)
            link.send(ANSWER.pack(status, 0, 0, 0, *[0.0] * 6) + str(failure).encode())
            continue
        command, setpoint = ([factors[name] * found[name] if name in found else 0.0 for name in names]
                             for names in (COMMANDS, SETPOINTS))
        gear, shifting, flags = (max(0, int(found.get(name, 0))) for name in ("gear", "shifting", "flags"))
        status = Status.DISCARD if found.get("status") == Status.DISCARD else Status.OK
        link.send(ANSWER.pack(status, gear, shifting, flags, *command, *setpoint) + own_values)


def main() -> int:
    """Arguments: the FMU's file, the descriptors of the socket and of the file for its newest message, the rig's process."""
    file, (descriptor, said, parent) = sys.argv[1], map(int, sys.argv[2:])
    # an FMU that computes without end must not outlive the rig
    ct.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        return 1
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # a person's Ctrl-C is the rig's to obey: it ends this process in order
    with socket.socket(fileno=descriptor) as link, contextlib.suppress(BrokenPipeError, ConnectionResetError):
        try:
            serve(link, file, said)
        except RigError as error:
            link.send(json.dumps({"error": str(error).removeprefix(f"{file}: ")}).encode())
    return 0


def serve(link: socket.socket, file: str, said: int) -> None:
    """Everything from the FMU's loading to its end; RigError before the first sample."""
    def keep(text: str) -> None:  # where the rig finds it when the FMU crashes
        os.ftruncate(said, 0)
        os.pwrite(said, text.encode(), 0)

    with Fmu(file, "controller", keep) as fmu:
        check_variables(fmu)
        levels, level_from = levels_of(fmu)
        link.send(json.dumps({"levels": levels, "level_from": level_from, "wants": wants_of(fmu), "signals": signals_of(fmu),
                              "settings": settings_of(fmu)}).encode())
        start = link.recv(FRAME)
        if not start:
            return
        order = json.loads(start)
        fmu.initialize(**start_values(fmu, order["level"], order["parameters"]))
        link.send(b"{}")
        answer_samples(link, fmu, order["period"], order["settings"])
        fmu.terminate()


if __name__ == "__main__":
    sys.exit(main())
