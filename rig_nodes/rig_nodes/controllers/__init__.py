# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam where shift-control code meets the rig, and its plugs (load.KINDS): one record in, one record out, one timing.

It is used by runs.simulate, by the alfa46 process and by users' own controller files.
"""

from typing import TYPE_CHECKING, Any

from .seam import ControllerFailed, ControllerInfo, ControllerInputs, ControllerOutputs, Status

if TYPE_CHECKING:
    from .load import load_controller

__all__ = ["ControllerFailed", "ControllerInfo", "ControllerInputs", "ControllerOutputs", "Status", "load_controller"]


def __getattr__(name: str) -> Any:
    """Import the maker of plugs when it is first used: it brings the whole rig, which a user's controller does without."""
    if name != "load_controller":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .load import load_controller

    return load_controller
