# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages that an extra of rig_nodes installs, loaded when they are used; everything that needs such a package asks here."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import RigError

if TYPE_CHECKING:
    from types import ModuleType


def optional(module: str, extra: str) -> ModuleType:
    """Load a module of an optional package.

    Parameters
    ----------
    module : str
        Its name in Python, e.g. ``"matplotlib.figure"``.
    extra : str
        The extra of rig_nodes that installs its package.

    Returns
    -------
    ModuleType
        The module.

    Raises
    ------
    RigError
        When it cannot be loaded; the sentence names the extra.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and (error.name or module).partition(".")[0] == package
        why = "is not installed" if missing else f"cannot be loaded ({error})"
        raise RigError(f"{package} {why}; pip install 'rig_nodes[{extra}]'") from None
