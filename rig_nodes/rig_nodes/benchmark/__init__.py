# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parts of ``rig bench``: what each measures, the other tools, and docs/reference/performance.md."""
