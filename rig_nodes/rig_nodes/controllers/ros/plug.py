# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plugs for a controller that is a ROS 2 node: in lockstep, or by its own clock (docs/how_to/ros_controller.md).

load.py makes them. The topics are in topics.py; the node may start before or after the rig and serves many runs.
"""

from __future__ import annotations

import os
import re
import select
import time
from typing import TYPE_CHECKING

from rig_msgs.msg import ControllerReady, ControllerStart
from rig_msgs.msg import ControllerRecord as ControllerRecordMessage

from ...base import RigError
from ..free_running import FreeRunning, split_options
from ..own_signals import checked_settings, checked_signals, once_each
from ..plug import RECEIVED, Plug, Waiting, chosen_level
from ..record import ControllerRecord
from ..seam import LEVELS, ControllerFailed, ControllerInputs, ControllerOutputs, Status, checked_wants, shortened
from .topics import Answered, NoAnswer, Topics, pack_step

if TYPE_CHECKING:
    from ...rig import RigConfig

TOKEN = "[A-Za-z](_?[A-Za-z0-9])*_?"  # ROS 2 does not allow two underscores in succession
NAME = re.compile(f"{TOKEN}(/{TOKEN})*")
OPTIONS = ("timing", "wants", "settings", "signals")
TIMINGS = ("lockstep", "free")
LEVEL_BITS = {"duty": 1, "current": 2}
RESEND = 0.02  # s of wall clock without an answer after which a step is sent again
FAREWELL = 0.5  # s of wall clock that the last message to a controller may take
GLANCE = 0.0005  # s of wall clock for an answer in real time while the controller is away


def ros_controller(rest: str, config: RigConfig, level: str | None = None) -> Plug:
    """Return the plug of ros:NAME?timing=free&wants=M_wej,p_p&settings=gain:2.0&signals=slip:rad/s,state.

    Parameters
    ----------
    rest : str
        The specification behind "ros:"; all of its parts may be left out.
    config : RigConfig
        The rig's configuration.
    level : str or None
        "duty" or "current"; None takes the plug's default.

    Returns
    -------
    Plug
        A RosNode, or a FreeRosNode with timing=free.

    Raises
    ------
    RigError
        When a part of the specification is not right.
    """
    spec = f"ros:{rest}"
    name, options = split_options(rest, spec, OPTIONS)
    name = checked_topics(name or "controller", f"controller {spec}: ")
    timing = options.get("timing", TIMINGS[0])
    if timing not in TIMINGS:
        raise RigError(f"controller {spec}: timing is '{timing}', expected {' or '.join(TIMINGS)}")
    plug = FreeRosNode(spec, config, level) if timing == "free" else RosNode(spec, config, chosen_level(level, LEVELS, spec))
    plug.level_from = RECEIVED
    plug.other_side = _OtherSide(plug, name)
    plug.wants = checked_wants(_items(options, "wants"), spec, plug.rig_record.all_transducers)
    values = once_each((_setting(item, spec) for item in _items(options, "settings")), "settings", spec)
    signals = (item.partition(":") for item in _items(options, "signals"))
    units = once_each(((signal, unit or "-") for signal, _, unit in signals), "signals", spec)
    plug.settings, plug.signals = checked_settings(values, spec), checked_signals(units, spec)
    return plug


def checked_topics(name: str, where: str = "") -> str:
    """Check the name with which the topics of a rig and its controller begin.

    Parameters
    ----------
    name : str
        The name.
    where : str
        Begin of the error's sentence.

    Returns
    -------
    str
        The name.

    Raises
    ------
    RigError
        When ROS 2 would not accept the name.
    """
    if not NAME.fullmatch(name):
        raise RigError(f"{where}'{name}' is no name of topics; expected letters, digits and single underscores, e.g. controller")
    return name


def _items(options: dict[str, str], key: str) -> list[str]:
    return [item for item in options.get(key, "").split(",") if item]


def _setting(item: str, spec: str) -> tuple[str, float]:
    name, _, value = item.partition(":")
    try:
        return name, float(value)
    except ValueError:
        raise RigError(f"controller {spec}: setting '{item}' has no first value; expected e.g. gain:2.0") from None


class Gone(Exception):
    """The controller has gone; the message has the reason."""


class _OtherSide:
    """The controller at the other end of the topics: waits for it, and detects when it has gone."""

    def __init__(self, plug: Plug, name: str) -> None:
        self._plug, self.name = plug, name
        self.topics = None  # None until they are opened: `rig run` reads a plug before its domain is known
        self.controller = 0  # number of the controller at work, 0 while there is none
        self.was_here = False
        self.session = self._seq = 0
        self._life: int | None = None  # descriptor that becomes readable when the controller's process ends

    @property
    def place(self) -> str:
        """Where the controller is expected, in words."""
        return f"ROS topic /{self.name}/answer in domain {self.topics.domain}"

    @property
    def advice(self) -> str:
        """Advice for the user when no controller comes, in words."""
        return f"start its node in the same ROS domain (export ROS_DOMAIN_ID={self.topics.domain} in both terminals)"

    def awaited(self) -> str:
        """Return the sentence of every plug that no controller has come."""
        if self.was_here or self.topics is None:
            return ""
        return self._plug.not_here(self.place, self.advice)

    def open(self) -> None:
        """Join the graph; further calls do nothing."""
        if self.topics is None:
            self.topics = Topics(self.name)
            self.begin()

    def begin(self) -> None:
        """Begin a new session for the controller that is there or comes."""
        self.forget()
        self.session = int.from_bytes(os.urandom(4), "little") or 1
        self._seq = 0
        self.topics.start(self._start(over=False))

    def _start(self, over: bool, message: str = "") -> ControllerStart:
        info, plug = self._plug.info, self._plug
        return ControllerStart(
            session=self.session,
            over=over,
            level=LEVELS.index(info.level),
            period=info.period,
            command_high=info.command_high,
            parameter_names=list(info.parameters),
            parameter_values=list(info.parameters.values()),
            wants=list(plug.wants),
            settings=list(plug.settings),
            signals=list(plug.signals),
            record=record_message(plug.rig_record),
            message=message,
        )

    def forget(self) -> None:
        """Forget the controller that was at work."""
        self.controller = 0
        if self._life is not None:
            os.close(self._life)
            self._life = None

    def next_step(self, inputs: ControllerInputs) -> bytes:
        """Return the message of the next step."""
        self._seq += 1
        return pack_step(self.session, self.controller, self._seq, inputs)

    def take(self, seconds: float) -> Answered | None:
        """Return the next answer of this session.

        Parameters
        ----------
        seconds : float
            Longest wait [s of wall clock].

        Returns
        -------
        Answered or None
            None when no answer comes in time, and when a controller becomes ready.

        Raises
        ------
        Gone
            When the controller at work has left.
        """
        try:
            came = self.topics.take(seconds)
        except NoAnswer as error:
            self._plug.ignored.add(str(error))
            return None
        if isinstance(came, Answered):
            if came.session != self.session or self.controller not in (0, came.controller):
                if came.session == self.session:  # the others are from an earlier run
                    self._plug.ignored.add("an answer came from a controller that was not asked")
                return None
            if came.seq > self._seq:
                self._plug.ignored.add("an answer came to a step that was not asked yet")
                return None
            return came
        if came is not None and came.session == self.session:
            self._hear(came)
        return None

    def is_newest(self, answered: Answered) -> bool:
        """Return whether an answer is to the newest step."""
        return answered.seq == self._seq

    def _hear(self, ready: ControllerReady) -> None:
        """Handle a controller's message that it is ready, refuses or leaves."""
        plug, text = self._plug, shortened(" ".join(ready.message.split())) or "it gave no reason"
        why = ""
        if ready.state == ready.LEAVES:
            if ready.controller == self.controller:
                raise Gone(f"it has left: {text}")
            return
        if ready.state == ready.REFUSES:
            why = text
        elif not ready.levels & LEVEL_BITS[plug.level]:
            known = " and ".join(name for name, bit in LEVEL_BITS.items() if ready.levels & bit) or "none"
            why = f"this run is at level {plug.level}, the controller's is {known}; choose with --level"
        elif self.controller not in (0, ready.controller):
            why = "another controller is at work"
        if why:
            plug.refused = why
            sentence = f"a controller on {self.place} is not used: {why}"
            plug.ignored.add(sentence, sentence)
            return
        if ready.controller != self.controller:
            self.controller, self.was_here = ready.controller, True
            self._watch(ready)
            process = f" (process {ready.process_id})" if ready.process_id else ""
            plug.say(f"controller on {self.place} is here{process}")

    def _watch(self, ready: ControllerReady) -> None:
        """Let the kernel report the end of the controller's process, unless the process number belongs to another container."""
        if ready.process_id and ready.pid_namespace == os.readlink("/proc/self/ns/pid"):
            try:
                self._life = os.pidfd_open(ready.process_id)
            except ProcessLookupError:
                raise Gone("its process has ended") from None

    def look_after(self) -> None:
        """Raise Gone when the controller at work has ended without a message."""
        if self._life is not None and select.select([self._life], [], [], 0.0)[0]:
            raise Gone("its process has ended")
        if self.controller and not self.topics.somebody_answers():
            raise Gone("its node has left the graph")

    def close(self, message: str) -> None:
        """End the run: send the last message and leave the graph."""
        if self.topics is not None:
            self.topics.start(self._start(over=True, message=message))
            self.topics.close(FAREWELL if self.controller else 0.0)
            self.topics = None
        self.forget()


class RosNode(Plug):
    """A node in lockstep: one step out, its answer in; simulated time waits."""

    def __init__(self, name: str, config: RigConfig, level: str) -> None:
        super().__init__(name, config, level)
        self.other_side: _OtherSide | None = None
        self._away = True  # the newest sample was not answered
        self._waiting: Waiting | None = None  # in real time: the wait since then

    def pace(self, step_timeout: float | None, real_time: bool = False) -> None:
        """Set the pace as in every plug, and open the topics."""
        super().pace(step_timeout, real_time)
        self.other_side.open()

    def wait(self, patience: float | None = None) -> None:
        """Wait, as in every plug, until a controller reports that it is ready."""
        side = self.other_side
        side.open()
        self.refused = ""
        waiting = Waiting(f"waiting for controller on {side.place}", self.say)
        while not side.controller and not self.stopped():
            in_vain = self._in_vain(waiting, patience, "none has come", f"; {side.advice}")
            if in_vain:
                self.close()
                raise in_vain
            waiting.report()
            try:
                side.take(0.2)
            except Gone:
                side.begin()  # the controller came and went before its first step

    def awaited(self) -> str:
        """Return the sentence of every plug that no controller has come."""
        return self.other_side.awaited()

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        side = self.other_side
        side.open()
        try:
            while side.take(0.0) is not None:
                pass  # late answers are dropped
            answered = self._exchange(inputs)
        except Gone as gone:
            self._away = True
            side.begin()  # another controller may come
            raise ControllerFailed(f"controller {self.name}, sample {inputs.sample}: {gone}", Status.FATAL) from None
        if answered is None:
            why = "it has not answered in time" if side.controller else self.not_here(side.place, side.advice)
            return ControllerOutputs(status=Status.DISCARD, message=why)
        return outputs_of(answered, self)

    def _exchange(self, inputs: ControllerInputs) -> Answered | None:
        """Return the answer; None in real time while there is none."""
        side, began = self.other_side, time.monotonic()
        patience = GLANCE if self.real_time and self._away else self.step_timeout
        waiting, sent_to, data = None, 0, b""
        while True:
            if side.controller != sent_to:
                data, sent_to = side.next_step(inputs), side.controller
            if sent_to:
                side.topics.step(data)
            again = time.monotonic() + RESEND
            if patience is not None:
                again = min(again, began + patience)
            while (left := again - time.monotonic()) > 0.0:
                answered = side.take(left)
                if answered is not None and side.is_newest(answered):
                    self._away, self._waiting = False, None
                    return answered
            side.look_after()
            if self.stopped():
                raise Gone("the run was ended")
            if patience is not None and time.monotonic() >= began + patience:
                return self._no_answer()
            waiting = waiting or Waiting(f"waiting for controller on {side.place}", self.say)
            waiting.report()

    def _no_answer(self) -> None:
        side = self.other_side
        if self.real_time:
            if not self._away:
                self.say(f"waiting for controller on {side.place}: no answer for {self.step_timeout * 1e3:.0f} ms")
            self._away = True
            self._waiting = self._waiting or Waiting(f"waiting for controller on {side.place}", self.say)
            self._waiting.report()
            return
        if side.was_here:
            raise Gone(f"no answer for {self.step_timeout:g} s (--step-timeout)")
        raise Gone(f"none has come within {self.step_timeout:g} s")

    def _end(self) -> None:
        self.other_side.close("the run is over")

    def _abandon(self) -> None:
        self._end()


class FreeRosNode(FreeRunning):
    """A node by its own clock: steps go out, the newest answer is used once; the rig does not wait."""

    def __init__(self, name: str, config: RigConfig, level: str | None) -> None:
        super().__init__(name, config, level, place="")  # the place is set when the domain is known
        self.other_side: _OtherSide | None = None

    def pace(self, step_timeout: float | None, real_time: bool = False) -> None:
        """Set the pace as in every plug, and open the topics."""
        super().pace(step_timeout, real_time)
        self._open()

    def wait(self, patience: float | None = None) -> None:
        """Wait, as in every plug, until a first answer has come."""
        self._open()
        super().wait(patience)

    def awaited(self) -> str:
        """Return the sentence of every plug that no controller has come."""
        return "" if self._was_here else self.other_side.awaited()

    def _is_here(self) -> None:
        if self.other_side.was_here:
            self._was_here = True  # the other side has reported it
        super()._is_here()

    def _open(self) -> None:
        self.other_side.open()
        self.place = self.other_side.place

    def _send(self, inputs: ControllerInputs) -> None:
        self._open()
        self.other_side.topics.step(self.other_side.next_step(inputs))

    def _listen(self, until: float) -> None:
        side = self.other_side
        self._open()
        while True:
            rest = until - time.monotonic()
            try:
                answered = side.take(max(rest, 0.0))
                side.look_after()
            except Gone as gone:
                self.say(f"controller {self.name}: {gone}")
                side.begin()
                return
            if answered is not None:
                self.received(outputs_of(answered, self))
            elif rest <= 0.0:
                return

    def _end(self) -> None:
        self.other_side.close("the run is over")


def record_message(record: ControllerRecord) -> ControllerRecordMessage:
    """Return a record as a message, without time and number."""
    return ControllerRecordMessage(
        id=record.id,
        outputs=[output.name for output in record.outputs],
        valves=[output.valve for output in record.outputs],
        transducers=list(record.names),
        units=[signal.unit for signal in record.transducers],
        gears=list(record.gear_names),
        gear_names=list(record.gear_names.values()),
    )


def outputs_of(answered: Answered, plug: Plug) -> ControllerOutputs:
    """Return the content of an answer for the seam, which checks it."""
    whole = len(answered.signals) == len(plug.signals)
    signals = dict(zip(plug.signals, answered.signals, strict=True)) if whole else list(answered.signals)
    return ControllerOutputs(
        answered.command,
        answered.setpoint or None,
        answered.gear,
        answered.shifting,
        answered.flags,
        answered.status,
        answered.message,
        signals,
    )
