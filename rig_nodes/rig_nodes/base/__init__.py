# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every room stands on: errors, clocks, arrays, files, YAML with units, compiled code."""
