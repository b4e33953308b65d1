# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the DC motor with its speed drive: torque and speed of shaft w0 out, speed setpoint in."""

from ..catalogue import catalogue
from ..testbench.timed import RigStatus
from .device import Device
from .settings import DeviceSettings, setpoint_knobs


class Motor(Device):
    """Publishes /motor/*, takes /motor/command (speed in rad/s); the same as parameters."""

    def __init__(self, rig, commands):
        super().__init__("motor", commands)
        self.on_drive("/motor/command", rig)

        def why_not(enable: bool) -> str | None:
            if enable and rig.status == RigStatus.TRIPPED:
                return f"enabled refused: the rig is tripped ({rig.reason}); call /rig/reset first"
            return None

        signal = catalogue().signal("n_wej")
        self.settings = DeviceSettings(self, commands, setpoint_knobs(
            rig.motor, "target", rig.set_motor, "speed", "Speed that the drive is asked for", signal.unit,
            (signal.low, signal.high), why_not))
