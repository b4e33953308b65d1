# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of one proportional pressure-reducing valve, ZR-P1 or ZR-P2: coil current and state out.

Its duty arrives with those of the other outputs in one message to the node `rig`.
"""

from .device import Device


class Valve(Device):
    """Publishes /valve_zr_p1/* or /valve_zr_p2/*. index: 1 or 2."""

    def __init__(self, index, commands):
        super().__init__(f"valve_zr_p{index}", commands)
