"""An FMU in the hands of FMPy: variables by name, statuses as such, for FMI 2.0 and 3.0 co-simulation.

Used by fmu.drive, which drives the rig's own FMU, and by controllers.fmu_process, which runs a user's controller.
FMPy is imported when an FMU is opened.
"""

from __future__ import annotations

import ctypes as ct
import os
import shutil
from pathlib import Path

from ..errors import RigError, no_file

STATUSES = ("ok", "warning", "discard", "error", "fatal")  # numbers of fmi2Status and fmi3Status
GROUPS = {"Real": "Real", "Float64": "Float64", "Float32": "Float32", "Boolean": "Boolean", "String": "String",
          **dict.fromkeys(("Integer", "Enumeration"), "Integer")}
GROUPS_3 = {"Enumeration": "Int64"}


class FmuFailed(RigError):
    """A call that the FMU answered with discard, error or fatal; ``status`` is its word."""

    exit_code = 1

    def __init__(self, message: str, status: str):
        super().__init__(message)
        self.status = status


class Fmu:
    """One instance of a co-simulation FMU; close it, or use it in a ``with``.

    ``variables``: name -> FMPy's ScalarVariable. RigError for a file that cannot be used here.
    """

    def __init__(self, path: str | Path, name: str = "instance"):
        try:
            import fmpy
            from fmpy.fmi1 import FMICallException
            from fmpy.fmi2 import FMU2Slave
            from fmpy.fmi3 import FMU3Slave
        except ImportError:
            raise RigError("FMUs need FMPy, which is not installed here; install it into the rig's environment "
                           "(pip install fmpy)") from None
        self._error = FMICallException
        self._instance = self._folder = None
        self.path, self.said = Path(path), ""
        if not self.path.is_file():
            raise RigError(f"{path}: {no_file(path)}")
        self.description = description = self._read(fmpy)
        self.version = 3 if str(description.fmiVersion).startswith("3") else 2
        if str(description.fmiVersion).split(".")[0] not in ("2", "3"):
            raise RigError(f"{path}: the FMU is of FMI {description.fmiVersion}; expected 2.0 or 3.0")
        if description.coSimulation is None:
            raise RigError(f"{path}: the FMU is for model exchange only; expected co-simulation")
        here = fmpy.platform if self.version == 2 else fmpy.platform_tuple
        there = fmpy.supported_platforms(str(self.path))
        if here not in there and fmpy.platform not in there:
            found = ", ".join(there) or "none"
            raise RigError(f"{path}: the FMU has no binary for this platform, {here}; it has {found}")
        self.variables = {v.name: v for v in description.modelVariables}
        self._folder = fmpy.extract(str(self.path))
        kind = FMU3Slave if self.version == 3 else FMU2Slave
        try:
            self._instance = kind(guid=description.guid, unzipDirectory=self._folder, instanceName=name,
                                  modelIdentifier=description.coSimulation.modelIdentifier)
            self._instantiate()
        except RigError:
            self._remove()
            raise
        except Exception as error:  # FMPy raises what ctypes and the loader raise
            self._remove()
            raise RigError(f"{path}: the FMU cannot be loaded: {' '.join(str(error).split())}") from None

    def _read(self, fmpy):
        try:
            return fmpy.read_model_description(str(self.path), validate=False)
        except Exception as error:  # not a zip, no XML in it, wrong XML: FMPy has a class for each
            raise RigError(f"{self.path}: it cannot be read as an FMU: {' '.join(str(error).split())}") from None

    def _instantiate(self) -> None:
        """Makes the instance; what the FMU says is kept in ``said``."""
        if self.version == 3:
            def log(environment, status, category, message):
                self.said = message.decode("utf-8", "replace")

            from fmpy import fmi3
            self._log = fmi3.fmi3LogMessageCallback(log)
            self._call("instantiate", loggingOn=True, logMessage=self._log)
            return
        from fmpy import fmi2

        # variadic in C: of what follows the format only a single text can be read
        signature = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p, ct.c_void_p)

        def log2(environment, instance, status, category, form, text):
            said = ct.string_at(text) if form == b"%s" and text else form
            self.said = (said or b"").decode("utf-8", "replace")

        self._log = signature(log2)
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = ct.cast(self._log, type(callbacks.logger))
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        self._callbacks = callbacks
        self._call("instantiate", callbacks=callbacks, loggingOn=True)

    def _call(self, name: str, *values, **named):
        try:
            return getattr(self._instance, name)(*values, **named)
        except self._error as failure:
            status = failure.status
        except Exception as error:  # instantiate raises a plain Exception
            raise RigError(f"{self.path}: {self.said or ' '.join(str(error).split())}") from None
        word = STATUSES[status] if status in range(len(STATUSES)) else f"status {status}"
        raise FmuFailed(self.said or f"{name} ended with status {word}", word)

    # ---- variables

    def _variable(self, name: str):
        if name not in self.variables:
            raise RigError(f"{self.path}: there is no variable {name}; there are {', '.join(self.variables)}")
        return self.variables[name]

    def _group(self, variable) -> str:
        if self.version == 3:
            return GROUPS_3.get(variable.type, variable.type)
        return GROUPS.get(variable.type, variable.type)

    def get(self, *names: str) -> list:
        """Values of variables by name."""
        out = []
        for name in names:
            variable = self._variable(name)
            (value,) = self._call(f"get{self._group(variable)}", [variable.valueReference])
            out.append(value.decode("utf-8", "replace") if isinstance(value, bytes) else value)
        return out

    def set(self, **values) -> None:
        """Values of variables by name; names with dots by ``set(**{"alfa46.t12": -0.2})``."""
        for name, value in values.items():
            variable = self._variable(name)
            group = self._group(variable)
            value = {"Boolean": bool, "String": str}.get(group, float if group in ("Real", "Float32", "Float64") else int)(value)
            self._call(f"set{group}", [variable.valueReference], [value])

    def reader(self, names: list[str]):
        """A function that gives the values of these variables, with one call for each of their types."""
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            groups.setdefault(self._group(self._variable(name)), []).append(k)
        calls = [(f"get{group}", places, [self.variables[names[k]].valueReference for k in places])
                 for group, places in groups.items()]

        def read() -> list:
            out = [0.0] * len(names)
            for call, places, references in calls:
                for k, value in zip(places, self._call(call, references), strict=True):
                    out[k] = value
            return out
        return read

    def writer(self, names: list[str]):
        """A function that sets these variables, with one call for each of their types."""
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            groups.setdefault(self._group(self._variable(name)), []).append(k)
        calls = [(f"set{group}", places, [self.variables[names[k]].valueReference for k in places],
                  bool if group == "Boolean" else float if group in ("Real", "Float32", "Float64") else int)
                 for group, places in groups.items()]

        def write(values) -> None:
            for call, places, references, kind in calls:
                self._call(call, references, [kind(values[k]) for k in places])
        return write

    # ---- life

    def initialize(self, start: float = 0.0, **inputs) -> None:
        """Enter and leave the initialization, with values of inputs and parameters by name."""
        if self.version == 2:
            self._call("setupExperiment", startTime=start)
            self._call("enterInitializationMode")
        else:
            self._call("enterInitializationMode", startTime=start)
        self.set(**inputs)
        self._call("exitInitializationMode")

    def step(self, time: float, size: float) -> None:
        """One communication step; FmuFailed with the status when the FMU refuses it."""
        self._call("doStep", currentCommunicationPoint=time, communicationStepSize=size)

    def terminate(self) -> None:
        self._call("terminate")

    def reset(self) -> None:
        self._call("reset")

    def close(self) -> None:
        """Free instance and library and remove what was unpacked; safe to call twice."""
        instance, self._instance = self._instance, None
        if instance is not None:
            if getattr(instance, "component", None):
                instance.freeInstance()
            instance.freeLibrary()
        self._remove()

    def _remove(self) -> None:
        folder, self._folder = self._folder, None
        if folder and os.path.isdir(folder):
            shutil.rmtree(folder, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
