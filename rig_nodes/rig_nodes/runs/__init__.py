# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench: configuration, the lockstep rig, its outputs, test sequences."""
