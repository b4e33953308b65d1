# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common parts of the verbs that act on a running rig: the selection of the rig and the connection to it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from ..nodes import RunningRig


def add_domain(parser: argparse.ArgumentParser) -> None:
    """Add the argument that selects the rig."""
    parser.add_argument(
        "--domain",
        type=int,
        metavar="N",
        help="ROS domain of the rig, which `rig run` prints (default: ROS_DOMAIN_ID, or the only rig's of this host)",
    )


def running_rig(args: argparse.Namespace) -> RunningRig:
    """Return the rig of --domain, a context manager; RigError when there is none."""
    from ..base import need_ros
    from ..controllers import environment, of_running_rig

    domain = of_running_rig(args.domain)
    wanted = environment(domain)
    for name in set(os.environ) - set(wanted):
        del os.environ[name]
    os.environ.update(wanted)
    need_ros("a rig that runs")
    # ROS reads the environment above when it is loaded or started.
    from ..nodes import RunningRig

    return RunningRig(domain.number)
