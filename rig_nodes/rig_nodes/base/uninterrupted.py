# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Delay of Ctrl-C and SIGTERM to the end of a piece of work that is done whole or not at all; the headless run uses it.

Python raises their exceptions between any two instructions, so also between a message and the count of it.
"""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType


class Uninterrupted:
    """A block in which signals that arrive while ``held`` is set are delivered by :meth:`let_in`, or at the end of the block."""

    def __init__(self) -> None:
        self.held = False
        self._before: dict[int, Callable[[int, FrameType | None], object]] = {}
        self._came: int | None = None

    def __enter__(self) -> Uninterrupted:
        if threading.current_thread() is threading.main_thread():  # no other thread is ever interrupted
            for number in (signal.SIGINT, signal.SIGTERM):
                before = signal.getsignal(number)
                if callable(before):
                    self._before[number] = before
                    signal.signal(number, self._on)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            if signal.getsignal(number) == self._on:  # otherwise a handler that was called has set another one
                signal.signal(number, before)
        self.let_in()

    def let_in(self) -> None:
        """Clear ``held`` and deliver the signal that arrived meanwhile."""
        self.held = False
        if self._came is not None:
            number, self._came = self._came, None
            self._before[number](number, None)

    def _on(self, number: int, frame: FrameType | None) -> None:
        if self.held:
            self._came = number
        else:
            self._before[number](number, frame)
