# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of devices, one file for each: configuration, states, compiled steps, ports. Used by plant.engine and the rigs.

Importing it sets the folder of numba's cache before numba is loaded.
"""

from ...base.compiled import use_kernel_cache

use_kernel_cache()
