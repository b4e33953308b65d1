# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs as files of other tools, and files of other loggers as runs: CSV, Parquet, MDF4 and MAT.

The verbs ``export``, ``import`` and ``compare`` use it.
"""
