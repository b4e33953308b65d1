# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verbs of the `rig` command, one module each; main.py finds and runs them."""
