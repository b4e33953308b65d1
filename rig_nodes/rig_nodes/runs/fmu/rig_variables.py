# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The variables of the rig as an FMU, and how their values reach a rig and come from it.

runs.fmu.build, which writes them into modelDescription.xml, and runs.fmu.rig_process use it. The order gives the value references.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base import NOT_WRITTEN, SI, SWITCH
from ...controllers import record_of
from ...plant import part as parts
from ...rig import CONTROLLER_COMMAND, FAULTS_APART, RigConfig, Setpoint, Setting, cross_check
from ..rig import Rig
from ..topics import Readings, States
from .description import Variable

# units of the configuration as FMI writes them
UNITS = {
    "-": "1",
    "Nm": "N.m",
    "1/Nm": "1/(N.m)",
    "kg m2": "kg.m2",
    "Nm s/rad": "N.m.s/rad",
    "Nm/rad": "N.m/rad",
    "N s/m": "N.s/m",
    "Pa s": "Pa.s",
    "Pa s/m3": "Pa.s/m3",
    "V/(A s)": "V/(A.s)",
}
CONTROLLERS = ("embedded", "duty", "current")  # values of the parameter controller
FAULT = "fault"  # input that takes orders of faults


def rig_variables(config: RigConfig) -> list[Variable]:
    """Return all variables: parameters, inputs, outputs."""
    parameters = _parameters(config)
    return [*parameters, *_inputs(config), *_outputs(config, [v.name for v in parameters])]


def _parameters(config: RigConfig) -> list[Variable]:
    out = [Variable("seed", "integer", "parameter", "Seed of the transducers' noise and errors", 1, low=0, high=2**31 - 1)]
    if config.structure.shifts:
        out.append(
            Variable(
                "controller",
                "integer",
                "parameter",
                "0: the embedded Alfa46 shifts, by gear_request; 1: command_1 to "
                "_3 are duties of the coils; 2: they are current setpoints [A]",
                0,
                low=0,
                high=2,
            )
        )
    out.append(Variable("record", "string", "parameter", "Folder for the rig's bag and report; none is recorded when empty", ""))
    for one in _settings(config):
        value = config.value(one.name)
        if one.dimension == SWITCH:
            out.append(Variable(one.name, "boolean", "parameter", one.text, bool(value), tunable=one.live))
        else:
            unit = UNITS.get(written := SI.get(one.dimension) or NOT_WRITTEN[one.dimension], written)
            out.append(
                Variable(one.name, "real", "parameter", one.text, float(value), unit, low=one.low, high=one.high, tunable=one.live)
            )
    return out


def _settings(config: RigConfig) -> list[Setting]:
    """Return what an importer sets before the rig runs: all kept settings except words, the kernel's and those of cut devices."""
    return [
        one for one in config.settings.kept() if (one.is_number or one.dimension == SWITCH) and one.owner not in ("kernel", "cut")
    ]


def _inputs(config: RigConfig) -> list[Variable]:
    out = []
    for one in config.settings.steps.values():
        setpoint, signal = one.setpoint, config.catalogue.signals[one.setpoint.like]
        out += [
            Variable(
                setpoint.name, "real", "input", one.text, 0.0, signal.unit, (signal.display_unit, signal.scale), one.low, one.high
            ),
            Variable(enable_of(setpoint), "boolean", "input", f"{one.text}: on", False),
        ]
    if config.structure.shifts:
        out += _controller_inputs(config)
    if config.faults is not None:
        # a string, because an order is a text everywhere; FMPy and libcosim set strings between steps, and a tool that has no
        # strings takes an FMU that was made without faults
        text = f"Orders of faults and of their ends, {FAULTS_APART} between two, taken by the next step when the text has changed"
        out.append(Variable(FAULT, "string", "input", text, ""))
    return out


def _controller_inputs(config: RigConfig) -> list[Variable]:
    """Return the gear that is ordered, and the answer of a controller that the importer runs."""
    record = record_of(config)
    outputs, highest = len(record.outputs), max(record.gear_names)
    gear_request = Variable(
        "gear_request",
        "integer",
        "input",
        f"Gear ordered of the embedded Alfa46: {record.gears_text}; one that comes while a shift runs is taken at its end",
        0,
        low=0,
        high=highest,
    )
    commands = [
        Variable(
            f"command_{k}",
            "real",
            "input",
            f"Command of controller output {k}: duty 0 to 1, or current setpoint "
            f"0 to {config.alfa46.values.current_limit:g} A, depending on the parameter controller",
            0.0,
        )
        for k in range(1, outputs + 1)
    ]
    return [
        gear_request,
        *commands,
        Variable("command_gear", "integer", "input", "Gear that your controller has taken", 0, low=0, high=highest),
        Variable("command_shifting", "boolean", "input", "Your controller's shift is still running", False),
        Variable(
            "command_flags",
            "integer",
            "input",
            "Bit k: at controller = 2, output k stays on at a setpoint of zero",
            0,
            low=0,
            high=2**outputs - 1,
        ),
    ]


def enable_of(setpoint: Setpoint) -> str:
    """Return the name of a setpoint's switch."""
    return f"{setpoint.step}_enable"


def _outputs(config: RigConfig, parameters: Sequence[str]) -> list[Variable]:
    """Return the outputs; the rig begins at rest, so that only transducers and the oil's temperature depend on parameters."""
    out, known = [], config.catalogue
    oils = {f"{one.name}.oil_temperature": f"{one.name}.temperature" for one in config.structure.of_role(parts.OIL)}
    temperature = {one.name: (oils[one.shows],) for one in config.structure.transducers if one.shows in oils}
    transducers = tuple(name for name in parameters if name in ("seed", "effects.transducers") or name.startswith("instruments."))
    for signal in known.signals.values():
        by = (*transducers, *temperature.get(signal.name, ())) if signal.topic in known.measured() else ()
        states = ", ".join(f"{key} {word}" for key, word in signal.states.items())
        text = f"{signal.text} {f'({states})' if states else signal.sign}"
        if signal.quantity == "state":
            words = tuple((int(key), word) for key, word in signal.states.items())
            out.append(Variable(signal.name, "integer", "output", text, words=words))
        else:
            out.append(
                Variable(
                    signal.name,
                    "real",
                    "output",
                    text,
                    unit=UNITS.get(signal.unit, signal.unit),
                    display=(signal.display_unit, signal.scale),
                    initial_by=by,
                )
            )
    for name in known.measured().values():
        signal = known.signals[name]
        out.append(
            Variable(
                f"true.{name}",
                "real",
                "output",
                f"{signal.text} Without the transducer.",
                unit=signal.unit,
                display=(signal.display_unit, signal.scale),
                initial_by=temperature.get(name, ()),
            )
        )
    if config.structure.shifts:
        out += [
            Variable(
                f"current_{k}",
                "real",
                "output",
                f"Measured coil current at controller output {k}",
                unit="A",
                initial_by=transducers,
            )
            for k in range(1, len(record_of(config).outputs) + 1)
        ]
        out.append(Variable("shifting", "boolean", "output", "A profile of the controller runs"))
    return [
        *out,
        Variable("sample", "integer", "output", "Controller samples of 1 ms since the start"),
        Variable("reason", "string", "output", "Why the rig tripped; empty while it has not"),
    ]


class Values:
    """The values of an FMU's variables by name, over the two blocks in which they are sent.

    ``numbers`` (variables,) holds, for a string, the number of its text in ``texts``.

    Parameters
    ----------
    variables : sequence of Variable
        The FMU's variables.
    """

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.variables = list(variables)
        self.place = {v.name: k for k, v in enumerate(self.variables)}
        self.strings = [v.name for v in self.variables if v.type == "string"]
        self.numbers = np.zeros(len(self.variables))
        self.texts = [""] * len(self.strings)

    def __getitem__(self, name: str) -> float:
        return float(self.numbers[self.place[name]])

    def text(self, name: str) -> str:
        """Return the text of a variable of type string."""
        return self.texts[self.strings.index(name)]

    def set_text(self, name: str, text: str) -> None:
        """Set the text of a variable of type string."""
        self.texts[self.strings.index(name)] = text


def with_parameters(config: RigConfig, values: Values) -> RigConfig:
    """Return the rig with the parameters that differ changed.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    values : Values
        The FMU's values.

    Returns
    -------
    RigConfig
        The changed configuration.

    Raises
    ------
    RigError
        When a parameter is out of its range.
    """
    changed = {}
    for one in _settings(config):
        value = values[one.name]
        if one.dimension == SWITCH:
            value = value != 0.0
        else:
            one.check(value)
        if value != config.value(one.name):
            changed[one.name] = value
    config = config.with_values(changed)
    cross_check(config, lambda keys: "parameter ")
    return config


class Tunables:
    """The parameters that may change between steps; their first values are those with which the rig was made."""

    def __init__(self, config: RigConfig, values: Values) -> None:
        self._values, self._settings = values, [one for one in _settings(config) if one.live]
        self._places = [values.place[one.name] for one in self._settings]
        self._given = values.numbers[self._places]

    def give(self, rig: Rig) -> list[tuple[Setting, float]]:
        """Set the parameters that have changed.

        Parameters
        ----------
        rig : Rig
            The rig.

        Returns
        -------
        list of (Setting, float)
            The changed settings and their new values [SI].

        Raises
        ------
        RigError
            When a value is refused.
        """
        now = self._values.numbers[self._places]
        changed = [(self._settings[k], float(now[k])) for k in np.flatnonzero(now != self._given)]
        for setting, value in changed:
            rig.set_value(setting.name, value != 0.0 if setting.dimension == SWITCH else value)
        self._given = now
        return changed


class Reader:
    """Fills the outputs of ``values`` from the present state of a rig."""

    def __init__(self, rig: Rig, values: Values) -> None:
        self.rig, self.values = rig, values
        known = rig.config.catalogue
        self._states, self._readings, signals = States(rig), Readings(known), known.signals
        first = values.place[next(iter(signals))]
        measured = self._states.measured
        self._measured = [(first + k, measured[s.topic]) for k, s in enumerate(signals.values()) if s.topic in measured]
        self._others = [(first + k, name) for k, (name, s) in enumerate(signals.items()) if s.topic not in measured]
        self._true = [
            (values.place[f"true.{name}"], rig.world.source[rig.channels.index(name)]) for name in known.measured().values()
        ]
        self._currents = values.place["current_1"] if rig.shifts else None

    def read(self) -> None:
        """Read all outputs."""
        rig, numbers, fields = self.rig, self.values.numbers, self._readings.fields
        row = rig.row()
        for place, column in self._measured:
            numbers[place] = row[column]
        self._states.refresh()
        for topic, newest in self._states.topics.items():
            fields[topic] = newest()
        if rig.shifts:
            fields[CONTROLLER_COMMAND] = self._states.command() if rig.level else (0, 0, False, 0, 0, rig.duty, rig.setpoint)
        for place, name in self._others:
            numbers[place] = self._readings.reading(name)
        for place, true in self._true:
            numbers[place] = rig.world.numbers[true]
        if self._currents is not None:
            currents = rig.coil_currents()
            numbers[self._currents : self._currents + len(currents)] = currents
            numbers[self.values.place["shifting"]] = rig.shifting
        numbers[self.values.place["sample"]] = rig.sample
        self.values.set_text("reason", rig.reason)
