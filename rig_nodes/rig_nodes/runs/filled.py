# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ${names} of a sequence's steps and of a procedure, replaced by values, and loops written out; runs.sequence uses it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from ..base import List, Map, RigError, brief, check_keys, unknown, where_of

LONGEST = 10_000  # steps after unrolling repeats
MOST_FILLED = 200_000  # values after unrolling repeats
_NAMED = re.compile(r"\$(?:\{([^}]*)(\}?)|(\w+))")


def filled(text: str, values: dict, where: str, what: str) -> str:
    """Return a text in which the values of names replace their ${names}.

    Parameters
    ----------
    text : str
        The text with ${names}.
    values : dict
        Values by name.
    where : str
        Place of the text, for the errors.
    what : str
        What the names are called in the errors, e.g. "parameter".

    Returns
    -------
    str
        The text with all names replaced.

    Raises
    ------
    RigError
        When a name is unknown, is not a name, or lacks one of its braces.
    """

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
                f"{where}: between the braces of {brief(match[0])} there is no name; nothing is computed there, "
                f"so give the {what} the value that is wanted"
            )
        raise RigError(f"{where}: {unknown(what, f'${{{inner}}}', [f'${{{name}}}' for name in values])}")

    return _NAMED.sub(value, text)


class Looped(Map):
    """A map in loops, with the value of each as it is written."""

    def __init__(self, line: int, loops: dict[str, str]) -> None:
        super().__init__(line)
        self.loops = loops


class Filled:
    """Steps in which values replace the ${names} of parameters, and in which ``each`` is written out once for each value.

    What is read is not changed. What is made is counted, so that nested loops that make too much end with an error.
    """

    def __init__(self, path: str | Path) -> None:
        self.path, self.made = path, 0
        self.loops: dict[str, str] = {}  # names and values of the loops around what is read

    def of(self, node: Any, parameters: dict, where: str) -> Any:
        """Return the node with all names replaced; maps and lists keep their lines."""
        self.made += 1
        if self.made > MOST_FILLED:
            raise RigError(f"{where}: repeats make more than {MOST_FILLED} values of the steps")
        if isinstance(node, str):
            names = _NAMED.fullmatch(node)
            if names and names[2] and names[1] in parameters:
                return parameters[names[1]]  # a whole number stays a whole number
            return filled(node, parameters, where, "parameter")
        if isinstance(node, Map):
            out = Looped(node.line, self.loops)
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
        """Write out a repeat over the values of a name: its steps once for each value."""
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
        around = self.loops
        for value in values:
            self.loops = {**around, str(name): str(value)}
            more = self.of(node["steps"], {**parameters, name: value}, where)
            steps.extend(more)
            steps.lines += more.lines
            if len(steps) > LONGEST:
                raise RigError(f"{at} makes more than {LONGEST} steps")
        self.loops = around
        out = Map(node.line)
        out.update(times=1, steps=steps)
        out.lines = {"times": node.line, "steps": node.lines["steps"]}
        return out
