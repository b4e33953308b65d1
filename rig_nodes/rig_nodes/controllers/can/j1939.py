# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The duties of a J1939 node: identifiers (J1939-21), NAME and address claim (J1939-81), requests.

The CAN plug (bus.py) uses it. Numbers with a fixed meaning are those of the standard's documents.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import NamedTuple

ACKNOWLEDGEMENT, REQUEST, ADDRESS_CLAIMED = 59392, 59904, 60928  # PGN
GLOBAL, NULL = 255, 254  # addresses: to all nodes; of a node without an address
PRIORITY = 6  # of the three groups above
NEGATIVE = 1  # control byte of an acknowledgement: the requested group is not available here
FUNCTION = 3  # function in the NAME, all industry groups: transmission
CLAIM_PAUSE = 0.25  # s after its claim in which a node with a dynamic address sends nothing else
DYNAMIC = range(128, 248)  # addresses with that pause
ERROR_1, ERROR_2 = 0xFE, 0xFE00  # "error" as a parameter of one and of two bytes
NONE_1, NONE_2 = 0xFF, 0xFFFF  # "not available"
HIGHEST_1, HIGHEST_2 = 0xFA, 0xFAFF  # the largest values; those above are reserved
OFF, ON, ERROR, NOT_AVAILABLE = range(4)  # states of two bits


class Identifier(NamedTuple):
    """The parts of a 29-bit identifier; the destination is GLOBAL for groups that always go to all nodes."""

    priority: int
    pgn: int
    destination: int
    source: int


def identifier(pgn: int, source: int, destination: int = GLOBAL, priority: int = PRIORITY) -> int:
    """Return a 29-bit identifier.

    Parameters
    ----------
    pgn : int
        Number of the parameter group.
    source : int
        Source address.
    destination : int
        Destination address; it is used only for groups that have one (PDU1).
    priority : int
        Priority of the frame.

    Returns
    -------
    int
        The identifier.
    """
    return priority << 26 | pgn << 8 | (destination << 8 if _is_addressed(pgn) else 0) | source


def parts(number: int) -> Identifier:
    """Return the parts of a 29-bit identifier."""
    pgn, destination = number >> 8 & 0x3FFFF, GLOBAL
    if _is_addressed(pgn):
        pgn, destination = pgn & 0x3FF00, pgn & 0xFF
    return Identifier(number >> 26, pgn, destination, number & 0xFF)


def _is_addressed(pgn: int) -> bool:
    return pgn >> 8 & 0xFF < 240


def new_name() -> int:
    """Return a NAME: transmission, no industry group, a random identity number, an address that does not change by itself."""
    return FUNCTION << 40 | secrets.randbits(21)


class Node:
    """A node that claims a source address, defends it, and answers requests.

    Parameters
    ----------
    address : int
        The source address to claim.
    send : callable
        ``send(number, data)`` puts a frame with a 29-bit identifier on the bus.
    answers : dict of int to callable
        By PGN that may be requested, the function that sends the group.
    lost : callable
        ``lost(text)`` is called once when another node has taken the address.
    """

    def __init__(
        self, address: int, send: Callable[[int, bytes], None], answers: dict[int, Callable[[], None]], lost: Callable[[str], None]
    ) -> None:
        self.address, self.name = address, new_name()
        self._send, self._answers, self._lost = send, answers, lost
        self._free_at = time.monotonic() + (CLAIM_PAUSE if address in DYNAMIC else 0.0)
        self.claim()

    @property
    def may_send(self) -> bool:
        """Whether the address is this node's and the pause after its claim is over."""
        return self.address != NULL and time.monotonic() >= self._free_at

    def claim(self) -> None:
        """Send the address that this node has, or that it has none."""
        self._send(identifier(ADDRESS_CLAIMED, self.address), self.name.to_bytes(8, "little"))

    def received(self, number: int, data: bytes) -> None:
        """Handle a frame with a 29-bit identifier that has come."""
        _, pgn, destination, source = parts(number)
        if pgn == ADDRESS_CLAIMED and len(data) == 8 and source == self.address:
            self._other_claim(int.from_bytes(data, "little"))
        elif pgn == REQUEST and len(data) >= 3 and destination in (self.address, GLOBAL):
            self._requested(int.from_bytes(data[:3], "little"), destination, source)

    def _other_claim(self, name: int) -> None:
        """Compare NAMEs: the smaller number gets the address; an equal NAME is this node's own claim, sent back."""
        if name > self.name:
            self.claim()
        elif name < self.name:
            self._lost(f"the J1939 address {self.address} is another node's (NAME {name:016x})")
            self.address = NULL
            self.claim()

    def _requested(self, pgn: int, destination: int, source: int) -> None:
        if pgn == ADDRESS_CLAIMED:
            self.claim()
        elif not self.may_send:
            return
        elif pgn in self._answers:
            self._answers[pgn]()
        elif destination != GLOBAL:
            data = bytes([NEGATIVE, 0xFF, 0xFF, 0xFF, source]) + pgn.to_bytes(3, "little")
            self._send(identifier(ACKNOWLEDGEMENT, self.address), data)
