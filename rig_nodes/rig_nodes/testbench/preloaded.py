# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the server of testbench.workers imports: each process forked from it has both plants compiled and in memory.

It compiles where nothing is cached yet, so that of several processes none does it beside another; ``rig test`` runs it
for that.
"""

from .configuration import load_rig
from .rig import Rig

for _name in ("hydmag", "clutch_bench"):
    Rig(load_rig(_name)).advance_samples(1)
