# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a YAML map to a frozen dataclass: every key is known, and every value has its unit, range and source.

rig.configuration uses it for the rig's parts; the dataclass of a part stands with its physics in plant/. A value is
written ``key: [1500 rpm, "where it is from"]``.

A library of schemas (JSON Schema, pydantic) knows neither units nor sources nor the lines of a file, which every refusal names, and
would need the ranges once more beside the fields.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .errors import RigError, brief
from .names import meant
from .units import quantity, span
from .yaml_file import no_space, where_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from pathlib import Path

    from _typeshed import DataclassInstance

    from .arrays import Record

    T = TypeVar("T", bound=DataclassInstance)

WORDS, SWITCH = "choice", "switch"  # dimensions of values that are not numbers


def param(
    dimension: str, low: float, high: float, text: str, default: object = dataclasses.MISSING, live: bool | str = False
) -> Any:
    """Return a dataclass field for a number with a dimension.

    Parameters
    ----------
    dimension : str
        Dimension of base.units.
    low, high : float
        Range [SI], inclusive.
    text : str
        What the value is, in one sentence without a full stop, its unit or its range. People see it wherever the value can be
        set; this also holds for :func:`choice` and :func:`switch`.
    default : object
        Value of a field that is left out; without it the field must be written.
    live : bool or str
        True, or the name of the device's state that takes the value, when it can be changed while the rig runs.

    Returns
    -------
    dataclasses.Field
        The field.
    """
    return dataclasses.field(
        default=default, metadata={"dimension": dimension, "low": low, "high": high, "text": text, "live": live}
    )


def choice(text: str, *names: str) -> Any:
    """Return a dataclass field that takes one of some words."""
    return dataclasses.field(metadata={"dimension": WORDS, "choices": names, "text": text})


def switch(text: str, default: object = dataclasses.MISSING) -> Any:
    """Return a dataclass field that is True or False, written on or off; a field with a default may be left out."""
    return dataclasses.field(default=default, metadata={"dimension": SWITCH, "choices": ("on", "off"), "text": text})


def check_keys(
    path: str | Path, node: object, allowed: Collection[object], required: Iterable[str], what: str, where: str = ""
) -> None:
    """Refuse a map with an unknown key, or without a required one.

    Parameters
    ----------
    path : str or Path
        The file.
    node : object
        The map.
    allowed : collection
        Keys that it may have.
    required : iterable of str
        Keys that it must have.
    what : str
        What the map is, for the errors.
    where : str
        ``file:line``, for a node that is not a map and has no line of its own.

    Raises
    ------
    RigError
        With file and line, when the node is not such a map.
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
    """Return an instance of the dataclass ``cls`` from a marked map.

    Parameters
    ----------
    cls : type
        The dataclass.
    node : Map
        The map.
    path : str or Path
        The file.
    what : str
        What the map is, for the errors.
    others : tuple of str
        Keys of the map that other code reads.
    where : str
        As of :func:`check_keys`.

    Returns
    -------
    instance of cls
        The values.

    Raises
    ------
    RigError
        With file and line, when a key or a value is not right.
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
    """Return the value of a field from its [value with unit, "its source"]; RigError when it is not right."""
    if not (isinstance(node, list) and len(node) == 2 and isinstance(node[1], str) and node[1].strip()):
        raise RigError(f'{where} must be [value with unit, "its source"], found {brief(node)}')
    meta = field.metadata
    return value_of(meta["dimension"], meta.get("low"), meta.get("high"), meta.get("choices", ()), node[0], where)


def value_of(dimension: str, low: float, high: float, choices: tuple[str, ...], text: Any, where: str) -> float | bool | str:
    """Return the value of a text for a dimension with its range, or for some words.

    Parameters
    ----------
    dimension : str
        Dimension of base.units, or SWITCH or WORDS.
    low, high : float
        Range of a number [SI], inclusive.
    choices : tuple of str
        The words; empty for a number.
    text : object
        What was written.
    where : str
        Beginning of the error.

    Returns
    -------
    float, bool or str
        The number [SI], True or False, or the word.

    Raises
    ------
    RigError
        When the text is not such a value.
    """
    if choices:
        if dimension == SWITCH and isinstance(text, bool):
            return text  # a truth value of YAML
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
    """The fields that the kernel reads: all except words."""
    return [f for f in dataclasses.fields(cls) if f.metadata["dimension"] != WORDS]


def record_dtype(*classes: type[DataclassInstance]) -> np.dtype:
    """Return the numpy type of a record that the compiled kernel reads: one float64 for each field except words, in order."""
    return np.dtype([(f.name, np.float64) for cls in classes for f in _numbers(cls)])


def fill(record: Record | np.void, *instances: DataclassInstance) -> None:
    """Copy the values of dataclasses into a numpy record of :func:`record_dtype`."""
    for instance in instances:
        for field in _numbers(type(instance)):
            record[field.name] = getattr(instance, field.name)
