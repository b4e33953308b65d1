"""The plug for a controller as an FMU (2.0 or 3.0 co-simulation): ``fmu:FILE.fmu``.

Made by load.py. The FMU lives in a process of its own (fmu_process.py): its crash is a fatal status, not the rig's end.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
from pathlib import Path

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from .plug import Plug, chosen_level
from .seam import LEVELS, ControllerInputs, ControllerOutputs, Status

SAMPLE = struct.Struct("<QI8d")  # sample, gear_request, currents (3), n_wej, n_wyj, p1, p2 and a spare
ANSWER = struct.Struct("<IIII6d")  # status, gear, shifting, flags, command (3), setpoint (3); a sentence may follow
FRAME = 1 << 16  # longest message
START = 60.0  # s that the FMU's process may take to load and initialize
END = 2.0  # s that it may take to end


class ControllerFmu(Plug):
    """A controller FMU; variables are found by the names of the seam (docs/fmu.md).

    step_timeout: s of real time that a step may take, None for any.
    """

    def __init__(self, file: str, config: Alfa46Config, level: str | None = None, step_timeout: float | None = 5.0):
        name = f"fmu:{file}"
        if not Path(file).is_file():
            raise RigError(f"controller {name}: there is no such file")
        if level not in (None, *LEVELS):
            raise RigError(f"level '{level}' of controller {name}: expected {' or '.join(LEVELS)}")
        self._timeout, self._process, self._file = step_timeout, None, file
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._link = ours
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "rig_nodes.controllers.fmu_process", str(theirs.fileno()), file],
                stdin=subprocess.DEVNULL, stdout=sys.stderr, pass_fds=[theirs.fileno()], env=environment,
                start_new_session=True)  # Ctrl-C is the rig's
        try:
            levels = tuple(self._told(name, START)["levels"])
            super().__init__(name, config, chosen_level(level, levels, name))
            start = {"level": self.level, "parameters": dict(self.info.parameters), "period": self.info.period}
            self._link.send(json.dumps(start).encode())
            self._told(name, START)
        except RigError:
            self._stop()
            raise

    def _told(self, name: str, patience: float) -> dict:
        """The process's next JSON message; RigError with its sentence, or when there is none."""
        self._link.settimeout(patience)
        try:
            data = self._link.recv(FRAME)
        except TimeoutError:
            raise RigError(f"controller {name}: the FMU did not load and initialize within {patience:g} s") from None
        except OSError:
            data = b""
        if not data:
            raise RigError(f"controller {name}: the FMU's process {self._how()} before it was initialized")
        message = json.loads(data)
        if "error" in message:
            raise RigError(f"controller {name}: {message['error']}")
        return message

    def _how(self) -> str:
        """How the process ended, as a piece of a sentence."""
        try:
            code = self._process.wait(END)
        except subprocess.TimeoutExpired:
            return "closed its link"
        return f"was ended by signal {-code}" if code < 0 else f"ended with exit code {code}"

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        self._link.settimeout(self._timeout)
        try:
            self._link.send(SAMPLE.pack(inputs.sample, inputs.gear_request, *inputs.current, inputs.n_wej, inputs.n_wyj,
                                        inputs.p1, inputs.p2, 0.0))
            data = self._link.recv(FRAME)
        except TimeoutError:
            self._stop()
            return ControllerOutputs(status=Status.FATAL, message=f"no answer of the FMU within {self._timeout:g} s")
        except OSError:
            data = b""
        if not data:
            how = self._how()
            self._stop()
            return ControllerOutputs(status=Status.FATAL, message=f"the FMU's process {how}")
        status, gear, shifting, flags, *values = ANSWER.unpack_from(data)
        if status == Status.FATAL:
            self._stop()
        return ControllerOutputs(values[:3], values[3:], gear, bool(shifting), flags, status,
                                 data[ANSWER.size:].decode("utf-8", "replace"))

    def _stop(self) -> None:
        """End the process, whatever it does."""
        self._link.close()
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
        if self._process is not None:
            self._process.wait()

    def _end(self) -> None:
        """The FMU is terminated and freed by its process, which ends when the link does."""
        self._link.close()
        try:
            self._process.wait(END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
