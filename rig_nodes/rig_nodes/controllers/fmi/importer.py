# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An FMU opened with FMPy: variables by name and statuses as they are, for FMI 2.0 and 3.0 co-simulation.

runs.fmu.drive, which drives the rig's own FMU, and controllers.fmi.process, which runs a user's controller, use it. FMPy is
imported when an FMU is opened.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import shutil
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base import RigError, no_file, optional, printable
from .archive import unpack
from .log_text import SIGNATURE, formatted, text_at

if TYPE_CHECKING:
    from types import ModuleType

    from fmpy.model_description import ModelDescription, ScalarVariable

STATUSES = ("ok", "warning", "discard", "error", "fatal")  # numbers of fmi2Status and fmi3Status
GROUPS = {
    "Real": "Real",
    "Float64": "Float64",
    "Float32": "Float32",
    "Boolean": "Boolean",
    "String": "String",
    **dict.fromkeys(("Integer", "Enumeration"), "Integer"),
}
GROUPS_3 = {"Enumeration": "Int64"}
KEPT, LONGEST = 3, 500  # largest number of an FMU's messages in a sentence, and of characters of each


class FmuFailed(RigError):
    """A call that the FMU answered with discard, error or fatal.

    Parameters
    ----------
    message : str
        Why the call failed.
    status : str
        The FMU's status in words, or "terminated" when the FMU ended the simulation by itself.
    """

    exit_code = 1

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class Fmu:
    """One instance of a co-simulation FMU; close it, or use it in a ``with``.

    ``variables`` holds FMPy's ScalarVariable by name, ``arrays`` the names of the arrays of FMI 3.0, which are not read or set.

    Parameters
    ----------
    path : str or Path
        The FMU's file.
    name : str
        Name of the instance.
    keep : callable
        Receives each message of the FMU as soon as it comes, so that the newest one outlives a crash.
    folder : str or None
        Where it is unpacked; None takes the folder of temporary files.

    Raises
    ------
    RigError
        When the file cannot be used here.
    """

    def __init__(
        self, path: str | Path, name: str = "instance", keep: Callable[[str], None] = lambda text: None, folder: str | None = None
    ) -> None:
        fmpy = optional("fmpy")
        from fmpy.fmi1 import FMICallException
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self._error = FMICallException
        self._instance = self._folder = None
        self.path, self._keep = Path(path), keep
        self._newest_messages: deque[tuple[int, str]] = deque(maxlen=KEPT)  # status and text of the FMU's newest messages
        if not self.path.is_file():
            raise RigError(f"{path}: {no_file(path)}")
        self._folder = tempfile.mkdtemp(prefix="rig-fmu-", dir=folder)
        try:
            self.description = description = self._read(fmpy)
            self.version = 3 if str(description.fmiVersion).startswith("3") else 2
            if str(description.fmiVersion).split(".")[0] not in ("2", "3"):
                raise RigError(f"{path}: the FMU is of FMI {description.fmiVersion}; expected 2.0 or 3.0")
            if description.coSimulation is None:
                raise RigError(f"{path}: the FMU is for model exchange only; expected co-simulation")
            here = fmpy.platform if self.version == 2 else fmpy.platform_tuple
            there = fmpy.supported_platforms(self._folder)
            if here not in there and fmpy.platform not in there:
                found = ", ".join(there) or "none"
                raise RigError(f"{path}: the FMU has no binary for this platform, {here}; it has {found}")
            self.arrays = {v.name for v in description.modelVariables if v.dimensions}
            self.variables = {v.name: v for v in description.modelVariables if v.name not in self.arrays}
            kind = FMU3Slave if self.version == 3 else FMU2Slave
            self._instance = kind(
                guid=description.guid,
                unzipDirectory=self._folder,
                instanceName=name,
                modelIdentifier=description.coSimulation.modelIdentifier,
            )
            self._instantiate()
        except RigError:
            self._remove()
            raise
        except Exception as error:  # FMPy passes on errors of ctypes and the loader
            self._remove()
            raise RigError(f"{path}: the FMU cannot be loaded: {_in_one_line(error)}") from None

    def _read(self, fmpy: ModuleType) -> ModelDescription:
        """Unpack the archive and return its model description."""
        try:
            unpack(self.path, Path(self._folder))
            return fmpy.read_model_description(self._folder, validate=False)
        except RigError as error:
            raise RigError(f"{self.path}: it cannot be read as an FMU: {error}") from None
        except Exception as error:  # for other XML FMPy raises errors of many classes
            raise RigError(f"{self.path}: it cannot be read as an FMU: {_in_one_line(error)}") from None

    # ---- messages of the FMU

    def _hear(self, status: int, text: str) -> None:
        if text := _in_one_line(text)[:LONGEST]:
            self._newest_messages.append((status, text))
            self._keep(text)

    def forget(self) -> None:
        """Forget the messages so far, so that they are not given as the reason of a later failure."""
        self._newest_messages.clear()

    def newest_message(self) -> str:
        """Return the newest message since they were forgotten; empty when there is none."""
        return self._newest_messages[-1][1] if self._newest_messages else ""

    def _why(self, otherwise: str) -> str:
        """Return why a call failed: the FMU's warnings and errors, else ``otherwise`` with the newest message."""
        reasons = list(dict.fromkeys(text for status, text in self._newest_messages if status > 0))
        if reasons:
            return "; ".join(reasons)
        return f"{otherwise}; its last message: {self._newest_messages[-1][1]}" if self._newest_messages else otherwise

    def _instantiate(self) -> None:
        """Make the instance and receive its messages."""
        if self.version == 3:

            def log(environment: int | None, status: int, category: bytes | None, message: bytes | None) -> None:
                self._hear(status, (message or b"").decode("utf-8", "replace"))

            from fmpy import fmi3

            self._log = fmi3.fmi3LogMessageCallback(log)
            self._call("instantiate", loggingOn=True, logMessage=self._log)
            return
        from fmpy import fmi2

        def log2(
            environment: int | None, instance: int | None, status: int, category: int | None, form: int | None, *values: float
        ) -> None:
            self._hear(status, formatted(text_at(form), values))

        self._log = SIGNATURE(log2)
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = ct.cast(self._log, type(callbacks.logger))
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self._callbacks = callbacks
        self._call("instantiate", callbacks=callbacks, loggingOn=True)

    def _call(self, name: str, *values: object, **named: object) -> Any:
        try:
            return getattr(self._instance, name)(*values, **named)
        except self._error as failure:
            status = failure.status
        except Exception as error:  # instantiate raises a plain Exception
            raise RigError(f"{self.path}: {self._why(_in_one_line(error))}") from None
        word = STATUSES[status] if status in range(len(STATUSES)) else f"status {status}"
        why = self._why(f"{name} ended with status {word}")
        self.forget()
        raise FmuFailed(why, word)

    # ---- variables

    def _variable(self, name: str) -> ScalarVariable:
        if name not in self.variables:
            raise RigError(f"{self.path}: there is no variable {name}; there are {', '.join(self.variables)}")
        return self.variables[name]

    def _group(self, variable: ScalarVariable) -> str:
        if self.version == 3:
            return GROUPS_3.get(variable.type, variable.type)
        return GROUPS.get(variable.type, variable.type)

    def get(self, *names: str) -> list:
        """Return the values of variables by name, in the order of the names."""
        out = []
        for name in names:
            variable = self._variable(name)
            (value,) = self._call(f"get{self._group(variable)}", [variable.valueReference])
            out.append(value.decode("utf-8", "replace") if isinstance(value, bytes) else value)
        return out

    def set(self, **values: float | str) -> None:
        """Set variables by name; names with dots are set by ``set(**{"alfa46.t12": -0.2})``."""
        for name, value in values.items():
            variable = self._variable(name)
            group = self._group(variable)
            value = {"Boolean": bool, "String": str}.get(group, float if group in ("Real", "Float32", "Float64") else int)(value)
            self._call(f"set{group}", [variable.valueReference], [value])

    def reader(self, names: list[str]) -> Callable[[], list]:
        """Return a function that reads these variables in their order, with one call for each of their types."""
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            groups.setdefault(self._group(self._variable(name)), []).append(k)
        calls = [
            (f"get{group}", places, [self.variables[names[k]].valueReference for k in places]) for group, places in groups.items()
        ]

        def read() -> list:
            out = [0.0] * len(names)
            for call, places, references in calls:
                for k, value in zip(places, self._call(call, references), strict=True):
                    out[k] = value
            return out

        return read

    def writer(self, names: list[str]) -> Callable[[Sequence[float]], None]:
        """Return a function that sets these variables from values in their order, with one call for each of their types."""
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            groups.setdefault(self._group(self._variable(name)), []).append(k)
        calls = [
            (
                f"set{group}",
                places,
                [self.variables[names[k]].valueReference for k in places],
                bool if group == "Boolean" else float if group in ("Real", "Float32", "Float64") else int,
            )
            for group, places in groups.items()
        ]

        def write(values: Sequence[float]) -> None:
            for call, places, references, kind in calls:
                self._call(call, references, [kind(values[k]) for k in places])

        return write

    # ---- life

    def initialize(self, start: float = 0.0, stop: float | None = None, **inputs: float | str) -> None:
        """Enter and leave the initialization.

        Parameters
        ----------
        start : float
            Start time [s].
        stop : float or None
            End time [s], when it is known.
        **inputs : float or str
            Values of inputs and parameters by name.
        """
        if self.version == 2:
            self._call("setupExperiment", startTime=start, stopTime=stop)
            self._call("enterInitializationMode")
        else:
            self._call("enterInitializationMode", startTime=start, stopTime=stop)
        self.set(**inputs)
        self._call("exitInitializationMode")

    def step(self, time: float, size: float) -> None:
        """Make one communication step.

        Parameters
        ----------
        time : float
            Time at its begin [s].
        size : float
            Its length [s].

        Raises
        ------
        FmuFailed
            With the status, when the FMU refuses the step or ends the simulation.
        """
        try:
            done = self._call("doStep", currentCommunicationPoint=time, communicationStepSize=size)
        except FmuFailed as failure:
            if self.version == 2 and failure.status == "discard" and self._ended():
                failure.status = "terminated"
            raise
        if self.version == 3 and done[1]:
            raise FmuFailed(self._why("the FMU ended the simulation"), "terminated")

    def _ended(self) -> bool:
        """Return whether an FMU of FMI 2.0 that discarded a step has thereby ended the simulation."""
        from fmpy.fmi2 import fmi2Terminated

        with contextlib.suppress(Exception):  # the function is optional
            return bool(self._instance.getBooleanStatus(fmi2Terminated))
        return False

    def terminate(self) -> None:
        """End the simulation; FmuFailed when the FMU refuses it."""
        self._call("terminate")

    def reset(self) -> None:
        """Bring the instance back to its state before the initialization."""
        self._call("reset")

    def close(self) -> None:
        """Free the instance and the library and remove the unpacked files; it may be called twice."""
        instance, self._instance = self._instance, None
        if instance is not None:
            if getattr(instance, "component", None):
                instance.freeInstance()
            instance.freeLibrary()
        self._remove()

    def _remove(self) -> None:
        folder, self._folder = self._folder, None
        if folder:
            shutil.rmtree(folder, ignore_errors=True)

    def __enter__(self) -> Fmu:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _in_one_line(text: object) -> str:
    return printable(" ".join(str(text).split()))
