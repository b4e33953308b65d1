# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recording in lockstep: the bytes that a process publishes also go to the recorder, over a socket of their own.

The supervisor makes it; rig container and alfa46 hold one end (Tap), the recorder the other (TapReader). DDS takes
10 us to send and 20 us to receive each of some 5600 messages of a simulated second, which alone would hold a run below
8 times real time on two cores. A tap takes 1 us and loses nothing, and no process can run ahead of the recorder, because
its socket is full before that.
"""

from __future__ import annotations

import contextlib
import json
import socket
import struct
import threading
import time
from collections.abc import Iterable, Iterator

from ...base import PATIENCE, LinkClosed

HEAD = struct.Struct("<HI")  # number of the topic, bytes of the message that follows
NAMES = 0xFFFF  # in place of a topic's number, in the first message: the names of all topics that will come
FLUSH_BYTES = 1 << 17
FLUSH_PERIOD = 0.02  # s of real time: waking the recorder more often costs more than what it writes
READ_BYTES = 1 << 20
# the socket's buffer, doubled by the kernel, and its usual default: some 0.3 s of the rig with any settings of the host. What
# comes by DDS meanwhile must not look as if it had the stamps of another clock (AHEAD_NS of nodes.recorder).
SEND_BYTES = 106_496


def tap_pair() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a tap: for the process that publishes, and for the recorder."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    ends[0].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
    return ends


class Tap:
    """The end of a process that publishes; it is thread-safe.

    Parameters
    ----------
    descriptor : int
        Descriptor of the socket.
    topics : iterable of str
        Names of all topics that will be put.

    Raises
    ------
    LinkClosed
        When the recorder has ended.
    """

    def __init__(self, descriptor: int, topics: Iterable[str]) -> None:
        """Send the names of the topics."""
        self._socket = socket.socket(fileno=descriptor)
        self._socket.settimeout(PATIENCE)
        self._lock = threading.Lock()
        self._numbers = {name: number for number, name in enumerate(topics)}
        names = json.dumps(list(self._numbers)).encode()
        self._parts: list[bytes] = [HEAD.pack(NAMES, len(names)), names]
        self._bytes = len(names)
        self._flush_at = 0.0
        self.flush()

    def put(self, messages: Iterable[tuple[str, bytes]]) -> None:
        """Hand over (topic, encoded message) pairs; they are sent after 20 ms or 128 KiB, with later ones or by :meth:`flush`."""
        numbers, parts = self._numbers, self._parts
        with self._lock:
            for topic, data in messages:
                parts += HEAD.pack(numbers[topic], len(data)), data
                self._bytes += len(data)
            due = self._bytes > FLUSH_BYTES or time.monotonic() > self._flush_at
        if due:
            self.flush()

    def flush(self) -> None:
        """Send what was put; LinkClosed when the recorder has ended or receives nothing."""
        with self._lock:
            if not self._parts:
                return
            data = b"".join(self._parts)
            self._parts.clear()
            self._bytes = 0
            self._flush_at = time.monotonic() + FLUSH_PERIOD
            try:
                self._socket.sendall(data)
            except TimeoutError:
                raise LinkClosed(f"the recorder took nothing in for {PATIENCE:g} s") from None
            except OSError:
                raise LinkClosed("recorder has ended") from None

    def close(self) -> None:
        """Send the rest and close the tap; what was put is lost only when the recorder has ended."""
        with contextlib.suppress(LinkClosed):
            self.flush()
        self._socket.close()


class TapReader:
    """The recorder's end; ``topics`` holds the names of what comes, None until the other end has sent them."""

    def __init__(self, descriptor: int) -> None:
        self.topics: list[str] | None = None
        self._socket = socket.socket(fileno=descriptor)
        self._buffer = bytearray(READ_BYTES)
        self._view = memoryview(self._buffer)
        self._rest = b""

    def fileno(self) -> int:
        """Return the socket's descriptor, for a selector."""
        return self._socket.fileno()

    def read(self) -> Iterator[tuple[str, bytes]] | None:
        """Return (topic, message) of what has arrived, waiting for some; None when nothing more will come."""
        try:
            size = self._socket.recv_into(self._buffer)
        except OSError:
            size = 0
        return self._split(bytes(self._view[:size])) if size else None

    def _split(self, data: bytes) -> Iterator[tuple[str, bytes]]:
        data = self._rest + data
        position, end = 0, len(data)
        while position + HEAD.size <= end:
            number, size = HEAD.unpack_from(data, position)
            begin = position + HEAD.size
            if begin + size > end:
                break
            position = begin + size
            if number == NAMES:
                self.topics = json.loads(data[begin:position])
            else:
                yield self.topics[number], data[begin:position]
        self._rest = data[position:]
