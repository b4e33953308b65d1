# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller at the other end of a UDP port: each sample is a frame out and a frame back (docs/how_to/udp.md).

load.py makes it. The rig opens the port, on loopback unless another address is given; the controller sends HELLO. Either
may start first.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
import sys
import time
from typing import TYPE_CHECKING

from ...base import RigError
from ..own_signals import MOST, checked_settings, checked_signals, once_each
from ..plug import RECEIVED, Plug, Waiting, chosen_level
from ..seam import LEVELS, ControllerFailed, ControllerInputs, ControllerOutputs, Status, checked_wants
from .frames import (
    ANSWER,
    ASK,
    BYE,
    HELLO,
    INFO,
    LONGEST,
    NAME,
    OWN,
    READY,
    SAMPLE,
    SETTING,
    SIGNAL,
    WANT,
    NoFrame,
    OtherVersion,
    pack,
    text,
    unpack,
)
from .frames import LEVELS as LEVEL_BITS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ...rig import RigConfig

LOOPBACK = "127.0.0.1"
RESEND = 0.02  # s of wall clock without an answer after which a sample is sent again
AT_ONCE = 100  # frames that one look at the port takes at most, so that a flood does not keep the rig from going on
GLANCE = 0.0005  # s of wall clock for an answer in real time while the controller is away
IP_RECVERR = 11  # of Linux: reports that no program listens at the other end, or that it cannot be reached


class Udp(Plug):
    """The plug udp:PORT, or udp:ADDRESS:PORT to listen at another interface than loopback."""

    named_later, level_from = True, RECEIVED

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        address, _, port = rest.rpartition(":")
        name = f"udp:{rest}"
        if not (port.isdecimal() and 0 < int(port) < 65536):
            raise RigError(f"controller {name}: expected udp:PORT or udp:ADDRESS:PORT with a port from 1 to 65535")
        super().__init__(name, config, chosen_level(level, LEVELS, name))
        self._port = int(port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((address or LOOPBACK, self._port))
        except OSError as error:
            self._socket.close()
            raise RigError(
                f"controller {name}: the port cannot be taken ({error.strerror}); is another rig running, "
                "or is the address none of this machine?"
            ) from None
        self._socket.setsockopt(socket.IPPROTO_IP, IP_RECVERR, 1)
        info = self.info
        self._name_lists = (  # value, name, unit; the rig's lists in the order of frames.py
            [(value, key, "") for key, value in info.parameters.items()],
            [(0.0, key, "") for key in info.outputs],
            [(0.0, key, unit) for key, unit in info.transducers.items()],
            [(float(number), key, "") for number, key in info.gears.items()],
        )
        self._session = int.from_bytes(os.urandom(4), "little") or 1
        self._peer = None  # address of the controller, once it is ready
        self._coming, self._names, self._count = None, {}, 0  # controller getting ready; its own names, and their number
        self._refused: dict = {}  # by address of a controller: why its names cannot be used
        self._declared = False  # a controller of this run has named its wants, signals and settings
        self._frame = 0
        self._was_here = False
        self._away = True  # the newest sample was not answered
        self._waiting: Waiting | None = None  # in real time: the wait since then

    # ---- until the controller is ready

    def wait(self, patience: float | None = None) -> None:
        """Wait, as in every plug, until a controller is ready."""
        waiting = Waiting(f"waiting for controller on udp {self._port}", self.say)
        self.refused = ""
        while self._peer is None and not self.stopped():
            in_vain = self._in_vain(waiting, patience, "none has come", f"; {self._advice}")
            if in_vain:
                raise in_vain
            waiting.report()
            self._serve(0.2)

    @property
    def _advice(self) -> str:
        return f"start it, or see that it sends to port {self._port} of this machine"

    def awaited(self) -> str:
        """Return the sentence of every plug that no controller has come."""
        return "" if self._was_here else self.not_here(f"udp {self._port}", self._advice)

    def _serve(self, seconds: float) -> tuple | None:
        """Handle the frames that come within so many seconds; return the values of an ANSWER to the newest sample when it comes."""
        until = time.monotonic() + seconds
        late = 0  # frames taken after that time
        while True:
            left = max(0.0, until - time.monotonic())
            late += left == 0.0
            if late > AT_ONCE or not select.select([self._socket], [], [], left)[0]:
                return None
            try:
                data, peer = self._socket.recvfrom(LONGEST)
            except OSError:  # a notice of a frame that was sent before
                self._see_who_has_gone()
                continue
            try:
                kind, session, frame, values = unpack(data)
            except OtherVersion as error:
                self._send_away(peer, str(error))
                continue
            except NoFrame as error:
                self.ignored.add(f"what came is no frame: {error}")
                continue
            if kind == HELLO:
                self._greet(session, peer, values[0], text(values[2]))
            elif session != self._session:
                self._send(BYE, peer, session=session, values=["another run; send HELLO"])
            elif kind == ASK and values[1] < len(self._name_lists) and values[0] < len(self._name_lists[values[1]]):
                self._send(NAME, peer, values=[values[0], values[1], *self._name_lists[values[1]][values[0]]])
            elif kind == READY and peer != self._peer and self._away:
                self._coming, self._count = peer, values[0]
                self._names = {}
                if self._is_here():
                    return None
            elif kind == OWN and peer == self._coming:
                what, first, name, unit = values[1:]
                self._names[values[0]] = what, text(name), first, text(unit)
                if self._is_here():
                    return None
            elif kind == BYE:
                why = text(values[0]) or "it gave no reason"
                if peer == self._peer:
                    raise _Gone(f"it has left: {why}")
                self._turned_down(peer, why)
            elif kind == ANSWER and peer != self._peer:
                self.ignored.add("an answer came from a program that is not the controller of this run")
            elif kind == ANSWER and frame == self._frame:
                return values
            elif kind not in (READY, OWN, ANSWER):  # these may come again
                self.ignored.add("a frame came that the rig does not expect")

    def _greet(self, session: int, peer: tuple[str, int], levels: int, record: str) -> None:
        if session == self._session and peer == self._peer:
            return  # the controller only checks that the rig is still there
        why = self._refused.get(peer, "")
        if not levels & LEVEL_BITS[self.level]:
            known = " and ".join(name for name, bit in LEVEL_BITS.items() if levels & bit) or "none"
            why = f"this run is at level {self.level}, the controller's is {known}; choose with --level"
        elif record not in ("", self.rig_record.id):
            why = f"it was {self.rig_record.made_for_another(record)}, and compile it again"
        elif self._peer not in (None, peer) and not self._away:
            why = "another controller is at work"
        if why:
            self._send_away(peer, why)
            return
        high, level = self.info.command_high, LEVEL_BITS[self.level]
        self._send(INFO, peer, values=[level, 0, *map(len, self._name_lists), self.info.period, high, self.rig_record.id])

    def _send_away(self, peer: tuple[str, int], why: str) -> None:
        self._send(BYE, peer, session=0, values=[why])
        self.refused = why
        sentence = f"a controller was sent away from udp {self._port}: {why}"
        self.ignored.add(sentence, sentence)

    def _turned_down(self, peer: tuple[str, int], why: str) -> None:
        """Note that a controller that was getting ready has refused."""
        self.refused = f"it refuses: {why}"
        if self._coming == peer:
            self._coming = None
        sentence = f"a controller on udp {self._port} is not used: {self.refused}"
        self.ignored.add(sentence, sentence)

    def _is_here(self) -> bool:
        """Request the controller's next own name; True when all have come and the controller is ready."""
        peer = self._coming
        missing = next((k for k in range(self._count) if k not in self._names), None)
        if missing is not None and self._count <= 3 * MOST:
            self._send(ASK, peer, values=[missing, 0])
            return False
        self._coming = None
        try:
            self._take_names()
        except RigError as error:
            self._refused[peer] = str(error)
            self._send(BYE, peer, values=[str(error)])  # with this session's number, for the controller has begun already
            self._send_away(peer, str(error))
            return False
        self._peer, self._was_here, self.refused = peer, True, ""
        self.say(f"controller on udp {self._port} is here ({peer[0]}:{peer[1]})")
        return True

    def _take_names(self) -> None:
        """Take transducers, signals and settings as the controller names them; RigError when they cannot be used."""
        if self._count > 3 * MOST:
            raise RigError(f"it has {self._count} names of its own, expected up to {MOST} of each kind")
        names = [self._names[k] for k in range(self._count)]
        wants = checked_wants([name for what, name, _, _ in names if what == WANT], self.name, self.rig_record.all_transducers)
        units = once_each(((name, unit) for what, name, _, unit in names if what == SIGNAL), "signals", self.name)
        values = once_each(((name, value) for what, name, value, _ in names if what == SETTING), "settings", self.name)
        signals, settings = checked_signals(units, self.name), checked_settings(values, self.name)
        now, before = (
            (tuple(w), tuple(s.items()), tuple(t))
            for w, s, t in ((wants, signals, settings), (self.wants, self.signals, self.settings))
        )
        if self._declared and now != before:
            raise RigError("it names other transducers, signals or settings than the controller before it in this run")
        if not self._declared:  # a later controller of the run does not reset settings that were changed
            self.wants, self.signals, self.settings, self._declared = wants, signals, settings, True
            self.named()

    def _send(self, kind: int, peer: tuple[str, int], session: int | None = None, values: Iterable[float | str] = ()) -> None:
        self._put(pack(kind, self._session if session is None else session, 0, *values), peer)

    def _put(self, data: bytes, peer: tuple[str, int]) -> None:
        """Send the bytes of a frame; _Gone when they cannot be sent to the controller. Other programs come again."""
        why = ""
        for _ in range(2):
            try:
                self._socket.sendto(data, peer)
                return
            except OSError as error:  # the first one may be a notice of a frame that was sent before
                self._see_who_has_gone()
                why = error.strerror
        if peer == self._peer:
            raise _Gone(f"no frame can be sent to it ({why})")
        self.ignored.add(f"a program has sent a frame and cannot be sent one ({why})")

    def _see_who_has_gone(self) -> None:
        """Read the system's notices of addresses that cannot be reached; _Gone when the controller's is among them."""
        gone: dict[tuple[str, int], int] = {}
        while True:
            try:
                _, about, _, peer = self._socket.recvmsg(1, 512, socket.MSG_ERRQUEUE | socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            number = next(
                (int.from_bytes(data[:4], sys.byteorder) for _, kind, data in about if kind == IP_RECVERR), errno.ECONNREFUSED
            )
            if number != errno.EMSGSIZE:  # the way takes smaller packets only; the frame is sent again in such ones
                gone[peer] = number
        if self._peer in gone:
            number = gone[self._peer]
            refused = number == errno.ECONNREFUSED
            raise _Gone(
                "no program listens at its port any more" if refused else f"it cannot be reached any more ({os.strerror(number)})"
            )

    # ---- samples

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        try:
            self._serve(0.0)  # frames that came since: the controller leaves, or is ready
            self._frame += 1
            values = self._exchange(inputs)
        except _Gone as gone:
            self._leave()
            raise ControllerFailed(f"controller {self.name}, sample {inputs.sample}: {gone}", Status.FATAL) from None
        if values is None:
            late = self._peer is not None
            why = "it has not answered in time" if late else self.not_here(f"udp {self._port}", self._advice)
            return ControllerOutputs(status=Status.DISCARD, message=why)
        status, gear, shifting, flags, message, *numbers = values
        count = len(self.info.outputs)
        expected = 2 * count + len(self.signals)
        if status == Status.OK and len(numbers) != expected:
            self._fail(
                Status.ERROR,
                inputs.sample,
                f"its answer has {len(numbers)} numbers, expected {expected}: command and setpoint of {count} outputs"
                + (f", {len(self.signals)} signals" if self.signals else ""),
            )
        return self._outputs_in(numbers, gear, shifting, flags, status, text(message))

    def _exchange(self, inputs: ControllerInputs) -> tuple | None:
        """Return the values of the answer; None in real time while there is none."""
        began, patience, waiting = time.monotonic(), self.step_timeout, None
        if self.real_time and self._away:
            patience = GLANCE
        while True:
            if self._peer is not None:
                if len(inputs.others) != len(self.wants):
                    return None  # the sample was made before the controller named the transducers that it wants
                self._put(self._sample(inputs), self._peer)
            left = None if patience is None else began + patience - time.monotonic()
            if left is not None and left <= 0.0:
                return self._no_answer(inputs.sample)
            if self.stopped():
                raise _Gone("the run was ended")
            values = self._serve(RESEND if left is None else min(RESEND, left))
            if values is not None:
                self._away, self._waiting = False, None
                return values
            if not self.real_time:
                waiting = waiting or Waiting(f"waiting for controller on udp {self._port}", self.say)
                waiting.report()

    def _sample(self, inputs: ControllerInputs) -> bytes:
        return pack(
            SAMPLE,
            self._session,
            self._frame,
            inputs.sample,
            inputs.time,
            inputs.gear_request,
            0,
            more=[*inputs.current, *inputs.measured, *inputs.others.values(), *self.settings.values()],
        )

    def _no_answer(self, sample: int) -> None:
        if self.real_time:
            if not self._away:
                self.say(f"waiting for controller on udp {self._port}: no answer for {self.step_timeout * 1e3:.0f} ms")
            self._away = True
            self._waiting = self._waiting or Waiting(f"waiting for controller on udp {self._port}", self.say)
            self._waiting.report()
            return
        self._away = True
        if self._was_here:
            raise _Gone(f"no answer for {self.step_timeout:g} s (--step-timeout)")
        raise _Gone(f"none has come within {self.step_timeout:g} s")

    def _leave(self) -> None:
        """Forget the controller, which has gone; another one may come and begins with a session of its own."""
        self._peer, self._away = None, True
        self._session = (self._session % 0xFFFFFFFF) + 1

    def _end(self) -> None:
        with contextlib.suppress(_Gone):
            if self._peer is not None:
                self._send(BYE, self._peer, values=["the run is over"])
        self._socket.close()

    def _abandon(self) -> None:
        self._end()


class _Gone(Exception):
    """The controller has gone; the message has the reason."""
