# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The shift controller Alfa46: valve profiles with delays and the current loop.

Importing it loads numba, with its cache in a folder of its own.
"""

from ..compiled import load_numba

load_numba()
