# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node of the measuring instruments: the 10 kHz logger, the controller's samples, mirrors in standard types."""

from functools import partial

from .device import Device
from .settings import DeviceSettings, Knob, Setting


class Instruments(Device):
    """Publishes /instruments/*; the transducers' noise as parameters."""

    def __init__(self, rig, commands):
        super().__init__("instruments", rig, commands)
        gauges = rig.gauges
        knobs = [Knob(Setting("noise", "Whether the transducers have their noise", gauges.on), lambda: gauges.on,
                      partial(rig.set_value, "instruments.noise"))]
        for channel in gauges.noisy:
            setting = Setting(f"noise.{channel}", f"Noise of {channel}, standard deviation", gauges.noise(channel),
                              self.catalogue.signal(channel).unit, gauges.noise_limits(channel))
            knobs.append(Knob(setting, partial(gauges.noise, channel),
                              partial(rig.set_value, f"instruments.{setting.name}")))
        self.settings = DeviceSettings(self, commands, knobs)
