# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The host of a user's Python class, and the frames that it exchanges with its plug (python_class.py).

guard.py loads it in the class's own process. Everything that user code returns is checked here; what the rig receives is numbers
and texts of limited length.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Sequence
from typing import NamedTuple

from ...base import RigError
from ..seam import ControllerInfo, ControllerInputs, Status, Taken, error_text, inputs_type, shortened, taken
from .user_class import Broken, UserClass

FRAME = 1 << 20  # longest message
FAULT = len(Status)  # in place of a status: the answer is not permitted, or the class has raised
DONE = b"done "  # as in hosted.py
END_OF_THREADS = 0.5  # s of wall clock for the class's threads after terminate
NO_TERMINAL = "; it has no terminal: a debugger works with --in-process, also --step-timeout none"


class Answer(NamedTuple):
    """What came back for a sample; ``status`` is a Status or FAULT, ``numbers`` commands, setpoints and own signals."""

    status: int
    gear: int
    shifting: int
    flags: int
    numbers: Sequence[float]
    text: str
    trace: str


class Frames:
    """The messages of a sample and of its answer.

    Parameters
    ----------
    outputs, transducers, wants, signals, settings : int
        How many there are of each.
    """

    def __init__(self, outputs: int, transducers: int, wants: int, signals: int, settings: int) -> None:
        self.ends = outputs, outputs + transducers, outputs + transducers + wants  # where the groups of a sample end
        self.sample = struct.Struct(f"=QdI{self.ends[-1] + settings}d")  # sample, time, gear_request
        self.answer = struct.Struct(f"=QIIII{2 * outputs + signals}d")  # sample, status, gear, shifting, flags
        self._nothing = (0.0,) * (2 * outputs + signals)

    def sample_of(self, given: ControllerInputs) -> bytes:
        """Return the message of a sample."""
        return self.sample.pack(
            given.sample,
            given.time,
            given.gear_request,
            *given.current,
            *given.measured,
            *given.others.values(),
            *given.settings.values(),
        )

    def fault(self, sample: int, status: int, text: str, trace: str = "") -> bytes:
        """Return the message of an answer without numbers."""
        return self.answer.pack(sample, status, 0, 0, 0, *self._nothing) + f"{text}\0{trace}".encode("utf-8", "replace")

    def answer_in(self, data: bytes, sample: int) -> Answer | None:
        """Return what a message says about a sample; None when it is no answer to it."""
        if len(data) < self.answer.size:
            return None
        found, status, gear, shifting, flags, *numbers = self.answer.unpack_from(data)
        if found != sample or status > FAULT or (len(data) > self.answer.size) != (status != Status.OK):
            return None
        text, _, trace = data[self.answer.size :].decode("utf-8", "replace").partition("\0")
        return Answer(status, gear, shifting, flags, numbers, text, trace)


def serve(line: socket.socket) -> None:
    """Do everything from the class's loading to its end; OSError when the line to the rig is lost."""
    getpid, leave = os.getpid, os._exit  # the class cannot replace these
    this = getpid()

    def tell(message: dict | bytes) -> None:
        if getpid() != this:
            leave(0)  # a copy that the class has forked; the class itself answers
        line.send(message if isinstance(message, bytes) else json.dumps(message).encode())

    order = _heard(line)
    sys.path[:] = order["path"]
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(line_buffering=True, errors="backslashreplace")
    name = order["name"]
    try:
        user = UserClass(order["rest"], name, order["transducers"])
        own = {"levels": user.levels, "declared": user.declared, "wants": user.wants}
        tell({**own, "signals": user.signals, "settings": user.settings, "process": this})
        begin = _heard(line)
        given = begin["info"]
        info = ControllerInfo(
            **{**given, "outputs": tuple(given["outputs"]), "gears": {int(k): v for k, v in given["gears"].items()}}
        )
        try:
            user.initialize(info)
        except Broken as broken:
            tell({"error": f"controller {name}: {broken}"})
            return
    except RigError as error:
        tell({"error": shortened(str(error))})
        return
    tell({})
    frames = Frames(len(info.outputs), len(info.transducers), *map(len, (user.wants, user.signals, user.settings)))
    inputs, size = inputs_type(begin["readings"]), frames.sample.size
    wants, settings, (currents, measured, others) = user.wants, tuple(user.settings), frames.ends
    buffer = bytearray(FRAME)
    while (count := line.recv_into(buffer)) == size:
        sample, moment, request, *values = frames.sample.unpack_from(buffer)
        given = inputs(
            sample,
            moment,
            request,
            tuple(values[:currents]),
            tuple(values[currents:measured]),
            dict(zip(wants, values[measured:others])),
            dict(zip(settings, values[others:])),
        )
        tell(_answer(frames, sample, user, given, info))
    if not count:
        raise OSError("the line to the rig is closed")
    said = ""
    try:
        user.terminate()
    except Broken as broken:
        said = f"{broken}\0{broken.trace}"
    threads = _left_over()
    tell(DONE + (said or threads).encode("utf-8", "replace"))
    if threads:
        os._exit(0)  # the interpreter would wait for them


def _heard(line: socket.socket) -> dict:
    data = line.recv(FRAME)
    if not data:
        raise OSError("the line to the rig is closed")
    return json.loads(data)


def _answer(frames: Frames, sample: int, user: UserClass, given: ControllerInputs, info: ControllerInfo) -> bytes:
    """Return the message of the answer to a sample."""
    try:
        got: Taken = taken(user.step(given), info, user.signals)
    except Broken as broken:
        hint = NO_TERMINAL if "BdbQuit" in str(broken) or "EOFError: EOF when reading" in str(broken) else ""
        return frames.fault(sample, FAULT, f"{broken}{hint}", broken.trace)
    except RigError as error:
        return frames.fault(sample, FAULT, shortened(str(error)))
    except BaseException as error:
        broken = Broken(f"its outputs cannot be read: {error_text(error)}", error)
        return frames.fault(sample, FAULT, str(broken), broken.trace)
    if got.status != Status.OK:
        return frames.fault(sample, got.status, got.text)
    return frames.answer.pack(sample, 0, got.gear, got.shifting, got.flags, *got.command, *got.setpoint, *got.own)


def _left_over() -> str:
    """Return a sentence on threads of the class for which the interpreter would wait at its end; empty when there is none."""
    until = time.monotonic() + END_OF_THREADS
    others = [one for one in threading.enumerate() if one is not threading.current_thread() and not one.daemon]
    for one in others:
        one.join(max(0.0, until - time.monotonic()))
    names = ", ".join(repr(one.name) for one in others if one.is_alive())
    return shortened(f"after terminate threads of the controller still run: {names}") if names else ""
