# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The formats of files that are read, one file for each; what no file here ends with ``FORMAT`` helps them."""
