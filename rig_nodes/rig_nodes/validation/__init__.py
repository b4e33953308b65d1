# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's printed results and how far the rig may be from them; used by whoever judges the rig.

targets.yaml has the rows, targets.py reads and checks them; `validation/` at the top of a checkout links to
the file.
"""
