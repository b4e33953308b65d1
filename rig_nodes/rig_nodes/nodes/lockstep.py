# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig container's side of a run in lockstep: no process goes on before all of them have done the sample.

The rig container uses it in place of its real-time clock. The order in each sample is that of ``simulate``: sequencer (every
tick), messages, controller, plant; so the plant's topics are the same, bit for bit, at any speed.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ..base import ANSWERED, DISCARDED, NOT_AT_ALL, PATIENCE, READY, SAMPLE_NS, STATUS, TICK_SAMPLES, Frames, Link, LinkClosed
from ..controllers import Answer, ControllerFailed, ControllerRecord, Status, record_of
from ..rig import BAD_CONTROLLER, CONTROLLER_COMMAND, ENDED_EARLY, PROCESS_LOST
from ..runs import RigStatus, give_answer
from .realtime import take_core

if TYPE_CHECKING:
    from ..runs import Outputs
    from .commands import Commands

GRACE = 0.5  # s more, so that the process nearer to the controller can report first
BEFORE_FIRST = 60.0  # s for the sequencer to be ready
LOOK_UP = 0.1  # s of waiting for the controller between checks for an order to end


class RunEnds(ControllerFailed):
    """No answer of the controller because the run ends, which is no fault of the controller."""


class RemoteController:
    """The controller of the alfa46 process as a plug of this process; it is asked through its link."""

    name = "alfa46"

    def __init__(
        self,
        link: Link,
        record: ControllerRecord,
        step_timeout: float | None,
        stopping: Callable[[], bool],
        cause: Callable[[], str],
    ) -> None:
        """Keep the link; ``step_timeout`` [s] is for one sample, and any wait ends when ``stopping`` returns True.

        ``cause`` returns why all processes of the run end, if that is so; then it is not the controller that has failed.
        The process of the controller has the exact limit and may report a timeout earlier.
        """
        self.level, self.wants = "", []  # the process sends them when it is ready
        self.trouble = ""  # what its plug knows of why the newest sample has no answer
        self.gear, self.shifting, self.flags = 0, False, 0
        self._link, self._record, self._limit, self._stopping = link, record, step_timeout, stopping
        self._cause = cause
        self._timeout = None if step_timeout is None else step_timeout + GRACE

    def wait(self) -> bool:
        """Wait until the process is ready; False when the run is to end first, LinkClosed when the process has ended.

        The process itself limits the time.
        """
        hello = self._receive(None)
        if hello is None:
            return False
        self.level, *self.wants = hello.removeprefix(READY).decode().split()
        self._frames = Frames(len(self._record.outputs), len(self._record.transducers), len(self.wants))
        return True

    def _receive(self, seconds: float | None) -> bytes | None:
        """The next message; None when none comes within these seconds, or before the run is to end."""
        until = math.inf if seconds is None else time.monotonic() + seconds
        while True:
            data = self._link.receive(LOOK_UP)
            if data is not None or self._stopping() or time.monotonic() >= until:
                return data

    def send_status(self, status: RigStatus, reason: str) -> None:
        """Send the state of the rig; a trip cancels every order."""
        try:
            self._link.send(STATUS + bytes([status]) + reason.encode())
        except LinkClosed:
            pass  # answer() reports it

    def ask(self, sample: int, current: Sequence[float], measured: Sequence[float], others: Sequence[float]) -> None:
        """Send one sample; :meth:`answer` waits for the answer."""
        try:
            self._link.send(self._frames.sample.pack(sample, *current, *measured, *others))
        except LinkClosed:
            pass  # answer() reports it

    def answer(self) -> Answer | None:
        """Return the answer to the sample that was sent, None when it was discarded.

        ControllerFailed when there is none, RunEnds when that is because the run ends.
        """
        try:
            data = self._receive(self._timeout)
        except LinkClosed:
            if why := self._cause():
                raise RunEnds(why, Status.FATAL) from None
            raise ControllerFailed("the shift controller's process has ended", Status.FATAL) from None
        if data is None and self._stopping():
            raise RunEnds(self._cause() or "the run was ended while the shift controller was waited for", Status.FATAL)
        if data is None:
            raise ControllerFailed(
                f"the shift controller took more than {self._limit:g} s for one sample (--step-timeout)", Status.FATAL
            )
        _, kind, *numbers = self._frames.answer.unpack_from(data)
        if kind == ANSWERED:
            *values, self.gear, shifting, self.flags = numbers
            self.shifting = bool(shifting)
            return Answer(tuple(values[: self._frames.outputs]), tuple(values[self._frames.outputs :]))
        text = data[self._frames.answer.size :].decode()
        if kind == DISCARDED:
            self.trouble = text
            return None
        raise ControllerFailed(text, Status.ERROR)


class Lockstep:
    """Sets the pace and the order of the samples; ``speed`` is simulated per real time, ``inf`` for as fast as possible."""

    def __init__(
        self,
        outputs: Outputs,
        commands: Commands,
        links: dict[str, Link],
        speed: float,
        step_timeout: float | None,
        stopping: Callable[[], bool],
        cause: Callable[[], str],
    ) -> None:
        self._cause, self._stopping = cause, stopping
        rig = outputs.rig
        self.rig, self.outputs, self.commands = rig, outputs, commands
        self.speed, self.overruns, self.real_time_priority = speed, 0, False
        self.controller = None
        if rig.shifts:
            self.controller = RemoteController(links["alfa46"], record_of(rig.config), step_timeout, stopping, cause)
        self._sequencer = links["sequencer"]
        self._done = False
        self._needed: list[str] = []
        # when the sequencer is to be asked: sample, condition that may be met before, rig status that it has received
        self._next, self._watch, self._published_status = 0, {}, rig.status
        self._reported: tuple | None = None  # status and reason
        self._took = 0.0

    def run(self, publish: Callable[[], None], stop: Callable[[], bool]) -> None:
        """Run until ``stop()`` is true at the start of a tick."""
        rig = self.rig
        take_core(0)
        if self.controller is None or self.controller.wait():
            self._needed = (self._hear_sequencer(BEFORE_FIRST) or {"need": []})["need"]
        else:  # no step of the sequence will be done
            self._done = True
        gc.collect()
        gc.freeze()  # objects made at the start need not be scanned again and again
        began = time.monotonic()
        while True:
            if rig.sample % TICK_SAMPLES == 0:
                if stop():
                    break
                self._pace(began)
                try:
                    if rig.sample > 0 and not self._done and self._sequencer_due():
                        self._ask_sequencer()
                except LinkClosed:
                    if not self._cause():
                        raise
                    rig.trip(self._cause(), PROCESS_LOST)
                    self._done = True
                if rig.safe:
                    time.sleep(TICK_SAMPLES * SAMPLE_NS * 1e-9)  # nothing to hurry for
            if self._done and not rig.safe:
                # `simulate` ends here too; the supervisor ends the process
                publish()
                while not stop():
                    time.sleep(0.01)
                break
            self.commands.apply()
            self._report_to_controller()
            if self.controller is None or rig.safe:
                publish()
                rig.advance_samples(1)
            else:
                self._sample(self.controller, publish)
        self._took = time.monotonic() - began

    def _report_to_controller(self) -> None:
        now = (self.rig.status, self.rig.reason)
        if self.controller is not None and now != self._reported:
            self._reported = now
            self.controller.send_status(*now)

    def _sample(self, controller: RemoteController, publish: Callable[[], None]) -> None:
        """Do one sample: the controller works on it while the messages are sent and the plant moves on."""
        rig = self.rig
        sample = rig.sample
        controller.ask(sample, *rig.handed(controller.wants))
        publish()
        if rig.delay > 0:
            rig.advance_samples(1)
        try:
            answer = controller.answer()
            if answer is None:
                rig.explain_silence(controller.trouble)
        except RunEnds as end:
            rig.trip(str(end), PROCESS_LOST if self._cause() else ENDED_EARLY)
            answer = None
        except ControllerFailed as failure:
            rig.trip(str(failure), BAD_CONTROLLER)
            answer = None
        if answer is not None:
            give_answer(rig, controller, sample, answer)
            if rig.idle_command:
                self.commands.refuse(CONTROLLER_COMMAND, f"valve command for sample {sample} does not act: {rig.idle_command}")
        if rig.delay == 0:
            rig.advance_samples(1)

    def _pace(self, began: float) -> None:
        if math.isfinite(self.speed):
            ahead = began + self.rig.time / self.speed - time.monotonic()
            if ahead > 0:
                time.sleep(ahead)

    def _sequencer_due(self) -> bool:
        """Return whether the sequencer is to be asked: for a time, a condition, a change of the rig or a received order."""
        rig, watch = self.rig, self._watch
        if rig.sample >= self._next or rig.status != self._published_status:
            return True
        if "gear" in watch and not rig.shifting and rig.gear == watch["gear"]:
            return True
        if "signal" in watch and (watch["low"] <= self.outputs.reading(watch["signal"]) <= watch["high"]) == watch["met"]:
            return True
        return self._sequencer.receive_json(NOT_AT_ALL) is not None

    def _hear_sequencer(self, seconds: float) -> dict | None:
        """Return the sequencer's next answer, None when the run is to end; its earlier requests to be asked are dropped."""
        until = time.monotonic() + seconds
        while not self._stopping():
            answer = self._sequencer.receive_json(LOOK_UP)
            if answer is not None and "wake" not in answer:
                return answer
            if time.monotonic() > until:
                raise LinkClosed(f"the sequencer took more than {seconds:g} s for one tick")
        return None

    def _ask_sequencer(self) -> None:
        """Do one tick of the sequence; wait for what it has sent over DDS, so that it acts in this same tick."""
        rig = self.rig
        self._published_status = rig.status
        self._sequencer.send_json(
            {
                "sample": rig.sample,
                "status": int(rig.status),
                "reason": rig.reason,
                "gear": rig.gear,
                "shifting": rig.shifting,
                "readings": {name: self.outputs.reading(name) for name in self._needed},
            }
        )
        reply = self._hear_sequencer(PATIENCE)
        if reply is None:
            return
        self._done, self._needed = reply["done"], reply["need"]
        self._next, self._watch = reply["next"], reply["watch"]
        deadline = time.monotonic() + PATIENCE
        while not self.commands.have(reply["sent"]) and not self._stopping():
            if time.monotonic() > deadline:
                raise LinkClosed("a setpoint of the sequencer did not arrive")
            time.sleep(2e-5)

    def summary(self) -> dict:
        """Return the same facts as the real-time clock, with the speed that was reached."""
        factor = self.rig.sample * SAMPLE_NS * 1e-9 / self._took if self._took else None
        return {"ticks": self.rig.sample // TICK_SAMPLES, "overruns": 0, "lateness_ms": None, "speed_factor": factor}
