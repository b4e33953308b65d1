# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig from Python: load a rig, simulate, open runs of any kind, read signals and tables; `import rig_nodes` gives its names."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
