# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress and remaining time of long work, on stderr, by tqdm: a line that is renewed in a terminal.

Every verb with long work uses it: ``sweep``, ``tune``, ``validate``, ``calibrate``, ``bench``.
"""

from __future__ import annotations

import sys
import threading
import time

QUIET = 10.0  # s between two lines when stderr is not a terminal
KNOWN, UNKNOWN = "{desc}, {elapsed}, about {remaining} left", "{desc}, {elapsed}"  # with tqdm's names
WIDTH = 79


class ProgressLine:
    """A line of progress; ``tell(done, text)`` renews it as work is done.

    ``of`` is the total amount, None when it is unknown; ``begun`` is the amount that was done before.
    """

    def __init__(self, of: float | None = None, begun: float = 0.0) -> None:
        from tqdm import tqdm  # imported here, because verbs are loaded without it

        tqdm.monitor_interval = 0  # no thread of its own
        tqdm.set_lock(threading.RLock())  # also no semaphore of the system, which would start another process
        self._of, self._begun, self._format = of, begun, tqdm.format_meter
        self._start = self._told = time.monotonic()
        # a fixed size, because tqdm shows no line on a terminal that reports no size
        shape = {"bar_format": "{desc}", "ncols": WIDTH, "nrows": 20}
        self._bar = tqdm(total=of, initial=begun, file=sys.stderr, **shape) if sys.stderr.isatty() else None

    def show(self, done: float, text: str, part: bool = False) -> None:
        """Renew the line; a file gets at most one line every QUIET seconds, the last line, and one where a part is done."""
        last = self._of is not None and done >= self._of
        form = UNKNOWN if last or self._of is None or done <= self._begun else KNOWN
        if self._bar is not None:
            self._bar.bar_format, self._bar.n = form, done
            self._bar.set_description_str(text)
            if last:
                self._bar.close()
            return
        now = time.monotonic()
        if last or part or now - self._told >= QUIET:
            self._told = now
            gone, wide = now - self._start, len(text) + WIDTH
            line = self._format(done, self._of, gone, prefix=text, bar_format=form, initial=self._begun, ncols=wide)
            print(line, file=sys.stderr, flush=True)

    def leave(self) -> None:
        """Continue below the line, if there is one."""
        if self._bar is not None:
            self._bar.close()
