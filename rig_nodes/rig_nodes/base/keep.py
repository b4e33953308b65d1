# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Content that was read once and is kept as JSON for later processes: configuration files (config), message definitions (bags).

Kept content is never executed: at worst it is wrong, and only someone who can write to the user's own folder can make it so.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from .compiled import cache_root, own_folder

if TYPE_CHECKING:
    from pathlib import Path


def kept_folder(what: str) -> Path:
    """Return the folder of this name in which content is kept; it need not exist."""
    return cache_root().parent / what


def kept(path: Path, about: bytes, make: Callable[[], Any]) -> Any:
    """Return the content that is kept in a file, or make it and keep it.

    Parameters
    ----------
    path : Path
        The file.
    about : bytes
        Everything on which the content depends.
    make : callable
        Returns the content, which JSON can hold.

    Returns
    -------
    object
        The content.
    """
    with suppress(OSError):
        if own_folder(path.parent):
            key, _, body = path.read_bytes().partition(b"\n")
            if key == _key(about, body):  # otherwise it is damaged or outdated
                return json.loads(body)
    content = make()
    with suppress(OSError):  # without a folder that can be written, it is made each time
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if own_folder(path.parent):
            part = path.with_name(f".{path.name}.{os.getpid()}")
            body = json.dumps(content, separators=(",", ":")).encode()
            part.write_bytes(_key(about, body) + b"\n" + body)
            os.replace(part, path)
    return content


def _key(about: bytes, body: bytes) -> bytes:
    return hashlib.sha256(about + b"\0" + body).hexdigest().encode()
