# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is given to the functions of the API: its type and range, refused in one sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path

from ..base import KINDS, RigError, brief, check_product, not_written, quantity

LEAST = 1e-6  # s between rows
MOST_SEED = 2**63 - 1


def whole(name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """Return a whole number as int, of which numpy has types of its own; RigError when it is none or outside of the range."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least or (most is not None and value > most):
        span = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise RigError(f"{name} is {brief(value)}, expected a whole number {span}")
    return int(value)


def seed_of(value: object) -> int:
    """Return a seed; RigError when it is none."""
    return whole("seed", value, 0, MOST_SEED)


def chosen(name: str, value: object, count: int, owner: str) -> int:
    """Return the index of what is chosen by its number from 1 on; RigError when ``owner`` has no such number."""
    if isinstance(value, Integral) and not isinstance(value, bool) and 1 <= value <= count:
        return int(value) - 1
    raise RigError(f"there is no {name} {brief(value)}; {owner} has {count} {name}s" + (", the first is 1" if count else ""))


def seconds_of(name: str, value: object) -> float | None:
    """Return a time [s] that is given as a text with its unit or as a number of at least 1 us; None for None."""
    if value is None:
        return None
    seconds = quantity(value, "time", name) if isinstance(value, str) else value
    if not isinstance(seconds, Real) or isinstance(seconds, bool) or not LEAST <= seconds < math.inf:
        raise RigError(f"{name} is {brief(value)}, expected a time of at least 1 us, e.g. '5 ms'")
    return float(seconds)


def product(name: str, value: object, kind: str) -> Path:
    """Return the path of a file to write; RigError when something else than an older file of this kind is there."""
    path = path_of(name, value)
    try:
        check_product(str(path), path, KINDS[kind])
    except OSError as error:
        raise not_written(path, error) from None
    return path


def texts(name: str, value: object) -> list[str]:
    """Return a list of texts, which is empty for None; RigError for anything else, such as one text alone."""
    if value is None:
        return []
    if isinstance(value, str) or not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise RigError(f"{name} is {brief(value)}, expected a list of texts")
    return list(value)


def texts_of(name: str, value: object) -> dict[str, str]:
    """Return names with their values as texts, none for None; RigError for anything but a dict."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise RigError(f"{name} is {brief(value)}, expected a dict of names and values")
    return {str(key): str(one) for key, one in value.items()}


def path_of(name: str, value: object) -> Path:
    """Return a path; RigError when it is neither a text nor a Path."""
    if not isinstance(value, str | Path) or not str(value):
        raise RigError(f"{name} is {brief(value)}, expected a path")
    return Path(value)
