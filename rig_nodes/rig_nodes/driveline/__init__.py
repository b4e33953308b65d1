# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The solver of drivelines: inertias, gears, shafts, clutches in any arrangement; it knows no rig, no ROS and no YAML.

Importing it sets the folder of numba's cache before numba is loaded.
"""

import lazy_loader

from ..base import use_kernel_cache

use_kernel_cache()
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
