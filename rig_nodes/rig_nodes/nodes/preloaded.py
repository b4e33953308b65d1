# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all processes of the graph have in memory when they begin; the server from which they are forked makes it once.

Only that server imports it (nodes.processes.child.start_server). Whatever is missing here costs each process its own time, when the
rig's time may run already.
"""

import gc
from importlib import import_module

from rclpy.type_support import check_for_type_support

from ..bags import installed
from ..rig import installed_topics
from . import alfa46, recorder, rig_container, sequencer  # noqa: F401  loaded, to be there in all of them
from .message_class import message_class

SERVICES = ("rcl_interfaces.srv", "std_srvs.srv", "type_description_interfaces.srv", "rig_msgs.srv", "rig_msgs.action")

for _type in {topic.ros_type for topic in installed_topics().values()}:
    check_for_type_support(message_class(_type))
    _definition = installed(_type)
    _definition.store.get_msgdef(_type)  # makes the functions that decode it
for _name in SERVICES:
    for _class in vars(import_module(_name)).values():
        if isinstance(_class, type):
            check_for_type_support(_class)
gc.collect()
gc.freeze()  # a collection in a process would touch, and so copy, what it shares with the others
