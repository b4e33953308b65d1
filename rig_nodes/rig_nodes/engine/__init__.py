# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled engine under all rigs: records made from a rig's parts, the step, measuring, the loop over time.

Importing it points numba's cache at a folder of its own before numba is loaded.
"""

from ..compiled import use_kernel_cache

use_kernel_cache()
