# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A controller in a process of its own, as its plug sees it: start, messages, prints, and how it ended.

The plugs of C libraries, Python classes and FMUs are made of it. guard.py is the program that is started; it loads the plug's host.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, NamedTuple

from ..base import Link, LinkClosed, RigError, pair, printable
from .guard import END_ALL, LINE_LOST
from .plug import Plug
from .seam import Status, shortened

GUARD = Path(__file__).parent / "guard.py"
CORE = ct.CDLL(None).sched_getcpu
LOAD_TIMEOUT = 30.0  # s of wall clock for loading, and for initialize or create
END_PATIENCE = 2.0  # s of wall clock for each call at the end, and for the end of the process
MOST_PRINTED = 1 << 20  # bytes of a controller's prints that are shown
LINE = 4096  # bytes of a printed line that are shown in one piece
# messages beside the frames of each plug
END = b"end"  # from the rig, in place of a sample: end the controller
DONE = (
    b"done "  # from the host, for each call that has returned at the end; what went wrong in it follows, and behind a 0 a traceback
)
SAID = b"said "  # from the host, in place of an answer: why it cannot go on


class Hosting(NamedTuple):
    """How a kind of controllers runs in a process of its own.

    Parameters
    ----------
    subject : str
        What the user gave, for sentences: "the library".
    folder, module : str
        Where the host's module is imported from, and its name.
    process : str
        Name of the process, for pgrep.
    last_calls : tuple of str
        The calls at the end, each of which the host reports with DONE.
    options : tuple of str
        Options of the Python interpreter.
    """

    subject: str
    folder: str
    module: str
    process: str
    last_calls: tuple[str, ...]
    options: tuple[str, ...] = ("-P",)


class Host:
    """The processes in which a controller runs, and the connection to them.

    Parameters
    ----------
    kind : Hosting
        What runs there.
    name : str
        The controller's name.
    arguments : list of str
        What the host's ``serve`` receives behind the line.
    descriptors : tuple of int
        Further descriptors that the host inherits.
    put_aside : str
        A folder that is removed when the controller's process has ended in any way; empty for none.
    """

    def __init__(
        self, kind: Hosting, name: str, arguments: list[str], descriptors: tuple[int, ...] = (), put_aside: str = ""
    ) -> None:
        self._kind, self._name = kind, name
        ours, theirs = pair()
        line = theirs.fileno()
        with theirs:
            program = [sys.executable, *kind.options, GUARD, kind.folder, kind.module, kind.process, line, os.getpid(), put_aside]
            self._guard = subprocess.Popen(
                list(map(str, (*program, *arguments))),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=[line, *descriptors],
            )
        self._printed = threading.Thread(target=_show, args=(self._guard.stdout, name), daemon=True)
        self._printed.start()
        self.remark: Callable[[], str] = lambda: ""  # what else is known of a controller that fell silent, the end of a sentence
        self.trace = ""  # traceback of a fault in the last call
        self.process = 0  # number of the controller's own process, once it is known
        self._line = Link(ours.detach(), name)
        self.send, self._receive = self._line.send, self._line.receive
        self._core = -1

    def ask(self, data: bytes, seconds: float | None) -> bytes | None:
        """Send one message and :meth:`receive` the next.

        The host is kept on the caller's core, which is idle meanwhile: waking a process on another, sleeping core takes some
        50 us, on this one 10.
        """
        core = CORE()
        if core != self._core:
            self._core = core
            with contextlib.suppress(ProcessLookupError):  # the process has ended: receive() raises the error
                os.sched_setaffinity(self.process, {core})
        with contextlib.suppress(LinkClosed):
            self.send(data)
        return self.receive(seconds)

    def receive(self, seconds: float | None) -> bytes | None:
        """Return the host's next message.

        Parameters
        ----------
        seconds : float or None
            Longest wait [s of wall clock]; None sets no limit.

        Returns
        -------
        bytes or None
            None when no message comes in time.

        Raises
        ------
        LinkClosed
            When the process has ended; the sentence describes how.
        """
        try:
            return self._receive(seconds)
        except LinkClosed:
            raise LinkClosed(self._how_it_ended()) from None

    def hear(self, when: str) -> dict:
        """Return the host's next message before the first sample, which is JSON.

        Parameters
        ----------
        when : str
            What the controller does meanwhile, for the error's sentence: "while it was loaded".

        Returns
        -------
        dict
            The message.

        Raises
        ------
        RigError
            When none comes within LOAD_TIMEOUT, or the process has ended.
        """
        try:
            data = self.receive(LOAD_TIMEOUT)
        except LinkClosed as gone:
            raise RigError(f"controller {self._name}: {gone} {when}{self.remark()}") from None
        why = f"no answer for {LOAD_TIMEOUT:g} s"
        if data is not None:
            try:
                return json.loads(data)
            except ValueError:
                why = self.unreadable(data)
        raise RigError(f"controller {self._name}: {why} {when}{self.remark()}")

    def unreadable(self, data: bytes) -> str:
        """Return the reason that a message, which is no answer to the sample, gives for going no further."""
        if data.startswith(SAID):
            return shortened(data.removeprefix(SAID).decode("utf-8", "replace"))
        return f"{self._kind.subject} wrote {len(data)} bytes of its own into the rig's line to it"

    def _how_it_ended(self) -> str:
        try:
            code = self._guard.wait(END_PATIENCE)
        except subprocess.TimeoutExpired:  # it closed its end of the link and still runs
            self.kill()
            code = LINE_LOST
        if code == LINE_LOST:
            return f"{self._kind.subject} has closed or changed the rig's line to it"
        if code < 0:
            return f"{self._kind.subject}'s process was ended by {_signal(-code)}"
        return f"{self._kind.subject}'s process ended itself with exit code {code}"

    def end(self) -> str:
        """Have the controller ended in order and end the processes, by force when that takes too long.

        Returns
        -------
        str
            What went wrong at the end; empty when nothing did.
        """
        with contextlib.suppress(LinkClosed):
            self.send(END)
        text, call = "", ""
        try:
            for call in self._kind.last_calls:
                said = self._done()
                if said is None:
                    text = text or f"{call} did not return within {END_PATIENCE:g} s"
                    break
                text = text or said
            else:
                if self._guard.wait(END_PATIENCE):
                    text = text or f"after {call} {self._how_it_ended()}"
        except LinkClosed as gone:
            text = text or f"in {call} {gone}"
        except subprocess.TimeoutExpired:
            text = text or f"{self._kind.subject}'s process did not end within {END_PATIENCE:g} s after {call}"
        self.kill()
        self._line.close()
        return text

    def _done(self) -> str | None:
        """Return what the next call at the end reports; None when it does not return in time."""
        until = time.monotonic() + END_PATIENCE
        while (left := until - time.monotonic()) > 0.0:
            data = self.receive(left)
            if data is not None and data.startswith(DONE):  # others are answers that came too late
                text, _, self.trace = data.removeprefix(DONE).decode("utf-8", "replace").partition("\0")
                return shortened(text)
        return None

    def kill(self) -> None:
        """End the controller's process and all its children without a call into the controller."""
        self._guard.send_signal(END_ALL)
        try:
            self._guard.wait(END_PATIENCE)
        except subprocess.TimeoutExpired:
            self._guard.kill()
            self._guard.wait()
        self._printed.join(END_PATIENCE)


class HostedPlug(Plug):
    """A plug whose controller runs in a process of its own, ``_host``."""

    _host: Host

    def _tell(self, message: dict) -> None:
        """Send the host a message before the first sample."""
        with contextlib.suppress(LinkClosed):  # the next message that is expected of it does not come, and is reported
            self._host.send(json.dumps(message).encode())

    def _asked(self, sample: int, data: bytes, limit: float | None) -> bytes:
        """Return the host's answer to a sample within a limit [s]; ControllerFailed when none comes or the process has ended."""
        try:
            answer = self._host.ask(data, limit)
        except LinkClosed as gone:
            self._fail(Status.FATAL, sample, str(gone))
        if answer is None:
            self._overdue(sample)
        return answer

    @property
    def process_id(self) -> int:
        """Number of the controller's process, for a debugger."""
        return self._host.process

    def _abandon(self) -> None:
        self._host.kill()

    def _end(self) -> None:
        self.end_fault = self._host.end()


def _signal(number: int) -> str:
    """Return a signal in words; those of real time have a number in place of a name."""
    name = signal.Signals(number).name if number in tuple(signal.Signals) else f"signal {number}"
    text = signal.strsignal(number)
    return f"{name} ({text.lower()})" if text else name


def _show(pipe: IO[bytes], name: str) -> None:
    """Show what a controller's process prints, without characters that control a terminal, and no more than MOST_PRINTED."""
    left = MOST_PRINTED
    with pipe:
        while left > 0 and (line := pipe.readline(LINE)):
            left -= len(line)
            print(printable(line.decode("utf-8", "replace").rstrip("\n"), "\t"), file=sys.stderr, flush=True)
        if left <= 0 and pipe.read(1):
            text = f"controller {name} has printed more than {MOST_PRINTED >> 20} MiB; the rest is not shown"
            print(printable(text), file=sys.stderr, flush=True)
        while pipe.read(1 << 16):  # it must not wait for a reader
            pass
