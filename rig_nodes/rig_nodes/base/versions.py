# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Versions of installed packages, by which content that is kept between processes is recognised as outdated.

compiled, config and bags use it, at every start of a command that computes or reads a run.
"""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from functools import cache


def version_of(package: str) -> str:
    """Return the version of an installed package, by the name of the folder that describes it.

    importlib.metadata reads that folder's files; with all that it loads this takes some 20 ms.

    Parameters
    ----------
    package : str
        Name of the package as it is installed.

    Returns
    -------
    str
        The version.

    Raises
    ------
    importlib.metadata.PackageNotFoundError
        When it is not installed.
    """
    if found := _named().get(_name(package)):
        return found
    from importlib.metadata import version  # a package may be described in another way, as Debian's are

    return version(package)


@cache
def _named() -> dict[str, str]:
    """The version of each package that a folder describes, by its name; of several the first on the path of imports counts."""
    out: dict[str, str] = {}
    for folder in sys.path:
        with suppress(OSError):
            for entry in os.listdir(folder or os.curdir):
                if entry.endswith(".dist-info"):
                    name, _, version = entry.removesuffix(".dist-info").rpartition("-")
                    out.setdefault(_name(name), version)
    return out


def _name(package: str) -> str:
    return re.sub(r"[-_.]+", "_", package).lower()
