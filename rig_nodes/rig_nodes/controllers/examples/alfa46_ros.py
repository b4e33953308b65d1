"""The Alfa46 law of alfa46.py as a ROS 2 node of its own.

``.venv/bin/python -m rig_nodes.controllers.examples.alfa46_ros [NAME]`` in one terminal,
``./rig simulate demo --controller ros:`` (ros:NAME) in another, before or after, both in the same ROS_DOMAIN_ID.
"""

import sys

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.ros_node import serve

if __name__ == "__main__":
    sys.exit(serve(Alfa46(), Alfa46.levels, *sys.argv[1:2]))
