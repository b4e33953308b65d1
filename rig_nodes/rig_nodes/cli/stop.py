# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig stop``: the orderly end of the running rig, or with --emergency its safe state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .by_hand import add_domain, running_rig

if TYPE_CHECKING:
    import argparse

PATIENCE = 60.0  # s for the end of all processes and the report
HELP = "end the rig that runs, or with --emergency only stop it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "--emergency",
        action="store_true",
        help="emergency stop: safe state at once; the rig stays in it, running, until `rig reset`",
    )
    add_domain(parser)


def main(args: argparse.Namespace) -> int:
    """Stop the rig; return 0 when it has ended with its report, or is in its safe state."""
    from ..base import RigError
    from ..controllers import until_free

    with running_rig(args) as rig:
        text = rig.trigger("/rig/e_stop" if args.emergency else "/rig/end")
        print(f"{text} (ROS domain {rig.number})", flush=True)
    if not args.emergency and not until_free(rig.number, PATIENCE):
        raise RigError(f"the rig in ROS domain {rig.number} was told to end and has not ended within {PATIENCE:g} s")
    return 0
