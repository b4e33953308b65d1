# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a Python class with initialize / step / terminate, from a file or an importable module.

load.py makes it. An error in user code becomes a sentence with file and line; the traceback is logged.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import inspect
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from ..config.names import unknown
from ..errors import RigError, no_file
from .own_signals import checked_settings, checked_signals
from .plug import DECLARED, DEFAULT, LOG, Plug, chosen_level, error_text
from .seam import LEVELS, ControllerInputs, ControllerOutputs, Status, checked_wants

if TYPE_CHECKING:
    from types import ModuleType

    from ..testbench.configuration import RigConfig

GROUP = "rig_nodes.controllers"  # group of entry points in an installed package's metadata
METHODS = ("initialize", "step", "terminate")
# a sys.exit() in user code ends the controller, not the rig; Ctrl-C (KeyboardInterrupt) still ends the rig
BREAKDOWNS = (Exception, SystemExit)


class Overtime(BaseException):
    """The step takes too long; it is no Exception, so that an ``except Exception`` in user code does not catch it."""


def _out_of_time(_number: int, _frame: object) -> NoReturn:
    raise Overtime


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
        if Path(f.filename).parent != Path(__file__).parent and not f.filename.startswith("<")
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
    known = {point.name: point for point in importlib.metadata.entry_points(group=GROUP)}
    if name not in known:
        raise RigError(f"controller python:{name}: {unknown(f'entry point of the group {GROUP}', name, sorted(known))}")
    return known[name].module, known[name].attr


def load_class(source: str, name: str) -> type:
    """Return a class of a .py file or module.

    Parameters
    ----------
    source : str
        Path of a .py file, or a module's dotted name.
    name : str
        Name of the class.

    Returns
    -------
    type
        The class, which has initialize, step and terminate.

    Raises
    ------
    RigError
        When the code cannot be loaded, or the class is missing or lacks a method.
    """
    what = f"controller python:{source}:{name}"
    try:
        module = _load_module(source)
    except RigError:
        raise
    except BREAKDOWNS as error:
        line = f"line {error.lineno}: " if isinstance(error, SyntaxError) else place_of(error, source)
        raise RigError(f"{what}: the code cannot be loaded: {line}{error_text(error)}") from None
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


class PythonClass(Plug):
    """An instance of a user's class; its attribute ``levels`` names the levels at which it works (default: duty only)."""

    in_process = True

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        """Load the class; ``rest`` is FILE.py:CLASS, MODULE:CLASS or the NAME of an entry point of GROUP."""
        source, sign, class_name = rest.rpartition(":")
        if not sign and not rest.endswith(".py"):
            source, class_name = _entry_point(rest)
        if not source or not class_name.isidentifier():
            raise RigError(f"controller python:{rest}: expected python:FILE.py:CLASS or python:MODULE:CLASS")
        found, name = load_class(source, class_name), f"python:{rest}"
        levels = getattr(found, "levels", ("duty",))
        if not (isinstance(levels, (tuple, list)) and levels and all(item in LEVELS for item in levels)):
            raise RigError(f"controller {name}: levels is {levels!r}, expected a tuple of {', '.join(LEVELS)}")
        super().__init__(name, config, chosen_level(level, tuple(levels), name))
        self.level_from = DECLARED if hasattr(found, "levels") else DEFAULT
        self.wants = checked_wants(getattr(found, "wants", ()), name, self.rig_record.all_transducers)
        self.signals = checked_signals(getattr(found, "signals", ()), name)
        self.settings = checked_settings(getattr(found, "settings", {}), name)
        try:
            self._file = inspect.getsourcefile(found)
            self._user = found()
            self._user.initialize(self.info)
        except BREAKDOWNS as error:
            raise RigError(f"controller {name}: initialize failed: {place_of(error, self._file)}{error_text(error)}") from None

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        timed = self._timed()
        try:
            if timed:
                signal.setitimer(signal.ITIMER_REAL, self.step_timeout)
            return self._user.step(inputs)
        except Overtime:
            self._overdue(inputs.sample)
        except BREAKDOWNS as error:
            LOG.error("controller %s, sample %d", self.name, inputs.sample, exc_info=True)
            self._fail(Status.ERROR, inputs.sample, f"step failed: {place_of(error, self._file)}{error_text(error)}")

        finally:
            if timed:
                signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _timed(self) -> bool:
        """Set the timer's handler; True when a timer can watch the step.

        It can where simulated time waits for the step, in the main thread, which is the one that receives signals.
        """
        if self.real_time or self.step_timeout is None:
            return False
        if threading.current_thread() is not threading.main_thread():
            return False
        signal.signal(signal.SIGALRM, _out_of_time)
        return True

    def _end(self) -> None:
        try:
            self._user.terminate()
        except BREAKDOWNS:
            LOG.error("controller %s: terminate failed", self.name, exc_info=True)
