# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameters that a sweep varies, and the points of its members: grid, list, random or Latin hypercube.

The verb ``sweep`` and studies.sweep.run use it; a plan is plain data that is written into the sweep's folder unchanged.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base import UNITS, RigError, brief, check_keys, dimension_of, load_yaml, quantity, rig_of, unknown, where_of
from ...rig import load_rig, with_overrides
from ...runs import load_sequence, on_recording
from .plugged import Plugged, plugged_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ...rig import RigConfig
    from ...runs import Sequence

METHODS = ("grid", "list", "random", "lhs")
DRAWN = ("random", "lhs")  # methods that need a number of samples
SEED = "seed"  # name under which the seed itself is varied
MOST_MEMBERS = 1_000_000
FILE_KEYS = (
    "description",
    "sequence",
    "rig",
    "method",
    "samples",
    "seed",
    "repeats",
    "vary",
    "set",
    "with",
    "controller",
    "level",
    "delay",
    "calculate",
)
_RANGE = re.compile(r"(.+?)\s*\.\.\s*(.+?)(?:\s+in\s+(\d+))?(?:\s+step\s+(\S+(?:\s+[^\d\s]\S*)?))?(\s+log)?\s*")
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


@dataclass(frozen=True)
class Varied:
    """One parameter that is varied.

    Parameters
    ----------
    name : str
        Name of the rig's parameter (as in ``--set``, or a point's ``.time`` or ``.current``), of the sequence's parameter
        (as in ``--with``), or "seed".
    of : str
        "rig", "sequence" or "seed".
    unit : str or None
        Unit of the numbers, as first written; "" for whole numbers, None for words.
    values : tuple
        The values; empty for a range from which values are drawn.
    low, high : float
        Ends of the range, in ``unit``.
    log : bool
        Whether the range is divided along its logarithm.
    """

    name: str
    of: str
    unit: str | None
    values: tuple = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def text(self, value: float | str) -> str:
        """Return a value as it is written after ``--set`` or ``--with``."""
        return f"{value!r} {self.unit}" if self.unit else str(value)

    def at(self, share: float) -> float | str:
        """Return the value at a share (0 to 1) of the range or of the values."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            value = math.exp(math.log(self.low) + share * (math.log(self.high) - math.log(self.low)))
        else:
            value = self.low + share * (self.high - self.low)
        return round(value) if self.unit == "" else value


@dataclass(frozen=True)
class Member:
    """One run of a sweep: its number, its seed, and the texts of what it sets at the rig and at the sequence."""

    number: int
    seed: int
    values: dict
    overrides: dict[str, str]
    parameters: dict[str, str]


@dataclass(frozen=True)
class Plan:
    """A checked sweep, or a draft of one.

    Parameters
    ----------
    sequence, rig : str
        Names or absolute files.
    method : str
        One of METHODS.
    samples : int or None
        Number of points for a method that draws them, else 0; None in a draft that gives none.
    seed : int
        Seed of the first member, and of the drawing.
    repeats : int
        Members at each point.
    varied : tuple of Varied
        The parameters that are varied.
    fixed, fixed_with : dict of str to str
        Settings of the rig and parameters of the sequence that all members share.
    description : str
        Text for people.
    plugged : Plugged or None
        Controller of all members; None for the rig's own Alfa46.
    calculation : str
        The calculation of the rig's folder that is made of each run in place of shift metrics; empty for none.
    """

    sequence: str
    rig: str
    method: str = ""
    samples: int | None = None
    seed: int = 1
    repeats: int = 1
    varied: tuple[Varied, ...] = ()
    fixed: dict[str, str] = field(default_factory=dict)
    fixed_with: dict[str, str] = field(default_factory=dict)
    description: str = ""
    plugged: Plugged | None = None
    calculation: str = ""

    @property
    def name(self) -> str:
        """Name of the sweep's folder."""
        return f"{Path(self.sequence).stem}-sweep"

    def members(self) -> list[Member]:
        """Return all members in their order; an equal plan gives equal members."""
        members = []
        for point in self._points():
            values = dict(zip((one.name for one in self.varied), point))
            for _ in range(self.repeats):
                number = len(members)
                members.append(
                    Member(
                        number,
                        int(values.get(SEED, self.seed + number)),
                        values,
                        {**self.fixed, **self._texts("rig", point)},
                        {**self.fixed_with, **self._texts("sequence", point)},
                    )
                )
        return members

    def _texts(self, of: str, point: Iterable[float | str]) -> dict[str, str]:
        return {one.name: one.text(value) for one, value in zip(self.varied, point) if one.of == of}

    def count(self) -> int:
        """Return the number of members."""
        if self.method in DRAWN:
            return self.samples * self.repeats
        sizes = [len(one.values) for one in self.varied]
        return (math.prod(sizes) if self.method == "grid" else sizes[0]) * self.repeats

    def _points(self) -> Iterable[tuple[float | str, ...]]:
        if self.method == "grid":
            return product(*(one.values for one in self.varied))
        if self.method == "list":
            return zip(*(one.values for one in self.varied))
        return [tuple(one.at(share) for one, share in zip(self.varied, row)) for row in self._shares().tolist()]

    def _shares(self) -> np.ndarray:
        """Return the places of the samples in the unit cube (samples, parameters)."""
        random = np.random.default_rng(self.seed)
        shares = random.random((self.samples, len(self.varied)))
        if self.method == "random":
            return shares
        # Latin hypercube: each column visits its strata in an order of its own; scipy's function would take 0.7 s to load
        strata = random.permuted(np.tile(np.arange(self.samples)[:, None], len(self.varied)), axis=0)
        return (strata + shares) / self.samples

    def as_dict(self) -> dict:
        """Return plain data, from which :func:`plan_of` makes the plan again."""
        return {
            "sequence": self.sequence,
            "rig": self.rig,
            "method": self.method,
            "samples": self.samples,
            "seed": self.seed,
            "repeats": self.repeats,
            "description": self.description,
            "controller": asdict(self.plugged) if self.plugged else None,
            "varied": [
                {
                    "name": one.name,
                    "of": one.of,
                    "unit": one.unit,
                    "values": list(one.values),
                    "low": one.low,
                    "high": one.high,
                    "log": one.log,
                }
                for one in self.varied
            ],
            "set": self.fixed,
            "with": self.fixed_with,
            "calculate": self.calculation,
        }


def plan_of(data: dict) -> Plan:
    """Return the plan of the data that :meth:`Plan.as_dict` returned."""
    varied = tuple(Varied(**{**one, "values": tuple(one["values"])}) for one in data["varied"])
    names = ("sequence", "rig", "method", "samples", "seed", "repeats", "description")
    plugged = Plugged(**data["controller"]) if data.get("controller") else None
    return Plan(
        **{name: data[name] for name in names},
        varied=varied,
        fixed=data["set"],
        fixed_with=data["with"],
        plugged=plugged,
        calculation=data.get("calculate", ""),
    )


def read_plan(path: str | Path, default: str) -> Plan:
    """Return the plan of a sweep file; RigError with file and line when the file is not right.

    ``default`` is the rig of a sequence that names none, as for :func:`base.names.rig_of`.
    """
    node = load_yaml(path)
    check_keys(path, node, FILE_KEYS, ("sequence", "vary"), "the sweep")
    vary = node["vary"]
    if not isinstance(vary, dict) or not vary:
        raise RigError(f"{where_of(path, node, 'vary')}: vary must be a map of parameters and what they take")
    wheres = {str(name): f"{where_of(path, vary, name)}: vary {name}" for name in vary}
    for key in ("set", "with"):
        if not isinstance(node.get(key) or {}, dict):
            raise RigError(f"{where_of(path, node, key)}: {key} must be a map of names and values, found {brief(node[key])}")
    numbers = {}
    for key in ("samples", "seed", "repeats", "delay"):
        if key in node:
            if not isinstance(node[key], int) or isinstance(node[key], bool):
                raise RigError(f"{where_of(path, node, key)}: {key} is {brief(node[key])}, expected a whole number")
            numbers[key] = node[key]
    fixed, fixed_with = ({str(k): str(v) for k, v in (node.get(key) or {}).items()} for key in ("set", "with"))
    beside = Path(path).parent
    names = {
        key: str(beside / node[key]) if str(node.get(key, "")).endswith((".yaml", ".yml")) else str(node[key])
        for key in ("sequence", "rig")
        if key in node
    }
    words = {key: str(node[key]) for key in ("controller", "level") if key in node}
    plugged = plugged_of(words.get("controller"), words.get("level"), numbers.pop("delay", 1), beside)
    return make_plan(
        Plan(
            names["sequence"],
            names.get("rig") or rig_of(names["sequence"], default),
            method=node.get("method") or "",
            fixed=fixed,
            fixed_with=fixed_with,
            description=str(node.get("description", "")),
            plugged=plugged,
            calculation=str(node.get("calculate", "")),
            **numbers,
        ),
        {str(name): spec for name, spec in vary.items()},
        wheres=wheres,
    )


def make_plan(draft: Plan, vary: dict, wheres: dict[str, str] | None = None) -> Plan:
    """Check a sweep and return its plan.

    Parameters
    ----------
    draft : Plan
        The sweep without what it varies; an empty ``method`` takes grid, or lhs when samples are given.
    vary : dict
        Text or list of values by the parameter's name.
    wheres : dict of str to str, or None
        Place of each parameter in a file, for the errors' sentences.

    Returns
    -------
    Plan
        The plan.

    Raises
    ------
    RigError
        When a name, a unit or a value does not fit the rig or the sequence, or the method does not fit the values.
    """
    load = partial(load_sequence, draft.sequence, rig=draft.rig)
    loaded = load(draft.fixed_with)
    config = load_rig(draft.rig, draft.fixed)
    loaded.check_rig(config)
    if draft.plugged:
        draft.plugged.check(config)
    if draft.calculation:
        on_recording(draft.rig, draft.calculation)
    method = draft.method or ("grid" if draft.samples is None else "lhs")
    if method not in METHODS:
        raise RigError(f"method is '{method}', expected {', '.join(METHODS)}")
    varied = []
    for name, spec in vary.items():
        where = (wheres or {}).get(name, f"--vary {name}")
        if name in draft.fixed or name in draft.fixed_with:
            raise RigError(f"{where}: it is set for all members too; give it once")
        varied.append(_read(name, spec, where, config, load, loaded))
    if not varied:
        raise RigError('a sweep needs something to vary: by the name of each parameter "LOW .. HIGH" or "A, B, C"')
    for name, low, high in (("samples", 1, MOST_MEMBERS), ("seed", 0, 2**62), ("repeats", 1, MOST_MEMBERS)):
        value = getattr(draft, name)
        if value is not None and not low <= value <= high:
            raise RigError(f"{name} is {value}, expected {low} to {high}")
    if draft.repeats > 1 and any(one.name == SEED for one in varied):
        raise RigError("a varied seed is the noise of a run, so that repeats would be the same run again; leave them out")
    _check_method(method, draft.samples, varied, wheres or {})
    names = {"sequence": _place(draft.sequence), "rig": _place(draft.rig)}
    plan = replace(draft, **names, method=method, samples=draft.samples or 0, varied=tuple(varied))
    if not 1 <= plan.count() <= MOST_MEMBERS:
        raise RigError(f"the sweep has {plan.count()} members, expected 1 to {MOST_MEMBERS}")
    return plan


def _place(name: str) -> str:
    """Return a file by its absolute path, so that the sweep can go on from another folder; an installed name stays as it is."""
    text = str(name)
    return str(Path(text).expanduser().absolute()) if text.endswith((".yaml", ".yml")) or "/" in text else text


def _check_method(method: str, samples: int | None, varied: list[Varied], wheres: dict[str, str]) -> None:
    if method in DRAWN:
        if not samples:
            raise RigError(
                f"method {method} draws its members; give their number with --samples (in a file and in Python: samples)"
            )
        return
    if samples:
        raise RigError(f"method {method} has as many members as its values make; samples belong to {' and '.join(DRAWN)}")
    for one in varied:
        if not one.values:
            raise RigError(
                f"{wheres.get(one.name, f'--vary {one.name}')}: method {method} needs values; write "
                '"A, B, C", "LOW .. HIGH in 5" or "LOW .. HIGH step 10 ms", or choose method lhs'
            )
    sizes = {one.name: len(one.values) for one in varied}
    if method == "list" and len(set(sizes.values())) > 1:
        raise RigError(
            "method list takes the values row by row, so all parameters need equally many; found "
            + ", ".join(f"{size} of {name}" for name, size in sizes.items())
        )


# ---- reading the values of a parameter


def _read(name: str, spec: object, where: str, config: RigConfig, load: Callable, loaded: Sequence) -> Varied:
    of, dimension = _dimension(name, where, config, loaded)
    texts = spec if isinstance(spec, list) else None
    if texts is None and isinstance(spec, str):
        match = _RANGE.fullmatch(spec) if dimension is not None else None
        if match:
            return _range(name, of, dimension, match, where, config, load)
        texts = spec.split(",")
    if texts is None:
        texts = [spec]
    texts = [str(text).strip() for text in texts]
    if not texts or not all(texts):
        raise RigError(f'{where}: expected values, e.g. "A, B, C", or a range "LOW .. HIGH"')
    if dimension is None:
        values, unit = tuple(texts), None
    else:
        unit = _unit(texts[0], dimension, where)
        values = tuple(_number(text, dimension, unit, where) for text in texts)
    one = Varied(name, of, unit, values)
    for value in values:
        _check(one, value, where, config, load)
    return one


def _dimension(name: str, where: str, config: RigConfig, sequence: Sequence) -> tuple[str, str | None]:
    """Return (owner of the parameter, its dimension: "whole" for whole numbers, None for words)."""
    if name == SEED:
        return "seed", "whole"
    if name in sequence.parameters:
        default = sequence.parameters[name]
        return "sequence", "whole" if isinstance(default, int) else dimension_of(default)
    if "." not in name and name != "wiring":
        what = f"parameter of sequence '{sequence.name}' and no value of the rig (as --set names them)"
        raise RigError(f"{where}: {unknown(what, name, [*sequence.parameters, *(one.name for one in config.settings.kept())])}")
    try:
        setting = config.settings.find(name)
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
    return "rig", setting.dimension if setting.is_number else None


def _unit(text: str, dimension: str, where: str) -> str:
    """Return the unit in which a value is written; RigError for a unit of another dimension."""
    if dimension == "whole":
        return ""
    quantity(text, dimension, where)
    return _NUMBER.fullmatch(text)[2] or "-"


def _number(text: str, dimension: str, unit: str, where: str) -> float | int:
    """Return a value in ``unit``."""
    if dimension == "whole":
        if not re.fullmatch(r"-?\d+", text):
            raise RigError(f"{where}: '{text}' is no whole number")
        return int(text)
    value = quantity(text, dimension, where)
    number, own = _NUMBER.fullmatch(text).groups()
    return float(number) if (own or "-") == unit else value / UNITS[unit][1]


def _range(name: str, of: str, dimension: str, match: re.Match[str], where: str, config: RigConfig, load: Callable) -> Varied:
    low_text, high_text, count, step_text, log = match.groups()
    if dimension != "whole" and dimension_of(low_text) is None and dimension_of(high_text) is not None:
        low_text = f"{low_text} {_NUMBER.fullmatch(high_text)[2]}"  # "-250 .. -150 ms"
    unit = _unit(low_text, dimension, where)
    low, high = (_number(text, dimension, unit, where) for text in (low_text, high_text))
    if not low < high:
        raise RigError(f"{where}: the range must rise, found {low_text} .. {high_text}")
    if log and low <= 0.0:
        raise RigError(f"{where}: a range along its logarithm must be above 0")
    if count and step_text:
        raise RigError(f"{where}: a range takes 'in' or 'step', not both")
    one = Varied(name, of, unit, (), low, high, bool(log))
    for value in (low, high):
        _check(one, value, where, config, load)
    if not (count or step_text):
        return one
    if step_text:
        step = _number(step_text, dimension, unit, where)
        if not step > 0:
            raise RigError(f"{where}: the step must be above 0")
        number = (high - low) / step * (1.0 + 1e-12) + 1.0
        if number >= MOST_MEMBERS + 1:
            raise RigError(f"{where}: the step makes {number:.6g} values, more than {MOST_MEMBERS}")
        number = math.floor(number)
        values = [low + k * step for k in range(number)]
        values = values if unit == "" else [float(f"{value:.12g}") for value in values]
    else:
        number = int(count)
        if not 2 <= number <= MOST_MEMBERS:
            raise RigError(f"{where}: 'in {number}': expected 2 to {MOST_MEMBERS} values")
        values = [one.at(k / (number - 1)) for k in range(number)]
        values = values if unit == "" else [float(f"{value:.12g}") for value in values]
        if len(set(values)) < number:
            raise RigError(f"{where}: 'in {number}' makes {', '.join(map(str, values[:6]))}: the same value more than once")
    return Varied(name, of, unit, tuple(values))


def _check(one: Varied, value: float | str, where: str, config: RigConfig, load: Callable) -> None:
    """Raise RigError when rig or sequence refuses this value by itself; values that do not fit together show only in a run."""
    if one.of == "sequence":
        try:
            load({one.name: one.text(value)})
        except RigError as error:
            raise RigError(f"{where}: {error}") from None
    if one.of != "rig":
        return
    try:
        with_overrides(config, {one.name: one.text(value)}, together=False)
    except RigError as error:
        raise RigError(f"{where}: {error}") from None
