# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of faults, a file for each family: a record says what fails, by what parameter, and how it shows (fault.py)."""
