# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is given to the functions of the API: its type and range, refused in one sentence."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from pathlib import Path

from ..base import RigError, brief


def whole(name: str, value: object, least: int = 0) -> int:
    """Return a whole number as int, of which numpy has types of its own; RigError when it is none or below the least."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise RigError(f"{name} is {brief(value)}, expected a whole number of at least {least}")
    return int(value)


def texts(name: str, value: object) -> list[str]:
    """Return a list of texts, which is empty for None; RigError for anything else, such as one text alone."""
    if value is None:
        return []
    if isinstance(value, str) or not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise RigError(f"{name} is {brief(value)}, expected a list of texts")
    return list(value)


def path_of(name: str, value: object) -> Path:
    """Return a path; RigError when it is neither a text nor a Path."""
    if not isinstance(value, str | Path) or not str(value):
        raise RigError(f"{name} is {brief(value)}, expected a path")
    return Path(value)
