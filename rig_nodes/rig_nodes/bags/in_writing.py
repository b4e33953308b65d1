# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who writes a file at this moment, so that the bag of a run that goes on is not taken for one that was cut off.

bags.mcap_file asks it of files that were not closed.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

PROC = Path("/proc")
WRITES = os.O_WRONLY | os.O_RDWR
AFTER_NAME, START = ") ", 19  # of /proc/PID/stat: the end of the name, and the place behind it of the start [ticks since the boot]


def writer_of(file: Path) -> str:
    """Return which other process has a file open for writing, and since when it runs; empty when none is seen.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    str
        E.g. "recorder (process 4711, since 2026-11-28 14:03:05)". Processes of other users are seen by root only.
    """
    try:
        wanted = os.stat(file)
    except OSError:
        return ""
    for process in PROC.glob("[0-9]*"):
        if int(process.name) != os.getpid():
            with suppress(OSError):  # it is another user's, or has ended
                for descriptor in (process / "fd").iterdir():
                    if _is(descriptor, wanted) and _flags(process / "fdinfo" / descriptor.name) & WRITES:
                        return _named(process)
    return ""


def _is(descriptor: Path, wanted: os.stat_result) -> bool:
    """Return whether an open file is the wanted one; False when it has been closed meanwhile."""
    with suppress(OSError):
        return os.path.samestat(os.stat(descriptor), wanted)
    return False


def _flags(info: Path) -> int:
    """Return the flags with which a file was opened (proc(5): in octal digits)."""
    return int(info.read_text(encoding="ascii").partition("flags:")[2].split()[0], 8)


def _named(process: Path) -> str:
    name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
    ticks = int((process / "stat").read_text(encoding="utf-8", errors="replace").rpartition(AFTER_NAME)[2].split()[START])
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(time.time() - age))
    return f"{name} (process {process.name}, since {since})"
