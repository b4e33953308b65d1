# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transducers and loggers of the laboratory.

Importing it sets the folder of numba's cache before numba is loaded.
"""

from ...base import use_kernel_cache

use_kernel_cache()
