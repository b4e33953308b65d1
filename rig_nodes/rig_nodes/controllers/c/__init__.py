# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controllers in C: a library of the user in a process of its own."""
