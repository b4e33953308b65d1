# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of a running rig in blocks, as times and values of signals; the live view and the operator's page decode with it."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bags import cdr, installed

if TYPE_CHECKING:
    from ..rig import Signal, Topic

_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?")


@dataclass(frozen=True)
class Block:
    """Messages of one topic.

    Attributes
    ----------
    ros_type : str
        Their type.
    messages : list of bytes
        The messages.
    rows : (n,) array of records
        Their fields of fixed place.
    times : (n,) array of float
        Their stamps [s]; 0 for a message of a user without a stamp.
    """

    ros_type: str
    messages: list[bytes]
    rows: np.ndarray
    times: np.ndarray

    @cached_property
    def whole(self) -> list[Any]:
        """The decoded messages; ValueError when one is not of their type."""
        return [cdr.decode(self.ros_type, data) for data in self.messages]

    def values(self, signal: Signal) -> np.ndarray:
        """Return the values (n,) of a signal of the topic, in its ``unit``; ValueError as of :attr:`whole`."""
        match = _FIELD.fullmatch(signal.field)
        assert match is not None
        field, index = match.groups()
        # the position of a field after a text or a list differs from message to message
        values = self.rows[field] if field in (self.rows.dtype.names or ()) else np.array([getattr(m, field) for m in self.whole])
        return values if index is None else values[:, int(index)]


class Blocks:
    """Decoder of one topic."""

    def __init__(self, topic: Topic) -> None:
        self._ros_type, self._definition = topic.ros_type, installed(topic.ros_type)
        self._dtype = self._definition.dtype()

    def of(self, messages: list[bytes]) -> Block | None:
        """Return those messages that are of the topic's type as a block; None when there are none."""
        size = self._dtype.itemsize
        sound = []
        for data in messages:
            if len(data) >= size and data[:2] == cdr.HEADER[:2]:
                with suppress(ValueError):  # such a message counts as unreadable
                    sound.append(cdr.frameless(self._definition, data))
        if not sound:
            return None
        rows = np.frombuffer(b"".join(data[:size] for data in sound), self._dtype)
        return Block(self._ros_type, sound, rows, rows["stamp.sec"].astype(float) + rows["stamp.nanosec"] * 1e-9)
