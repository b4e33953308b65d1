# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam where shift-control code meets the rig, and its plugs (load.KINDS): one record in, one record out, one timing.

It is used by testbench.simulate, by the alfa46 process and by users' own controller files.
"""

from .load import load_controller
from .seam import ControllerFailed, ControllerInfo, ControllerInputs, ControllerOutputs, Status

__all__ = ["ControllerFailed", "ControllerInfo", "ControllerInputs", "ControllerOutputs", "Status", "load_controller"]
