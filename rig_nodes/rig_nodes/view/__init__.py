# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Rerun view of a run: what is shown and how (layout), the file (convert, document), window and picture.

Used by `rig view`. Only functions that need it import rerun, so that the rest of the rig runs without it.
"""
