# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller of your own over UDP: the law of my_law.py, answering each sample of the rig.

It needs rig_udp.py beside it and any Python 3.8 or newer, on this machine or another.
"""

import sys

from my_law import MyController
from rig_udp import rig_address, serve

if __name__ == "__main__":
    try:
        serve(MyController(), *rig_address(sys.argv[1:]), levels=("current",))  # setpoints in A; "duty" would be 0 to 1
    except KeyboardInterrupt:
        sys.exit(130)
