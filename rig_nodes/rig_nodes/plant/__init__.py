# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Physics of the rig: driveline, clutches, valves, oil, motor, load. No ROS; imported by testbench and tests.

Importing it loads numba, with its cache in a folder of its own.
"""

from ..compiled import load_numba

load_numba()
