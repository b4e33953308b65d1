# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many members of one sequence, each with other parameters: what varies, how it is run, where results are kept.

Used by the verb ``sweep``; docs/how_to/sweep.md says how.
"""
