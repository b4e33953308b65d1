# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig reset``: the running rig leaves its safe state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .by_hand import add_domain, running_rig

if TYPE_CHECKING:
    import argparse

HELP = "leave the safe state of the rig that runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_domain(parser)


def main(args: argparse.Namespace) -> int:
    """Reset the rig; return 0 when it has left the safe state, 1 when it was not in it."""
    with running_rig(args) as rig:
        print(rig.trigger("/rig/reset"))
    return 0
