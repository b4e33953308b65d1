# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the plug of a controller's specification; used by ``simulate``, alfa46, ``controller`` and the tests.

A plug is one line in PLUGS. Its module is imported only when it is needed, so that the imports of the other plugs
cost nothing.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..base import RigError, need_ros, printable, unknown
from .plug import DECLARED, DEFAULT, GIVEN, BuiltIn, Plug
from .seam import LEVELS

if TYPE_CHECKING:
    from ..rig import RigConfig


class Kind(NamedTuple):
    """Where the plug of a prefix is, ``maker(rest, config, level)`` in ``module``, and how its specification is written.

    alone: the prefix is enough, nothing needs to follow it.
    """

    module: str
    maker: str
    form: str
    alone: bool = False


PLUGS = {
    "python": Kind("python.python_class", "PythonClass", "python:FILE.py:CLASS, python:MODULE:CLASS, python:NAME"),
    "c": Kind("c.library", "CLibrary", "c:FILE.so, c:FILE.c, c:FILE.cpp"),
    "simulink": Kind("c.simulink", "SimulinkModel", "simulink:FOLDER"),
    "udp": Kind("udp.plug", "Udp", "udp:PORT"),
    "fmu": Kind("fmi.plug", "ControllerFmu", "fmu:FILE.fmu"),
    "can": Kind("can.bus", "CanBus", "can:CHANNEL?interface=NAME"),
    "modbus": Kind("modbus.server", "Modbus", "modbus:PORT"),
    "ros": Kind("ros.plug", "ros_controller", "ros:NAME", alone=True),
}

IN_PROCESS = "@in-process"  # behind the specification of a Python class, before its level: it runs in the rig's process
SENDS = {"duty": "shares of the supply", "current": "currents in A"}  # what a command means, by level

# the most likely meaning of a file name that is given without a prefix
OF_A_FILE = {".c": "c:{}", ".cpp": "c:{}", ".cc": "c:{}", ".cxx": "c:{}", ".so": "c:{}", ".fmu": "fmu:{}", ".py": "python:{}:CLASS"}


def forms() -> str:
    """Return all forms of a specification, for people."""
    return ", ".join(["alfa46", *(kind.form for kind in PLUGS.values())])


def split_level(spec: str, level: str | None) -> tuple[str, str | None]:
    """Split a trailing "@level" off a specification.

    Parameters
    ----------
    spec : str
        The specification, with or without "@duty" or "@current".
    level : str or None
        A level that was asked for separately.

    Returns
    -------
    tuple
        (specification without the level, level or None).

    Raises
    ------
    RigError
        When the two levels differ, or the level is unknown.
    """
    for name in LEVELS:
        if spec.endswith(f"@{name}"):
            if level not in (None, name):
                raise RigError(f"controller {spec}: level '{level}' is asked for too; name one level")
            return spec.removesuffix(f"@{name}"), name
    if level not in (None, *LEVELS):
        raise RigError(f"level '{level}' of controller {spec}: expected {' or '.join(LEVELS)}")
    return spec, level


def _meant(text: str) -> str | None:
    """Return the specification that the bare name of a file or Simulink folder stands for, None when it is neither."""
    path = Path(text)
    if path.is_dir():
        return f"simulink:{text}"
    return OF_A_FILE[path.suffix].format(text) if path.suffix in OF_A_FILE else None


def load_controller(spec: str | None, config: RigConfig, level: str | None = None) -> Plug:
    """Return the plug of a specification for a rig, initialised with the rig's alfa46 settings.

    Parameters
    ----------
    spec : str or None
        The specification; None stands for the built-in Alfa46. A trailing "@duty" or "@current" chooses the level, IN_PROCESS
        before it the rig's process.
    config : RigConfig
        The rig's configuration.
    level : str or None
        The level, when the controller works at both; None takes the controller's first.

    Returns
    -------
    Plug
        The plug; its ``level_from`` is the origin of the level.

    Raises
    ------
    RigError
        One sentence, for everything that cannot be loaded.
    """
    text, level = split_level(spec or "alfa46", level)
    plug = _loaded(text, config, level)
    if level:
        plug.level_from = GIVEN
    return plug


def level_line(plug: Plug) -> str:
    """Return the first line of a run: the controller, its level, and where the level comes from."""
    text = _line(printable(plug.name), plug.level, plug.level_from)
    if plug.level_from == DEFAULT:
        other = LEVELS[1 - LEVELS.index(plug.level)]
        text += f"; if it sends {SENDS[other]}, choose --level {other}"
    return text


def embedded_line() -> str:
    """Return :func:`level_line` of the built-in controller inside the kernel."""
    return _line("alfa46", "duty", DECLARED)


def _line(name: str, level: str, level_from: str) -> str:
    return f"controller {name} sends {SENDS[level]}: level {level}, {level_from}"


def _loaded(text: str, config: RigConfig, level: str | None) -> Plug:
    if text.endswith(IN_PROCESS):
        from .python.python_class import InProcess

        name, _, rest = text.removesuffix(IN_PROCESS).partition(":")
        if name != "python" or not rest:
            raise RigError(f"controller {text}: only a Python class runs in the rig's process (--in-process)")
        return InProcess(rest, config, level)
    name, _, rest = text.partition(":")
    if text == "alfa46":
        return BuiltIn(config, level)
    kind = PLUGS.get(name)
    if kind is None or not (rest or kind.alone):
        if meant := _meant(text):
            raise RigError(f"controller '{text}' cannot be loaded; did you mean {meant}?")
        if kind is None and name not in OF_A_FILE:
            raise RigError(f"controller '{text}': {unknown('kind', name, ['alfa46', *PLUGS])} (expected {forms()})")
        raise RigError(f"controller '{text}' cannot be loaded; expected {forms()}")
    _, sign, other = rest.rpartition("@")
    if sign and other.isidentifier() and not Path(rest).exists():
        raise RigError(f"controller {text}: there is no level '{other}'; expected {' or '.join(LEVELS)} behind the @")
    if kind.module.startswith("ros."):
        need_ros(f"controller {text}")
    module = importlib.import_module(f".{kind.module}", __package__)
    return getattr(module, kind.maker)(rest, config, level)
