# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller of your own as a ROS 2 node: the law of my_law.py, answering each sample of the rig.

It needs rig_ros.py beside it, and a Python with rclpy and rig_msgs: the rig's own Python, or the Python of a ROS 2 installation
with the rig's workspace.
"""

import sys

from my_law import MyController
from rig_ros import serve

if __name__ == "__main__":
    sys.exit(serve(MyController(), levels=("current",)))  # setpoints in A; "duty" would be 0 to 1
