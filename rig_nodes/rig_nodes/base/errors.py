# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one exception and the one warning of the rig that users are meant to read, and texts that several errors share.

Everything that refuses input raises it; the command line prints its message and ends with its exit code.
"""

from __future__ import annotations

import errno
import os
import signal
from pathlib import Path

TERMINATED, INTERRUPTED = "ended by SIGTERM", "interrupted by Ctrl-C"


class RigError(Exception):
    """Bad input or an impossible request, with a message in one sentence: what, where, and what would be right."""

    exit_code = 2


class RigWarning(UserWarning):
    """What a result rests on though nobody said so, in one sentence; the command line prints it as its own."""


def no_file(path: str | Path) -> str:
    """Return why there is no file to read under this name, for a sentence that begins with the name."""
    return "it is a folder, expected a file" if os.path.isdir(path) else "there is no such file"


def printable(text: object, kept: str = "") -> str:
    r"""Return a text as people see it, with control characters and invisible characters written as JSON writes them.

    These are ``\u001b`` or ``\n``, for example, which a terminal would obey instead of showing them. It is for every text that may
    contain what a user, a file or another program wrote: names may contain control characters, marks that turn the direction of
    writing, and halves of characters.

    Parameters
    ----------
    text : object
        The text.
    kept : str
        Characters that stay as they are.

    Returns
    -------
    str
        The printable text.
    """
    text = str(text)
    if text.isprintable():
        return text
    from json import dumps

    return "".join(c if c.isprintable() or c in kept else dumps(c)[1:-1] for c in text)


def quoted(path: str | Path) -> str:
    """Return a path as a word of a printed command, which a user may copy into a shell."""
    from shlex import quote

    return quote(f"./{path}" if str(path).startswith("-") else str(path))


def brief(value: object) -> str:
    """Return a value as text on one line, shortened when it is long, so that an error does not contain a whole file or array."""
    from reprlib import Repr

    short = Repr()
    short.maxstring = short.maxother = 60
    short.maxdict, short.maxlevel = 4, 3
    return " ".join(line.strip() for line in short.repr(value).splitlines())


class BagError(RigError):
    """A bag that cannot be read; the message has the offset of the damage and a hint what to do."""


class Terminated(KeyboardInterrupt):
    """SIGTERM, which ends a command as Ctrl-C does."""


def ended_by(stop: KeyboardInterrupt) -> tuple[str, int]:
    """Return the reason of an interrupt, and the exit code for it."""
    reason = TERMINATED if isinstance(stop, Terminated) else INTERRUPTED
    return reason, interrupted_code(reason)


def interrupted_code(reason: str) -> int:
    """Return the exit code of a run that was interrupted for one of the two reasons above."""
    return 128 + (signal.SIGTERM if reason == TERMINATED else signal.SIGINT)


class DiskFull(RigError):
    """A disk, a quota or a limit that took no more of a file that had begun well."""

    exit_code = 1


def not_written(what: str | Path, error: OSError, kept: str = "") -> RigError:
    """Return the error on a file that cannot be written.

    Parameters
    ----------
    what : str or Path
        The file.
    error : OSError
        Why it cannot be written.
    kept : str
        What there is of it nevertheless.

    Returns
    -------
    RigError
        The error; DiskFull when the disk, a quota or a limit is full.
    """
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    why = "disk full" if full else error.strerror or error
    kind = DiskFull if full or error.errno == errno.EFBIG else RigError
    return kind(f"{what} cannot be written ({why}){f'; {kept}' if kept else ''}")
