# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled engine under all rigs: records made from a rig's parts, the step, measuring, the loop over time.

Importing it loads numba, with its cache in a folder of its own.
"""

from ..compiled import load_numba

load_numba()
