# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The common part of controllers that run by their own clock: CAN, Modbus, free ROS 2 nodes. The rig does not wait for them.

In simulated time the rig is held to real time: sample k is not asked before k ms have passed. The newest command is
used once. A sample without a new command is discarded, so that the rig trips when 100 ms bring none
(docs/how_to/can.md); for a slow controller with a longer ``timeout`` the newest command is used again until that time
is near. Of several controllers that send commands, one is the master.
"""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from ..base import COMMAND_TIMEOUT, RigError
from .plug import RECEIVED, Plug, Waiting, chosen_level
from .seam import LEVELS, ControllerInputs, ControllerOutputs, Status
from .wire import Wire, held_in

if TYPE_CHECKING:
    from ..rig import RigConfig

LONGEST = 10.0  # s, the largest value of the option timeout
MASTER = 1.0  # s of silence after which another controller may command, or the timeout when that is longer
LATE = 2e-2  # s behind real time; from here on the clock is set anew instead of running faster to catch up
AT_ONCE = 100  # frames that are taken in a sample at most, so that a flood does not keep the rig from going on
IDLE = 1e-2  # s between messages to a controller that has not sent anything yet


def split_options(rest: str, name: str, known: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """Split "channel?option=value&..." into ("channel", {"option": "value"}).

    Parameters
    ----------
    rest : str
        The specification behind its prefix.
    name : str
        The controller's name, for the error's sentence.
    known : tuple of str
        Names of the options that the plug has.

    Returns
    -------
    tuple
        (channel, options): a str, and the text of each given option by name.

    Raises
    ------
    RigError
        For an option that is not known.
    """
    head, _, tail = rest.partition("?")
    options = dict(parse_qsl(tail, keep_blank_values=True))
    for key in options:
        if key not in known:
            raise RigError(f"controller {name}: unknown option '{key}'; known are {', '.join(known)}")
    return head, options


def number(options: dict[str, str], key: str, default: float, name: str, low: float, high: float) -> float:
    """Return an option as a number.

    Parameters
    ----------
    options : dict of str to str
        The options as :func:`split_options` returns them.
    key : str
        The option's name.
    default : float
        The value when the option is not given.
    name : str
        The controller's name, for the error's sentence.
    low, high : float
        Smallest and largest value permitted.

    Returns
    -------
    float
        The value.

    Raises
    ------
    RigError
        When the text is no number or the number is out of range.
    """
    text = options.get(key, str(default))
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise RigError(f"controller {name}: option {key} is '{text}', expected {low:g} to {high:g}")
    return value


def timeout_of(options: dict[str, str], name: str) -> float:
    """Return the option timeout [s]; RigError when it is no number or out of range."""
    return number(options, "timeout", COMMAND_TIMEOUT, name, COMMAND_TIMEOUT, LONGEST)


class FreeRunning(Plug):
    """A plug whose controller has a clock of its own; subclasses define ``_send``, ``_listen`` and ``_end``.

    Parameters
    ----------
    name : str
        The controller's name, for people.
    config : RigConfig
        The rig's configuration.
    level : str or None
        "duty" or "current"; None takes "current".
    place : str
        Where the controller is expected, in words.
    timeout : float
        Time without a command after which the rig trips [s].
    """

    own_clock, level_from = True, RECEIVED

    def __init__(self, name: str, config: RigConfig, level: str | None, place: str, timeout: float = COMMAND_TIMEOUT) -> None:
        super().__init__(name, config, chosen_level(level, LEVELS[::-1], name))
        self.place, self.timeout = place, timeout
        self.conflict = ""  # why the rig must not go on: another rig or a second controller is at work in its place
        self._newest: ControllerOutputs | None = None
        self._waiting: Waiting | None = None  # the wait since the newest command
        self._discarded, self._silence_reported, self._was_here = 0, False, False
        self._held: ControllerOutputs | None = None  # the newest answer
        self._master, self._mastered = "", -math.inf  # the controller that commands, and time.monotonic() of its newest command
        self._origin: float | None = None  # time.monotonic() of sample 0

    def received(self, outputs: ControllerOutputs) -> None:
        """Take in a valid command that has come."""
        self._newest = outputs

    def received_raw(self, raw: Sequence[int], wires: list[Wire], state: Sequence[int], where: str) -> None:
        """Take in a valid command that came as whole numbers.

        Parameters
        ----------
        raw : sequence of int
            The raw number of each of ``wires``.
        wires : list of Wire
            The wires of a command at this level.
        state : sequence of int
            Gear, 1 while it shifts, flags and status of the controller.
        where : str
            Where the controller reports its status, in words.
        """
        command = held_in([wire.decode(number) for wire, number in zip(wires, raw, strict=True)], self.info, wires)
        gear, shifting, flags, status = state
        self.received(ControllerOutputs(command, None, gear, shifting, flags, status, f"the controller reports it {where}"))

    def may_command(self, who: str) -> bool:
        """Return whether a command of this controller is taken now; only the master's is, until it leaves or falls silent."""
        return who == self._master or time.monotonic() - self._mastered >= max(MASTER, self.timeout)

    def commands_now(self, who: str) -> None:
        """Make this controller the master, because a command of it is taken."""
        self._master, self._mastered = who, time.monotonic()

    def has_left(self, who: str) -> None:
        """Give up the master if this controller was it; the next one that commands becomes the master."""
        if who == self._master:
            self._mastered = -math.inf

    def refuse(self, who: str) -> None:
        """Report a command of a controller that is not the master."""
        self.ignored.add(
            f"a command of {who} is refused: {self._master} commands, until it leaves or has been silent for "
            f"{max(MASTER, self.timeout):g} s"
        )

    def wait(self, patience: float | None = None) -> None:
        """Wait, as in every plug, until a first command has come; RigError too for a conflict."""
        waiting = Waiting(f"waiting for controller on {self.place}", self.say)
        record = self.rig_record
        idle = record.inputs(0, 0.0, 0, (0.0,) * len(record.outputs), (0.0,) * len(record.transducers))
        self.refused = ""
        while self._newest is None:
            if self.stopped():
                return
            in_vain = self._in_vain(waiting, patience, f"no command came on {self.place}", self.ignored.text())
            if in_vain:
                self.close()
                raise in_vain
            waiting.report()
            self._send(idle)
            self._listen(time.monotonic() + IDLE)
            if self.conflict:
                self.close()
                raise RigError(f"controller {self.name}: {self.conflict}")
        self._newest = None  # it came before the first sample, so it answers none
        self._is_here()

    def awaited(self) -> str:
        """Return the sentence of every plug that no command has come."""
        return "" if self._was_here else f"no command has come on {self.place}{self.ignored.text()}"

    def _is_here(self) -> None:
        if not self._was_here:
            self._was_here = True
            self.say(f"controller on {self.place} is here")

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        now = time.monotonic()
        if self._origin is None or now - self._origin - inputs.time > LATE:
            self._origin = now - inputs.time
        self._listen(now if self.real_time else self._origin + inputs.time)
        if self.conflict:
            self._fail(Status.ERROR, inputs.sample, self.conflict)
        self._send(inputs)
        if self._newest is None:
            self._silence()
            if self._held is not None and self._discarded * self.info.period <= self.timeout - COMMAND_TIMEOUT:
                return self._held
            return ControllerOutputs(status=Status.DISCARD, message=f"no command comes on {self.place}{self.ignored.text()}")
        answer, self._newest = self._newest, None
        self._held = answer
        self._waiting, self._discarded, self._silence_reported = None, 0, False
        self._is_here()
        return answer

    def _silence(self) -> None:
        """Count a sample without a new command; report it half-way to the trip, which the rig itself makes, and while it lasts."""
        self._discarded += 1
        if self._waiting is None:
            self._waiting = Waiting(f"waiting for controller on {self.place}", self.say)
        if self._was_here and not self._silence_reported and self._discarded * self.info.period > 0.5 * self.timeout:
            self._silence_reported = True
            self.say(
                f"{self.name}: no command on {self.place} for {0.5e3 * self.timeout:.0f} ms; the rig trips at "
                f"{1e3 * self.timeout:.0f} ms{self.ignored.text()}"
            )
        self._waiting.report()

    def _abandon(self) -> None:
        self._end()

    @abstractmethod
    def _send(self, inputs: ControllerInputs) -> None:
        """Send a sample to the controllers."""

    @abstractmethod
    def _listen(self, until: float) -> None:
        """Take in what comes until a time of time.monotonic(), and call ``received`` with each command."""
