# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`python -m rig_nodes` is the `rig` command; the launcher and the benchmark start it so."""

import gc
import sys

from rig_nodes.cli.main import main

if __name__ == "__main__":
    gc.set_threshold(500_000)  # loaded objects stay in use; examining them again and again would cost 0.1 s at the start
    exit_code = main()
    gc.freeze()  # and 0.2 s at the exit
    sys.exit(exit_code)
