# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's Python class with initialize / step / terminate, from a file or an importable module: loading it and calling it.

host.py uses it in the class's own process, python_class.py in the rig's. An error in user code becomes a sentence with file
and line.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base import Group, RigError, no_file, unknown
from ..own_signals import checked_settings, checked_signals
from ..seam import LEVELS, ControllerInfo, ControllerInputs, checked_wants, error_text, shortened

if TYPE_CHECKING:
    from types import ModuleType

GROUP = Group("controllers", "controller")  # entry points of installed packages
METHODS = ("initialize", "step", "terminate")
MOST_TRACE = 20_000  # characters of a traceback that are kept: the newest


class Broken(RigError):
    """A call into user code that has raised; the message is a piece of a sentence, ``trace`` the traceback."""

    def __init__(self, message: str, error: BaseException) -> None:
        super().__init__(shortened(message))
        self.trace = "".join(traceback.format_exception(error))[-MOST_TRACE:]


class Overtime(BaseException):
    """The step takes too long; it is no Exception, so that an ``except Exception`` in user code does not catch it."""


def place_of(error: BaseException, file: str | None) -> str:
    """Return where an error was raised in user code.

    Parameters
    ----------
    error : BaseException
        The error, with its traceback.
    file : str or None
        The user's file.

    Returns
    -------
    str
        "name line n: " of the newest frame in the user's file, else of the newest frame in any file outside this package;
        empty when there is none.
    """
    frames = [
        f
        for f in traceback.extract_tb(error.__traceback__)
        if Path(__file__).parents[1] not in Path(f.filename).parents and not f.filename.startswith("<")
    ]
    frames = [f for f in frames if f.filename == file] or frames
    return f"{Path(frames[-1].filename).name} line {frames[-1].lineno}: " if frames else ""


def _load_module(source: str) -> ModuleType:
    """Return the module of a .py file or of a dotted name."""
    if not source.endswith(".py"):
        try:
            return importlib.import_module(source)
        except ModuleNotFoundError as error:
            if error.name and (source == error.name or source.startswith(error.name + ".")):
                raise RigError(
                    f"controller python:{source}: there is no module '{error.name}' here; "
                    "give a file ending in .py or an importable module"
                ) from None
            raise
    path = Path(source)
    if not path.is_file():
        raise RigError(f"controller python:{source}: {no_file(path)}")
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)  # at the end: the file finds its neighbours, and they hide no module of the rig
    name = f"rig_controller_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _entry_point(name: str) -> tuple[str, str]:
    """Return (module, class) of an entry point in the group GROUP; RigError, which names the known ones, when there is none."""
    known = GROUP.added()
    if name not in known:
        raise RigError(f"controller python:{name}: {unknown(f'entry point of the group {GROUP.group}', name, known)}")
    return known[name].module, known[name].attr


class UserClass:
    """A user's class, and after :meth:`initialize` an instance of it.

    Attributes
    ----------
    levels : tuple of str
        The levels at which it works, the preferred one first (default: duty only); ``declared`` is True when the class names them.
    wants, signals, settings
        What the class names as its own, checked.

    Parameters
    ----------
    rest : str
        FILE.py:CLASS, MODULE:CLASS or the NAME of an entry point of GROUP.
    name : str
        The controller's name, for the errors' sentences.
    transducers : sequence of str
        Names of the rig's transducers.
    passed : tuple of types
        Exceptions of user code that are passed on; every other one is a fault of the controller.

    Raises
    ------
    RigError
        When the code cannot be loaded, the class is missing or lacks a method, or what it names is not permitted.
    """

    def __init__(self, rest: str, name: str, transducers: Sequence[str], passed: tuple[type[BaseException], ...] = ()) -> None:
        source, sign, class_name = rest.rpartition(":")
        if not sign and not rest.endswith(".py"):
            source, class_name = _entry_point(rest)
        if not source or not class_name.isidentifier():
            raise RigError(f"controller python:{rest}: expected python:FILE.py:CLASS or python:MODULE:CLASS")
        self._passed, self.name = passed, name
        self._class = self._load(source, class_name)
        self.levels = getattr(self._class, "levels", ("duty",))
        if not (isinstance(self.levels, (tuple, list)) and self.levels and all(item in LEVELS for item in self.levels)):
            raise RigError(f"controller {name}: levels is {self.levels!r}, expected a tuple of {', '.join(LEVELS)}")
        self.levels, self.declared = tuple(self.levels), hasattr(self._class, "levels")
        self.wants = checked_wants(getattr(self._class, "wants", ()), name, transducers)
        self.signals = checked_signals(getattr(self._class, "signals", ()), name)
        self.settings = checked_settings(getattr(self._class, "settings", {}), name)

    def _load(self, source: str, name: str) -> type:
        """Return a class, which has initialize, step and terminate, of a .py file or module."""
        what = f"controller python:{source}:{name}"
        try:
            module = _load_module(source)
        except (*self._passed, RigError):
            raise
        except BaseException as error:
            line = f"line {error.lineno}: " if isinstance(error, SyntaxError) else place_of(error, source)
            raise Broken(f"{what}: the code cannot be loaded: {line}{error_text(error)}", error) from None
        found = getattr(module, name, None)
        if not inspect.isclass(found):
            there = [n for n, c in vars(module).items() if inspect.isclass(c) and callable(getattr(c, "step", None))]
            raise RigError(f"{what}: {unknown('class with a step', name, there)}")
        missing = [method for method in METHODS if not callable(getattr(found, method, None))]
        if missing:
            raise RigError(
                f"{what}: the class has no method {', '.join(missing)}; it needs initialize(info), step(inputs) and terminate()"
            )
        return found

    def initialize(self, info: ControllerInfo) -> None:
        """Make the instance and let a run begin; Broken when the class raises."""

        def begin() -> None:
            self.user = self._class()
            self.user.initialize(info)

        try:
            self._file = inspect.getsourcefile(self._class)
        except (OSError, TypeError):
            self._file = None  # a class of a notebook stands in no file
        self._call("initialize", begin)

    def step(self, inputs: ControllerInputs) -> Any:
        """Return the user's answer to a sample as it is; Broken when the class raises."""
        return self._call("step", self.user.step, inputs)

    def terminate(self) -> None:
        """Let the run end; Broken when the class raises."""
        self._call("terminate", self.user.terminate)

    def _call(self, what: str, function: Callable[..., Any], *arguments: object) -> Any:
        try:
            return function(*arguments)
        except (*self._passed, Overtime):
            raise
        except BaseException as error:
            raise Broken(f"{what} failed: {place_of(error, self._file)}{error_text(error)}", error) from None
