# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 law of alfa46.py as a ROS 2 node of its own.

``.venv/bin/python -m rig_nodes.controllers.examples.alfa46_ros [NAME]`` in one terminal,
``./rig simulate demo --controller ros:`` (ros:NAME) in another, before or after, both in the same ROS_DOMAIN_ID.
"""

import sys

from rclpy.utilities import remove_ros_args

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.examples.command import parser, run
from rig_nodes.controllers.ros.node import serve
from rig_nodes.controllers.ros.plug import checked_topics


def main() -> None:
    """Serve the controller until it is stopped."""
    given = parser(__doc__, "alfa46_ros")
    given.add_argument("name", nargs="?", type=checked_topics, default="controller")
    sys.exit(serve(Alfa46(), Alfa46.levels, given.parse_args(remove_ros_args(sys.argv)[1:]).name))


if __name__ == "__main__":
    run(main)
