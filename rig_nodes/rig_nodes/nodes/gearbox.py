# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the gearbox: the state of its shafts out; it is moved by oil and shafts, so no command comes in."""

from .device import Device


class Gearbox(Device):
    """Publishes /gearbox/state."""

    def __init__(self, rig, commands):
        super().__init__("gearbox", commands)
