# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The conditions under which the laboratory measured, by name; runs.procedure and validation use them.

A series of a procedure is run under some of them, and a target names those that its records must have.
"""

from .transmission import transmission_of

# name -> what the condition takes: a dimension, one of some words, or whole numbers
CONDITIONS = {
    "shift": tuple(transmission_of().ways()),
    "n_wej": "angular velocity",
    "n_wyj": "angular velocity",
    "m_wyj": "torque",
    "t12": "time",
    "t21": "time",
    "series": int,
    "valve": tuple(clutch.valve_name for clutch in transmission_of().clutches),
    "clutch": tuple(clutch.name for clutch in transmission_of().clutches),
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
