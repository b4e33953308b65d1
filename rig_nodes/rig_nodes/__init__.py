# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG virtual powertrain test rig as ROS 2 nodes; see docs/background/architecture.md for the walls."""

__version__ = "0.1.0"
