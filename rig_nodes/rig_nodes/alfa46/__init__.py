# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The shift controller Alfa46: valve profiles with delays, and the current loop.

Importing it sets the folder of numba's cache before numba is loaded.
"""

from ..compiled import use_kernel_cache

use_kernel_cache()
