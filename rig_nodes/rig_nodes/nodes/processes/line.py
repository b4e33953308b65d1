# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The line on which a process of the graph reports to its supervisor, which may read it late.

nodes.process writes it; nodes.processes.child has the other end.
"""

from __future__ import annotations

import json
import os
import threading
from contextlib import suppress

REPEATED = ("alive", "state")  # kinds that come again soon


class Line:
    """Writes to a pipe and never waits; while the pipe is full, what is not repeated is kept. It is thread-safe.

    Parameters
    ----------
    descriptor : int
        The pipe's writing end.
    """

    def __init__(self, descriptor: int) -> None:
        """Make the pipe one that nobody waits for."""
        os.set_blocking(descriptor, False)
        self._descriptor, self._unsent, self._lock = descriptor, b"", threading.Lock()

    def send(self, kind: str, fields: dict[str, object]) -> None:
        """Send one line, after those that there was no room for.

        Parameters
        ----------
        kind : str
            Kind of the line.
        fields : dict of str to object
            Its fields, which JSON can hold.
        """
        line = (json.dumps({"kind": kind, **fields}, allow_nan=False) + "\n").encode()
        with self._lock:
            if not (self._unsent and kind in REPEATED):
                self._unsent += line
            with suppress(BlockingIOError, BrokenPipeError):
                self._unsent = self._unsent[os.write(self._descriptor, self._unsent) :]
