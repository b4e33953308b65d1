# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many members of one sequence, each with other parameters: what varies, how the members are run, where results are kept.

The verb ``sweep`` uses it; docs/how_to/sweep.md describes it.
"""
