# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The file of a bag while it is written: the room that the disk keeps for its end, and what others do to it meanwhile.

bags.writer uses it. Where a file system keeps no room, only what the disk has left counts.
"""

from __future__ import annotations

import ctypes
import errno
import io
import os
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from _typeshed import ReadableBuffer

KEEP_SIZE = 1  # fallocate(2): the file does not grow by what is kept for it
AHEAD = 1024 * 1024  # bytes that are kept at once


@cache
def _fallocate() -> Any:
    """Return the function of the C library that keeps room; None where it has none."""
    found = getattr(ctypes.CDLL(None, use_errno=True), "fallocate64", None)
    if found is not None:
        found.argtypes = ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64
    return found


class GrowingFile(io.FileIO):
    """A new file, which nobody else writes; FileExistsError when there is one.

    Attributes
    ----------
    written : int
        Bytes that the system has got for it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "xb")
        self.written, self._held = 0, 0  # bytes from the file's begin
        self._whole = True

    def write(self, data: ReadableBuffer, /) -> int:
        """Write at the end; what would come behind a cut is dropped, because the hole before it would make the file look whole."""
        self._whole = self._whole and os.fstat(self.fileno()).st_size >= self.written
        if not self._whole:
            return memoryview(data).nbytes
        count = super().write(data)
        self.written += count
        return count

    def keep(self, size: int) -> None:
        """Keep room for the file at a size [bytes] and for AHEAD bytes more, or for the size alone, as far as the disk has it.

        So its end fits when other programs have filled the disk.
        """
        if size <= self._held:
            return
        call = _fallocate()
        for wanted in (size + AHEAD, size) if call else ():
            if call(self.fileno(), KEEP_SIZE, 0, wanted) == 0:
                self._held = wanted
                return
            if ctypes.get_errno() not in (errno.ENOSPC, errno.EDQUOT):
                return  # this file system keeps none

    def left(self) -> int:
        """Return how many bytes the file can grow beyond those written: what is kept, and what the disk has left."""
        disk = os.fstatvfs(self.fileno())
        return disk.f_bavail * disk.f_frsize + max(0, self._held - self.written)

    def give_back(self) -> None:
        """Give back what is kept beyond the file's end."""
        if self._held:
            self.truncate(os.fstat(self.fileno()).st_size)
            self._held = 0

    def harm(self, path: Path, kept: str) -> tuple[str, bool]:
        """Return what others have done to the file, and whether it is still whole.

        Parameters
        ----------
        path : Path
            Its place.
        kept : str
            The time up to which it has been recorded.

        Returns
        -------
        (str, bool)
            A sentence, empty where all is well; False where the file was cut.

        Raises
        ------
        OSError
            When the file cannot be looked at.
        """
        own, there = os.fstat(self.fileno()), None
        self._whole = self._whole and own.st_size >= self.written
        with suppress(OSError):
            there = os.stat(path)
        why = ""
        if not self._whole:
            why = (
                f"{path} was cut from outside to {own.st_size} bytes at {kept}; what is left of it can be read with rig bag recover"
            )
        elif own.st_nlink == 0:
            why = f"{path} was removed while it was recorded, at {kept}; nothing of it is left"
        elif there is None or there.st_ino != own.st_ino:
            why = f"{path} is not at its place any more at {kept}: it or its folder was renamed or moved; "
            why += "the bag was ended in order where it is now"
        elif not os.access(path.parent, os.W_OK, effective_ids=True):
            why = f"{path.parent} takes no more files at {kept}: it or its disk was made read-only; "
            why += f"{path.name} was ended in order, without metadata.yaml"
        return why, self._whole
