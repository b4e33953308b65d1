# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What controllers have in common that run by their own clock: CAN, Modbus, free ROS 2 nodes. Nobody waits for them.

In simulated time the rig is held to real time: sample k is not asked before k ms have passed. The newest command is
used once; a sample without a new one is discarded, so that the rig trips when 100 ms bring none (docs/how_to/can.md), or,
for a slow controller, gets the newest one again until its longer ``timeout`` is near. Of several who command, one is
the master.
"""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from ..clocks import COMMAND_TIMEOUT
from ..errors import RigError
from .plug import TOLD, Plug, Waiting, chosen_level
from .seam import LEVELS, ControllerInputs, ControllerOutputs, Status

if TYPE_CHECKING:
    from ..testbench.configuration import RigConfig

LONGEST = 10.0  # s that it may be told to be
MASTER = 1.0  # s of silence after which another one may command, or the timeout when that is longer
LATE = 2e-2  # s behind real time from which on the clock is set anew instead of hurrying after it
IDLE = 1e-2  # s between messages to a controller that has not spoken yet


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


def timeout_of(options: dict[str, str], name: str) -> float:
    """The option timeout [s]; RigError when it is none."""
    return number(options, "timeout", COMMAND_TIMEOUT, name, COMMAND_TIMEOUT, LONGEST)


class FreeRunning(Plug):
    """A plug whose controller has a clock of its own.

    Subclasses give ``_send``, ``_listen`` and ``_end``. timeout: s without a command after which the rig trips.
    """

    own_clock, level_from = True, TOLD

    def __init__(self, name: str, config: RigConfig, level: str | None, place: str, timeout: float = COMMAND_TIMEOUT) -> None:
        super().__init__(name, config, chosen_level(level, LEVELS[::-1], name))
        self.place, self.timeout = place, timeout  # where the controller is expected, in words
        self.faults: dict[str, int] = {}  # what came and was not used -> how often
        self._newest: ControllerOutputs | None = None
        self._waiting: Waiting | None = None  # since the newest command
        self._discarded, self._told_silence, self._was_here = 0, False, False
        self._held: ControllerOutputs | None = None  # the newest answer
        self._master, self._mastered = "", -math.inf  # who commands, and time.monotonic() of the newest command
        self._origin: float | None = None  # time.monotonic() of sample 0

    def heard(self, outputs: ControllerOutputs) -> None:
        """A valid command has come."""
        self._newest = outputs

    def may_command(self, who: str) -> bool:
        """Whether a command of this one is taken now: that of the first, until it has been silent or has left."""
        return who == self._master or time.monotonic() - self._mastered >= max(MASTER, self.timeout)

    def commands_now(self, who: str) -> None:
        """A command of this one is taken: it is the master."""
        self._master, self._mastered = who, time.monotonic()

    def has_left(self, who: str) -> None:
        """If this one was the master, the next who commands is."""
        if who == self._master:
            self._mastered = -math.inf

    def refuse(self, who: str) -> None:
        """Tell of a command of one who is not the master."""
        self.fault(
            f"a command of {who} is refused: {self._master} commands, until it leaves or has been silent for "
            f"{max(MASTER, self.timeout):g} s"
        )

    def fault(self, text: str) -> None:
        """Something came that is never used: said the first time, counted from then on."""
        self.faults[text] = self.faults.get(text, 0) + 1
        if self.faults[text] == 1:
            self.say(f"{self.name}: {text}; it is not used, nor are others like it")

    def wait(self, patience: float | None = None) -> None:
        """As of every plug: until a first command has come."""
        waiting = Waiting(f"waiting for controller on {self.place}", self.say)
        record = self.rig_record
        idle = record.inputs(0, 0.0, 0, (0.0,) * len(record.outputs), (0.0,) * len(record.transducers))
        self.refused = ""
        while self._newest is None:
            if self.stopped():
                return
            in_vain = self._in_vain(waiting, patience, f"no command came on {self.place}", self._faults_told())
            if in_vain:
                self.close()
                raise in_vain
            waiting.tell()
            self._send(idle)
            self._listen(time.monotonic() + IDLE)
        self._newest = None  # it answers nothing of this run
        self._is_here()

    def awaited(self) -> str:
        """As of every plug."""
        return "" if self._was_here else f"no command has come on {self.place}{self._faults_told()}"

    def _is_here(self) -> None:
        if not self._was_here:
            self._was_here = True
            self.say(f"controller on {self.place} is here")

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        now = time.monotonic()
        if self._origin is None or now - self._origin - inputs.time > LATE:
            self._origin = now - inputs.time
        self._listen(now if self.real_time else self._origin + inputs.time)
        self._send(inputs)
        if self._newest is None:
            self._silence()
            if self._held is not None and self._discarded * self.info.period <= self.timeout - COMMAND_TIMEOUT:
                return self._held
            return ControllerOutputs(status=Status.DISCARD)
        answer, self._newest = self._newest, None
        self._held = answer
        self._waiting, self._discarded, self._told_silence = None, 0, False
        self._is_here()
        return answer

    def _silence(self) -> None:
        """No new command for this sample: said half-way to the trip, which is the rig's own, and while it lasts."""
        self._discarded += 1
        if self._waiting is None:
            self._waiting = Waiting(f"waiting for controller on {self.place}", self.say)
        if self._was_here and not self._told_silence and self._discarded * self.info.period > 0.5 * self.timeout:
            self._told_silence = True
            self.say(
                f"{self.name}: no command on {self.place} for {0.5e3 * self.timeout:.0f} ms; the rig trips at "
                f"{1e3 * self.timeout:.0f} ms{self._faults_told()}"
            )
        self._waiting.tell()

    def _faults_told(self) -> str:
        told = ", ".join(f"{text} ({count} times)" for text, count in self.faults.items())
        return f"; not used: {told}" if told else ""

    def _abandon(self) -> None:
        self._end()

    @abstractmethod
    def _send(self, inputs: ControllerInputs) -> None:
        """Show a sample to whoever looks."""

    @abstractmethod
    def _listen(self, until: float) -> None:
        """Take in what comes until a time of time.monotonic(), and call ``heard`` with each command."""
