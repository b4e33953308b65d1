# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`python -m rig_nodes` is the `rig` command; the launcher and the benchmark start it so."""

import gc
import sys

from rig_nodes.cli.main import main

# Python keeps frames in pieces of 16 kB and gives each back as soon as it is empty: where a loop's calls begin a new piece, every
# call asks the system for memory, 0.1 s of a demo. A frame that asks for more than that gets a piece with room for all others.
ROOM = 40_000  # places on the stack, 8 bytes each; what is not used takes no memory


def command() -> int:
    """Run the command."""
    return main()


if __name__ == "__main__":
    command.__code__ = command.__code__.replace(co_stacksize=ROOM)
    gc.set_threshold(500_000)  # loaded objects stay in use; examining them again and again would cost 0.1 s at the start
    exit_code = command()
    gc.freeze()  # and 0.2 s at the exit
    sys.exit(exit_code)
