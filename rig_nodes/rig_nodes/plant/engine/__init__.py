# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled engine of all rigs: records made from a rig's parts, the step, measuring, and the loop over time.

Importing it sets the folder of numba's cache before numba is loaded.
"""

from ...base import use_kernel_cache

use_kernel_cache()
