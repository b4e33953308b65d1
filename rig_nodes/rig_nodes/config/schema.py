# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a YAML map to a frozen dataclass: every key known, every value with its unit, range and source.

Used by testbench.configuration for the rig's parts; a part's dataclass stands beside its physics in plant/.
A value is written ``key: [1500 rpm, "where it is from"]``.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ..errors import RigError, brief
from .names import meant
from .units import quantity, span
from .yaml_file import no_space, where_of


def param(dimension: str, low: float, high: float, text: str, default=dataclasses.MISSING):
    """A dataclass field: SI value of this dimension between low and high (SI, inclusive); one with a default may be left out.

    text: what it is, in one sentence without a full stop, its unit or its range; so for the others below. People see it
    wherever the value can be set.
    """
    return dataclasses.field(default=default, metadata={"dimension": dimension, "low": low, "high": high, "text": text})


def choice(text: str, *names: str):
    """A dataclass field: one of these words."""
    return dataclasses.field(metadata={"dimension": "choice", "choices": names, "text": text})


def switch(text: str, default=dataclasses.MISSING):
    """A dataclass field: True or False, written on or off; one with a default may be left out."""
    return dataclasses.field(default=default, metadata={"dimension": "switch", "choices": ("on", "off"), "text": text})


def limits(cls, name: str) -> tuple[float, float]:
    """Lowest and highest value (SI, inclusive) of a :func:`param` field."""
    meta = cls.__dataclass_fields__[name].metadata
    return meta["low"], meta["high"]


def check_keys(path, node, allowed, required, what: str, where: str = "") -> None:
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
            raise RigError(f"{where_of(path, node, key)}: {slip or f'unknown key {brief(str(key))} in {what}; {meant(key, allowed)}'}")
    missing = [key for key in required if key not in node]
    if missing:
        raise RigError(f"{where_of(path, node)}: {what} lacks the key '{missing[0]}'")


def build(cls, node, path, what: str, others: tuple = (), where: str = ""):
    """An instance of the dataclass ``cls`` from a marked map; RigError with file and line otherwise.

    ``others`` are keys of the map that somebody else reads; where: as for :func:`check_keys`.
    """
    names = [f.name for f in dataclasses.fields(cls)]
    check_keys(path, node, [*names, *others], [f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING],
               what, where)
    values = {}
    for field in dataclasses.fields(cls):
        if field.name not in node:
            continue
        where = f"{where_of(path, node, field.name)}: {what}.{field.name}"
        values[field.name] = entry(field, node[field.name], where)
    return cls(**values)


def entry(field, node, where: str):
    """Value of a field from its [value with unit, "its source"]; RigError otherwise."""
    if not (isinstance(node, list) and len(node) == 2 and isinstance(node[1], str) and node[1].strip()):
        raise RigError(f"{where} must be [value with unit, \"its source\"], found {brief(node)}")
    return field_value(field, node[0], where)


def field_value(field, text, where: str):
    """What a field of a part takes from the words of its YAML or an override; RigError otherwise."""
    meta = field.metadata
    if "choices" in meta:
        if meta["dimension"] == "switch" and isinstance(text, bool):
            return text  # YAML's own
        if text not in meta["choices"]:
            raise RigError(f"{where} is '{text if isinstance(text, str) and len(text) < 60 else brief(text)}', expected one "
                           f"of {', '.join(meta['choices'])}")
        return text == "on" if meta["dimension"] == "switch" else text
    value = quantity(text, meta["dimension"], where)
    if not meta["low"] <= value <= meta["high"]:
        raise RigError(f"{where} is {text}, outside {span(meta['low'], meta['high'], text)}")
    return value


def _numbers(cls) -> list:
    """The fields that the kernel reads: all but words."""
    return [f for f in dataclasses.fields(cls) if f.metadata["dimension"] != "choice"]


def record_dtype(*classes) -> np.dtype:
    """One float64 per field of the dataclasses but words, in order: what the compiled kernel reads."""
    return np.dtype([(f.name, np.float64) for cls in classes for f in _numbers(cls)])


def fill(record, *instances) -> None:
    """Copy dataclass values into a numpy record of :func:`record_dtype`."""
    for instance in instances:
        for field in _numbers(type(instance)):
            record[field.name] = getattr(instance, field.name)
