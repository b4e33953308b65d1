# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig gear GEAR``: a shift of the running rig, from its order to its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .by_hand import add_domain, running_rig

if TYPE_CHECKING:
    import argparse

HELP = "order a gear of the rig that runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("gear", metavar="GEAR", help="its name, e.g. I, or N (neutral)")
    add_domain(parser)


def main(args: argparse.Namespace) -> int:
    """Order a gear; return 0 when it is engaged, 1 when the controller refused it or the shift failed."""
    from ..base import RigError

    with running_rig(args) as rig:
        box = rig.transmission
        gear = box.number(args.gear)
        if gear is None:
            driving = ", ".join(box.names[number] for number in box.ratios)
            raise RigError(f"there is no gear '{args.gear}'; expected {driving} or N (neutral)")
        print(rig.shift(gear))
    return 0
