# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A CAN bus of UDP multicast packets on this machine's loopback: python-can's udp_multicast, bound to nothing else.

python-can's own bus listens on every address of the machine and joins the group on the network of the default route.
The packets are the same, so whoever of its programs is on loopback too (docs/how_to/can.md) is on the same bus. Used by the
plug and by controllers on this machine; it imports nothing of the rig.
"""

from __future__ import annotations

import select
import socket
from typing import Any

import can
from can.interfaces.udp_multicast.utils import is_msgpack_installed, pack_message, unpack_message

PORT = 43113  # python-can's
HERE = socket.inet_aton("127.0.0.1")
LONGEST = 4096  # bytes of a packet


class LoopbackBus(can.BusABC):
    """The bus of a multicast group (IPv4, 224.0.0.0 to 239.255.255.255) and a port; classic CAN.

    The ``channel`` of a frame that came is the port that it was sent from: another one for each such bus. ``recv``
    raises can.CanOperationError for a packet that is no frame.
    """

    def __init__(self, channel: str, port: int = PORT, **options: Any) -> None:
        """OSError when ``channel`` is no such group."""
        is_msgpack_installed()
        super().__init__(channel, **options)
        self.channel_info = f"UDP multicast {channel}:{port} on loopback"
        self._group = (channel, port)
        self._socket, self._sender = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        try:
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, HERE)
            for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
                self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(channel) + HERE)
            self._socket.bind(self._group)  # to the group: what is sent to an address of the machine does not arrive
        except OSError:
            self.shutdown()
            raise

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not select.select([self._socket], [], [], timeout)[0]:
            return None, False
        data, (_, port) = self._socket.recvfrom(LONGEST)
        try:
            message = unpack_message(data, replace={"channel": str(port)}, check=True)
        except Exception as error:  # whatever msgpack and Message find in foreign bytes
            raise can.CanOperationError("a packet is no frame of python-can") from error
        return (None if message.is_fd else message), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; can.CanOperationError when that fails. A multicast packet is not waited for."""
        try:
            self._sender.sendto(pack_message(msg), self._group)
        except OSError as error:
            raise can.CanOperationError(str(error)) from error

    def fileno(self) -> int:
        """The socket's descriptor."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the group."""
        super().shutdown()
        self._socket.close()
        self._sender.close()
