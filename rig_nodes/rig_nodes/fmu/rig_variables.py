# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The variables of the rig as an FMU: which there are, and how their values reach a rig and come from it.

Used by fmu.build, which writes them into modelDescription.xml, and by fmu.rig_process. Order is value reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from ..alfa46.settings import OUTPUT_KEYS, POINTS, Alfa46Config
from ..config.units import NOT_WRITTEN, SI
from ..controllers.record import record_of
from ..description.commands import Setpoint
from ..errors import RigError
from ..parts import part as parts
from ..testbench.configuration import RigConfig
from ..testbench.rig import Rig
from ..testbench.together import check_together
from ..testbench.topics import COMMAND, Heard, States
from .description import Variable

# units of the configuration as FMI writes them
UNITS = {"-": "1", "Nm": "N.m", "1/Nm": "1/(N.m)", "kg m2": "kg.m2", "Nm s/rad": "N.m.s/rad", "Nm/rad": "N.m/rad",
         "N s/m": "N.s/m", "Pa s": "Pa.s", "Pa s/m3": "Pa.s/m3", "V/(A s)": "V/(A.s)"}
CONTROLLERS = ("embedded", "duty", "current")  # values of the parameter controller


def rig_variables(config: RigConfig) -> list[Variable]:
    """All of them: parameters, inputs, outputs."""
    parameters = _parameters(config)
    return [*parameters, *_inputs(config), *_outputs(config, [v.name for v in parameters])]


def _parameters(config: RigConfig) -> list[Variable]:
    out = [Variable("seed", "integer", "parameter", "Seed of the transducers' noise and errors", 1, low=0, high=2**31 - 1),
           Variable("controller", "integer", "parameter", "0: the embedded Alfa46 shifts, by gear_request; 1: command_1 to "
                    "_3 are duties of the coils; 2: they are current setpoints [A]", 0, low=0, high=2),
           Variable("record", "string", "parameter", "Folder for the rig's bag and report; none is recorded when empty", "")]
    for name, (owner, field) in _fields(config).items():
        meta, value = field.metadata, getattr(owner, field.name)
        if meta["dimension"] == "switch":
            out.append(Variable(name, "boolean", "parameter", meta["text"], bool(value)))
        else:
            unit = SI.get(meta["dimension"]) or NOT_WRITTEN[meta["dimension"]]
            out.append(Variable(name, "real", "parameter", meta["text"], float(value),
                                UNITS.get(unit, unit), low=meta["low"], high=meta["high"]))
    for key, points in zip(OUTPUT_KEYS, config.alfa46.profiles, strict=True):
        for point, (time, current) in zip(POINTS, points, strict=True):
            name = f"alfa46.{key}.{point}"
            out += [Variable(f"{name}.time", "real", "parameter", f"Time of {point} in the profile of {key}", float(time), "s"),
                    Variable(f"{name}.current", "real", "parameter", f"Current of {point} in the profile of {key}",
                             float(current), "A")]
    return out


def _fields(config: RigConfig) -> dict:
    """Name as `--set` takes it -> (its part, field), of all values but words and the cutting of time."""
    known = {part: (config.values(part), names) for part, names in config.settings().items() if part not in ("kernel", "cut")}
    return {f"{part}.{field.name}": (owner, field) for part, (owner, names) in known.items() for field in fields(owner)
            if field.name in names and field.metadata["dimension"] != "choice"}


def _inputs(config: RigConfig) -> list[Variable]:
    out, record = [], record_of(config)
    outputs, highest = len(record.outputs), max(record.gear_names)
    for setpoint in config.setpoints.values():
        signal = config.catalogue.signals[setpoint.like]
        text = setpoint.command.text[0].upper() + setpoint.command.text[1:] + (", gauge" if signal.gauge else "")
        out += [Variable(setpoint.name, "real", "input", text, 0.0, signal.unit, (signal.display_unit, signal.scale), signal.low,
                         signal.high), Variable(enable_of(setpoint), "boolean", "input", f"{text}: on", False)]
    out.append(Variable("gear_request", "integer", "input", f"Gear ordered of the embedded Alfa46: {record.gears_told}; "
                        "one that comes while a shift runs is taken at its end", 0, low=0, high=highest))
    out += [Variable(f"command_{k}", "real", "input", f"Command of controller output {k}: duty 0 to 1, or current setpoint "
                     f"0 to {config.alfa46.values.current_limit:g} A, as the parameter controller says", 0.0)
            for k in range(1, outputs + 1)]
    return [*out, Variable("command_gear", "integer", "input", "Gear that your controller has taken", 0, low=0,
                           high=highest),
            Variable("command_shifting", "boolean", "input", "Your controller's shift is still running", False),
            Variable("command_flags", "integer", "input", "Bit k: at controller = 2, output k stays on at a setpoint of zero",
                     0, low=0, high=2**outputs - 1)]


def enable_of(setpoint: Setpoint) -> str:
    """The name of a setpoint's switch."""
    return f"{setpoint.step}_enable"


def _outputs(config: RigConfig, parameters: Sequence[str]) -> list[Variable]:
    """The rig begins at rest: only its transducers and the oil's temperature show parameters at the initialization."""
    out, outputs, known = [], len(record_of(config).outputs), config.catalogue
    oils = {f"{one.name}.oil_temperature": f"{one.name}.temperature" for one in config.structure.of_role(parts.OIL)}
    temperature = {one.name: (oils[one.shows],) for one in config.structure.transducers if one.shows in oils}
    transducers = tuple(name for name in parameters if name in ("seed", "effects.transducers")
                        or name.startswith("instruments."))
    for signal in known.signals.values():
        by = (*transducers, *temperature.get(signal.name, ())) if signal.topic in known.measured() else ()
        states = ", ".join(f"{key} {word}" for key, word in signal.states.items())
        text = f"{signal.text} {f'({states})' if states else signal.sign}"
        if signal.quantity == "state":
            words = tuple((int(key), word) for key, word in signal.states.items())
            out.append(Variable(signal.name, "integer", "output", text, words=words))
        else:
            out.append(Variable(signal.name, "real", "output", text, unit=UNITS.get(signal.unit, signal.unit),
                                display=(signal.display_unit, signal.scale), initial_by=by))
    for name in known.measured().values():
        signal = known.signals[name]
        out.append(Variable(f"true.{name}", "real", "output", f"{signal.text} Without the transducer.", unit=signal.unit,
                            display=(signal.display_unit, signal.scale),
                            initial_by=temperature.get(name, ())))
    currents = (Variable(f"current_{k}", "real", "output", f"Measured coil current at controller output {k}", unit="A",
                         initial_by=transducers)
                for k in range(1, outputs + 1))
    return [*out, *currents, Variable("shifting", "boolean", "output", "A profile of the controller runs"),
            Variable("sample", "integer", "output", "Controller samples of 1 ms since the start"),
            Variable("reason", "string", "output", "Why the rig tripped; empty while it has not")]


class Values:
    """The values of an FMU's variables by name, over the two blocks in which they travel.

    numbers (variables,): those of strings are the number of their text in ``texts``.
    """

    def __init__(self, variables: Sequence[Variable]):
        self.variables = list(variables)
        self.place = {v.name: k for k, v in enumerate(self.variables)}
        self.strings = [v.name for v in self.variables if v.type == "string"]
        self.numbers = np.zeros(len(self.variables))
        self.texts = [""] * len(self.strings)

    def __getitem__(self, name: str) -> float:
        return float(self.numbers[self.place[name]])

    def text(self, name: str) -> str:
        return self.texts[self.strings.index(name)]

    def set_text(self, name: str, text: str) -> None:
        self.texts[self.strings.index(name)] = text


def with_parameters(config: RigConfig, values: Values) -> RigConfig:
    """The rig with those parameters changed that differ; RigError for one out of its range."""
    changed: dict[str, dict] = {}
    for name, (owner, field) in _fields(config).items():
        value, meta = values[name], field.metadata
        if meta["dimension"] == "switch":
            value = value != 0.0
        elif not meta["low"] <= value <= meta["high"]:
            raise RigError(f"parameter {name} is {value:g}, expected {meta['low']:g} to {meta['high']:g} (SI)")
        if value != getattr(owner, field.name):
            part, _, key = name.partition(".")
            changed.setdefault(part, {})[key] = value
    profiles = np.array([[[values[f"alfa46.{key}.{point}.{what}"] for what in ("time", "current")] for point in POINTS]
                         for key in OUTPUT_KEYS])
    settings = replace(config.alfa46.values, **changed.pop("alfa46", {}))
    sections = {part: replace(config.values(part), **own) for part, own in changed.items()}
    config = config.replaced(alfa46=Alfa46Config(settings, profiles), **sections)
    check_together(config, lambda keys: "parameter ")
    return config


class Reader:
    """Fills the outputs of ``values`` from a rig as it is."""

    def __init__(self, rig: Rig, values: Values):
        self.rig, self.values = rig, values
        known = rig.config.catalogue
        self._states, self._heard, signals = States(rig), Heard(known), known.signals
        first = values.place[next(iter(signals))]
        measured = self._states.measured
        self._measured = [(first + k, measured[s.topic]) for k, s in enumerate(signals.values()) if s.topic in measured]
        self._others = [(first + k, name) for k, (name, s) in enumerate(signals.items()) if s.topic not in measured]
        self._true = [(values.place[f"true.{name}"], rig.world.source[rig.channels.index(name)])
                      for name in known.measured().values()]
        self._currents = values.place["current_1"]

    def read(self) -> None:
        rig, numbers, fields = self.rig, self.values.numbers, self._heard.fields
        row = rig.row()
        for place, column in self._measured:
            numbers[place] = row[column]
        self._states.refresh()
        for topic, told in self._states.topics.items():
            fields[topic] = told()
        fields[COMMAND] = self._states.command() if rig.level else (0, 0, False, 0, 0, rig.duty, rig.setpoint)
        for place, name in self._others:
            numbers[place] = self._heard.reading(name)
        for place, true in self._true:
            numbers[place] = rig.world.numbers[true]
        currents = rig.coil_currents()
        numbers[self._currents:self._currents + len(currents)] = currents
        numbers[self.values.place["shifting"]] = rig.shifting
        numbers[self.values.place["sample"]] = rig.sample
        self.values.set_text("reason", rig.reason)
