# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the load: output torque, speed and line pressure out, relief setting in."""

from ..catalogue import catalogue
from .device import Device
from .settings import DeviceSettings, setpoint_knobs


class LoadPump(Device):
    """Publishes /load_pump/*, takes /load_pump/command (relief pressure in Pa, gauge); the same as parameters."""

    def __init__(self, rig, commands):
        super().__init__("load_pump", commands)
        self.on_setpoint("/load_pump/command", rig.set_load)
        signal = catalogue().signal("p_po")
        self.settings = DeviceSettings(self, commands, setpoint_knobs(
            rig.load, "setting", rig.set_load, "relief_pressure",
            "Setting of the relief valve in the pump's pressure line, gauge", signal.unit, (signal.low, signal.high)))
