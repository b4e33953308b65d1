# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of one wet multi-plate clutch, S1 or S2: cylinder pressure and state out."""

from .device import Device


class Clutch(Device):
    """Publishes /clutch_s1/* or /clutch_s2/*. index: 1 or 2."""

    def __init__(self, index, commands):
        super().__init__(f"clutch_s{index}", commands)
