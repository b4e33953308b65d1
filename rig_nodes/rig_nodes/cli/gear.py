# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig gear GEAR``: a shift of the rig that runs, from its order to its end."""

from __future__ import annotations

from .by_hand import add_domain, running_rig

HELP = "order a gear of the rig that runs"
GEARS = {"n": 0, "neutral": 0, "0": 0, "i": 1, "1": 1, "ii": 2, "2": 2}


def add_arguments(parser) -> None:
    """The arguments of the verb."""
    parser.add_argument("gear", metavar="GEAR", help="I, II or N (neutral)")
    add_domain(parser)


def main(args) -> int:
    """0 when the gear is in; 1 when the controller refused it or the shift failed."""
    from ..errors import RigError

    if args.gear.lower() not in GEARS:
        raise RigError(f"there is no gear '{args.gear}'; expected I, II or N (neutral)")
    with running_rig(args) as rig:
        print(rig.shift(GEARS[args.gear.lower()]))
    return 0
