# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node graph as processes: domain, start, watch and end; `rig run` and the tests use it. It imports no ROS."""
