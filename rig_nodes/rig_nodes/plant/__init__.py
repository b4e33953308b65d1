# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Physics of the rig: driveline, clutches, valves, oil, motor and load, without ROS; used by the rigs, the runs and tests.

Importing it sets the folder of numba's cache before numba is loaded.
"""

import lazy_loader

from ..base import use_kernel_cache

use_kernel_cache()
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
