# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node graph as processes: domain, start, watch and end; used by `rig run` and by the tests. No ROS in here."""
