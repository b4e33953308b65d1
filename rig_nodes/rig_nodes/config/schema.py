# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a YAML map to a frozen dataclass: every key known, every value with its unit, range and source.

Used by testbench.configuration for the rig's parts; a part's dataclass stands beside its physics in plant/.
A value is written ``key: [1500 rpm, "where it is from"]``.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..errors import RigError, brief
from .names import meant
from .units import quantity, span
from .yaml_file import no_space, where_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from pathlib import Path

    from _typeshed import DataclassInstance

    from ..arrays import Record

    T = TypeVar("T", bound=DataclassInstance)

WORDS, SWITCH = "choice", "switch"  # dimensions of what is no number


def param(
    dimension: str, low: float, high: float, text: str, default: object = dataclasses.MISSING, live: bool | str = False
) -> Any:
    """A dataclass field: SI value of this dimension between low and high (SI, inclusive); one with a default may be left out.

    text: what it is, in one sentence without a full stop, its unit or its range; so for the others below. People see it
    wherever the value can be set. live: it can change while the rig runs, at a device by this one of its states.
    """
    return dataclasses.field(
        default=default, metadata={"dimension": dimension, "low": low, "high": high, "text": text, "live": live}
    )


def choice(text: str, *names: str) -> Any:
    """A dataclass field: one of these words."""
    return dataclasses.field(metadata={"dimension": WORDS, "choices": names, "text": text})


def switch(text: str, default: object = dataclasses.MISSING) -> Any:
    """A dataclass field: True or False, written on or off; one with a default may be left out."""
    return dataclasses.field(default=default, metadata={"dimension": SWITCH, "choices": ("on", "off"), "text": text})


def check_keys(
    path: str | Path, node: object, allowed: Collection[object], required: Iterable[str], what: str, where: str = ""
) -> None:
    """RigError with file and line when a map has a key it should not have, or lacks one.

    where: ``file:line`` of what may be no map at all and then has no line of its own.
    """
    if not isinstance(node, dict):
        slip = no_space(node) if isinstance(node, str) else ""
        where = where_of(path, node) if hasattr(node, "line") or not where else where
        raise RigError(f"{where}: {what} must be a map of keys, found {brief(node)}{f'; {slip}' if slip else ''}")
    for key in node:
        if key not in allowed:
            slip = no_space(key) if isinstance(key, str) else ""
            raise RigError(
                f"{where_of(path, node, key)}: {slip or f'unknown key {brief(str(key))} in {what}; {meant(key, allowed)}'}"
            )
    missing = [key for key in required if key not in node]
    if missing:
        raise RigError(f"{where_of(path, node)}: {what} lacks the key '{missing[0]}'")


def build(cls: type[T], node: Any, path: str | Path, what: str, others: tuple = (), where: str = "") -> T:
    """An instance of the dataclass ``cls`` from a marked map; RigError with file and line otherwise.

    ``others`` are keys of the map that somebody else reads; where: as for :func:`check_keys`.
    """
    names = [f.name for f in dataclasses.fields(cls)]
    check_keys(
        path, node, [*names, *others], [f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING], what, where
    )
    values = {}
    for field in dataclasses.fields(cls):
        if field.name not in node:
            continue
        where = f"{where_of(path, node, field.name)}: {what}.{field.name}"
        values[field.name] = entry(field, node[field.name], where)
    return cls(**values)


def entry(field: dataclasses.Field, node: object, where: str) -> float | bool | str:
    """Value of a field from its [value with unit, "its source"]; RigError otherwise."""
    if not (isinstance(node, list) and len(node) == 2 and isinstance(node[1], str) and node[1].strip()):
        raise RigError(f'{where} must be [value with unit, "its source"], found {brief(node)}')
    meta = field.metadata
    return value_of(meta["dimension"], meta.get("low"), meta.get("high"), meta.get("choices", ()), node[0], where)


def value_of(dimension: str, low: float, high: float, choices: tuple[str, ...], text: Any, where: str) -> float | bool | str:
    """What a value of this dimension, range (SI) or words takes from what somebody has written; RigError otherwise."""
    if choices:
        if dimension == SWITCH and isinstance(text, bool):
            return text  # YAML's own
        if text not in choices:
            raise RigError(
                f"{where} is '{text if isinstance(text, str) and len(text) < 60 else brief(text)}', expected one "
                f"of {', '.join(choices)}"
            )
        return text == "on" if dimension == SWITCH else text
    value = quantity(text, dimension, where)
    if not low <= value <= high:
        raise RigError(f"{where} is {text}, outside {span(low, high, text)}")
    return value


def _numbers(cls: type[DataclassInstance]) -> list:
    """The fields that the kernel reads: all but words."""
    return [f for f in dataclasses.fields(cls) if f.metadata["dimension"] != WORDS]


def record_dtype(*classes: type[DataclassInstance]) -> np.dtype:
    """One float64 per field of the dataclasses but words, in order: what the compiled kernel reads."""
    return np.dtype([(f.name, np.float64) for cls in classes for f in _numbers(cls)])


def fill(record: Record | np.void, *instances: DataclassInstance) -> None:
    """Copy dataclass values into a numpy record of :func:`record_dtype`."""
    for instance in instances:
        for field in _numbers(type(instance)):
            record[field.name] = getattr(instance, field.name)
