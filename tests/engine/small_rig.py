# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the small rigs of the engine's tests share: a motor on the body engine, and its speed."""

HEAD = """step: [100 us, "assumed"]
parts:
  motor: {part: dc_motor, body: engine, torque_limit: [50 Nm, x], braking_limit: [20 Nm, x], power_limit: [10 kW, x],
    torque_time: [3.3 ms, x], speed_gain: [1 Nm s/rad, x], speed_gain_integral: [20 Nm/rad, x], ramp: [5000 rpm/s, x]}
transducers:
  n_in: {type: speed, shows: engine.speed, at: motor, range: [0 rpm, 9000 rpm], text: Speed of the engine.}
instruments: {speed_noise: [0.01 rad/s, x], speed_range: [9000 rpm, x], speed_gate: [2 ms, x], hum_frequency: [50 Hz, x]}
"""
