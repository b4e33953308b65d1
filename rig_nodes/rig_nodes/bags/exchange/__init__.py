# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Export of runs to files of other tools, and import of other loggers' files as runs: CSV, Parquet, MDF, MAT, xlsx, TDMS.

The verbs ``export``, ``import`` and ``compare`` use it.
"""
