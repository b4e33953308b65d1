# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: they only translate between topics and the rig, the shift controller, the sequence and the bag.

The processes are rig_container (one node per device), alfa46, sequencer and recorder; nodes.processes.supervisor starts all of
them.
"""
