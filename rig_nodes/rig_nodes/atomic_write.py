# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes a file whole or not at all; used by what writes where its user says (`rig export`, FMUs, layouts), bags, sweeps
and tuner.

A name that stands for an older file keeps that one until the new one is on the disk.
"""

from __future__ import annotations

import os
from pathlib import Path

from .errors import not_written


def atomic_write(target: Path, data: bytes | str) -> None:
    """``data``, text as UTF-8, as the file ``target``, which is replaced only by all of it; RigError when it cannot be written."""
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        try:
            part.write_bytes(data.encode() if isinstance(data, str) else data)
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise not_written(f"{target}: it", error) from None
