# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of devices, one file each: configuration, states, compiled steps, ports. Read by engine/ and the rigs.

Importing it loads numba, with its cache in a folder of its own.
"""

from ..compiled import load_numba

load_numba()
