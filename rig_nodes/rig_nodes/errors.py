# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one exception of the rig that users are meant to read, and words that several refusals share.

Everything that refuses input raises it; the command line prints its sentence and ends with its exit code.
"""

from __future__ import annotations

import errno
import os
import signal
from pathlib import Path

TERMINATED, INTERRUPTED = "ended by SIGTERM", "interrupted by Ctrl-C"


class RigError(Exception):
    """Bad input or an impossible request, said in one sentence: what, where, what would be right."""

    exit_code = 2


def no_file(path: str | Path) -> str:
    """Why there is no file to read under this name, for a sentence that begins with the name."""
    return "it is a folder, expected a file" if os.path.isdir(path) else "there is no such file"


def printable(text: object, kept: str = "") -> str:
    r"""``text`` as people see it: what a terminal would obey instead of show it, and what nobody can see, is written as JSON
    writes it (``\u001b``, ``\n``); the characters of ``kept`` stay as they are.

    For every text that may carry what a user, a file or another program wrote: control characters, marks that turn the
    direction of writing and halves of characters come along in names.
    """
    text = str(text)
    if text.isprintable():
        return text
    from json import dumps

    return "".join(c if c.isprintable() or c in kept else dumps(c)[1:-1] for c in text)


def brief(value: object) -> str:
    """A value as it is found in a file, cut where it is long: a sentence holds no whole file."""
    from reprlib import Repr

    short = Repr()
    short.maxstring = short.maxother = 60
    short.maxdict, short.maxlevel = 4, 3
    return short.repr(value)


class BagError(RigError):
    """A bag that cannot be read, with the offset of the damage and a hint what to do."""


class Terminated(KeyboardInterrupt):
    """SIGTERM: it ends what a verb does as Ctrl-C does."""


def ended_by(stop: KeyboardInterrupt) -> tuple[str, int]:
    """What ended it, and the exit code of that."""
    reason = TERMINATED if isinstance(stop, Terminated) else INTERRUPTED
    return reason, interrupted_code(reason)


def interrupted_code(reason: str) -> int:
    """Exit code of a run that was interrupted for one of the two reasons above."""
    return 128 + (signal.SIGTERM if reason == TERMINATED else signal.SIGINT)


class DiskFull(RigError):
    """A disk, a quota or a limit took no more of what had begun well."""

    exit_code = 1


def not_written(what: str | Path, error: OSError, kept: str = "") -> RigError:
    """That a file cannot be written, and why; kept: what is there of it all the same."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    why = "disk full" if full else error.strerror or error
    kind = DiskFull if full or error.errno == errno.EFBIG else RigError
    return kind(f"{what} cannot be written ({why}){f'; {kept}' if kept else ''}")
