# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The step handshake of a run in lockstep: whole messages over a socket pair between two of its processes.

Made by the supervisor, held by the rig container at one end and by alfa46 or sequencer at the other. DDS carries the
same content for everybody to see; the link only says who may go on, in some 20 us where DDS takes 300.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import time

from ..errors import RigError

FRAME = 1 << 20  # longest message
ANSWERED, DISCARDED, FAILED = range(3)  # kind of an answer; the sentence of a failure follows
TIMEVAL = struct.Struct("@ll")  # s, us
STATUS = b"status "  # in place of a sample: what the rig does now, a testbench.rig_base.RigStatus; the reason follows
READY = b"ready "  # first word of the controller; the level of its commands follows, and what it wants
SPIN = 300e-6  # s; to sleep and be woken takes 50 us, for each of 1000 samples of a simulated second
NOT_AT_ALL = 0.0  # as a timeout: take what is there
PATIENCE = 30.0  # s that sequencer and recorder may take for one exchange


class Frames:
    """The messages of a sample and of its answer, for a controller with so many outputs, transducers and wants.

    sample: number, coil currents, transducers, what the controller wants; answer: number, kind, commands, setpoints,
    gear, shifting, flags, and for FAILED a sentence behind it.
    """

    def __init__(self, outputs: int, transducers: int, wants: int) -> None:
        self.outputs, self.measured = outputs, outputs + transducers  # where in a sample commands and transducers end
        self.sample = struct.Struct(f"<Q{outputs + transducers + wants}d")
        self.answer = struct.Struct(f"<QB{2 * outputs}dBBB")

    def none(self, sample: int, kind: int) -> bytes:
        """An answer without numbers."""
        return self.answer.pack(sample, kind, *(0.0,) * (2 * self.outputs), 0, 0, 0)


class LinkClosed(RigError):
    """The other process has gone."""

    exit_code = 1


def pair() -> tuple[socket.socket, socket.socket]:
    """The two ends of a link; their descriptors are handed to child processes."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


class Link:
    """One end; ``other`` is the name of the process at the other one. One thread receives."""

    def __init__(self, descriptor: int, other: str, watchful: bool = False) -> None:
        """watchful: look for a message for SPIN s before sleeping, where answers are expected within that."""
        self.other = other
        self._watchful = watchful and len(os.sched_getaffinity(0)) > 1
        self._socket = socket.socket(fileno=descriptor)
        self._socket.settimeout(None)
        self._buffer = bytearray(FRAME)  # a fresh one for each message would cost more than the message
        self._view = memoryview(self._buffer)
        self._timeout: float | None = None

    def send(self, data: bytes) -> None:
        """Send one message; LinkClosed when nobody is there any more."""
        try:
            self._socket.send(data)
        except OSError:
            raise LinkClosed(f"{self.other} has ended") from None

    def receive(self, timeout: float | None) -> bytes | None:
        """The next message, None when there is none within ``timeout`` s; LinkClosed when there will be none."""
        size = self._look() if self._watchful and timeout != NOT_AT_ALL else None
        if size is None:
            size = self._sleep(timeout)
        if size is None:
            return None
        if not size:
            raise LinkClosed(f"{self.other} has ended")
        return bytes(self._view[:size])

    def _look(self) -> int | None:
        """Bytes of a message that comes within SPIN s, None when none does."""
        until = time.monotonic() + SPIN
        while time.monotonic() < until:
            try:
                return self._socket.recv_into(self._buffer, 0, socket.MSG_DONTWAIT)
            except BlockingIOError:
                os.sched_yield()
            except OSError:
                return 0
        return None

    def _sleep(self, timeout: float | None) -> int | None:
        """Bytes of the next message, None when there is none within ``timeout`` s."""
        flags = socket.MSG_DONTWAIT if timeout == NOT_AT_ALL else 0
        if not flags and timeout != self._timeout:
            # the kernel's own timeout: Python's takes a poll and two mode switches for each message
            micros = 0 if timeout is None else max(1, round(timeout * 1e6))
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIMEVAL.pack(*divmod(micros, 1_000_000)))
            self._timeout = timeout
        try:
            return self._socket.recv_into(self._buffer, 0, flags)
        except BlockingIOError:
            return None
        except OSError:
            return 0

    def close(self) -> None:
        """No more messages either way."""
        self._socket.close()

    def send_json(self, message: dict) -> None:
        """Send a message of names and values."""
        self.send(json.dumps(message).encode())

    def receive_json(self, timeout: float | None) -> dict | None:
        """As :meth:`receive`, for what :meth:`send_json` sent."""
        data = self.receive(timeout)
        return None if data is None else json.loads(data)
