# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Rerun view of a run: its contents and form (layout), its file (convert, document), its window and its picture.

`rig view` uses it. Only functions that need rerun import it, so that the rest of the rig runs without it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
