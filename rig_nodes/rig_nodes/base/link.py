# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The step handshake of a run in lockstep: whole messages over a socket pair between two of its processes.

The supervisor makes it; the rig container holds one end, alfa46 or sequencer the other. DDS carries the same content for
all other programs; the link only controls which process may go on, in some 20 us where DDS takes 300.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import time

from .errors import RigError

FRAME = 1 << 20  # longest message
ANSWERED, DISCARDED, FAILED = range(3)  # kind of an answer; the sentence of a failure follows
TIMEVAL = struct.Struct("@ll")  # s, us
STATUS = b"status "  # in place of a sample: the present runs.rig_base.RigStatus; the reason follows
READY = b"ready "  # first message of the controller; the level of its commands and the transducers that it wants follow
SPIN = 300e-6  # s of busy waiting: sleeping and waking takes 50 us, for each of 1000 samples of a simulated second
NOT_AT_ALL = 0.0  # as a timeout: take only what is there
PATIENCE = 30.0  # s that sequencer and recorder may take for one exchange


class Frames:
    """The messages of a sample and of its answer.

    A sample holds its number, coil currents, transducers and what the controller wants. An answer holds the sample's
    number, kind, commands, setpoints, gear, shifting and flags, followed by a sentence for FAILED.

    Parameters
    ----------
    outputs, transducers, wants : int
        Numbers of outputs, of transducers and of wanted transducers.
    """

    def __init__(self, outputs: int, transducers: int, wants: int) -> None:
        self.outputs, self.measured = outputs, outputs + transducers  # places in a sample where currents and transducers end
        self.sample = struct.Struct(f"<Q{outputs + transducers + wants}d")
        self.answer = struct.Struct(f"<QB{2 * outputs}dBBB")

    def none(self, sample: int, kind: int) -> bytes:
        """Return an answer without numbers."""
        return self.answer.pack(sample, kind, *(0.0,) * (2 * self.outputs), 0, 0, 0)


class LinkClosed(RigError):
    """The process at the other end has ended."""

    exit_code = 1


def pair() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a link; their descriptors are passed to child processes."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


class Link:
    """One end of a link; only one thread receives.

    Parameters
    ----------
    descriptor : int
        Descriptor of the socket.
    other : str
        Name of the process at the other end.
    watchful : bool
        True: poll for a message for SPIN s before sleeping, where answers are expected within that time.
    """

    def __init__(self, descriptor: int, other: str, watchful: bool = False) -> None:
        """Take over the descriptor."""
        self.other = other
        self._watchful = watchful and len(os.sched_getaffinity(0)) > 1
        self._socket = socket.socket(fileno=descriptor)
        self._socket.settimeout(None)
        self._buffer = bytearray(FRAME)  # kept, because a new one for each message would cost more than the message
        self._view = memoryview(self._buffer)
        self._timeout: float | None = None

    def send(self, data: bytes) -> None:
        """Send one message; LinkClosed when the other process has ended."""
        try:
            self._socket.send(data)
        except OSError:
            raise LinkClosed(f"{self.other} has ended") from None

    def receive(self, timeout: float | None) -> bytes | None:
        """Return the next message.

        Parameters
        ----------
        timeout : float or None
            Longest wait [s]; None sets no limit.

        Returns
        -------
        bytes or None
            None when no message comes in time.

        Raises
        ------
        LinkClosed
            When the other process has ended.
        """
        size = self._look() if self._watchful and timeout != NOT_AT_ALL else None
        if size is None:
            size = self._sleep(timeout)
        if size is None:
            return None
        if not size:
            raise LinkClosed(f"{self.other} has ended")
        return bytes(self._view[:size])

    def _look(self) -> int | None:
        """Return the size of a message that comes within SPIN s, None when none does."""
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
        """Return the size of the next message, None when none comes within ``timeout`` s."""
        flags = socket.MSG_DONTWAIT if timeout == NOT_AT_ALL else 0
        if not flags and timeout != self._timeout:
            # the kernel's timeout, because Python's needs a poll and two mode switches for each message
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
        """Close the link in both directions."""
        self._socket.close()

    def send_json(self, message: dict) -> None:
        """Send a message of names and values."""
        self.send(json.dumps(message).encode())

    def receive_json(self, timeout: float | None) -> dict | None:
        """Receive, as :meth:`receive` does, what :meth:`send_json` sent."""
        data = self.receive(timeout)
        return None if data is None else json.loads(data)
