# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Test sequences: YAML steps with waits, end conditions, timeouts, repeats and a readiness gate.

This module reads and checks them; runs.sequence_runner runs them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis import NO_SEQUENCE
from ..base import (
    Map,
    RigError,
    brief,
    check_keys,
    dimension_of,
    find_of_rigs,
    load_yaml,
    quantity,
    rig_of,
    span,
    unknown,
    where_of,
    with_bases,
)
from ..plant import most_torque
from ..rig import CONTROLLER, DIMENSIONS, OWN, RigConfig, Setting, check_enabled, load_rig, read_fault
from .filled import LONGEST, Filled

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

KEYS = ("description", "rig", "parameters", "ready", "steps")  # of a sequence's file
DEFAULT_TIMEOUT = 30.0
LONGEST_TIME = 86_400.0  # s of one wait


@dataclass(frozen=True)
class Condition:
    """A condition that is met while the reading of a signal lies from low to high [SI]."""

    signal: str
    low: float
    high: float


@dataclass(frozen=True)
class Step:
    """One step: its kind, its SI values, the text for people, its place in the file, and the values of the loops around it."""

    kind: str
    text: str
    where: str
    value: float = 0.0
    enable: bool = True
    by_torque: bool = False
    hold: float = 0.0
    timeout: float = DEFAULT_TIMEOUT
    condition: Condition | None = None
    setting: str = ""
    fault: str = ""  # order of a fault
    loops: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Sequence:
    """A checked sequence.

    Parameters
    ----------
    name : str
        Name of the sequence.
    description : str
        One line of text about it.
    ready_timeout : float
        Time that the rig has to become ready [s].
    steps : list of Step
        The steps, with repeats written out.
    parameters : dict of str to (str or int)
        Parameters with the values that the steps were read with, as they are written.
    rig : str
        The rig for which the sequence was read; empty for orders by hand, which are read for none.
    """

    name: str
    description: str
    ready_timeout: float
    steps: list[Step] = field(default_factory=list)
    parameters: dict[str, str | int] = field(default_factory=dict)
    rig: str = ""

    def loops(self) -> list[dict]:
        """Return ``first`` and ``last`` number (from 1) of steps in the same turn of the loops around them, with its ``values``."""
        found = []
        for values, steps in groupby(enumerate(self.steps, 1), key=lambda one: one[1].loops):
            numbers = [number for number, _ in steps]
            found += [{"first": numbers[0], "last": numbers[-1], "values": values}] if values else []
        return found

    def check_rig(self, config: RigConfig) -> None:
        """Refuse a rig that lacks something that the sequence asks for, or that the sequence loads too much.

        Parameters
        ----------
        config : RigConfig
            The rig's configuration.

        Raises
        ------
        RigError
            With the place of the step, when the rig does not fit.
        """
        gears = config.transmission.names if config.structure.gears else {}
        for step in self.steps:
            if step.fault:
                check_enabled(config, f"{step.where}: fault refused")
                read_fault(config, step.fault, step.where)
            of_rig = (
                ("device", step.kind, config.settings.steps)
                if step.kind not in _OTHER_STEPS
                else ("signal", step.condition.signal, config.catalogue.signals)
                if step.condition is not None
                else ("gear", int(step.value), gears)
                if step.kind == "shift"
                else ("setting", step.setting, config.settings)
                if step.kind == "set" and not step.setting.startswith(f"{CONTROLLER}.{OWN}")
                else None
            )
            if of_rig is not None and of_rig[1] not in of_rig[2]:
                what, name, known = of_rig
                raise RigError(
                    f"sequence '{self.name}' is for a rig like {self.rig}, not for '{config.name}': {step.where}: "
                    f"{unknown(what, name, map(str, known))}; choose a rig like {self.rig}"
                )
            if step.by_torque:
                device = config.settings.steps[step.kind].setpoint.device
                if step.value > (most := most_torque(getattr(config, device))):
                    raise RigError(
                        f"{step.where}: {step.text}: the load pump holds at most {most:.4g} Nm, by its "
                        f"{device}.displacement and .pressure_limit"
                    )


BY_HAND = Sequence(NO_SEQUENCE, "ordered over ROS", 0.0)  # in the record of a run without a sequence of its own


def load_sequence(
    name: str | Path,
    values: dict[str, str] | None = None,
    rig: str | Path | None = None,
    default: str | None = None,
    config: RigConfig | None = None,
) -> Sequence:
    """Read a sequence by its name, from a rig or from the installed ones, or from a file.

    Parameters
    ----------
    name : str or Path
        Name of the sequence, or its file.
    values : dict of str to str, optional
        Values of its parameters in place of their defaults, e.g. {"speed": "1500 rpm"}.
    rig : str or Path, optional
        The rig on which it is to run; by default the one for which it is written.
    default : str, optional
        The rig of a sequence that names none; as for :func:`base.names.rig_of`.
    config : RigConfig, optional
        The configuration of ``rig``, when it is known; otherwise it is read.

    Returns
    -------
    Sequence
        The checked sequence.

    Raises
    ------
    RigError
        With file and line, when something is not right.
    """
    path = find_of_rigs("sequences", name, rig, default)
    node = load_yaml(path)
    check_keys(path, node, KEYS, ("description", "steps"), "the sequence")
    own = rig is None and "rig" in node
    rig = rig or rig_of(path, default)
    try:
        config = config or _read_rig(str(rig), tuple((str(base), base.stat().st_mtime_ns) for base, _ in with_bases(rig)))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'rig')}: rig: {error}" if own else str(error)) from None

    def refused(nodes: Any, error: RigError) -> RigError:
        written_for = rig_of(path, default or str(rig))
        if own or written_for in (str(rig), config.name) or not _suits(nodes, path, written_for):
            return error
        return RigError(
            f"sequence '{Path(path).stem}' is for a rig like {written_for}, not for '{config.name}': {error}; "
            f"choose a rig like {written_for}"
        )

    return checked(node, path, values or {}, config, str(rig), refused)


def checked(
    node: Map, path: Path, values: dict[str, str], config: RigConfig, rig: str, refused: Callable[[Any, RigError], RigError]
) -> Sequence:
    """Return the sequence of a map that has only known keys.

    Parameters
    ----------
    node : Map
        The map.
    path : Path
        Its file, for the errors; the sequence is called as it is.
    values : dict of str to str
        Values of parameters in place of their defaults.
    config : RigConfig
        The rig on which it is to run.
    rig : str
        Name or file of that rig.
    refused : callable
        refused(nodes, error) returns the error to raise when the rig does not take the steps.

    Raises
    ------
    RigError
        When something is not right.
    """
    parameters = _parameters(node, path, values)
    nodes = Filled(path).of(node["steps"], parameters, where_of(path, node, "steps"))
    _check_used(node, path, parameters)
    timeout = DEFAULT_TIMEOUT
    if "ready" in node:
        check_keys(path, node["ready"], ("timeout",), ("timeout",), "ready", where_of(path, node, "ready"))
        timeout = _time(node["ready"]["timeout"], f"{where_of(path, node, 'ready')}: ready.timeout")
    try:
        steps = _steps(nodes, path, "steps", config, where_of(path, node, "steps"))
    except RigError as error:
        raise refused(nodes, error) from None
    least = sum((step.value if step.condition is None else step.hold) for step in steps if step.kind == "wait")
    if least > LONGEST_TIME:
        raise RigError(
            f"{where_of(path, node, 'steps')}: the waits of the sequence take {least:.6g} s in all, expected at "
            f"most {LONGEST_TIME:.6g} s, which is a day"
        )
    return Sequence(path.stem, str(node["description"]), timeout, steps, parameters, rig)


def _suits(nodes: Any, path: Path, rig: str) -> bool:
    """Return True when the steps of a sequence can be read for a rig; a typing error fits none."""
    try:
        _steps(nodes, path, "steps", load_rig(rig), "")
    except RigError:
        return False
    return True


@lru_cache(maxsize=8)
def _read_rig(rig: str, _files: tuple) -> RigConfig:
    """The rig of a sequence; it is read once while its files stay the same, because a sweep reads its sequence for each member."""
    return load_rig(rig)


def _parameters(node: Map, path: str | Path, values: dict[str, str]) -> dict[str, str | int]:
    """Return the value of every parameter: the default, or the given one, which is checked against the kind of the default."""
    defaults = node.get("parameters") or {}
    if not isinstance(defaults, dict):
        raise RigError(f"{where_of(path, node, 'parameters')}: parameters must be a map of names and defaults")
    for name in values:
        if name not in defaults:
            raise RigError(f"sequence '{Path(path).stem}': {unknown('parameter', name, defaults)}")
    out: dict[str, str | int] = {}
    for name, default in defaults.items():
        where = f"{where_of(path, defaults, name)}: parameter {name}"
        if not isinstance(default, (str, int)) or isinstance(default, bool):
            raise RigError(f"{where} is {brief(default)}; expected a value with its unit, a whole number or a name")
        out[name] = _like(default, values[name], f"parameter {name}={values[name]}") if name in values else default
        if not re.fullmatch(r"\w+", str(name)):
            raise RigError(f"{where}: a parameter's name has letters, digits and _ only")
    return out


def _check_used(node: Map, path: str | Path, parameters: Iterable[str]) -> None:
    """Raise RigError for a parameter that no step uses."""
    steps = str(node["steps"])
    for name in parameters:
        if f"${{{name}}}" not in steps:
            raise RigError(
                f"{where_of(path, node['parameters'], name)}: parameter {name} is used by no step; write "
                f"${{{name}}} where its value belongs, or leave it out"
            )


def _like(default: str | int, text: str, where: str) -> str | int:
    """Return a given value of the same kind as the default: a whole number, a quantity of its dimension, or a name."""
    if isinstance(default, int):
        if not re.fullmatch(r"-?\d+", str(text)):
            raise RigError(f"{where}: expected a whole number, e.g. {default}")
        return int(text)
    dimension = dimension_of(default)
    if dimension is not None:
        quantity(text, dimension, where)
    return text


def _steps(nodes: Any, path: str | Path, what: str, config: RigConfig, where: str) -> list[Step]:
    readers = _readers(config)
    if not isinstance(nodes, list) or not nodes:
        dashes = "; each begins with a dash" if isinstance(nodes, dict) else ""
        raise RigError(f"{where}: {what} must be a list with at least one step{dashes}")
    steps: list[Step] = []
    for k, node in enumerate(nodes):
        check_keys(path, node, readers, (), "a step", where_of(path, nodes, k))
        if len(node) != 1:
            last = f"; is there a dash missing before '{list(node)[-1]}'?" if node else ""
            raise RigError(
                f"{where_of(path, node)}: a step has one key, one of {', '.join(readers)}; "
                f"found {', '.join(map(str, node)) or 'none'}{last}"
            )
        kind = next(iter(node))
        body, where = node[kind], where_of(path, node, kind)
        found = readers[kind](body, path, where, config)
        steps += [replace(step, loops=node.loops) if node.loops and not step.loops else step for step in found]
        if len(steps) > LONGEST:
            raise RigError(f"{where}: the sequence is longer than {LONGEST} steps")
    return steps


def _one_of(body: Any, path: str | Path, where: str, what: str, choices: Collection[str], extra: Collection[str] = ()) -> str:
    """The single key of ``choices`` that the body of a step names."""
    check_keys(path, body, (*choices, *extra), (), what, where)
    named = [key for key in choices if key in body]
    if len(named) != 1:
        raise RigError(f"{where}: {what} takes one of {', '.join(choices)}, found {', '.join(named) or 'none'}")
    return named[0]


def _off(body: Map, where: str, what: str) -> None:
    if body["off"] is not True:
        raise RigError(f"{where}: {what}.off is {brief(body['off'])}, expected true")


def _setting(setting: Setting) -> Callable[[Any, str | Path, str, RigConfig], list[Step]]:
    """Return the reader of a device's step; a value must lie in the range of its setting."""
    kind, choices = setting.setpoint.step, setting.setpoint.command.takes

    def read(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
        key = _one_of(body, path, where, kind, (*choices, "off"))
        if key == "off":
            _off(body, where, kind)
            return [Step(kind, f"{kind} off", where, enable=False)]
        value = quantity(body[key], choices[key], f"{where}: {kind}.{key}")
        by_torque = choices[key] == "torque"
        low, high = setting.low, setting.high
        if by_torque:
            low, high = _torques(setting.setpoint.device, config, f"{where}: {kind}.{key}")
        if not low <= value <= high:
            raise RigError(f"{where}: {kind}.{key} is {body[key]}; the rig takes {span(low, high, body[key])}")
        return [Step(kind, f"{kind} {key} {body[key]}", where, value, by_torque=by_torque)]

    return read


def _torques(load: str, config: RigConfig, where: str) -> tuple[float, float]:
    """Return the range of the torque of a load [Nm]; RigError where its speed is not known."""
    try:
        config.structure.speed_of_load(load)
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
    output = config.structure.output
    return 0.0, config.catalogue.signals[output.torque].high if output else most_torque(config.values(load))


def _shift(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    check_keys(path, body, ("to", "timeout"), ("to",), "shift", where)
    box = config.transmission
    gear = box.number(str(body["to"]))
    if gear is None:
        raise RigError(f"{where}: shift.to is {brief(str(body['to']))}, expected {', '.join(box.numbers)}")
    return [Step("shift", f"shift to {box.names[gear]}", where, gear, timeout=_timeout(body, where, "shift"))]


def _controller(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    """Read settings of the user's controller; each becomes a step."""
    if not isinstance(body, dict) or not body:
        raise RigError(f"{where}: controller takes names of its settings and their values, e.g. {{gain: 1.5}}")
    steps = []
    for name, given in body.items():
        try:
            value = math.nan if isinstance(given, bool) else float(given)
        except (TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise RigError(f"{where_of(path, body, name)}: controller.{name} is {brief(given)}, expected a number (SI)")
        steps.append(Step("set", f"controller {name} {value:g}", where, value, setting=f"{CONTROLLER}.{OWN}{name}"))
    return steps


def _set(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    """Read settings of the rig and its shift controller that can change while the rig runs; each becomes a step."""
    if not isinstance(body, dict) or not body:
        raise RigError(f"{where}: set takes names of settings and their values, e.g. {{oil_supply.temperature: 50 degC}}")
    steps = []
    for name, given in body.items():
        place = where_of(path, body, name)
        try:
            setting = config.settings.find(str(name))
            setting.check_lives()
        except RigError as error:
            raise RigError(f"{place}: set: {error}") from None
        if setting.setpoint is not None:
            raise RigError(f"{place}: set: {name} is a setpoint; the step '{setting.setpoint.step}' sets it")
        if setting.numbers > 1:
            raise RigError(f"{place}: set: {name} has {setting.numbers} numbers; a sequence sets single values")
        value = float(setting.value_of(given, f"{place}: set.{name}"))
        shown = str(given).lower() if isinstance(given, bool) else given
        steps.append(Step("set", f"set {name} {shown}", where, value, setting=setting.name))
    return steps


def _fault(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    """Read an order of a fault."""
    if not isinstance(body, dict) or "name" not in body:
        raise RigError(f"{where}: fault takes a map with the name of the fault, e.g. {{name: oil_supply.air, size: 5 %}}")
    check_enabled(config, f"{where}: fault refused")
    order = read_fault(config, body, where)
    return [Step("fault", f"fault {order.text}", where, fault=order.text)]


def _timeout(body: Map, where: str, what: str) -> float:
    return _time(body["timeout"], f"{where}: {what}.timeout") if "timeout" in body else DEFAULT_TIMEOUT


def _time(text: object, where: str) -> float:
    value = quantity(text, "time", where)
    if not 0.0 <= value <= LONGEST_TIME:
        raise RigError(f"{where} is {text}, expected {span(0.0, LONGEST_TIME, text)}")
    return value


def _wait(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    key = _one_of(body, path, where, "wait", ("for", "until"), ("timeout", "hold"))
    if key == "for":
        if "timeout" in body or "hold" in body:
            raise RigError(f"{where}: wait.for takes no timeout and no hold; they belong to wait.until")
        value = _time(body["for"], f"{where}: wait.for")
        return [Step("wait", f"wait {body['for']}", where, value)]
    hold = _time(body["hold"], f"{where}: wait.hold") if "hold" in body else 0.0
    condition, text = _condition(body["until"], path, f"{where}: wait.until", config)
    timeout = _timeout(body, where, "wait")
    if hold > timeout:
        given = body.get("timeout", f"{DEFAULT_TIMEOUT:g} s, where none is given")
        raise RigError(f"{where}: wait.hold is {body['hold']}, expected at most the timeout of {given}")
    return [Step("wait", f"wait until {text}", where, hold=hold, timeout=timeout, condition=condition)]


def _condition(node: Any, path: str | Path, where: str, config: RigConfig) -> tuple[Condition, str]:
    check_keys(path, node, ("signal", "above", "below", "near", "within"), ("signal",), "wait.until", where)
    signals = config.catalogue.signals
    signal = signals.get(str(node["signal"]))
    if signal is None:
        raise RigError(f"{where}: {unknown('signal', node['signal'], signals)}; ./rig list signals has them all")
    dimension = DIMENSIONS.get(signal.quantity, signal.quantity)
    low, high, text = float("-inf"), float("inf"), signal.name
    if "above" in node:
        low, text = quantity(node["above"], dimension, f"{where}.above"), f"{text} above {node['above']}"
    if "below" in node:
        high, text = quantity(node["below"], dimension, f"{where}.below"), f"{text} below {node['below']}"
    if "near" in node or "within" in node:
        check_keys(path, node, ("signal", "near", "within"), ("signal", "near", "within"), "wait.until")
        middle = quantity(node["near"], dimension, f"{where}.near")
        width = quantity(node["within"], dimension, f"{where}.within")
        if not width > 0.0:
            raise RigError(f"{where}.within is {node['within']}, expected more than 0")
        low, high, text = middle - width, middle + width, f"{text} within {node['within']} of {node['near']}"
    if not low < high or (low == float("-inf") and high == float("inf")):
        raise RigError(f"{where}: needs 'above', 'below' or both with above < below, or 'near' with 'within'")
    return Condition(signal.name, low, high), text


def _repeat(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    check_keys(path, body, ("times", "steps"), ("times", "steps"), "repeat", where)
    times = body["times"]
    if not isinstance(times, int) or isinstance(times, bool) or not 1 <= times <= LONGEST:
        raise RigError(f"{where}: repeat.times is {brief(times)}, expected a whole number from 1 to {LONGEST}")
    steps = _steps(body["steps"], path, "repeat.steps", config, where_of(path, body, "steps"))
    if times * len(steps) > LONGEST:
        raise RigError(f"{where}: repeat makes {times * len(steps)} steps, more than {LONGEST}")
    return steps * times


_OTHER_STEPS = ("shift", "set", "fault", "wait", "repeat")  # all others are setpoints of devices


def _readers(config: RigConfig) -> dict:
    """Readers by the key of a step: setpoints of the rig's devices, orders when it has gears, settings, waits and repeats."""
    orders = {"shift": _shift, "controller": _controller} if config.structure.shifts else {}
    return {
        **{step: _setting(one) for step, one in config.settings.steps.items()},
        **orders,
        "set": _set,
        "fault": _fault,
        "wait": _wait,
        "repeat": _repeat,
    }
