# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C and SIGTERM between pieces of work that are done whole or not at all; used by the headless run.

Python raises what they raise between any two instructions, so also between a message and the count of it.
"""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType


class Uninterrupted:
    """While the block runs, signals that come while ``held`` is set are handed on by :meth:`let_in`, or at the block's end."""

    def __init__(self) -> None:
        self.held = False
        self._before: dict[int, object] = {}
        self._came: int | None = None

    def __enter__(self) -> Uninterrupted:
        if threading.current_thread() is threading.main_thread():  # no other one is ever interrupted
            for number in (signal.SIGINT, signal.SIGTERM):
                before = signal.getsignal(number)
                if callable(before):
                    self._before[number] = before
                    signal.signal(number, self._on)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            if signal.getsignal(number) == self._on:  # else whoever it was handed on to has set another
                signal.signal(number, before)
        self.let_in()

    def let_in(self) -> None:
        """Clear ``held`` and hand on the signal that came meanwhile."""
        self.held = False
        if self._came is not None:
            number, self._came = self._came, None
            self._before[number](number, None)

    def _on(self, number: int, frame: FrameType | None) -> None:
        if self.held:
            self._came = number
        else:
            self._before[number](number, frame)
