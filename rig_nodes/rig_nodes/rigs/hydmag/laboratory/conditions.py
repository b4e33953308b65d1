# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The conditions under which the laboratory measured, by name: a target names those that its records must have."""

# name -> what the condition takes: a dimension, one of some words, or whole numbers
CONDITIONS = {
    "shift": ("I-II", "II-I"),
    "n_wej": "angular velocity",
    "n_wyj": "angular velocity",
    "m_wyj": "torque",
    "t12": "time",
    "t21": "time",
    "series": int,
    "valve": ("ZR-P1", "ZR-P2"),
    "clutch": ("S1", "S2"),
    "side": ("driving", "driven"),
    "phase": ("before", "shift", "fill", "after contact"),
    "source": ("measured", "simulated"),
    "ring": ("80x115", "80x101.9", "65x115", "46x88.9", "50x76"),
    "thickness": "length",
    "surfaces": int,
    "model": ("thesis", "osinski", "traditional"),
    "pressure": "pressure",
    "time": "time",
    "inertia": "inertia",
}
