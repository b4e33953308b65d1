# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The results with which a rig is compared: the laboratory's printed ones and the rows of a rig's own folder.

Used by the verbs `validate` and `calibrate`. targets.yaml of rigs/hydmag has the laboratory's rows, targets.py reads and checks
them; validation.yaml of any rig has its own rows, which own_rows.py reads.
"""
