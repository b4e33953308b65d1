"""What controllers have in common that run by their own clock: CAN and Modbus. Nobody waits for their answer.

The rig is held to real time: sample k is not asked before k ms have passed. The newest command is used once; a sample
without a new one is discarded, so that the rig trips when 100 ms bring none (docs/can.md, docs/modbus.md).
"""

from __future__ import annotations

import sys
import time
from urllib.parse import parse_qsl

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from .plug import Plug, chosen_level
from .seam import LEVELS, ControllerInputs, ControllerOutputs, Status

OLD = 0.1  # s without a command after which the rig trips (testbench.rig.COMMAND_TIMEOUT)
EARLY = 2e-3  # s that a sample may come before its time: the graph's own clock jitters
LATE = 2e-2  # s behind real time from which on the clock is set anew instead of hurrying after it
WAIT = 30.0  # s that a controller may take to appear
IDLE = 1e-2  # s between messages to a controller that has not spoken yet


def say(text: str) -> None:
    """One sentence for the person at the terminal; on the graph it is in logs/alfa46.log."""
    print(f"rig: {text}", file=sys.stderr, flush=True)


def split_options(rest: str, name: str, known: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """("channel", {"option": "value"}) of "channel?option=value&..."; RigError for an option that is not known."""
    head, _, tail = rest.partition("?")
    options = dict(parse_qsl(tail, keep_blank_values=True))
    for key in options:
        if key not in known:
            raise RigError(f"controller {name}: unknown option '{key}'; known are {', '.join(known)}")
    return head, options


def number(options: dict[str, str], key: str, default: float, name: str, low: float, high: float) -> float:
    """A number of the options; RigError when it is none or out of range."""
    text = options.get(key, str(default))
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise RigError(f"controller {name}: option {key} is '{text}', expected {low:g} to {high:g}")
    return value


class FreeRunning(Plug):
    """A plug whose controller has a clock of its own.

    Subclasses give ``_send(inputs)``, ``_listen(until)``, which takes in what comes until a time of time.monotonic()
    and calls ``heard`` with each command, and ``_close``; they call ``wait_for_controller`` at the end of __init__.
    """

    def __init__(self, name: str, config: Alfa46Config, level: str | None, place: str):
        super().__init__(name, config, chosen_level(level, LEVELS[::-1], name))
        self.place = place  # where the controller is expected, in words
        self.faults: dict[str, int] = {}  # what came and was not used -> how often
        self._newest: ControllerOutputs | None = None
        self._discarded, self._told_silence = 0, False
        self._origin: float | None = None  # time.monotonic() of sample 0

    def heard(self, outputs: ControllerOutputs) -> None:
        """A valid command has come."""
        self._newest = outputs

    def fault(self, text: str) -> None:
        """Something came that is never used: said the first time, counted from then on."""
        self.faults[text] = self.faults.get(text, 0) + 1
        if self.faults[text] == 1:
            say(f"controller {self.name}: {text}; it is not used, nor are others like it")

    def wait_for_controller(self, patience: float) -> None:
        """Returns when the first command has come; says each second that it waits; RigError after ``patience`` s."""
        began = time.monotonic()
        shown = 0
        idle = ControllerInputs(0, 0.0, 0, (0.0,) * 3, 0.0, 0.0, 0.0, 0.0)
        try:
            while self._newest is None:
                waited = time.monotonic() - began
                if waited >= patience:
                    raise RigError(f"controller {self.name}: no command came on {self.place} within {patience:g} s"
                                   f"{self._faults_told()}")
                if int(waited) > shown:
                    shown = int(waited)
                    say(f"waiting for controller on {self.place}, {shown} s")
                self._send(idle)
                self._listen(min(time.monotonic() + IDLE, began + patience))
        except BaseException:
            self._close()
            raise
        self._newest = None  # it answers nothing of this run

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        now = time.monotonic()
        due = inputs.time
        if self._origin is None or now - self._origin - due > LATE:
            self._origin = now - due
        self._listen(self._origin + due - EARLY)
        self._send(inputs)
        if self._newest is not None:
            answer, self._newest = self._newest, None
            self._discarded, self._told_silence = 0, False
            return answer
        self._discarded += 1
        return self._silence()

    def _silence(self) -> ControllerOutputs:
        """No new command: discarded, until the rig trips by its own rule; said half-way there."""
        if not self._told_silence and self._discarded * self.info.period > 0.5 * OLD:
            self._told_silence = True
            say(f"controller {self.name}: no command on {self.place} for {0.5e3 * OLD:.0f} ms; the rig trips at "
                f"{1e3 * OLD:.0f} ms{self._faults_told()}")
        return ControllerOutputs(status=Status.DISCARD)

    def _faults_told(self) -> str:
        told = ", ".join(f"{text} ({count} times)" for text, count in self.faults.items())
        return f"; not used: {told}" if told else ""

    def _end(self) -> None:
        if self.faults:
            say(f"controller {self.name}{self._faults_told()}")
        self._close()

    def _send(self, inputs: ControllerInputs) -> None:
        raise NotImplementedError

    def _listen(self, until: float) -> None:
        raise NotImplementedError

    def _close(self) -> None:
        raise NotImplementedError
