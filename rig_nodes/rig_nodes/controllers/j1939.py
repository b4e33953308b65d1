# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a J1939 node does beside its messages: identifiers (J1939-21), NAME and address claim (J1939-81), requests.

Used by the CAN plug (can_bus.py). Numbers with a meaning of their own are those of the standard's documents.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import NamedTuple

ACKNOWLEDGEMENT, REQUEST, ADDRESS_CLAIMED = 59392, 59904, 60928  # PGN
GLOBAL, NULL = 255, 254  # addresses: to all; of one that has none
PRIORITY = 6  # of the three above
NEGATIVE = 1  # control byte of an acknowledgement: what is requested is not available here
FUNCTION = 3  # of the NAME, all industry groups: transmission
CLAIM_PAUSE = 0.25  # s after its claim in which a node of a dynamic address sends nothing else
DYNAMIC = range(128, 248)  # addresses with that pause
ERROR_1, ERROR_2 = 0xFE, 0xFE00  # "error" as a parameter of one and of two bytes
NONE_1, NONE_2 = 0xFF, 0xFFFF  # "not available"
HIGHEST_1, HIGHEST_2 = 0xFA, 0xFAFF  # the largest values; what is above is reserved
OFF, ON, ERROR, NOT_AVAILABLE = range(4)  # states of two bits


class Identifier(NamedTuple):
    """The parts of 29 bits. destination: GLOBAL for groups that are always for all."""

    priority: int
    pgn: int
    destination: int
    source: int


def identifier(pgn: int, source: int, destination: int = GLOBAL, priority: int = PRIORITY) -> int:
    """29 bits; the destination counts for groups that have one (PDU1) only."""
    return priority << 26 | pgn << 8 | (destination << 8 if _is_addressed(pgn) else 0) | source


def parts(number: int) -> Identifier:
    """What 29 bits say."""
    pgn, destination = number >> 8 & 0x3FFFF, GLOBAL
    if _is_addressed(pgn):
        pgn, destination = pgn & 0x3FF00, pgn & 0xFF
    return Identifier(number >> 26, pgn, destination, number & 0xFF)


def _is_addressed(pgn: int) -> bool:
    return pgn >> 8 & 0xFF < 240


def new_name() -> int:
    """A NAME: transmission, no industry group, a random identity number, an address that stays as it is chosen."""
    return FUNCTION << 40 | secrets.randbits(21)


class Node:
    """Claims a source address, defends it, and answers requests.

    ``send(number, data)`` puts a frame of 29 bits on the bus, ``answers`` has for each PGN that may be requested what
    sends it, ``lost(text)`` is called once when another node has the address.
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
        """The address is this node's."""
        return self.address != NULL and time.monotonic() >= self._free_at

    def claim(self) -> None:
        """Say which address this node has, or that it has none."""
        self._send(identifier(ADDRESS_CLAIMED, self.address), self.name.to_bytes(8, "little"))

    def heard(self, number: int, data: bytes) -> None:
        """A frame of 29 bits has come."""
        _, pgn, destination, source = parts(number)
        if pgn == ADDRESS_CLAIMED and len(data) == 8 and source == self.address:
            self._other_claim(int.from_bytes(data, "little"))
        elif pgn == REQUEST and len(data) >= 3 and destination in (self.address, GLOBAL):
            self._requested(int.from_bytes(data[:3], "little"), destination, source)

    def _other_claim(self, name: int) -> None:
        """Of two NAMEs the smaller number has the address. The same NAME is this node's own claim, come back."""
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
