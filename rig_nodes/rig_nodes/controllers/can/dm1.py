# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Active trouble codes as the group DM1 of SAE J1939-73, in one frame or by broadcast announce of J1939-21.

bus.py sends them while a rig is in its safe state, and runs.can_log for a recorded run; what is active is what the rig has
noticed, and never what was injected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from ...rig import bench_trips, trips_named
from .j1939 import GLOBAL, PRIORITY, identifier

if TYPE_CHECKING:
    from ...rig import RigConfig

EVERY, APART = 1000, 50  # samples of 1 ms between two groups while a code is active, and between two frames of one
DM1, ANNOUNCE, TRANSFER = 65226, 60416, 60160  # PGN of the codes, of the announce of a longer message, and of its pieces
BROADCAST = 32  # control byte of an announce to all nodes
TRANSPORT_PRIORITY = 7
PIECE = 7  # bytes of a message in a frame of it
MOST = 1785  # bytes of the longest message
STOPPED = 1 << 4  # red stop lamp on, the other lamps off
NO_FLASH = 0xFF  # how lamps flash: not available
MOST_SPN, MOST_FMI, MOST_COUNT = (1 << 19) - 1, 31, 126  # 127 is a count that is not available


class Code(NamedTuple):
    """A trouble code: suspect parameter number, failure mode identifier, and how often it has become active."""

    spn: int
    fmi: int
    count: int = 1


def dm1_data(codes: Sequence[Code]) -> bytes:
    """Return the content of DM1 for the active codes, 8 bytes or more.

    A code is its SPN in 19 bits with the FMI above its three highest ones, and its count in seven bits (conversion method 0).

    Parameters
    ----------
    codes : sequence of Code
        The active codes; none gives the content without a code.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    ValueError
        When a number does not fit into its bits, or there are too many codes for a message.
    """
    data = bytearray([STOPPED if codes else 0, NO_FLASH])
    for code in codes or (Code(0, 0, 0),):
        if not (0 <= code.spn <= MOST_SPN and 0 <= code.fmi <= MOST_FMI):
            raise ValueError(f"SPN {code.spn} with FMI {code.fmi} does not fit into a trouble code")
        data += bytes([code.spn & 0xFF, code.spn >> 8 & 0xFF, code.spn >> 16 << 5 | code.fmi, min(code.count, MOST_COUNT)])
    if len(data) > MOST:
        raise ValueError(f"{len(codes)} trouble codes do not fit into a message of {MOST} bytes")
    return bytes(data).ljust(8, b"\xff")


def dm1_frames(codes: Sequence[Code], source: int) -> list[tuple[int, bytes]]:
    """Return the frames of DM1 from a source address, each with its 29-bit identifier, in their order.

    A message of more than 8 bytes is announced and then sent in pieces, which follow each other by 50 to 200 ms.
    """
    data = dm1_data(codes)
    if len(data) <= 8:
        return [(identifier(DM1, source, priority=PRIORITY), data)]
    pieces = [data[k : k + PIECE].ljust(PIECE, b"\xff") for k in range(0, len(data), PIECE)]
    head = bytes([BROADCAST, len(data) & 0xFF, len(data) >> 8, len(pieces), 0xFF]) + DM1.to_bytes(3, "little")
    number = identifier(TRANSFER, source, GLOBAL, TRANSPORT_PRIORITY)
    return [
        (identifier(ANNOUNCE, source, GLOBAL, TRANSPORT_PRIORITY), head),
        *((number, bytes([k]) + piece) for k, piece in enumerate(pieces, 1)),
    ]


class ActiveCode:
    """The trouble codes of the trips that a rig is in, and when DM1 is due.

    It is due when a code becomes active, then every second, and once more when none is active any longer. A code stays active until
    the reset, also when a person presses the red button after its trip.

    Parameters
    ----------
    config : RigConfig
        The rig, which has the trips.
    """

    def __init__(self, config: RigConfig) -> None:
        self._trips = {one.name: one for one in (*config.trips, *bench_trips(config))}
        self._times = Counter[str]()
        self._reason, self._at = "", -1  # why the rig is in its safe state; sample at which DM1 is due, -1 for never
        self._waiting: list[tuple[int, tuple[int, bytes]]] = []  # frames of a message of several, by the samples of their turns
        self.codes: tuple[Code, ...] = ()

    def take(self, reason: str) -> None:
        """Take why the rig is in its safe state, the sentence of a trip; empty when it is not."""
        if reason == self._reason:
            return
        self._reason, before = reason, self.codes
        if not reason:
            self.codes = ()
        for name in trips_named(reason):
            one = self._trips.get(name)
            if one is not None and one.spn not in (code.spn for code in self.codes):
                self._times[name] += 1
                self.codes += (Code(one.spn, one.fmi, self._times[name]),)
        if self.codes != before:
            self._at = 0

    def due(self, sample: int, source: int) -> list[tuple[int, bytes]]:
        """Return the frames of DM1 whose turn it is at a sample, from a source address; see :func:`dm1_frames`."""
        if 0 <= self._at <= sample:
            self._at = sample + EVERY if self.codes else -1
            self._waiting = [(sample + APART * k, frame) for k, frame in enumerate(dm1_frames(self.codes, source))]
        due = [frame for at, frame in self._waiting if at <= sample]
        del self._waiting[: len(due)]
        return due
