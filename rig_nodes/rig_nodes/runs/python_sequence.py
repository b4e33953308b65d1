# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sequence that is built in Python: the same maps and lists as in a file, read and checked by the same code.

The Python API uses it. An error names the number of the step, where that of a file names the line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base import List, Map, RigError, check_keys
from .sequence import KEYS, Sequence, checked

if TYPE_CHECKING:
    from ..rig import RigConfig

NAME, PLACE = "steps", Path("step")  # errors begin with step:NUMBER
MOST_NESTED = 50


def sequence_of(steps: Any, values: dict[str, str], config: RigConfig, rig: str) -> Sequence:
    """Return a sequence of steps.

    Parameters
    ----------
    steps : list or mapping
        The steps as in a sequence's file, or a mapping with the keys of such a file, of which only ``steps`` is needed.
    values : dict of str to str
        Values of its parameters in place of their defaults.
    config : RigConfig
        The rig on which it is to run.
    rig : str
        Its name or file.

    Returns
    -------
    Sequence
        The checked sequence.

    Raises
    ------
    RigError
        When something is not right, with the number of the step.
    """
    node = _marked(steps if isinstance(steps, Mapping) else {"steps": steps})
    node.setdefault("description", "steps given in Python")
    check_keys(PLACE, node, KEYS, ("steps",), "the sequence")
    if isinstance(node["steps"], List):
        for number, step in enumerate(node["steps"]):
            node["steps"][number] = _marked(step, number)
        node["steps"].lines = list(range(len(node["steps"])))
    return replace(checked(node, PLACE, values, config, rig, lambda _nodes, error: error), name=NAME)


def _marked(node: Any, line: int = 0, depth: int = 0) -> Any:
    """Return maps and lists as those of a file, all of them in one line; it counts from 0."""
    if depth > MOST_NESTED:
        raise RigError(f"{PLACE}: the sequence is nested deeper than {MOST_NESTED} levels")
    if isinstance(node, Mapping):
        out = Map(line)
        out.update((key, _marked(value, line, depth + 1)) for key, value in node.items())
        out.lines = dict.fromkeys(out, line)
        return out
    if isinstance(node, list | tuple):
        items = List(line)
        items.extend(_marked(item, line, depth + 1) for item in node)
        items.lines = [line] * len(items)
        return items
    return node
