# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads that people give as a torque: the page has it beside the setting of the relief valve, which makes it at the present speed.

nodes.panel.description finds them.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from ...base import RigError
from ...plant import load_torque, most_torque, relief_setting_for
from ...rig import Setting

if TYPE_CHECKING:
    from ...rig import RigConfig
    from .tracks import Tracks

FINEST = 1  # decimals of a torque [Nm] that is told, so that the noise of the speed is not


class Load:
    """The torque of a load.

    Attributes
    ----------
    torque, relief : Setting
        The torque, which only the page has, and the setting of the relief valve.
    speed : str
        Signal of the speed by which the torque depends on the setting.
    """

    def __init__(self, config: RigConfig, relief: Setting) -> None:
        assert relief.setpoint is not None
        self._values, output = config.values(relief.setpoint.device), config.structure.output
        self.relief, self.speed = relief, config.structure.speed_of_load(relief.setpoint.device)
        known, most = config.catalogue.signals, most_torque(self._values)
        self._scale = known[self.speed].scale
        most = most if output is None else min(known[output.torque].high, most)
        text = f"Torque of the load at the present {self.speed}"
        self.torque = Setting(f"{relief.owner}.torque", text, "torque", 0.0, most, live=True, setpoint=relief.setpoint)

    def relief_for(self, torque: float, tracks: Tracks) -> float:
        """Return the setting [Pa] for a torque [Nm] at the newest speed; RigError when the valve cannot be set so high."""
        setting = relief_setting_for(torque, self._newest(tracks), self._values)
        if setting > self.relief.high:
            most = load_torque(self.relief.high, self._newest(tracks), self._values)
            raise RigError(
                f"{self.torque.name} of {torque:g} Nm is too much for the relief valve; at this speed up to {most:.4g} Nm"
            )
        return setting

    def torque_of(self, relief: float, tracks: Tracks) -> float:
        """Return the torque [Nm] of a setting [Pa] at the newest speed, as it is told."""
        return round(load_torque(relief, self._newest(tracks), self._values), FINEST)

    def _newest(self, tracks: Tracks) -> float:
        """Speed [rad/s], 0 before the first."""
        return (tracks.latest(self.speed) or 0.0) / self._scale


def loads_of(config: RigConfig) -> dict[str, Load]:
    """Return the loads of a rig by the names of their torques: what takes a torque in a sequence."""
    reliefs = [one for one in config.settings.steps.values() if "torque" in one.setpoint.command.takes and one.live]
    found: dict[str, Load] = {}
    for one in reliefs:
        with suppress(RigError):  # nothing measures the speed by which its torque depends on its setting
            load = None if one.lacking else Load(config, one)
            found |= {load.torque.name: load} if load else {}
    return found
