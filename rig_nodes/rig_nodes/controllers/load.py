"""From a controller's specification to its plug; used by ``simulate``, the alfa46 process and the tests."""

from __future__ import annotations

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from .c_library import CLibrary
from .others import PLUGS, plugged
from .plug import BuiltIn, Plug
from .python_class import PythonClass
from .seam import LEVELS

FORMS = "alfa46, python:FILE.py:CLASS, python:MODULE:CLASS, c:FILE.so, c:FILE.c or fmu:FILE.fmu"


def split_level(spec: str, level: str | None) -> tuple[str, str | None]:
    """A specification without its "@level", and the level; RigError when the two say different things."""
    for name in LEVELS:
        if spec.endswith(f"@{name}"):
            if level not in (None, name):
                raise RigError(f"controller {spec}: level '{level}' is asked for too; name one level")
            return spec.removesuffix(f"@{name}"), name
    if level not in (None, *LEVELS):
        raise RigError(f"level '{level}' of controller {spec}: expected {' or '.join(LEVELS)}")
    return spec, level


def load_controller(spec: str | None, config: Alfa46Config, level: str | None = None) -> Plug:
    """The plug of a specification (None: the built-in Alfa46), initialised with the rig's alfa46 settings.

    ``level`` or a trailing "@duty" / "@current" chooses the level when the controller knows both; without, it
    is the controller's first. RigError, one sentence, for everything that cannot be loaded.
    """
    text, level = split_level(spec or "alfa46", level)
    kind, _, rest = text.partition(":")
    if text == "alfa46":
        return BuiltIn(config, level)
    if kind == "python":
        source, sign, name = rest.rpartition(":")
        if not sign or not source or not name.isidentifier():
            raise RigError(f"controller {text}: expected python:FILE.py:CLASS or python:MODULE:CLASS")
        return PythonClass(source, name, config, level)
    if kind == "c" and rest:
        return CLibrary(rest, config, level)
    if kind in PLUGS and rest:
        return plugged(kind, rest, config, level)
    raise RigError(f"controller '{text}' is none that can be loaded; expected {FORMS}")
