# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A CAN bus of UDP multicast packets on this machine's loopback: python-can's udp_multicast, bound to nothing else.

python-can's own bus listens on every address of the machine and joins the group on the network of the default route.
The packets are the same, so that every program of python-can that is also on loopback (docs/how_to/can.md) is on the
same bus. The plug and controllers on this machine use it; it imports nothing of the rig.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from typing import Any

import can
from can.interfaces.udp_multicast.utils import is_msgpack_installed, pack_message, unpack_message

PORT = 43113  # the default of python-can
HERE = socket.inet_aton("127.0.0.1")
LONGEST = 4096  # bytes of a packet
CHANNEL = 0  # of each frame; logs write it as the first one
_SO_TIMESTAMPNS = 35  # Linux' number, which the module socket does not have
_TIME = struct.Struct("@ll")  # s and ns


class LoopbackBus(can.BusABC):
    """The bus of a multicast group (IPv4, 224.0.0.0 to 239.255.255.255) and a port; classic CAN.

    A received frame has the kernel's time of its arrival [s since 1970] and channel 0, so that every log of python-can takes it.
    ``sender`` is the UDP port from which the frame that was received last was sent; each such bus sends from a port of its own.
    ``recv`` raises can.CanOperationError for a packet that is no frame.

    Parameters
    ----------
    channel : str
        Address of the multicast group.
    port : int
        UDP port of the group.
    **options : Any
        Options of can.BusABC.
    """

    def __init__(self, channel: str, port: int = PORT, **options: Any) -> None:
        """Open the sockets; OSError when ``channel`` is no multicast group."""
        is_msgpack_installed()
        super().__init__(channel, **options)
        self.channel_info = f"UDP multicast {channel}:{port} on loopback"
        self._group, self.sender = (channel, port), 0
        self._socket, self._sender = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        try:
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, HERE)
            for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
                self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(channel) + HERE)
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            self._socket.bind(self._group)  # bound to the group: packets to an address of the machine do not arrive
        except OSError:
            self.shutdown()
            raise

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        until = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if until is None else max(0.0, until - time.monotonic())
            if not select.select([self._socket], [], [], left)[0]:
                return None, False
            data, about, _, (_, port) = self._socket.recvmsg(LONGEST, socket.CMSG_SPACE(_TIME.size))
            if port != self._sender.getsockname()[1]:
                break  # the others are what this bus has sent itself, which no bus of python-can gives back
        try:
            message = unpack_message(data, replace={"channel": CHANNEL, "timestamp": _arrival(about)}, check=True)
        except Exception as error:  # msgpack and Message raise various errors for foreign bytes
            raise can.CanOperationError("a packet is no frame of python-can") from error
        self.sender = port
        return (None if message.is_fd else message), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; can.CanOperationError when that fails. ``timeout`` has no effect: a multicast packet is not confirmed."""
        try:
            self._sender.sendto(pack_message(msg), self._group)
        except OSError as error:
            raise can.CanOperationError(str(error)) from error

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the group."""
        super().shutdown()
        self._socket.close()
        self._sender.close()


def _arrival(about: list[tuple[int, int, bytes]]) -> float:
    """Return the time at which the kernel received a packet [s since 1970]; that of the clock where it does not tell."""
    for level, kind, data in about:
        if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS) and len(data) >= _TIME.size:
            seconds, nanoseconds = _TIME.unpack_from(data)
            return seconds + nanoseconds * 1e-9
    return time.time()
