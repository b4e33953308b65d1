# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Physics of the rig: driveline, clutches, valves, oil, motor, load. No ROS; imported by testbench and tests.

Importing it points numba's cache at a folder of its own before numba is loaded.
"""

from ..compiled import use_kernel_cache

use_kernel_cache()
