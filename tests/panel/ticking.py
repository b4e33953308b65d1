# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How many ticks begin late on a core at a priority above the rig's: what the machine alone does to a rig in real time.

test_soak.py starts one for each core; it prints the number once its input ends.
"""

import os
import select
import sys
import time
from contextlib import suppress

PERIOD = 0.005  # s, a tick of the graph
PRIORITY = 50  # the rig's processes have 9 and 10


def late_ticks(core: int) -> int:
    """Returns how many ticks until the end of the input began more than one tick late."""
    os.sched_setaffinity(0, {core})
    with suppress(OSError):  # this user may have no real-time priority, and then neither has the rig
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    late, due = 0, time.monotonic()
    while not select.select([sys.stdin], [], [], max(0.0, due - time.monotonic()))[0]:
        late += time.monotonic() - due > PERIOD
        due += PERIOD
    return late


if __name__ == "__main__":
    print(late_ticks(int(sys.argv[1])))
