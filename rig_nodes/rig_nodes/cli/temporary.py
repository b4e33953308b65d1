# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The temporary folder of one command: all that it and its processes put aside, removed at its end, or at the next start.

cli.main makes it for each verb. A command that is killed cannot remove it; a lock in it shows whether somebody still uses it.
"""

from __future__ import annotations

import atexit
import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

PREFIX = "rig-tmp-"
LOCK = "lock"


def own_folder() -> None:
    """Have Python's temporary files in a folder of this command, and remove the folders of commands that were killed."""
    clear()
    try:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        part = folder / f"{LOCK}.new"
        lock = os.open(part, os.O_CREAT | os.O_WRONLY, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.rename(part, folder / LOCK)  # so that nobody meets it before it is locked
    except OSError:
        return  # the first file that is needed says why none can be made
    tempfile.tempdir = str(folder)
    # a forked process has the lock too, and does not come here: the folder stays until the last one has ended
    atexit.register(_remove, folder, os.getpid())


def clear() -> None:
    """Remove the folders of this user's commands that are not locked, so that no process of theirs is left."""
    with suppress(OSError), os.scandir(tempfile.gettempdir()) as entries:
        for entry in entries:
            if entry.name.startswith(PREFIX) and entry.is_dir(follow_symlinks=False):
                with suppress(OSError):
                    _clear(Path(entry.path))


def _clear(folder: Path) -> None:
    if folder.stat().st_uid != os.getuid():
        return
    lock = os.open(folder / LOCK, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # BlockingIOError while a process has it
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(lock)


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
