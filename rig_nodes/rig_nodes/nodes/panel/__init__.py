# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page: a process that translates between the ROS graph of a running rig and browsers."""
