# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parts of ``rig bench``: its measurements, the models in other tools, and the text of docs/reference/performance.md."""
