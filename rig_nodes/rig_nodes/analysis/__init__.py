# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of recorded runs: shift metrics after the laboratory's definitions, energy balance, report.

Works on arrays and bags; used by the command line, the tests and whoever opens a bag in Python.
"""
