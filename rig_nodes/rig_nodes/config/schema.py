"""From a YAML map to a frozen dataclass: every key known, every value with its unit, range and source.

Used by testbench.configuration for the rig's parts; a part's dataclass stands beside its physics in plant/.
A value is written ``key: [1500 rpm, "where it is from"]``.
"""

from __future__ import annotations

import dataclasses
import difflib

import numpy as np

from ..errors import RigError
from .units import quantity


def param(dimension: str, low: float, high: float):
    """A dataclass field: SI value of this dimension between low and high (SI, inclusive)."""
    return dataclasses.field(metadata={"dimension": dimension, "low": low, "high": high})


def limits(cls, name: str) -> tuple[float, float]:
    """Lowest and highest value (SI, inclusive) of a :func:`param` field."""
    meta = cls.__dataclass_fields__[name].metadata
    return meta["low"], meta["high"]


def where_of(path, node, key=None) -> str:
    """``file:line`` of a key in a map that was loaded with its marks."""
    try:
        line = node.lc.key(key)[0] if key is not None else node.lc.line
    except (AttributeError, KeyError, TypeError):
        return str(path)
    return f"{path}:{line + 1}"


def check_keys(path, node, allowed, required, what: str) -> None:
    """RigError with file and line when a map has a key it should not have, or lacks one."""
    if not isinstance(node, dict):
        raise RigError(f"{where_of(path, node)}: {what} must be a map of keys, found {node!r}")
    for key in node:
        if key not in allowed:
            near = difflib.get_close_matches(str(key), [str(a) for a in allowed], 1)
            hint = f"did you mean '{near[0]}'?" if near else f"expected one of {', '.join(map(str, allowed))}"
            raise RigError(f"{where_of(path, node, key)}: unknown key '{key}' in {what}; {hint}")
    missing = [key for key in required if key not in node]
    if missing:
        raise RigError(f"{where_of(path, node)}: {what} lacks the key '{missing[0]}'")


def build(cls, node, path, what: str, others: tuple = ()):
    """An instance of the dataclass ``cls`` from a marked map; RigError with file and line otherwise.

    ``others`` are keys of the map that somebody else reads.
    """
    names = [f.name for f in dataclasses.fields(cls)]
    check_keys(path, node, [*names, *others], names, what)
    values = {}
    for field in dataclasses.fields(cls):
        where = f"{where_of(path, node, field.name)}: {what}.{field.name}"
        entry = node[field.name]
        if not (isinstance(entry, list) and len(entry) == 2 and isinstance(entry[1], str) and entry[1].strip()):
            raise RigError(f"{where} must be [value with unit, \"its source\"], found {entry!r}")
        value = quantity(entry[0], field.metadata["dimension"], where)
        low, high = field.metadata["low"], field.metadata["high"]
        if not low <= value <= high:
            raise RigError(f"{where} is {entry[0]}, outside {low:g} to {high:g} (SI)")
        values[field.name] = value
    return cls(**values)


def record_dtype(*classes) -> np.dtype:
    """One float64 per field of the dataclasses, in order: what the compiled kernel reads."""
    return np.dtype([(f.name, np.float64) for cls in classes for f in dataclasses.fields(cls)])


def fill(record, *instances) -> None:
    """Copy dataclass values into a numpy record of :func:`record_dtype`."""
    for instance in instances:
        for field in dataclasses.fields(instance):
            record[field.name] = getattr(instance, field.name)
