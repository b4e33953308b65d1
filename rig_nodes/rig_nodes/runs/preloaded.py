# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the server of runs.workers imports, so that each process forked from it has the plants compiled in memory.

The environment names the rigs, because a server imports modules and takes no arguments. What is not in the cache yet is compiled
here, so that no two processes compile the same at once; ``rig test`` runs it for that purpose.
"""

import json
import os
from contextlib import suppress

from ..base import RigError
from ..rig import load_rig
from .rig import Rig
from .workers import RIGS_PRELOADED

for _name in json.loads(os.environ.get(RIGS_PRELOADED, "[]")):
    with suppress(RigError):  # who named the rig reads it too, and says what is wrong
        Rig(load_rig(_name)).advance_samples(1)
