# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reads MDF files as channels with their own times; exchange.foreign calls it for the endings of MDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RigError
from .foreign import Channel, Foreign
from .packages import needed
from .provenance import KEY, read_provenance
from .units import unit_of


def read_mdf(path: Path) -> Foreign:
    """Read an MDF file.

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
    package = needed("asammdf", "MDF")
    channels, provenance = [], None
    try:
        with package.MDF(path) as file:
            for number, attachment in enumerate(getattr(file, "attachments", [])):
                if attachment.file_name == f"{KEY}.json":
                    provenance = read_provenance(file.extract_attachment(number)[0])
            for group in file.virtual_groups:
                for one in file.select(
                    [(None, *place) for place in _places(file, group)], ignore_value2text_conversions=True, copy_master=False
                ):
                    values = np.asarray(one.samples)
                    if values.ndim == 1 and values.dtype.kind in "fiub" and len(values) > 1:
                        unit = unit_of(one.unit or "") or one.unit or ""
                        channels.append(Channel(one.name, one.name, unit, values.astype(float), np.asarray(one.timestamps, float)))
    except RigError:
        raise
    except Exception as error:  # the package raises many classes for files that are damaged or no MDF
        problem = f"{type(error).__name__}: {error}".strip().splitlines()[0]
        raise RigError(f"{path}: cannot be read as MDF ({problem})") from None
    if not channels:
        raise RigError(f"{path}: holds no channel of numbers")
    return Foreign(path, channels, provenance=provenance)


def _places(file: Any, group: int) -> list[tuple[int, int]]:
    """Return group and number of each channel of a group, without its times."""
    included = file.included_channels(group)[group]
    return [(number, channel) for number, found in included.items() for channel in found]
