# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write a file whole or not at all.

It is used by what writes to a place that its user names (`rig export`, FMUs, layouts), bags, sweeps and tuner. An older file of
the same name stays until the new one is on the disk.
"""

from __future__ import annotations

import os
from pathlib import Path

from .errors import not_written

MAKER = "rig_nodes"  # stands in files that the rig makes, so that a later one may replace them


def atomic_write(target: Path, data: bytes | str) -> None:
    """Write a file, which replaces an older one only when all of it is written.

    Parameters
    ----------
    target : Path
        The file.
    data : bytes or str
        Its content; text is written as UTF-8.

    Raises
    ------
    RigError
        When the file cannot be written.
    """
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        try:
            part.write_bytes(data.encode() if isinstance(data, str) else data)
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise not_written(f"{target}: it", error) from None
