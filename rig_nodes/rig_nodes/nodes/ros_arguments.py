# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The part of a process's command line after --ros-args: names that the rig cannot have are refused, parameters are set.

nodes.process and `ros2 run rig_nodes replay` use it. rclpy reads the rest (topics, log level) itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rclpy.utilities import remove_ros_args

from ..base import RigError, load_yaml, unknown
from ..controllers import check_namespace

if TYPE_CHECKING:
    from rclpy.node import Node

REMAP, PARAMETER, FILE = ("-r", "--remap"), ("-p", "--param"), ("--params-file",)


class Override(NamedTuple):
    """A parameter on the command line or in a file: its place, its node (with * for several), and its name."""

    where: str
    node: str  # with its namespace, as /motor
    name: str


def own_arguments(words: list[str], name: str) -> list[str]:
    """Return a command line without the arguments for ROS; RigError if ROS cannot read these or they rename the node ``name``."""
    try:
        own = remove_ros_args(words)
    except RuntimeError as error:  # the text behind the last comma is a place in the source of rcl
        raise RigError(f"--ros-args: {str(error).partition(', at /')[0]}") from None
    for flag, rule in _pairs(words):
        if flag in REMAP:
            _check_remap(rule, name)
    return own


def _check_remap(rule: str, name: str) -> None:
    source, _, target = rule.partition(":=")
    what = source.rpartition(":")[2]
    if what == "__ns":
        check_namespace(target, f"--ros-args -r {rule}")
    elif what in ("__node", "__name") and target != name:
        raise RigError(
            f"--ros-args -r {rule}: the rig's nodes find each other by their names, so these cannot change; leave it out"
        )


def _pairs(words: list[str]) -> Iterator[tuple[str, str]]:
    """Each flag behind --ros-args with what follows it, up to the next --."""
    inside = False
    for word, following in zip(words, [*words[1:], ""]):
        inside = word == "--ros-args" or (inside and word != "--")
        if inside:
            yield word, following


def overrides(words: list[str]) -> list[Override]:
    """Return all parameters that a command line names, in its order."""
    found = []
    for flag, text in _pairs(words):
        if flag in PARAMETER:
            node, _, name = text.partition(":=")[0].rpartition(":")
            found.append(Override(f"--ros-args -p {text}", _absolute(node) if node else "/**", name))
        elif flag in FILE:
            found += (Override(text, node, name) for node, name in _entries("", load_yaml(Path(text))))
    return found


def _absolute(node: str) -> str:
    return "/" + node.strip("/")


def _entries(path: str, tree: dict | None) -> Iterator[tuple[str, str]]:
    """Each node and parameter that a parameter file names below a path of names."""
    for key, below in (tree or {}).items():
        if key == "ros__parameters":
            yield from ((_absolute(path), name) for name in _names("", below))
        else:
            yield from _entries(f"{path}/{str(key).strip('/')}", below)


def _names(prefix: str, tree: dict | None) -> Iterator[str]:
    for key, value in (tree or {}).items():
        if isinstance(value, dict):
            yield from _names(f"{prefix}{key}.", value)
        else:
            yield f"{prefix}{key}"


def set_parameters(words: list[str], nodes: Collection[Node], tell: Callable[[str], None]) -> None:
    """Set the parameters of some nodes from a command line, as if they had been set at run time.

    Parameters
    ----------
    words : list of str
        The command line.
    nodes : collection of Node
        The nodes of this process.
    tell : callable
        It gets a sentence on a parameter that is for no node here, as it may be for another process.

    Raises
    ------
    RigError
        When a node here lacks a parameter or refuses its value.
    """
    here = {_absolute(node.get_name()): node for node in nodes}
    for where, name, parameter in overrides(words):
        if "*" in name:
            if not any(has(node, parameter) for node in nodes):
                tell(f"{where}: none of {', '.join(here)} has a parameter '{parameter}'; nothing done here")
        elif name in here:
            if not has(here[name], parameter):
                known = here[name].get_parameters_by_prefix("")
                raise RigError(f"{where}: {unknown(f'parameter of {name}', parameter, known)}")
        elif where.startswith("--ros-args"):
            raise RigError(f"{where}: there is no node {name} here; expected one of {', '.join(here)}")
        else:
            tell(f"{where}: its entry {name} is for no node here ({', '.join(here)})")
    for node in nodes:
        if hasattr(node, "settings"):
            node.settings.take_overrides()


def has(node: Node, parameter: str) -> bool:
    """Return whether a node has this parameter, or may get it when its controller has come."""
    return node.has_parameter(parameter) or (hasattr(node, "settings") and node.settings.may_come(parameter))
