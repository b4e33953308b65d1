"""The transducers' table: noise, range and resolution of each channel, and the noise as it is set while the rig runs.

Owned by testbench.rig; the kernel reads ``table``, which is changed in place.
"""

from __future__ import annotations

import numpy as np

from ..config.schema import limits
from ..errors import RigError
from ..plant import kernel
from .configuration import InstrumentsConfig

# field of InstrumentsConfig with the noise of each channel; the thermometer has none
NOISE_FIELDS = {
    "M_wej": "torque_noise", "n_wej": "speed_noise", "M_wyj": "torque_noise", "n_wyj": "speed_noise",
    "p1": "p1_noise", "p2": "p2_noise", "p_po": "p_po_noise", "I_zr_p1": "current_noise",
    "I_zr_p2": "current_noise", "p_p": "p1_noise",
}
SIGNED = ("torque_noise",)


class Gauges:
    """``table`` (4, channels): rows NOISE, LOW, HIGH, QUANTUM of kernel.measure, SI."""

    def __init__(self, config: InstrumentsConfig):
        rows = []
        for name in kernel.CHANNELS:
            if name in kernel.SIGNALS:
                rows.append((0.0, 0.0, 1.0, 0.0))
                continue
            field = NOISE_FIELDS.get(name)
            noise = getattr(config, field) if field else 0.0
            high = getattr(config, field.replace("_noise", "_range")) if field else config.temperature_range
            low = -high if field in SIGNED else 0.0
            rows.append((noise, low, high, (high - low) / 2.0**config.resolution_bits))
        self.table = np.ascontiguousarray(np.array(rows).T)
        self.on = True
        self._noise = self.table[kernel.NOISE].copy()

    def switch(self, on: bool) -> None:
        """All noise on, at the levels that are set, or off."""
        self.on = on
        self.table[kernel.NOISE] = self._noise if on else 0.0

    def set_noise(self, channel: str, value: float) -> None:
        """Standard deviation of one channel [SI]; RigError when there is no such channel or it is out of range."""
        low, high = noise_limits(channel)
        if not low <= value <= high:
            raise RigError(f"noise of {channel} of {value:g} refused; expected {low:g} to {high:g}")
        self._noise[kernel.CHANNELS.index(channel)] = value
        self.switch(self.on)

    def noise(self, channel: str) -> float:
        """Standard deviation that is set, switched on or not [SI]."""
        return float(self._noise[kernel.CHANNELS.index(channel)])

    def effective(self, channel: str) -> float:
        """Standard deviation that acts [SI]."""
        return float(self.table[kernel.NOISE, kernel.CHANNELS.index(channel)])


def noise_limits(channel: str) -> tuple[float, float]:
    """Lowest and highest noise of a channel [SI]; RigError names the channels that have one."""
    if channel not in NOISE_FIELDS:
        raise RigError(f"'{channel}' has no noise to set; known are {', '.join(NOISE_FIELDS)}")
    return limits(InstrumentsConfig, NOISE_FIELDS[channel])
