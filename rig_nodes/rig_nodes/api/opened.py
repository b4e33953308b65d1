# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs, bags and loggers' files opened from Python; it is ``rig_nodes.open``."""

from __future__ import annotations

from pathlib import Path

from ..bags import OpenedBags
from .run import Run


def open(path: str | Path) -> Run:
    """Open a run.

    Parameters
    ----------
    path : str or Path
        Folder of a run, or a bag's file.

    Returns
    -------
    Run
        The run.

    Raises
    ------
    RigError
        When there is no such file, or it cannot be read.
    """
    with OpenedBags([path]) as bags:
        bags.check_began()
    return Run(Path(path))
