# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of devices, one file each: configuration, states, compiled steps, ports. Read by engine/ and the rigs.

Importing it points numba's cache at a folder of its own before numba is loaded.
"""

from ..compiled import use_kernel_cache

use_kernel_cache()
