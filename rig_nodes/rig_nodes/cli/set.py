# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig set NAME VALUE``: it sets a parameter of a node of the running rig; without a value it shows the present one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .by_hand import add_domain, running_rig

if TYPE_CHECKING:
    import argparse

HELP = "set or show a value of the rig that runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="e.g. motor.speed or alfa46.t12; without it all")
    parser.add_argument(
        "value", nargs="?", metavar="VALUE", help='with its unit, e.g. "1500 rpm"; on or off; six values with commas for a profile'
    )
    add_domain(parser)


def main(args: argparse.Namespace) -> int:
    """Set or show a setting; return 0 on success, 1 when the rig refused it, with its reason."""
    from ..base import RigError

    with running_rig(args) as rig:
        if args.value is not None:
            print(f"{args.name} = {rig.set(args.name, args.value)}")
            return 0
        found = rig.settings() if args.name is None else {args.name: rig.setting(args.name)}
        if not found:
            raise RigError(f"the rig in ROS domain {rig.number} has nothing to set but its setpoint topics")
        rows = [(name, str(one), one.range(), one.setting.text) for name, one in found.items()]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())
    return 0
