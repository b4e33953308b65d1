# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Print the nodes that send /rig/state in the ROS domain of the environment, one on each line, and end.

controllers.ros.domain starts it as a separate process before a rig or a replay begins. A rig that no socket of this host shows,
such as one in another container of the same network, is visible over DDS only.
"""

import sys
import time

import rclpy
from rclpy.signals import SignalHandlerOptions

STATE = "/rig/state"
NAMELESS = "_NODE_NAME_UNKNOWN_"
LOOK = 3.0  # s in which nodes find each other: time for two announcements, of which one may be lost
NAMED = 10.0  # s in which a node that was found has its name, on a busy machine too


def main() -> int:
    """Entry point."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("look_for_rig", enable_rosout=False, start_parameter_services=False)
    began = time.monotonic()
    names = found = set()
    while not names and time.monotonic() - began < (NAMED if found else LOOK):
        rclpy.spin_once(node, timeout_sec=0.05)
        found = {info.node_name for info in node.get_publishers_info_by_topic(STATE)}
        names = found - {NAMELESS}  # a moment later it has one
    for name in sorted(names) or ["a node without a name"] * bool(found):
        print(name)
    node.destroy_node()
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
