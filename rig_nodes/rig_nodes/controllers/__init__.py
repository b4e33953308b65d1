# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The seam where shift-control code meets the rig, and its plugs (load.PLUGS): one record in, one record out, one timing.

It is used by runs.simulation, by the alfa46 process and by users' own controller files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
