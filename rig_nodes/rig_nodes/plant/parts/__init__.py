# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of devices, one file for each: configuration, states, compiled steps, ports. Used by plant.engine and the rigs.

Importing it sets the folder of numba's cache before numba is loaded.
"""

from ...base import use_kernel_cache

use_kernel_cache()

from . import part as part  # noqa: E402 - the folder of the cache must be set before
