# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of the transducers: errors, disturbances, range and resolution of each channel, and the noise, which can change.

runs.rig_base owns it; the engine reads ``arrays``, which are changed in place.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from ..plant import GAIN, GATE, HIGH, HUM, KEEP, LOW, NOISE, OFFSET, PICKUP, QUANTUM, ROWS, STEP, TURN, channel_key, mains, uniform
from ..rig import TRANSDUCER_TYPES, measured_range

if TYPE_CHECKING:
    from ..rig import RigConfig, Transducer

DISTURBANCES = [NOISE, HUM, PICKUP]
DRAWS = 1 << 32  # number of the first channel whose random values stay the same in a run
NO_TRANSDUCER = {GAIN: 1.0, LOW: -math.inf, HIGH: math.inf}  # rows that are not 0


class Gauges:
    """The transducers of a rig, in the arrays that the engine reads.

    Parameters
    ----------
    rig : RigConfig
        The rig's configuration; ``kernel.step`` is the time of a row [s].
    seed : int
        Seed of the noise, the class errors, the phase of the mains and the places of the encoders' discs.
    channels : (n,) tuple of str
        Channels of the rig's plan.

    Attributes
    ----------
    arrays : tuple of array
        Table (rows of plant.instruments.transducers, channels), keys of the noise (channels,), hum by row, state (channels,) and
        counts (rows of the longest gate, channels).
    on : bool
        False when every channel shows its true value.
    changes : int
        How often the noise was changed.
    """

    def __init__(self, rig: RigConfig, seed: int, channels: tuple[str, ...]) -> None:
        """Fill the arrays; the class describes the parameters."""
        config, step, on = rig.instruments, rig.kernel.step, rig.effects.transducers
        self.config, self.present, self.on, self.channels = config, on, on, channels
        self.changes, size = 0, len(channels)
        self.table, self.state = np.zeros((ROWS, size)), np.zeros(size)
        for row, value in NO_TRANSDUCER.items():
            self.table[row] = value
        likes = {one.like for one in rig.structure.transducers if on and getattr(config, f"{one.like}_step", 0.0) > 0.0}
        self.gates = {like: self._gate(like, step) for like in sorted(likes)}
        self.counts = np.zeros((max(self.gates.values(), default=1), size))
        # a transducer that is not fitted leaves an open input, which shows nothing
        fitted = {one.name: one for one in rig.structure.transducers if getattr(config, f"{one.like}_fitted", True)}
        beside = {valve.wires.get("beside") for valve in rig.structure.valves}
        if on:
            for name, one in fitted.items():
                self._fill(one, name in beside, seed, step)
        absent = {one.name for one in rig.structure.transducers} - fitted.keys()
        self.table[:, [name in absent for name in channels]] = 0.0
        keys = np.array([channel_key(seed, c) for c in range(size)], np.uint64)
        hum = mains(step, config.hum_frequency, uniform(seed, DRAWS, 0))
        self.arrays = self.table, keys, hum, self.state, self.counts
        self._set = self.table[DISTURBANCES]

    def _gate(self, like: str, step: float) -> int:
        """Return the rows in the gate of the encoders with these errors."""
        gate = getattr(self.config, f"{like}_gate")
        rows = gate / step
        if abs(rows - round(rows)) > 1e-6 or rows < 0.5:
            raise RigError(
                f"instruments.{like}_gate of {gate * 1e3:g} ms is no whole number of the "
                f"plant's steps of {step * 1e6:g} us; give e.g. 2 ms"
            )
        return round(rows)

    def _fill(self, one: Transducer, beside: bool, seed: int, step: float) -> None:
        config, c, table = self.config, self.channels.index(one.name), self.table
        type_of = TRANSDUCER_TYPES[one.type]
        errors, signed = type_of.errors(), type_of.signed or one.low < 0.0

        def value(what: str) -> float:
            return getattr(config, f"{one.like}_{what}", 0.0)

        def drawn(number: int) -> float:
            return 2.0 * uniform(seed, DRAWS + 1 + c, number) - 1.0

        high = value("range")
        if "offset" in errors:
            offset, gain = value("offset"), value("gain")
        else:
            offset = gain = 0.5 * value("class")  # together the class, at the end of the range
            offset *= high
        table[OFFSET, c], table[GAIN, c] = offset * drawn(0), 1.0 + gain * drawn(1)
        table[LOW, c], table[HIGH, c] = measured_range(one.type, one.low, high, value("class"))
        table[NOISE, c], table[HUM, c] = value("noise"), value("hum")
        if beside:  # a valve's wire runs beside its own
            table[PICKUP, c] = value("pickup")
        if type_of.filtered and config.anti_alias > 0.0:
            table[KEEP, c] = math.exp(-2.0 * math.pi * config.anti_alias * step)
        if value("step") > 0.0:  # an encoder
            table[STEP, c] = value("step")
            table[GATE, c] = self.gates[one.like]
            table[TURN, c] = 1.0 / (value("step") * self.gates[one.like])
            self.state[c] = uniform(seed, DRAWS + 1 + c, 0)
        else:
            self.state[c] = table[OFFSET, c]
            if config.resolution_bits > 0.0:
                full = 2.0 * high if signed else high
                table[QUANTUM, c] = full / 2.0**config.resolution_bits

    def switch(self, on: bool) -> None:
        """Switch noise, hum and pickup of all channels on, with the values that are set, or off; RigError without transducers."""
        if on and not self.present:
            raise RigError("noise refused: this rig shows true values (effects.transducers is off)")
        self.on = on
        self.changes += 1
        self.table[DISTURBANCES] = self._set if on else 0.0

    def set_noise(self, channel: str, value: float) -> None:
        """Set the standard deviation of the noise of one channel [SI]."""
        self._set[0, self.channels.index(channel)] = value
        self.switch(self.on)

    @property
    def moved(self) -> tuple[np.ndarray, ...]:
        """The arrays that change in a run: what a step leaves to the next one, and what was set of the noise."""
        return self.state, self.counts, self.table, self._set

    def noise(self, channel: str) -> float:
        """Return the standard deviation that is set for a channel, whether it is switched on or not [SI]."""
        return float(self._set[0, self.channels.index(channel)])

    def effective(self, channel: str) -> float:
        """Return the standard deviation that acts on a channel [SI]."""
        return float(self.table[NOISE, self.channels.index(channel)])
