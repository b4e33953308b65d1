# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: thin translators between topics and the rig, the shift controller, the sequence and the bag.

Processes: rig_container (one node per device), alfa46, sequencer, recorder; graph.supervisor starts them all.
"""
