# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for settings of the Alfa46: profiles and delays for an operating range, as a front of trade-offs.

Used by the verb ``tune``; docs/how_to/tune.md describes how.
"""
