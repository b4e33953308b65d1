# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of a rig inside an FMU as bytes: a head of JSON and arrays, in the form that the rig of the same FMU has.

runs.fmu.rig_process writes and reads them. They hold no code and no object of Python, so foreign ones do no harm.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np

from ... import __version__
from ...base import RigError, sources_key

if TYPE_CHECKING:
    from ...rig import RigConfig

LENGTH = struct.Struct("<I")  # of the head [bytes]
OTHER = "the state is that of another rig or another version of rig_nodes"


def key_of(config: RigConfig) -> str:
    """Return a key of a rig and of its physics, which is the same in every process."""
    return sha256(json.dumps([__version__, sources_key(), config.as_dict()]).encode()).hexdigest()


def to_bytes(key: str, head: dict, arrays: Sequence[np.ndarray]) -> bytes:
    """Return a state as bytes.

    Parameters
    ----------
    key : str
        As :func:`key_of` returns it.
    head : dict
        Numbers and texts.
    arrays : sequence of array
        Numbers or records, of any shapes.

    Returns
    -------
    bytes
        What :func:`from_bytes` reads.
    """
    text = json.dumps({"key": key, "head": head}).encode()
    return b"".join((LENGTH.pack(len(text)), text, *(array.tobytes() for array in arrays)))


def from_bytes(key: str, data: bytes) -> tuple[dict, bytes]:
    """Return the head of a state and the bytes of its arrays.

    Parameters
    ----------
    key : str
        As :func:`key_of` returns it.
    data : bytes
        What :func:`to_bytes` returned.

    Raises
    ------
    RigError
        When the state is that of another rig or version.
    """
    end = LENGTH.size + LENGTH.unpack_from(data)[0] if len(data) >= LENGTH.size else 0
    try:
        found = json.loads(data[LENGTH.size : end])
        if found["key"] == key:
            return found["head"], data[end:]
    except (ValueError, TypeError, KeyError):
        pass
    raise RigError(OTHER)


def arrays_like(arrays: Sequence[np.ndarray], data: bytes) -> list[np.ndarray]:
    """Return arrays of the shapes and types of others from their bytes; RigError when their number of bytes is another."""
    if sum(array.nbytes for array in arrays) != len(data):
        raise RigError(OTHER)
    out, place = [], 0
    for array in arrays:
        out.append(np.frombuffer(data, array.dtype, array.size, place).reshape(array.shape))
        place += array.nbytes
    return out
