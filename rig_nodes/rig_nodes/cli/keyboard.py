# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Single keys from the terminal, without Enter; verbs that can be controlled while they run use it."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty

# the arrows in both modes of a terminal
_NAMES = {f"\x1b{mode}{letter}": arrow for mode in "[O" for letter, arrow in zip("ABC", "↑↓→")}


class Keyboard:
    """Reader of single keys, as a context manager.

    It gives no keys, and does not change the terminal, when the standard input is not a terminal or another job has it.

    Parameters
    ----------
    wanted : bool
        False to give no keys at all.
    """

    def __init__(self, wanted: bool = True) -> None:
        try:
            self._descriptor = sys.stdin.fileno()
            self.there = wanted and os.isatty(self._descriptor) and not _in_background(self._descriptor)
        except (AttributeError, OSError, ValueError):
            self.there = False

    def __enter__(self) -> Keyboard:
        if self.there:
            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        if self.there:
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

    def __call__(self) -> str:
        """Return the keys pressed since the last call in their order, arrows as ``↑``, ``↓``, ``→``; empty without a terminal."""
        pressed = ""
        while self.there and select.select([self._descriptor], [], [], 0)[0]:
            data = os.read(self._descriptor, 64)
            self.there = bool(data)  # a closed terminal sends no more keys
            pressed += data.decode("utf-8", "replace")
        for sequence, name in _NAMES.items():
            pressed = pressed.replace(sequence, name)
        return pressed


def _in_background(descriptor: int) -> bool:
    """Return True for a job in the background of its terminal, which would be stopped for accessing it."""
    try:
        return os.tcgetpgrp(descriptor) != os.getpgrp()
    except OSError:
        return False  # not the terminal of this session, so there is no job control on it
