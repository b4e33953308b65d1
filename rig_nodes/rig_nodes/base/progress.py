# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress and remaining time of long work, on stderr, by tqdm: a line that is renewed in a terminal.

Every verb with long work uses it: ``sweep``, ``tune``, ``validate``, ``calibrate``, ``bench``; verbs and the Python API use it
where a rig is compiled.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

QUIET = 10.0  # s between two lines when stderr is not a terminal
KNOWN, UNKNOWN = "{desc}, {elapsed}, about {remaining} left", "{desc}, {elapsed}"  # with tqdm's names
WIDTH = 79
PATIENCE = 2.0  # s without output before a line of work of unknown length
STARTING = "starting, and the first time compiling the plant"


class ProgressLine:
    """A line of progress; ``tell(done, text)`` renews it as work is done.

    ``of`` is the total amount, None when it is unknown; ``begun`` is the amount that was done before; ``since`` is the time [s] for
    which the work goes on already.
    """

    def __init__(self, of: float | None = None, begun: float = 0.0, since: float = 0.0) -> None:
        from tqdm import tqdm  # imported here, because verbs are loaded without it

        tqdm.monitor_interval = 0  # no thread of its own
        tqdm.set_lock(threading.RLock())  # also no semaphore of the system, which would start another process
        self._of, self._begun, self._format = of, begun, tqdm.format_meter
        self._start = self._printed_at = time.monotonic() - since
        # a fixed size, because tqdm shows no line on a terminal that reports no size
        shape = {"bar_format": "{desc}", "ncols": WIDTH, "nrows": 20}
        self._bar = tqdm(total=of, initial=begun, file=sys.stderr, **shape) if sys.stderr.isatty() else None
        if self._bar is not None:
            self._bar.start_t -= since

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
        if last or part or now - self._printed_at >= QUIET:
            self._printed_at = now
            gone, wide = now - self._start, len(text) + WIDTH
            line = self._format(done, self._of, gone, prefix=text, bar_format=form, initial=self._begun, ncols=wide)
            print(line, file=sys.stderr, flush=True)

    def leave(self) -> None:
        """Continue below the line, if there is one."""
        if self._bar is not None:
            self._bar.close()


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show a text with the elapsed seconds while the block runs, once it has run for PATIENCE."""
    over = threading.Event()

    def tell() -> None:
        if over.wait(PATIENCE):
            return
        line = ProgressLine(since=PATIENCE)
        line.show(0.0, text)
        while not over.wait(1.0):
            line.show(0.0, text)
        line.leave()

    teller = threading.Thread(target=tell, name="waiting", daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()
