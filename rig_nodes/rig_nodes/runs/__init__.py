# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig in time: the lockstep rig, its outputs, test sequences, measuring procedures, the rig as an FMU."""
