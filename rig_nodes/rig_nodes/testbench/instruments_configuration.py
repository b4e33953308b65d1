# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration of the gearbox rig's transducers; used by testbench.configuration and testbench.gauges."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.schema import param


@dataclass(frozen=True)
class InstrumentsConfig:
    """Of each transducer: noise (standard deviation), range, class (largest error as a share of the range, (7.1)),
    amplitude of the hum, height of the coil pulses that it picks up; 0 leaves a part out.

    speed_step: what an encoder resolves, speed_gate: time in which its pulses are counted. temperature_offset and
    _gain: of (7.2). anti_alias: corner frequency of the low pass. resolution_bits: of the range, of analog channels.
    """

    torque_noise: float = param("torque", 0.0, 100.0)
    torque_range: float = param("torque", 1.0, 1e5)
    torque_class: float = param("ratio", 0.0, 0.1)
    torque_hum: float = param("torque", 0.0, 100.0)
    speed_noise: float = param("angular velocity", 0.0, 100.0)
    speed_range: float = param("angular velocity", 1.0, 1e5)
    speed_step: float = param("angular velocity", 0.0, 10.0)
    speed_gate: float = param("time", 1e-6, 0.1)
    p1_noise: float = param("pressure", 0.0, 1e6)
    p1_range: float = param("pressure", 1e5, 1e9)
    p1_class: float = param("ratio", 0.0, 0.1)
    p1_hum: float = param("pressure", 0.0, 1e6)
    p1_pickup: float = param("pressure", 0.0, 1e6)
    p2_noise: float = param("pressure", 0.0, 1e6)
    p2_range: float = param("pressure", 1e5, 1e9)
    p2_class: float = param("ratio", 0.0, 0.1)
    p2_hum: float = param("pressure", 0.0, 1e6)
    p2_pickup: float = param("pressure", 0.0, 1e6)
    p_po_noise: float = param("pressure", 0.0, 1e7)
    p_po_range: float = param("pressure", 1e5, 1e9)
    p_po_class: float = param("ratio", 0.0, 0.1)
    current_noise: float = param("current", 0.0, 0.1)
    current_range: float = param("current", 0.1, 100.0)
    temperature_range: float = param("temperature", 1.0, 1e3)
    temperature_offset: float = param("temperature", 0.0, 10.0)
    temperature_gain: float = param("ratio", 0.0, 0.1)
    hum_frequency: float = param("frequency", 1.0, 1e3)
    anti_alias: float = param("frequency", 0.0, 1e5)
    resolution_bits: float = param("ratio", 0.0, 32.0)
