# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of ``rig bench``: what each measures, the peers, and docs/reference/performance.md."""
