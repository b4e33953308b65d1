# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reads MAT files as channels; exchange.foreign calls it for the ending of MAT."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import RigError
from .files import TIME
from .foreign import Channel, Foreign
from .provenance import KEY, read_provenance
from .units import split_head

if TYPE_CHECKING:
    from ..arrays import Floats


def read_matlab(path: Path) -> Foreign:
    """Read a MAT file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Foreign
        Its channels.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        found = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise RigError(f"{path}: is a MAT file of version 7.3, expected one of version 5 to 7; save it with '-v7'") from None
    except (MatReadError, ValueError, TypeError, KeyError) as error:
        raise RigError(f"{path}: cannot be read as a MAT file ({str(error).splitlines()[0]})") from None
    own = found.get(KEY.replace(".", "_"))
    provenance = read_provenance(own.get("json")) if isinstance(own, dict) else None
    channels = []
    for name, value in found.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            channels += _of_struct(value)
        elif (column := _vector(value)) is not None:
            channels.append(Channel(name, *split_head(name), column))
    if not channels:
        raise RigError(f"{path}: holds no vector of numbers and no struct of such vectors")
    return Foreign(path, channels, provenance=provenance)


def _of_struct(struct: dict) -> list[Channel]:
    """Return the vectors of a struct, with the times of the one that is named t or time, if they fit."""
    vectors = {name: column for name, value in struct.items() if (column := _vector(value)) is not None}
    units, names = (struct.get(one) if isinstance(struct.get(one), dict) else {} for one in ("units", "names"))
    times = next((vectors.pop(name) for name in (TIME, "time", "Time") if name in vectors), None)
    out = []
    for name, column in vectors.items():
        plain, unit = split_head(name)
        stated = units.get(name)
        own = times if times is not None and len(times) == len(column) else None
        out.append(
            Channel(
                str(names.get(name, name)), str(names.get(name, plain if not stated else name)), str(stated or unit), column, own
            )
        )
    return out


def _vector(value: object) -> Floats | None:
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim == 1 and len(value) > 1:
        return value.astype(float)
    return None
