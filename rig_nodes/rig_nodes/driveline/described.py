# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks the types of the arguments of a driveline's description.

Used by driveline.builder for all its public methods at once; the annotations of their parameters state the types.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..base import RigError, brief

Described = TypeVar("Described")


def checks_arguments(cls: type[Described]) -> type[Described]:
    """Make the public methods of a class raise RigError for arguments of another type than their annotations state."""
    for name, method in list(vars(cls).items()):
        if not name.startswith("_") and inspect.isfunction(method):
            setattr(cls, name, _checked(method))
    return cls


def is_number(value: object) -> bool:
    """True for one real number of Python or numpy; False for a truth value."""
    return not isinstance(value, str) and np.ndim(np.asarray(value, object)) == 0 and np.asarray(value).dtype.kind in "iuf"


def is_pair(value: object) -> bool:
    """True for two numbers."""
    return isinstance(value, Sequence) and len(value) == 2 and all(map(is_number, value))


# annotation -> the accepted values in words, and their test; arguments with other annotations are checked where they are used
KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "float": ("a number", is_number),
    "str": ("a name", lambda value: isinstance(value, str) and value != ""),
    "float | tuple[float, float]": ("a number or two of them", lambda value: is_number(value) or is_pair(value)),
    "Mapping[str, float]": (
        "a map of names and numbers",
        lambda value: isinstance(value, Mapping) and all(isinstance(k, str) and is_number(v) for k, v in value.items()),
    ),
    "Sequence[tuple[float, float]]": (
        "a list of pairs of numbers",
        lambda value: isinstance(value, Sequence) and all(map(is_pair, value)),
    ),
}


def _checked(method: Callable) -> Callable:
    shape = inspect.signature(method)
    wanted = {}
    for name, one in shape.parameters.items():
        kind = str(one.annotation)
        if (plain := kind.removesuffix(" | None")) in KINDS:
            wanted[name] = (*KINDS[plain], plain != kind)

    @functools.wraps(method)
    def checked(*arguments: Any, **named: Any) -> Any:
        try:
            given = shape.bind(*arguments, **named).arguments
        except TypeError as error:
            raise RigError(f"driveline: {method.__name__}: {error}") from None
        for name, value in given.items():
            if name in wanted:
                words, test, may_lack = wanted[name]
                if not (test(value) or (may_lack and value is None)):
                    one = f" '{given['name']}'" if isinstance(given.get("name"), str) and name != "name" else ""
                    raise RigError(f"driveline: {name} of {method.__name__}{one} is {brief(value)}; {words} is needed")
        return method(*arguments, **named)

    return checked
