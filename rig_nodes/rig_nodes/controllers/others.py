"""The plugs that stand on other packages or wires, by the kind that opens their specification; used by load.py.

They are imported when one is asked for.
"""

from __future__ import annotations

from importlib import import_module

from ..alfa46.settings import Alfa46Config
from .plug import Plug

PLUGS = {  # kind -> (module, class)
    "fmu": ("fmu", "ControllerFmu"),
    "can": ("can_bus", "CanBus"),
    "modbus": ("modbus", "Modbus"),
}


def plugged(kind: str, rest: str, config: Alfa46Config, level: str | None) -> Plug:
    """The plug of ``kind:rest``; RigError when it cannot be had."""
    module, name = PLUGS[kind]
    return getattr(import_module(f".{module}", __package__), name)(rest, config, level)
