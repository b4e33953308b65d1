"""The one exception of the rig that users are meant to read, and words that several refusals share.

Everything that refuses input raises it; the command line prints its sentence and ends with its exit code.
"""

from __future__ import annotations

from pathlib import Path


class RigError(Exception):
    """Bad input or an impossible request, said in one sentence: what, where, what would be right."""

    exit_code = 2


def no_file(path: str | Path) -> str:
    """Why there is no file to read under this name, for a sentence that begins with the name."""
    return "it is a folder, expected a file" if Path(path).is_dir() else "there is no such file"


class BagError(RigError):
    """A bag that cannot be read, with the offset of the damage and a hint what to do."""
