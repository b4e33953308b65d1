# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The host of a controller FMU, in the FMU's own process: it takes samples from the plug (fmu.py) and answers until the end."""

from __future__ import annotations

import json
import os
import socket
import struct

from ...base import RigError
from ..own_signals import MOST, NAME
from ..seam import Status, shortened
from .importer import Fmu, FmuFailed
from .plug import ANSWER, SAMPLE

FRAME = 1 << 20  # longest message
DONE = b"done "  # as in hosted.py
LEVELS = ("duty", "current")
UNITS = {"A": ("current", 1.0), "mA": ("current", 1e-3), "1": ("duty", 1.0), "-": ("duty", 1.0), "%": ("duty", 0.01)}
NUMBER_TYPES = ("Real", "Float64", "Float32", "Integer", "Int32", "Enumeration", "Boolean")
STATUS = {"discard": Status.DISCARD, "error": Status.ERROR, "fatal": Status.FATAL}


class Names:
    """The variables of the seam for a rig's record, sorted by their use."""

    def __init__(self, outputs: int, transducers: list[str], known: list[str], valves: list[int], record: int, rig: str) -> None:
        """Take the record's parts.

        Parameters
        ----------
        outputs : int
            Number of outputs.
        transducers : list of str
            Transducers of the record.
        known : list of str
            All transducers of the rig.
        valves : list of int
            Numbers of the outputs that drive a valve; the FMU must have their commands.
        record : int
            The record's number.
        rig : str
            The rig's name.
        """
        self.known, self.record, self.rig = set(known), record, rig
        numbers = range(1, outputs + 1)
        self.commands, self.setpoints = [f"command_{k}" for k in numbers], [f"setpoint_{k}" for k in numbers]
        self.inputs = ["gear_request", *(f"current_{k}" for k in numbers), *transducers]
        self.outputs = [*self.commands, *self.setpoints, "gear", "shifting", "flags", "status"]
        self.needed = ["gear_request", *(f"command_{k}" for k in valves), "gear", "shifting"]
        self.sample = struct.Struct(SAMPLE.format(outputs + len(transducers)))
        self.answer = struct.Struct(ANSWER.format(2 * outputs))


def check_variables(fmu: Fmu, names: Names) -> list[str]:
    """Return the seam's inputs that the FMU has.

    Parameters
    ----------
    fmu : Fmu
        The FMU.
    names : Names
        The variables of the seam.

    Returns
    -------
    list of str
        Names of the inputs.

    Raises
    ------
    RigError
        When a variable is missing, is an array or has the wrong causality, or the FMU was made for the record of another rig.
    """
    there = fmu.variables
    if "rig_record" in there and there["rig_record"].start != str(names.record):
        raise RigError(
            "the FMU was made for the record of another rig; make it anew with ./rig export controller-fmu FILE.c "
            f"--rig {names.rig}"
        )
    for name in (*names.inputs, *names.outputs):
        if name in fmu.arrays:
            raise RigError(f"the FMU's variable {name} is an array, expected a single number")
    for name in names.needed:
        if name not in there:
            raise RigError(f"the FMU has no variable {name}; it has {', '.join(there)}")
    for wanted, known in (("input", names.inputs), ("output", names.outputs)):
        for name in known:
            if name in there and there[name].causality != wanted:
                raise RigError(f"the FMU's variable {name} has causality {there[name].causality}, expected {wanted}")
    return [name for name in names.inputs if name in there]


def wants_of(fmu: Fmu, names: Names) -> list[str]:
    """Return further transducers: the FMU's other inputs that have the name of a transducer."""
    return [name for name, v in fmu.variables.items() if v.causality == "input" and name in names.known - set(names.inputs)]


def signals_of(fmu: Fmu, names: Names) -> dict[str, str]:
    """Return the FMU's own signals, which are recorded: unit by name of its first 64 other outputs that are numbers."""
    own = [
        name
        for name, v in fmu.variables.items()
        if v.causality == "output" and name not in names.outputs and v.type in NUMBER_TYPES and NAME.fullmatch(name)
    ]
    return {name: fmu.variables[name].unit or "-" for name in own[:MOST]}


def settings_of(fmu: Fmu) -> dict[str, float]:
    """Return the FMU's own settings: start value by name of its first 64 tunable parameters that are numbers."""
    names = [
        name
        for name, v in fmu.variables.items()
        if v.causality == "parameter"
        and v.variability == "tunable"
        and v.type in ("Real", "Float64", "Float32")
        and v.start is not None
        and NAME.fullmatch(name)
    ]
    return {name: float(fmu.variables[name].start) for name in names[:MOST]}


def meaning_of(fmu: Fmu, name: str) -> tuple[str, float]:
    """Return level and factor by the unit of an output.

    Parameters
    ----------
    fmu : Fmu
        The FMU.
    name : str
        Name of the output.

    Returns
    -------
    tuple
        (level, factor): "current", "duty", or empty without a unit; the factor to A or to 1.

    Raises
    ------
    RigError
        When the unit is neither of a current nor of a share.
    """
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


def levels_of(fmu: Fmu, names: Names) -> tuple[list[str], str]:
    """Return the levels at which the FMU works and where they come from.

    Parameters
    ----------
    fmu : Fmu
        The FMU.
    names : Names
        The variables of the seam.

    Returns
    -------
    tuple
        (levels, source): the levels, the likelier one first; the source in words is the parameter level, else the unit of
        the commands, and empty when neither gives it.

    Raises
    ------
    RigError
        When the units of the commands do not agree, or the parameter level is wrong.
    """
    commands = [name for name in names.commands if name in fmu.variables]
    level_of = {name: meaning_of(fmu, name)[0] for name in commands}
    if len(set(level_of.values())) > 1:
        found = ", ".join(f"{name} {f'at level {level}' if level else 'without one'}" for name, level in level_of.items())
        raise RigError(f"the units of the FMU's commands do not agree: {found}")
    level = fmu.variables.get("level")
    if level is None:
        (by_unit,) = set(level_of.values())
        if not by_unit:
            return list(LEVELS), ""
        return [by_unit], "the unit of its commands"
    try:
        low, high, preferred = (
            default if text is None else int(float(text)) for text, default in ((level.min, 0), (level.max, 1), (level.start, 0))
        )
    except ValueError:
        raise RigError("the min, max and start of the FMU's parameter level are not all numbers") from None
    known = [name for k, name in enumerate(LEVELS) if low <= k <= high]
    if not known:
        raise RigError(f"the FMU's parameter level goes from {low} to {high}; expected 0 (duty), 1 (current) or both")
    return sorted(known, key=lambda name: LEVELS.index(name) != preferred), "its parameter level"


def start_values(fmu: Fmu, level: str, parameters: dict[str, float]) -> dict[str, float]:
    """Return the parameters of the FMU that the rig sets.

    Parameters
    ----------
    fmu : Fmu
        The FMU.
    level : str
        "duty" or "current".
    parameters : dict of str to float
        The rig's settings as flat names [SI].

    Returns
    -------
    dict of str to float
        The level and those settings that the FMU has as parameters, by name.
    """
    given = {**parameters, "level": LEVELS.index(level)}
    return {name: value for name, value in given.items() if name in fmu.variables and fmu.variables[name].causality == "parameter"}


def answer_samples(link: socket.socket, fmu: Fmu, names: Names, period: float, settings: list[str]) -> bool:
    """Make one communication step for each sample until the rig sends the end.

    Parameters
    ----------
    link : socket
        The link to the plug.
    fmu : Fmu
        The initialised FMU.
    names : Names
        The variables of the seam.
    period : float
        Time between samples [s].
    settings : list of str
        Names of the settings whose values come with each sample.

    Returns
    -------
    bool
        True when the FMU may be terminated, False after an error.

    Raises
    ------
    OSError
        When the link is lost.
    """
    inputs = check_variables(fmu, names)
    write, places = fmu.writer(inputs), [names.inputs.index(name) for name in inputs]
    outputs = [name for name in names.outputs if name in fmu.variables]
    read, first, done, good = fmu.reader(outputs), None, 0, True
    this = os.getpid()
    wants, signals = wants_of(fmu, names), list(signals_of(fmu, names))
    write_others, read_own, write_settings = fmu.writer(wants), fmu.reader(signals), fmu.writer(settings)
    others, own, tuned = (struct.Struct(f"<{len(own)}d") for own in (wants, signals, settings))
    newest = tuple(settings_of(fmu)[name] for name in settings)  # the values in the FMU
    factors = {name: meaning_of(fmu, name)[1] for name in (*names.commands, *names.setpoints) if name in outputs}
    while len(data := link.recv(FRAME)) >= names.sample.size:
        sample, request, *values = names.sample.unpack_from(data)
        given = [request, *values]
        first = sample if first is None else first
        fmu.forget()
        try:
            write([given[k] for k in places])
            write_others(others.unpack_from(data, names.sample.size))
            now = tuned.unpack_from(data, names.sample.size + others.size)
            if now != newest:
                write_settings(now)
                newest = now
            while done <= sample - first:  # samples that did not come are stepped over with the present inputs
                fmu.step(done * period, period)
                done += 1
            found = dict(zip(outputs, read(), strict=True))
            own_values = own.pack(*read_own())
        except FmuFailed as failure:
            status = STATUS.get(failure.status, Status.ERROR)
            good = status == Status.DISCARD
            text = shortened(str(failure)).encode("utf-8", "replace")
            link.send(names.answer.pack(sample, status, 0, 0, 0, *[0.0] * 2 * len(names.commands)) + text)
            continue
        if os.getpid() != this:
            os._exit(0)  # a copy that the FMU has forked; the FMU itself answers
        command, setpoint = (
            [factors[name] * found[name] if name in found else 0.0 for name in one] for one in (names.commands, names.setpoints)
        )
        status, gear, shifting, flags = (found.get(name, 0) for name in ("status", "gear", "shifting", "flags"))
        if status == Status.DISCARD:
            own_values = shortened(fmu.newest_message()).encode("utf-8", "replace")
        link.send(names.answer.pack(sample, status, gear, shifting, flags, *command, *setpoint) + own_values)
    if not data:
        raise OSError("the line to the rig is closed")
    return good


def serve(link: socket.socket, file: str, folder: str, message_descriptor: str, record: str) -> None:
    """Do everything from the FMU's loading to its end.

    Parameters
    ----------
    link : socket
        The link to the plug.
    file : str
        The FMU.
    folder : str
        Where it is unpacked.
    message_descriptor : str
        Descriptor of the file for the FMU's newest message.
    record : str
        Arguments of Names as JSON.

    Raises
    ------
    OSError
        When the link is lost.
    """

    def keep(text: str) -> None:  # the rig reads it there when the FMU has crashed
        os.ftruncate(int(message_descriptor), 0)
        os.pwrite(int(message_descriptor), text.encode("utf-8", "replace"), 0)

    names = Names(**json.loads(record))
    try:
        fmu = Fmu(file, "controller", keep, folder)
        try:
            order = _described(link, fmu, names)
        except BaseException:
            fmu.close()
            raise
    except RigError as error:
        link.send(json.dumps({"error": shortened(str(error).removeprefix(f"{file}: "))}).encode())
        return
    link.send(b"{}")
    good = answer_samples(link, fmu, names, order["period"], order["settings"])
    fault = ""
    if good:
        try:
            fmu.terminate()
        except RigError as error:
            fault = shortened(f"terminate failed: {error}")
    link.send(DONE + fault.encode("utf-8", "replace"))
    fmu.close()
    link.send(DONE)


def _described(link: socket.socket, fmu: Fmu, names: Names) -> dict:
    """Describe the FMU to the plug, initialize it, and return the plug's order; RigError when the FMU cannot be used."""
    check_variables(fmu, names)
    levels, level_from = levels_of(fmu, names)
    about = {
        "levels": levels,
        "level_from": level_from,
        "wants": wants_of(fmu, names),
        "signals": signals_of(fmu, names),
        "settings": settings_of(fmu),
        "process": os.getpid(),
    }
    link.send(json.dumps(about).encode())
    start = link.recv(FRAME)
    if not start:
        raise OSError("the line to the rig is closed")
    order = json.loads(start)
    fmu.initialize(**start_values(fmu, order["level"], order["parameters"]))
    return order
