# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the server of runs.workers imports, so that each process forked from it has both plants compiled in memory.

It compiles what is not in the cache yet, so that no two processes compile the same at once; ``rig test`` runs it for that
purpose.
"""

from ..rig.configuration import load_rig
from .rig import Rig

for _name in ("hydmag", "clutch_bench"):
    Rig(load_rig(_name)).advance_samples(1)
