# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a Python class with initialize / step / terminate: in a process of its own, or with --in-process in the rig's.

load.py makes it. The traceback of an error in user code is logged.
"""

from __future__ import annotations

import dataclasses
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from ...base import RigError
from ..hosted import Host, HostedPlug, Hosting
from ..plug import DECLARED, DEFAULT, LOG, STEP_TIMEOUT, Plug, chosen_level
from ..record import record_of
from ..seam import ControllerInputs, ControllerOutputs, Status
from .host import FAULT, Frames
from .user_class import Broken, Overtime, UserClass

if TYPE_CHECKING:
    from ...rig import RigConfig

PYTHON = Hosting(
    "the controller", str(Path(__file__).parents[3]), "rig_nodes.controllers.python.host", "rig-python", ("terminate",)
)


class PythonClass(HostedPlug):
    """An instance of a user's class, in a process of its own (hosted.py, host.py)."""

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        """Load the class; ``rest`` is FILE.py:CLASS, MODULE:CLASS or the NAME of an entry point."""
        name, record = f"python:{rest}", record_of(config)
        self._host = Host(PYTHON, name, [])
        try:
            self._tell({"rest": rest, "name": name, "transducers": record.all_transducers, "path": sys.path})
            found = self._hear("while it was loaded")
            super().__init__(name, config, chosen_level(level, tuple(found["levels"]), name))
            self._host.process = found["process"]
            self.level_from = DECLARED if found["declared"] else DEFAULT
            self.wants, self.signals, self.settings = tuple(found["wants"]), found["signals"], found["settings"]
            self._frames = Frames(len(record.outputs), len(record.names), *map(len, (self.wants, self.signals, self.settings)))
            readings = {signal.name: f"{signal.text} [{signal.unit}]" for signal in record.transducers}
            self._tell({"info": dataclasses.asdict(self.info), "readings": readings})
            self._hear("in initialize")
        except BaseException:
            self._host.kill()
            raise
        self._answered = False

    def _hear(self, when: str) -> dict:
        """Return the host's next message before the first step; RigError with its sentence, or when it does not come."""
        message = self._host.hear(when)
        if "error" in message:
            raise RigError(message["error"])
        return message

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        limit = self.step_timeout
        if self.real_time and not self._answered:
            limit = STEP_TIMEOUT  # until its first answer the rig waits, and the first step may import and compile
        data = self._asked(inputs.sample, self._frames.sample_of(inputs), limit)
        answer = self._frames.answer_in(data, inputs.sample)
        if answer is None:
            self._fail(Status.FATAL, inputs.sample, self._host.unreadable(data))
        self._answered = True
        status, gear, shifting, flags, numbers, text, trace = answer
        if status == FAULT:
            if trace:
                LOG.error("controller %s, sample %d\n%s", self.name, inputs.sample, trace)
            self._fail(Status.ERROR, inputs.sample, text)
        return self._outputs_in(numbers, gear, bool(shifting), flags, Status(status), text)

    def _end(self) -> None:
        super()._end()
        if self._host.trace:
            LOG.error("controller %s\n%s", self.name, self._host.trace)


def _out_of_time(_number: int, _frame: object) -> NoReturn:
    raise Overtime


class InProcess(Plug):
    """An instance of a user's class in the rig's process, where a debugger works; only its step has a limit of time."""

    in_process = True

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        """Load the class; ``rest`` is as in :class:`PythonClass`."""
        name = f"python:{rest}"
        # Ctrl-C ends the rig; a sys.exit() in user code ends the controller only
        self._class = UserClass(rest, name, record_of(config).all_transducers, (KeyboardInterrupt,))
        super().__init__(name, config, chosen_level(level, self._class.levels, name))
        self.level_from = DECLARED if self._class.declared else DEFAULT
        self.wants, self.signals, self.settings = self._class.wants, self._class.signals, self._class.settings
        try:
            self._class.initialize(self.info)
        except Broken as broken:
            raise RigError(f"controller {name}: {broken}") from None

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        timed = self._timed()
        try:
            try:
                if timed:
                    signal.setitimer(signal.ITIMER_REAL, self.step_timeout)
                return self._class.step(inputs)
            finally:  # before a fault is handled: that calls terminate, which has no limit of time
                if timed:
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
        except Overtime:
            self._overdue(inputs.sample)
        except Broken as broken:
            LOG.error("controller %s, sample %d\n%s", self.name, inputs.sample, broken.trace)
            self._fail(Status.ERROR, inputs.sample, str(broken))

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
            self._class.terminate()
        except Broken as broken:
            LOG.error("controller %s\n%s", self.name, broken.trace)
            self.end_fault = str(broken)
        except Overtime:  # by an alarm that the class itself has set: the handler of the steps is still there
            self.end_fault = "terminate was ended by an alarm of the controller's own"
