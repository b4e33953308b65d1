# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A line on stderr that tells how far a long piece of work is and how long it will still take.

Used by every verb whose work is long: ``sweep``, ``tune``, ``validate``, ``calibrate``, ``bench``.
"""

from __future__ import annotations

import sys
import time

QUIET = 10.0  # s between two lines where stderr is no terminal


class ProgressLine:
    """``tell(done, text)`` as work is done; of: how much there is, None: nobody knows; begun: how much of it was done
    before.
    """

    def __init__(self, of: float | None = None, begun: float = 0.0) -> None:
        self.of, self.begun, self.start, self.live = of, begun, time.monotonic(), sys.stderr.isatty()
        self._told, self._open = self.start, False

    def tell(self, done: float, text: str, part: bool = False) -> None:
        """Renew the line; into a file at most one every QUIET seconds, the last one, and where a part of it is done."""
        now, last = time.monotonic(), self.of is not None and done >= self.of
        gone = now - self.start
        share = 0.0 if self.of is None else (done - self.begun) / max(self.of - self.begun, 1e-12)
        left = f", about {spoken(gone / share * (1.0 - share))} left" if share > 0.0 and not last else ""
        line = f"{text}, {spoken(gone)}{left}"
        if self.live:
            print(f"\r{line:<79}", end="\n" if last else "", file=sys.stderr, flush=True)
            self._open = not last
        elif last or part or now - self._told >= QUIET:
            self._told = now
            print(line, file=sys.stderr, flush=True)

    def leave(self) -> None:
        """Go on below the line, if there is one."""
        if self._open:
            print(file=sys.stderr, flush=True)
            self._open = False


def spoken(seconds: float) -> str:
    """E.g. "42 s", "3 min 05 s", "2 h 10 min"."""
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
