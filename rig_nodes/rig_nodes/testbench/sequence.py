# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Test sequences: YAML steps with waits, end conditions, timeouts, repeats and a readiness gate.

Used by ``rig simulate`` in one process and by the sequencer node over ROS; the runner only sees a bench object.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..config import load_yaml
from ..config.names import DEFAULT_RIG, beside, find_of_rigs, rig_with, unknown, with_bases
from ..config.schema import check_keys, where_of
from ..config.units import dimension_of, quantity, span
from ..config.yaml_file import List, Map
from ..description.settings import CONTROLLER, OWN, Setting
from ..errors import RigError, brief
from ..parts.load_pump import most_torque, relief_setting_for
from .configuration import RigConfig, load_rig

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

DEFAULT_TIMEOUT = 30.0
LONGEST_TIME = 86_400.0  # s of one wait
LONGEST = 10_000  # steps after unrolling repeats
MOST_FILLED = 200_000  # values after unrolling repeats
_NAMED = re.compile(r"\$(?:\{([^}]*)(\}?)|(\w+))")
# what the catalogue calls a quantity, and what config.units calls its dimension
DIMENSIONS = {"volume flow": "volume flow", "electric current": "current"}


class SequenceFailed(RigError):
    """A step that did not come to its end: which step, what it waited for, what was seen."""

    exit_code = 1


class Bench(Protocol):
    """What a sequence needs of a rig; times are simulated seconds. ``set``: a setpoint by its key, e.g. motor or oil."""

    def ready(self) -> bool:
        """True when the rig can take orders."""

    def set(self, step: str, value: float, enable: bool) -> None:
        """Hands over a setpoint [SI] by its step's key, and whether its device is on."""

    def order_gear(self, gear: int) -> None:
        """Orders a gear by its number."""

    def shift_done(self) -> bool:
        """True when the shift that was ordered last has ended."""

    def controller_says(self) -> tuple[int, bool] | None:
        """The controller's gear and whether it is shifting, None before it has said so."""

    def change(self, name: str, value: float) -> None:
        """Gives a setting of the rig, its shift controller or the user's controller another value [SI], a switch 1 or 0."""

    def changed(self) -> bool:
        """True when the setting that was given last has its value."""

    def reading(self, signal: str) -> float:
        """The newest value of a signal [SI]."""

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Tells of an event of the sequence."""


@dataclass(frozen=True)
class Condition:
    """True while the reading of a signal stays between low and high."""

    signal: str
    low: float
    high: float

    def met(self, bench: Bench) -> bool:
        """True while the bench's reading is within the range."""
        return self.low <= bench.reading(self.signal) <= self.high


@dataclass(frozen=True)
class Step:
    """One step: kind, its SI values, the sentence for people and where it stands."""

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


@dataclass(frozen=True)
class Sequence:
    """A checked sequence. parameters: name -> value that its steps were read with, as it is written; rig: the one that
    it was read for.
    """

    name: str
    description: str
    ready_timeout: float
    steps: list[Step] = field(default_factory=list)
    parameters: dict[str, str | int] = field(default_factory=dict)
    rig: str = DEFAULT_RIG

    def check_rig(self, config: RigConfig) -> None:
        """RigError when the sequence asks for what the rig of this configuration has not, or loads it too much."""
        gears = config.transmission.names if config.structure.gears else {}
        for step in self.steps:
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
                    f"{unknown(what, name, map(str, known))}; leave out --rig, or name one like {self.rig}"
                )
            if step.by_torque:
                device = config.settings.steps[step.kind].setpoint.device
                if step.value > (most := most_torque(getattr(config, device))):
                    raise RigError(
                        f"{step.where}: {step.text}: the load pump holds at most {most:.4g} Nm, by its "
                        f"{device}.displacement and .pressure_limit"
                    )


BY_HAND = Sequence("none", "ordered over ROS", 0.0)  # in the record of a run without a sequence of its own


def load_sequence(name: str | Path, values: dict[str, str] | None = None, rig: str | Path | None = None) -> Sequence:
    """The sequence of this name, of a rig or of an installed one, or a file; RigError with file and line when it is not right.

    ``values``: of its parameters, in place of their defaults, e.g. {"speed": "1500 rpm"}; rig: that it is to run on, by
    default the one that it is written for.
    """
    path = find_of_rigs("sequences", name, rig)
    node = load_yaml(path)
    check_keys(path, node, ("description", "rig", "parameters", "ready", "steps"), ("description", "steps"), "the sequence")
    own = rig is None and "rig" in node
    rig = beside(path, node["rig"]) if own else rig or rig_with(path)
    try:
        config = _read_rig(str(rig), tuple((str(base), base.stat().st_mtime_ns) for base, _ in with_bases(rig)))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'rig')}: rig: {error}" if own else str(error)) from None
    parameters = _parameters(node, path, values or {})
    nodes = _Filled(path).of(node["steps"], parameters, where_of(path, node, "steps"))
    _check_used(node, path, parameters)
    timeout = DEFAULT_TIMEOUT
    if "ready" in node:
        check_keys(path, node["ready"], ("timeout",), ("timeout",), "ready", where_of(path, node, "ready"))
        timeout = _time(node["ready"]["timeout"], f"{where_of(path, node, 'ready')}: ready.timeout")
    try:
        steps = _steps(nodes, path, "steps", config, where_of(path, node, "steps"))
    except RigError as error:
        written_for = beside(path, node["rig"]) if "rig" in node else rig_with(path)
        if own or str(written_for) in (str(rig), config.name):
            raise
        raise RigError(
            f"sequence '{Path(path).stem}' is for a rig like {written_for}, not for '{config.name}': {error}; leave out "
            f"--rig, or name one like {written_for}"
        ) from None
    least = sum((step.value if step.condition is None else step.hold) for step in steps if step.kind == "wait")
    if least > LONGEST_TIME:
        raise RigError(
            f"{where_of(path, node, 'steps')}: the waits of the sequence take {least:.6g} s in all, expected at "
            f"most {LONGEST_TIME:.6g} s, which is a day"
        )
    return Sequence(Path(path).stem, str(node["description"]), timeout, steps, parameters, str(rig))


@lru_cache(maxsize=8)
def _read_rig(rig: str, _files: tuple) -> RigConfig:
    """The rig of a sequence, read once as long as its files stay as they are: a sweep reads its sequence for each member."""
    return load_rig(rig)


def _parameters(node: Map, path: str | Path, values: dict[str, str]) -> dict[str, str | int]:
    """Every parameter's value: the given one, checked against the kind of the default, or the default."""
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
    """RigError for a parameter that no step takes."""
    steps = str(node["steps"])
    for name in parameters:
        if f"${{{name}}}" not in steps:
            raise RigError(
                f"{where_of(path, node['parameters'], name)}: parameter {name} is used by no step; write "
                f"${{{name}}} where its value belongs, or leave it out"
            )


def _like(default: str | int, text: str, where: str) -> str | int:
    """A given value of the same kind as the default: a whole number, a quantity of its dimension, or a name."""
    if isinstance(default, int):
        if not re.fullmatch(r"-?\d+", str(text)):
            raise RigError(f"{where}: expected a whole number, e.g. {default}")
        return int(text)
    dimension = dimension_of(default)
    if dimension is not None:
        quantity(text, dimension, where)
    return text


def filled(text: str, values: dict, where: str, what: str) -> str:
    """A text with the values of the names in place of their ${names}; RigError when one is not known or is no name."""

    def value(match: re.Match[str]) -> str:
        inner, closed, bare = match.groups()
        if bare is not None:
            if bare in values:
                raise RigError(f"{where}: '${bare}' has no braces; write ${{{bare}}}")
            return match[0]
        if not closed:
            raise RigError(f"{where}: the brace of {brief(match[0])} is not closed; write e.g. ${{{next(iter(values), 'name')}}}")
        if inner in values:
            return str(values[inner])
        if not re.fullmatch(r"\w+", inner):
            raise RigError(
                f"{where}: between the braces of {brief(match[0])} stands no name; nothing is computed there, "
                f"give the {what} the value that is wanted"
            )
        raise RigError(f"{where}: {unknown(what, f'${{{inner}}}', [f'${{{name}}}' for name in values])}")

    return _NAMED.sub(value, text)


class _Filled:
    """Steps with the values of parameters in place of their ${names}, and those of ``each`` once for each value.

    Of all that is read nothing is changed; what is made is counted, so that loops in loops end in a sentence.
    """

    def __init__(self, path: str | Path) -> None:
        self.path, self.made = path, 0

    def of(self, node: Any, parameters: dict, where: str) -> Any:
        """The node, filled; maps and lists keep their lines."""
        self.made += 1
        if self.made > MOST_FILLED:
            raise RigError(f"{where}: repeats make more than {MOST_FILLED} values of the steps")
        if isinstance(node, str):
            names = _NAMED.fullmatch(node)
            if names and names[2] and names[1] in parameters:
                return parameters[names[1]]  # a whole number stays one
            return filled(node, parameters, where, "parameter")
        if isinstance(node, Map):
            out = Map(node.line)
            for key, value in node.items():
                at = where_of(self.path, node, key)
                is_each = key == "repeat" and isinstance(value, Map) and "each" in value
                out[key] = self.each(value, parameters, at) if is_each else self.of(value, parameters, at)
        elif isinstance(node, List):
            out = List(node.line)
            out.extend(self.of(item, parameters, where_of(self.path, node, k)) for k, item in enumerate(node))
        else:
            return node
        out.lines = node.lines
        return out

    def each(self, node: Map, parameters: dict, where: str) -> Map:
        """A repeat over the values of a name: its steps once for each, filled."""
        path = self.path
        check_keys(path, node, ("each", "steps"), ("each", "steps"), "repeat")
        each = node["each"]
        if not isinstance(each, Map) or len(each) != 1 or not re.fullmatch(r"\w+", str(next(iter(each)))):
            raise RigError(f"{where_of(path, node, 'each')}: repeat.each must be one name with its values, found {brief(each)}")
        name, values = next(iter(each.items()))
        at = f"{where_of(path, each, name)}: repeat.each.{name}"
        values = self.of(values, parameters, where_of(path, each, name))
        if isinstance(values, str):
            values = [part.strip() for part in values.split(",")]
        if (
            not isinstance(values, list)
            or not values
            or any(isinstance(value, (bool, list, dict)) or value in (None, "") for value in values)
        ):
            raise RigError(f"{at} must be a list of values, found {brief(values)}")
        if not isinstance(node["steps"], list):
            raise RigError(f"{where_of(path, node, 'steps')}: repeat.steps must be a list with at least one step")
        steps = List(node["steps"].line)
        for value in values:
            more = self.of(node["steps"], {**parameters, name: value}, where)
            steps.extend(more)
            steps.lines += more.lines
            if len(steps) > LONGEST:
                raise RigError(f"{at} makes more than {LONGEST} steps")
        out = Map(node.line)
        out.update(times=1, steps=steps)
        out.lines = {"times": node.line, "steps": node.lines["steps"]}
        return out


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
        steps += readers[kind](body, path, where, config)
        if len(steps) > LONGEST:
            raise RigError(f"{where}: the sequence is longer than {LONGEST} steps")
    return steps


def _one_of(body: Any, path: str | Path, where: str, what: str, choices: Collection[str], extra: Collection[str] = ()) -> str:
    """The single key of ``choices`` that a step's body names."""
    check_keys(path, body, (*choices, *extra), (), what, where)
    named = [key for key in choices if key in body]
    if len(named) != 1:
        raise RigError(f"{where}: {what} takes one of {', '.join(choices)}, found {', '.join(named) or 'none'}")
    return named[0]


def _off(body: Map, where: str, what: str) -> None:
    if body["off"] is not True:
        raise RigError(f"{where}: {what}.off is {brief(body['off'])}, expected true")


def _setting(setting: Setting) -> Callable[[Any, str | Path, str, RigConfig], list[Step]]:
    """Reader of a device's step: what it takes keeps to the range of its setting."""
    kind, choices = setting.setpoint.step, setting.setpoint.command.takes

    def read(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
        key = _one_of(body, path, where, kind, (*choices, "off"))
        if key == "off":
            _off(body, where, kind)
            return [Step(kind, f"{kind} off", where, enable=False)]
        value = quantity(body[key], choices[key], f"{where}: {kind}.{key}")
        by_torque = choices[key] == "torque"
        high = config.catalogue.signals[config.structure.output.torque].high if by_torque else setting.high
        if not 0.0 <= value <= high:
            raise RigError(f"{where}: {kind}.{key} is {body[key]}; the rig takes {span(0.0, high, body[key])}")
        return [Step(kind, f"{kind} {key} {body[key]}", where, value, by_torque=by_torque)]

    return read


def _shift(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    check_keys(path, body, ("to", "timeout"), ("to",), "shift", where)
    gear, gears = str(body["to"]), config.transmission.numbers
    if gear not in gears:
        raise RigError(f"{where}: shift.to is {brief(gear)}, expected {', '.join(gears)}")
    return [Step("shift", f"shift to {gear}", where, gears[gear], timeout=_timeout(body, where, "shift"))]


def _controller(body: Any, path: str | Path, where: str, config: RigConfig) -> list[Step]:
    """Settings of the user's controller: a step for each."""
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
    """Settings of the rig and its shift controller, such as can change while it runs: a step for each."""
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
    return [Step("wait", f"wait until {text}", where, hold=hold, timeout=_timeout(body, where, "wait"), condition=condition)]


def _condition(node: Any, path: str | Path, where: str, config: RigConfig) -> tuple[Condition, str]:
    check_keys(path, node, ("signal", "above", "below", "near", "within"), ("signal",), "wait.until", where)
    signals = config.catalogue.signals
    signal = signals.get(str(node["signal"]))
    if signal is None:
        raise RigError(f"{where}: {unknown('signal', node['signal'], signals)}; docs/reference/signals.md has them all")
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


_OTHER_STEPS = ("shift", "set", "wait", "repeat")  # all others are setpoints of devices


def _readers(config: RigConfig) -> dict:
    """Key of a step -> what reads it: the setpoints of the rig's devices, orders where it has gears, waits and repeats."""
    orders = {"shift": _shift, "controller": _controller} if config.structure.shifts else {}
    return {
        **{step: _setting(one) for step, one in config.settings.steps.items()},
        **orders,
        "set": _set,
        "wait": _wait,
        "repeat": _repeat,
    }


class SequenceRunner:
    """Walks a sequence over a bench; ``poll`` is called with rising simulated time, every graph tick."""

    def __init__(self, sequence: Sequence, bench: Bench, config: RigConfig) -> None:
        """config: of the rig."""
        self.sequence, self.bench, self.config = sequence, bench, config
        self.step = -1  # -1: readiness gate
        self.text = "wait for the rig to be ready"
        self._since: float | None = None
        self._met_since: float | None = None

    @property
    def steps(self) -> int:
        """Number of steps, repeats written out."""
        return len(self.sequence.steps)

    def poll(self, t: float) -> bool:
        """Do what is due at time t [s]; True when the last step is done. Raises SequenceFailed."""
        if self._since is None:
            self._since = t
        if self.step < 0:
            if not self.bench.ready():
                if t - self._since > self.sequence.ready_timeout:
                    raise SequenceFailed(
                        f"sequence '{self.sequence.name}': the rig was not ready within {self.sequence.ready_timeout:g} s"
                    )
                return False
            self._begin(0, t)
        while self.step < self.steps:
            if not self._ended(self.sequence.steps[self.step], t):
                return False
            self._begin(self.step + 1, t)
        return True

    def next_look(self) -> dict:
        """When :meth:`poll` has something to do again, so that nobody need ask at every tick.

        ``until``: time [s], at the latest; before that as soon as ``signal`` lies between ``low`` and ``high`` (or no
        longer does: ``met`` False), or as soon as a shift to ``gear`` is done, where these are given.
        """
        if not 0 <= self.step < self.steps:
            return {"until": 0.0}
        step = self.sequence.steps[self.step]
        if step.kind == "shift":
            return {"until": self._since + step.timeout, "gear": int(step.value)}
        if step.kind == "set":
            return {"until": self._since}  # its answer is no signal: asked for at every tick
        if step.condition is None:
            return {"until": self._since + step.value}
        condition, met = step.condition, self._met_since is not None
        return {
            "until": self._met_since + step.hold if met else self._since + step.timeout,
            "signal": condition.signal,
            "low": condition.low,
            "high": condition.high,
            "met": not met,
        }

    def _begin(self, index: int, t: float) -> None:
        self.step, self._since, self._met_since = index, t, None
        if index >= self.steps:
            self.text = "done"
            self.bench.event("sequence_done", f"sequence {self.sequence.name} is done", float(index))
            return
        step = self.sequence.steps[index]
        self.text = step.text
        self.bench.event("step", step.text, float(index + 1))
        try:
            self._give(step)
        except SequenceFailed:
            raise
        except RigError as error:
            raise SequenceFailed(f"{step.where}: {error}") from None

    def _give(self, step: Step) -> None:
        """The order of a step, if it is one; RigError when the rig or its controller refuses it."""
        if step.kind == "shift":
            self.bench.order_gear(int(step.value))
        elif step.kind == "set":
            self.bench.change(step.setting, step.value)
        elif step.kind != "wait":
            if not step.by_torque:
                self.bench.set(step.kind, step.value, step.enable)
                return
            load, speed = (
                getattr(self.config, self.config.settings.steps[step.kind].setpoint.device),
                self.config.structure.output.speed,
            )
            try:
                self.bench.set(step.kind, relief_setting_for(step.value, self.bench.reading(speed), load), step.enable)
            except RigError as error:
                raise RigError(f"{step.text} asks the relief valve, at this speed, for too much: {error}") from None

    def _ended(self, step: Step, t: float) -> bool:
        waited = t - self._since
        if step.kind == "shift":
            done = waited > 0.0 and self.bench.shift_done()
        elif step.kind == "set":
            done = self.bench.changed()
        elif step.condition is not None:
            if not step.condition.met(self.bench):
                self._met_since = None
            elif self._met_since is None:
                self._met_since = t
            done = self._met_since is not None and t - self._met_since >= step.hold
        elif step.kind == "wait":
            return waited >= step.value - 1e-9
        else:
            return True
        if not done and waited > step.timeout:
            seen = ""
            if step.condition is not None:
                signal = self.config.catalogue.signal(step.condition.signal)
                value = signal.shown(self.bench.reading(signal.name))
                seen = f"; {signal.name} is {value:.4g} {signal.display_unit}"
            elif step.kind == "shift" and (says := self.bench.controller_says()) is not None:
                seen = f"; the controller says gear {says[0]}, {'shifting' if says[1] else 'not shifting'}"
            raise SequenceFailed(f"{step.where}: '{step.text}' did not come true within {step.timeout:g} s{seen}")
        return done
