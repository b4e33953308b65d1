# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The packages that read and write other tools' files; readers and writers here load them only when such a file is asked for.

They are in requirements.lock. Beside a system ROS 2 they are optional, and most of them there have to fit its numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError

if TYPE_CHECKING:
    from types import ModuleType

NAMES = {"nptdms": "npTDMS"}  # names in package indexes, where they are others than in Python


def needed(name: str, what: str) -> ModuleType:
    """Load a package.

    Parameters
    ----------
    name : str
        Its name in Python.
    what : str
        What needs it, as the beginning of a sentence.

    Returns
    -------
    ModuleType
        The package.

    Raises
    ------
    RigError
        When it cannot be loaded, with the remedy.
    """
    try:
        return import_module(name)
    except ImportError as error:
        numpy = " 'numpy<2'" if np.__version__.startswith("1.") else ""
        command = f"python -m pip install {NAMES.get(name, name)}{numpy}"
        missing = isinstance(error, ModuleNotFoundError) and (error.name or name).partition(".")[0] == name
        why = "is not installed" if missing else f"cannot be loaded ({error})"
        raise RigError(f"{what} needs the package {NAMES.get(name, name)}, which {why}; '{command}' installs it") from None
