# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig container's side of a run in lockstep: nobody goes on before everybody has done the sample.

Used by the rig container in place of its real-time clock. The order of each sample is that of ``simulate``: sequencer
(every tick), messages, controller, plant; so the plant's topics come out the same bit for bit at any speed.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ..clocks import SAMPLE_NS, TICK_SAMPLES
from ..controllers.plug import Answer
from ..controllers.record import ControllerRecord, record_of
from ..controllers.seam import ControllerFailed, Status
from ..graph.link import ANSWERED, DISCARDED, NOT_AT_ALL, PATIENCE, READY, STATUS, Frames, Link, LinkClosed
from ..testbench.rig import Rig
from ..testbench.rig_base import RigStatus
from ..testbench.simulate import give_answer
from ..testbench.topics import COMMAND
from .realtime import take_core

if TYPE_CHECKING:
    from ..testbench.outputs import Outputs
    from .commands import Commands

GRACE = 0.5  # s more for the sentence of whoever waits for a controller further away
BEFORE_FIRST = 60.0  # s for the sequencer to be ready
LOOK_UP = 0.1  # s of waiting for the controller after which an order to end is looked for


class RemoteController:
    """The controller of the alfa46 process, as a plug of this one: asked through its link."""

    name = "alfa46"

    def __init__(self, link: Link, record: ControllerRecord, step_timeout: float | None, stopping: Callable[[], bool]) -> None:
        """step_timeout: s for one sample; the process that knows its controller better may say so first.

        ``stopping``: true when the run is to end, and with it any wait.
        """
        self.level, self.wants = "", []  # as the process says when it is ready
        self.gear, self.shifting, self.flags = 0, False, 0
        self._link, self._record, self._limit, self._stopping = link, record, step_timeout, stopping
        self._timeout = None if step_timeout is None else step_timeout + GRACE

    def wait(self) -> bool:
        """Wait for the process to be ready, which itself knows how long; False when the run is to end first.

        LinkClosed when it has ended.
        """
        hello = self._receive(None)
        if hello is None:
            return False
        self.level, *self.wants = hello.removeprefix(READY).decode().split()
        self._frames = Frames(len(self._record.outputs), len(self._record.transducers), len(self.wants))
        return True

    def _receive(self, seconds: float | None) -> bytes | None:
        """The next message; None when there is none within so many s, or before the run is to end."""
        until = math.inf if seconds is None else time.monotonic() + seconds
        while True:
            data = self._link.receive(LOOK_UP)
            if data is not None or self._stopping() or time.monotonic() >= until:
                return data

    def tell(self, status: RigStatus, reason: str) -> None:
        """Say what the rig does: a trip takes every order back."""
        try:
            self._link.send(STATUS + bytes([status]) + reason.encode())
        except LinkClosed:
            pass  # answer() will say so

    def ask(self, sample: int, current: Sequence[float], measured: Sequence[float], others: Sequence[float]) -> None:
        """Hand over one sample; the answer is waited for by :meth:`answer`."""
        try:
            self._link.send(self._frames.sample.pack(sample, *current, *measured, *others))
        except LinkClosed:
            pass  # answer() will say so

    def answer(self) -> Answer | None:
        """The answer to the sample asked for, None when it was discarded; ControllerFailed when there is none."""
        try:
            data = self._receive(self._timeout)
        except LinkClosed:
            raise ControllerFailed("the shift controller's process has ended", Status.FATAL) from None
        if data is None and self._stopping():
            raise ControllerFailed("the run was ended while the shift controller was waited for", Status.FATAL)
        if data is None:
            raise ControllerFailed(
                f"the shift controller took more than {self._limit:g} s for one sample (--step-timeout)", Status.FATAL
            )
        _, kind, *numbers = self._frames.answer.unpack_from(data)
        if kind == ANSWERED:
            *values, self.gear, shifting, self.flags = numbers
            self.shifting = bool(shifting)
            return Answer(tuple(values[: self._frames.outputs]), tuple(values[self._frames.outputs :]))
        if kind == DISCARDED:
            return None
        raise ControllerFailed(data[self._frames.answer.size :].decode(), Status.ERROR)


class Lockstep:
    """Paces and orders the samples. speed: simulated per real time, ``inf`` for as fast as it goes."""

    def __init__(
        self,
        rig: Rig,
        outputs: Outputs,
        commands: Commands,
        links: dict[str, Link],
        speed: float,
        step_timeout: float | None,
        stopping: Callable[[], bool],
    ) -> None:
        self.rig, self.outputs, self.commands = rig, outputs, commands
        self.speed, self.overruns, self.real_time_priority = speed, 0, False
        self.controller = RemoteController(links["alfa46"], record_of(rig.config), step_timeout, stopping)
        self._sequencer = links["sequencer"]
        self._done = False
        self._needed: list[str] = []
        # when the sequencer wants to be asked: sample, what may come true before; status of the rig that it knows
        self._next, self._watch, self._told = 0, {}, rig.status
        self._controller_knows: tuple | None = None  # status and reason
        self._took = 0.0

    def run(self, publish: Callable[[], None], stop: Callable[[], bool]) -> None:
        """Until ``stop()`` is true at the start of a tick."""
        rig = self.rig
        take_core(0)
        if self.controller.wait():
            self._needed = self._hear_sequencer(BEFORE_FIRST)["need"]
        else:  # nothing of the sequence will be done
            self._done = True
        gc.collect()
        gc.freeze()  # what start-up made need not be looked through again and again
        began = time.monotonic()
        while True:
            if rig.sample % TICK_SAMPLES == 0:
                if stop():
                    break
                self._pace(began)
                if rig.sample > 0 and not self._done and self._sequencer_due():
                    self._ask_sequencer()
                if rig.status == RigStatus.TRIPPED:
                    time.sleep(TICK_SAMPLES * SAMPLE_NS * 1e-9)  # nothing to hurry for
            if self._done and rig.status != RigStatus.TRIPPED:
                # as far as `simulate` goes; the supervisor ends the process
                publish()
                while not stop():
                    time.sleep(0.01)
                break
            self.commands.apply()
            self._tell_controller()
            if rig.status == RigStatus.TRIPPED:
                publish()
                rig.advance_samples(1)
            else:
                self._sample(publish)
        self._took = time.monotonic() - began

    def _tell_controller(self) -> None:
        now = (self.rig.status, self.rig.reason)
        if now != self._controller_knows:
            self._controller_knows = now
            self.controller.tell(*now)

    def _sample(self, publish: Callable[[], None]) -> None:
        """One sample: the controller works on it while the messages go out and the plant moves on."""
        rig = self.rig
        sample = rig.sample
        self.controller.ask(sample, *rig.seen(), [rig.measurement(name) for name in self.controller.wants])
        publish()
        if rig.delay > 0:
            rig.advance_samples(1)
        try:
            answer = self.controller.answer()
        except ControllerFailed as failure:
            rig.trip(str(failure))
            answer = None
        if answer is not None:
            give_answer(rig, self.controller, sample, answer)
            if rig.idle_command:
                self.commands.refuse(COMMAND, f"valve command for sample {sample} does not act: {rig.idle_command}")
        if rig.delay == 0:
            rig.advance_samples(1)

    def _pace(self, began: float) -> None:
        if math.isfinite(self.speed):
            ahead = began + self.rig.time / self.speed - time.monotonic()
            if ahead > 0:
                time.sleep(ahead)

    def _sequencer_due(self) -> bool:
        """True when the sequencer wants to be asked: for a time, a condition, a change of the rig or an order to it."""
        rig, watch = self.rig, self._watch
        if rig.sample >= self._next or rig.status != self._told:
            return True
        if "gear" in watch and not rig.shifting and rig.gear == watch["gear"]:
            return True
        if "signal" in watch and (watch["low"] <= self.outputs.reading(watch["signal"]) <= watch["high"]) == watch["met"]:
            return True
        return self._sequencer.receive_json(NOT_AT_ALL) is not None

    def _hear_sequencer(self, seconds: float) -> dict:
        """Its next answer; calls to wake up are over with that."""
        answer = self._sequencer.receive_json(seconds)
        while answer is not None and "wake" in answer:
            answer = self._sequencer.receive_json(seconds)
        if answer is None:
            raise LinkClosed(f"the sequencer took more than {seconds:g} s for one tick")
        return answer

    def _ask_sequencer(self) -> None:
        """One tick of the sequence; what it has sent over DDS is waited for, so that it acts in this very tick."""
        rig = self.rig
        self._told = rig.status
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
        self._done, self._needed = reply["done"], reply["need"]
        self._next, self._watch = reply["next"], reply["watch"]
        deadline = time.monotonic() + PATIENCE
        while not self.commands.have(reply["sent"]):
            if time.monotonic() > deadline:
                raise LinkClosed("a setpoint of the sequencer did not arrive")
            time.sleep(2e-5)

    def summary(self) -> dict:
        """As the real-time clock's, with the factor reached."""
        factor = self.rig.sample * SAMPLE_NS * 1e-9 / self._took if self._took else None
        return {"ticks": self.rig.sample // TICK_SAMPLES, "overruns": 0, "lateness_ms": None, "speed_factor": factor}
