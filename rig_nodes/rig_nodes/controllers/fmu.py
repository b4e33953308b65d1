# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller as an FMU (2.0 or 3.0 co-simulation): ``fmu:FILE.fmu``.

load.py makes it. The FMU runs in a process of its own (fmu_process.py), so that its crash is a fatal status and does not
end the rig.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import struct
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO, TYPE_CHECKING, NoReturn

from ..errors import RigError, no_file, printable
from ..graph.link import Link, LinkClosed, pair
from .c_library import CORE
from .own_signals import checked_settings, checked_signals
from .plug import DECLARED, DEFAULT, Plug, chosen_level
from .record import record_of
from .seam import ControllerInputs, ControllerOutputs, Status, checked_wants

if TYPE_CHECKING:
    from ..testbench.configuration import RigConfig

# behind a sample: wanted transducers, the FMU's settings; behind an answer: the FMU's signals, or for a status other
# than ok a sentence
SAMPLE = "<QI{}d"  # sample, gear_request, currents, transducers
ANSWER = "<4d{}d"  # status, gear, shifting, flags as the FMU gives them, commands, setpoints
LOAD_TIMEOUT = 60.0  # s of wall clock for loading and for the initialization
END_PATIENCE = 2.0  # s of wall clock for the end of the process
MESSAGE = 4096  # bytes of a message or of a line that are shown


class ControllerFmu(Plug):
    """A controller FMU; its variables are found by the names of the seam (docs/how_to/fmu.md)."""

    def __init__(self, file: str, config: RigConfig, level: str | None = None) -> None:
        name = f"fmu:{file}"
        if not Path(file).is_file():
            raise RigError(f"controller {name}: {no_file(file)}")
        ours, theirs = pair()
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
        message_descriptor = os.memfd_create("message")
        record = record_of(config)
        outputs, names = len(record.outputs), list(record.names)
        self._sample, self._answer_form = (
            struct.Struct(SAMPLE.format(outputs + len(names))),
            struct.Struct(ANSWER.format(2 * outputs)),
        )
        self._outputs = outputs
        command = [
            sys.executable,
            "-P",
            "-m",
            "rig_nodes.controllers.fmu_process",
            file,
            str(theirs.fileno()),
            str(message_descriptor),
            str(os.getpid()),
            json.dumps(
                {
                    "outputs": outputs,
                    "transducers": names,
                    "known": record.all_transducers,
                    "record": record.number,
                    "rig": record.rig,
                    "valves": [k for k, output in enumerate(record.outputs, 1) if output.valve],
                }
            ),
        ]
        with theirs:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=[theirs.fileno(), message_descriptor],
                env=environment,
            )
        self._message_file = open(message_descriptor, "rb", buffering=0)  # the FMU's newest message, which outlives its process
        self._printed = threading.Thread(target=_show, args=(self._process.stdout,), daemon=True)
        self._printed.start()
        self._link, self._core = Link(ours.detach(), name), -1
        try:
            found = self._hear(name)
            super().__init__(name, config, chosen_level(level, tuple(found["levels"]), name))
            self.level_from = f"{DECLARED} ({found['level_from']})" if found["level_from"] else DEFAULT
            self.wants = checked_wants(found["wants"], name, record.all_transducers)
            self.signals = checked_signals(found["signals"], name)
            # a parameter with the name of one of the rig's settings gets the rig's value
            self.settings = checked_settings(
                {key: value for key, value in found["settings"].items() if key not in self.info.parameters}, name
            )
            self._behind = struct.Struct(f"<{len(self.wants) + len(self.settings)}d")
            self._own_values = struct.Struct(f"<{len(self.signals)}d")
            self._link.send_json(
                {
                    "level": self.level,
                    "parameters": dict(self.info.parameters),
                    "period": self.info.period,
                    "settings": list(self.settings),
                }
            )
            self._hear(name)
        except BaseException:
            self._abandon()
            raise

    def _hear(self, name: str) -> dict:
        """Return the process's next message before the first step; RigError with its sentence, or when no message comes."""
        try:
            data = self._link.receive(LOAD_TIMEOUT)
        except LinkClosed:
            raise RigError(f"controller {name}: {self._how_it_ended()} before it was initialized{self._last_message()}") from None
        if data is None:
            raise RigError(
                f"controller {name}: the FMU did not load and initialize within {LOAD_TIMEOUT:g} s{self._last_message()}"
            )
        message = json.loads(data)
        if "error" in message:
            raise RigError(f"controller {name}: {message['error']}")
        return message

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(END_PATIENCE)
        except subprocess.TimeoutExpired:  # it closed its end of the link and still runs
            return "the FMU's process has closed the rig's line to it"
        if code < 0:
            number = signal.Signals(-code)
            return f"the FMU's process was ended by {number.name} ({signal.strsignal(number).lower()})"
        return f"the FMU's process ended itself with exit code {code}"

    def _last_message(self) -> str:
        """Return the newest message of an FMU that has gone or does not answer, as the end of a sentence."""
        text = os.pread(self._message_file.fileno(), MESSAGE, 0).decode("utf-8", "replace")
        return f"; its last message: {text}" if text else ""

    def _fail(self, status: Status, sample: int, text: str) -> NoReturn:
        if status == Status.FATAL and not text.startswith("status"):  # the FMU's own status comes with its reason
            text += self._last_message()
        super()._fail(status, sample, text)

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        core = CORE()
        if core != self._core:  # as in c_library.Host.ask: a process on the waiting core is woken sooner
            self._core = core
            with contextlib.suppress(ProcessLookupError):  # the process has ended: receive() raises the error
                os.sched_setaffinity(self._process.pid, {core})
        try:
            self._link.send(
                self._sample.pack(inputs.sample, inputs.gear_request, *inputs.current, *inputs.measured)
                + self._behind.pack(*inputs.others.values(), *inputs.settings.values())
            )
            data = self._link.receive(self.step_timeout)
        except LinkClosed:
            self._fail(Status.FATAL, inputs.sample, self._how_it_ended())
        if data is None:
            self._overdue(inputs.sample)
        status, gear, shifting, flags = map(_whole, self._answer_form.unpack_from(data)[:4])
        values = self._answer_form.unpack_from(data)[4:]
        if status != Status.OK:
            return ControllerOutputs(status=status, message=data[self._answer_form.size :].decode("utf-8", "replace"))
        own = dict(zip(self.signals, self._own_values.unpack_from(data, self._answer_form.size), strict=True))
        return ControllerOutputs(values[: self._outputs], values[self._outputs :], gear, shifting, flags, signals=own)

    @property
    def process_id(self) -> int:
        """Number of the FMU's process, for a debugger."""
        return self._process.pid

    def _abandon(self) -> None:
        """End the process without a call into the FMU."""
        self._link.close()
        self._process.kill()
        self._gone()

    def _end(self) -> None:
        """Close the link; the FMU's process then terminates and frees the FMU and ends."""
        self._link.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_PATIENCE)
        self._process.kill()
        self._gone()

    def _gone(self) -> None:
        self._process.wait()
        self._printed.join(END_PATIENCE)  # a process that the FMU started may still hold the pipe
        self._message_file.close()


def _show(pipe: IO[bytes]) -> None:
    """Show what the FMU's process prints on standard error, without characters that control a terminal."""
    with pipe:
        while line := pipe.readline(MESSAGE):
            print(printable(line.decode("utf-8", "replace").rstrip("\n"), "\t"), file=sys.stderr, flush=True)


def _whole(value: float) -> float:
    """Return a whole number as an int, so that it is printed as one; the seam refuses any other."""
    return int(value) if value.is_integer() else value
