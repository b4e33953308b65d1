# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the clutch oil supply: pressure and temperature out, relief setting in."""

from ..catalogue import catalogue
from ..config.schema import limits
from .device import Device
from .settings import DeviceSettings, Knob, Setting, setpoint_knobs


class OilSupply(Device):
    """Publishes /oil_supply/*, takes /oil_supply/command (relief pressure in Pa, gauge); the same as parameters."""

    def __init__(self, rig, commands):
        super().__init__("oil_supply", commands)
        self.on_setpoint("/oil_supply/command", rig.set_oil)
        signal = catalogue().signal("p_p")
        knobs = setpoint_knobs(
            rig.oil, "setting", rig.set_oil, "pressure",
            "Setting of the relief valve of the clutch oil supply, gauge", signal.unit, (signal.low, signal.high))

        def temperature() -> float:
            return rig.config.oil_supply.temperature

        setting = Setting("temperature", "Temperature of the clutch oil", temperature(),
                          catalogue().signal("T_oil").unit, limits(type(rig.config.oil_supply), "temperature"))
        knobs.append(Knob(setting, temperature, lambda value: rig.set_value("oil_supply.temperature", value)))
        self.settings = DeviceSettings(self, commands, knobs)
