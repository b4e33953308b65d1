# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig device NAME``: one device in a separate process, for a rig whose plant leaves this device out."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from .shared_arguments import add_rig, add_set

if TYPE_CHECKING:
    import argparse

HELP = "start a device of its own, for a rig with source: topic"
NEEDS = ("ros",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("name", help="a device of the rig, e.g. motor")
    parser.add_argument(
        "--domain", type=int, metavar="N", help="ROS domain of the rig, which `rig run` prints (default: ROS_DOMAIN_ID)"
    )
    add_rig(parser)
    add_set(parser, "change one value of the device, as for run")


def main(args: argparse.Namespace) -> int:
    """Check the arguments, then become the node's process, so that signals reach only the node."""
    from ..base import RigError
    from ..controllers import environment, from_environment, numbered
    from ..plant import check_device
    from ..rig import load_rig
    from ..runs import parse_settings

    check_device(load_rig(args.rig, parse_settings(args.settings)).structure, args.name)
    if args.domain is None:
        if not os.environ.get("ROS_DOMAIN_ID"):
            raise RigError("which rig? give --domain N with the number that `rig run` prints, or set ROS_DOMAIN_ID")
        domain = from_environment()
    else:
        domain = numbered(args.domain)
    command = [sys.executable, "-P", "-m", "rig_nodes.nodes.cut_device", args.name, "--rig", args.rig]
    for text in args.settings:
        command += ["--set", text]
    sys.stdout.flush()
    os.execve(sys.executable, command, environment(domain))
