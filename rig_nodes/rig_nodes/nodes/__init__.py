# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: they only translate between topics and the rig, the shift controller, the sequence and the bag.

The processes are rig_container (one node per device), alfa46, sequencer and recorder; nodes.processes.supervisor starts all of
them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
