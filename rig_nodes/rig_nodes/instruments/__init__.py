# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transducers and loggers of the laboratory.

Importing it loads numba, with its cache in a folder of its own.
"""

from ..compiled import load_numba

load_numba()
